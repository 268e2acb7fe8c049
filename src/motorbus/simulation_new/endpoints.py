"""Real ports of a simulated bus: a pseudo-terminal, a TCP port, and the programs that open them."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import socket
from pathlib import Path
from typing import Final, Protocol

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.errors import LinkError, PortBusy, RequestError
from motorbus.link.lock import served_by_simulator
from motorbus.link.serial import line_speed
from motorbus.simulation_new.slcan import SlcanAdapter

CHUNK: Final = 4096
MAX_UNREAD: Final = 4096  # bytes kept for a program that does not read
MAX_WAITING: Final = 8
LOCAL: Final = "127.0.0.1"
TERMINALS: Final = "/dev/pts/"


class Stream(Protocol):
    """Bytes from and to one program; no call blocks. `gone`: the program has left for good."""

    gone: bool

    def fileno(self) -> int: ...

    def read(self) -> bytes:
        """The bytes that have arrived."""

    def write(self, data: bytes) -> int:
        """Send bytes; return how many fitted."""

    def rate(self) -> int | None:
        """Bit/s that the program has set; None: unknown."""

    def close(self) -> None: ...


class PtyPort:
    """A pseudo-terminal in raw mode, which also is the `Stream` of the programs that open it, one after the other.

    With `link` a symbolic link leads to it, and it can be unplugged and plugged. The other end stays open here, so that
    programs may come and go. Raises LinkError when the system has no pseudo-terminals or the link cannot be made,
    RequestError when something else is at `link`.
    """

    gone = False

    def __init__(self, link: str | Path | None = None) -> None:
        self.link = Path(link) if link is not None else None
        self._mark = contextlib.ExitStack()
        self._open()

    @property
    def name(self) -> str:
        """The path that a program opens."""
        return self.terminal if self.link is None else str(self.link)

    @property
    def can_unplug(self) -> bool:
        """Whether programs find it again: by a link."""
        return self.link is not None

    def _open(self) -> None:
        try:
            import tty

            self._master, self._slave = os.openpty()
        except (ImportError, AttributeError, OSError) as error:
            raise LinkError(
                f"no pseudo-terminal here: {error}", advice="serve the simulator on a TCP port instead"
            ) from error
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.terminal = os.ttyname(self._slave)
        try:
            self._make_link()
        except BaseException:
            self.close()
            raise
        self._mark.enter_context(served_by_simulator(self.terminal))

    def fileno(self) -> int:
        return self._master

    def read(self) -> bytes:
        try:
            return os.read(self._master, CHUNK)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> int:
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0

    def rate(self) -> int | None:
        return line_speed(self._master)

    def set_rate(self, rate: int) -> None:
        """Set the terminal to this rate (bit/s), which a program that sets none then has."""
        import termios

        code = getattr(termios, f"B{rate}", None)
        if code is not None:
            settings = termios.tcgetattr(self._slave)
            settings[4] = settings[5] = code
            termios.tcsetattr(self._slave, termios.TCSANOW, settings)

    def unplug(self) -> None:
        """Hang up and remove the link until `plug`."""
        self.close()

    def plug(self) -> None:
        """Open another terminal behind the same link."""
        self._open()

    def close(self) -> None:
        """Hang up and remove the link; a second call does nothing."""
        if self.link is not None:
            with contextlib.suppress(OSError):
                if str(self.link.readlink()) == self.terminal:
                    self.link.unlink()
        self._mark.close()
        for descriptor in (self._slave, self._master):
            if descriptor >= 0:
                os.close(descriptor)
        self._slave = self._master = -1

    def _make_link(self) -> None:
        if self.link is None:
            return
        try:
            if os.path.lexists(self.link):
                self._check_left_over(self.link)
            new = self.link.with_name(f"{self.link.name}.{secrets.token_hex(4)}")
            new.symlink_to(self.terminal)
            new.replace(self.link)
        except OSError as error:
            raise LinkError(f"{self.link}: cannot make the symbolic link: {error.strerror}") from error

    def _check_left_over(self, link: Path) -> None:
        """Raise RequestError unless a simulator that ended has left this link."""
        target = str(link.readlink()) if link.is_symlink() else ""
        is_ours = target == self.terminal or (target.startswith(TERMINALS) and not link.exists())
        if not is_ours:
            raise RequestError(
                f"{link} exists already" + (f" and leads to {target}" if target else ""),
                cause="another simulator serves it, or it is something else",
                advice="choose another name, or remove it",
            )


class TcpStream:
    """The `Stream` of a program that came by TCP; a socket has no rate."""

    def __init__(self, connection: socket.socket) -> None:
        self.gone = False
        self._connection = connection
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def fileno(self) -> int:
        return self._connection.fileno()

    def read(self) -> bytes:
        try:
            data = self._connection.recv(CHUNK)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        self.gone = self.gone or not data
        return data

    def write(self, data: bytes) -> int:
        try:
            return self._connection.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            self.gone = True
            return 0

    def rate(self) -> int | None:
        return None

    def close(self) -> None:
        self.gone = True
        self._connection.close()


class TcpPort:
    """An open TCP port. Raises PortBusy when it is taken, LinkError when it cannot be opened."""

    can_unplug = True

    def __init__(self, host: str = LOCAL, port: int = 0) -> None:
        self.host, self.port = host, port
        self._mark = contextlib.ExitStack()
        self.plug()

    @property
    def name(self) -> str:
        """What a host opens."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"socket://{host}:{self.port}"

    def fileno(self) -> int:
        return self._listener.fileno()

    def accept(self) -> TcpStream | None:
        """The next program; None when there is none, or it has left."""
        with contextlib.suppress(BlockingIOError, ConnectionError):
            return TcpStream(self._listener.accept()[0])
        return None

    def unplug(self) -> None:
        """Refuse programs until `plug`."""
        self.close()

    def plug(self) -> None:
        """Listen."""
        try:
            self._listener = _listen(self.host, self.port)
        except OSError as error:
            kind = PortBusy if error.errno == errno.EADDRINUSE else LinkError
            raise kind(f"cannot listen on {self.host}:{self.port}: {error.strerror or error}") from error
        self.host, self.port = self._listener.getsockname()[:2]
        self._mark.enter_context(served_by_simulator(self.name))

    def close(self) -> None:
        """Release the port; a second call does nothing."""
        self._mark.close()
        self._listener.close()


