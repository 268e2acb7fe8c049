"""The simulator's end of a TCP port."""

from __future__ import annotations

import contextlib
import errno
import os
import socket
from typing import Final

from motorbus.errors import LinkError, PortBusy, RequestError
from motorbus.link.lock import served_by_simulator

CHUNK: Final = 4096
MAX_WAITING: Final = 8
LOCAL: Final = "127.0.0.1"


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