def parse_endpoint(text: str) -> tuple[str, int]:
    """`HOST:PORT`, `[ADDRESS]:PORT`, `:PORT` or `PORT` -> host and port; without a host 127.0.0.1.

    Port 0 takes a free one. Raises RequestError.
    """
    host, _, port = text.rpartition(":")
    if not port.isascii() or not port.isdigit() or int(port) > 65535:
        raise RequestError(f"{text!r} is not a TCP endpoint", expected="HOST:PORT, such as 127.0.0.1:4000")
    return host.removeprefix("[").removesuffix("]") or LOCAL, int(port)


def _listen(host: str, port: int) -> socket.socket:
    found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    family, kind, protocol, _, address = found[0]
    listener = socket.socket(family, kind, protocol)
    try:
        if os.name == "posix":  # elsewhere this option lets two programs take one port
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(MAX_WAITING)
    except BaseException:
        listener.close()
        raise
    listener.setblocking(False)
    return listener


class Client:
    """A program on the bus: its stream and, on CAN, an slcan adapter.

    `lost` counts the bytes of a serial line, or the CAN frames, that the program did not read in time.
    """

    def __init__(self, stream: Stream, adapter: SlcanAdapter | None = None) -> None:
        self.stream = stream
        self.adapter = adapter
        self.lost = 0
        self._rate: int | None = None
        self._unsent = bytearray()
        self._is_behind = False

    def fileno(self) -> int:
        return self.stream.fileno()

    @property
    def gone(self) -> bool:
        """Whether the program has left."""
        return self.stream.gone

    def receive(self) -> list[Data]:
        """What the program has sent."""
        data = self.stream.read()
        if self.adapter is None:
            self._rate = self.stream.rate()
            return [data] if data else []
        frames: list[Data] = [*self.adapter.receive(data)]
        self._rate = self.adapter.bitrate if self.adapter.is_open or frames else None
        answer = self.adapter.take_answer()
        if len(self._unsent) < MAX_UNREAD:
            self._unsent += answer
        return frames

    def rate(self) -> int | None:
        """Bit/s that the program had set when it sent last; None: unknown, or its channel is closed."""
        return self._rate

    def send(self, data: Data, at: float) -> None:
        """Give data to the program with the next `flush`; a CAN frame reaches it whole or not at all."""
        if isinstance(data, CanFrame) != (self.adapter is not None):
            raise RequestError("a serial line carries bytes, and a CAN adapter carries frames")
        if not isinstance(data, CanFrame):
            self._unsent += data
        elif self.adapter is not None and (line := self.adapter.encode(data, at)):
            if self._is_behind:
                self.lost += 1
            else:
                self._unsent += line

    def flush(self) -> bool:
        """Send; whether all has been sent. On a serial line, bytes that do not fit are lost."""
        if self._unsent:
            del self._unsent[: self.stream.write(bytes(self._unsent))]
        if self.adapter is None:
            self.lost += len(self._unsent)
            self._unsent.clear()
        self._is_behind = bool(self._unsent)
        return not self._is_behind

    def close(self) -> None:
        self.stream.close()
