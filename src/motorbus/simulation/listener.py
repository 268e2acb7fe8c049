"""The simulator's end of a TCP port: the same bytes as on a serial line, one client after the other.

A client that comes while another is served waits in the queue of the operating system until that one leaves; a
serial line has one host. (On CAN there may be several, see `clients.Door`.) There is no baud rate on a socket, so
none is told.
"""

from __future__ import annotations

import contextlib
import errno
import os
import socket

from motorbus.errors import LinkError, PortBusy, RequestError

_CHUNK = 4096
_WAITING = 8
LOCAL = "127.0.0.1"


def parse_endpoint(text: str) -> tuple[str, int]:
    """`HOST:PORT`, `[ADDRESS]:PORT`, `:PORT` or `PORT` -> host and port; without a host only this machine.

    Raises RequestError for anything else. Port 0 takes a free one.
    """
    host, _, port = text.rpartition(":")
    if not port.isascii() or not port.isdigit() or int(port) > 65535:
        raise RequestError(f"{text!r} is not a TCP endpoint", expected="HOST:PORT, such as 127.0.0.1:4000")
    return host.removeprefix("[").removesuffix("]") or LOCAL, int(port)


class TcpClient:
    """A client that has come by TCP. `gone` once it has left or broken off. What is small leaves at once."""

    def __init__(self, connection: socket.socket) -> None:
        self.gone = False
        self._connection = connection
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def fileno(self) -> int:
        """Turns readable when it has sent something or left."""
        return self._connection.fileno()

    def read(self) -> bytes:
        """What it has sent; b"" when nothing."""
        try:
            data = self._connection.recv(_CHUNK)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        self.gone = self.gone or not data
        return data

    def write(self, data: bytes) -> int:
        """Send to it; returns how many bytes still had room."""
        try:
            return self._connection.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            self.gone = True
            return 0

    def rate(self) -> int | None:
        """A socket has no rate."""
        return None

    def close(self) -> None:
        """Hang up; calling it again does nothing."""
        self.gone = True
        self._connection.close()


class TcpPort:
    """An open TCP port. Raises PortBusy when it is taken, LinkError when it cannot be had."""

    def __init__(self, host: str = LOCAL, port: int = 0) -> None:
        try:
            self._listener = _listen(host, port)
        except OSError as error:
            kind = PortBusy if error.errno == errno.EADDRINUSE else LinkError
            raise kind(f"cannot listen on {host}:{port}: {error.strerror or error}") from error
        self._listener.setblocking(False)
        self.host, self.port = self._listener.getsockname()[:2]

    @property
    def address(self) -> str:
        """HOST:PORT."""
        return f"{f'[{self.host}]' if ':' in self.host else self.host}:{self.port}"

    def fileno(self) -> int:
        """Turns readable when a client has come."""
        return self._listener.fileno()

    def accept(self) -> TcpClient | None:
        """The next client; None when there is none, or it has left again."""
        with contextlib.suppress(BlockingIOError, ConnectionError):
            return TcpClient(self._listener.accept()[0])
        return None

    def unplug(self) -> None:
        """Refuse everybody until `plug`."""
        self.close()

    def plug(self) -> None:
        """Listen again where it did. Raises as making it does."""
        TcpPort.__init__(self, self.host, self.port)

    def close(self) -> None:
        """Give the port back; calling it again does nothing."""
        self._listener.close()


class TcpListener(TcpPort):
    """An open TCP port with at most one client. Errors as of `TcpPort`."""

    def __init__(self, host: str = LOCAL, port: int = 0) -> None:
        self._client: TcpClient | None = None
        super().__init__(host, port)

    @property
    def url(self) -> str:
        """What a host opens."""
        return f"socket://{self.address}"

    def fileno(self) -> int:
        """Turns readable when the client has sent something or left; without a client, when one has come."""
        return self._client.fileno() if self._client else super().fileno()

    def read(self) -> bytes:
        """What the client has sent; b"" when nothing. Takes in the next client when there is none."""
        if self._client is None:
            self._client = self.accept()
            return b""
        data = self._client.read()
        self._drop_if_gone()
        return data

    def write(self, data: bytes) -> int:
        """Send to the client; returns how many bytes still had room. Without a client they are lost, as on a wire."""
        sent = self._client.write(data) if self._client else 0
        self._drop_if_gone()
        return sent

    def rate(self) -> int | None:
        """A socket has no rate."""
        return None

    def unplug(self) -> None:
        """Refuse everybody until `plug`, and hang up on the client."""
        super().close()  # first, or the client comes back at once
        self.close()

    def close(self) -> None:
        """Hang up and give the port back; calling it again does nothing."""
        if self._client is not None:
            self._client.close()
        self._client = None
        super().close()

    def _drop_if_gone(self) -> None:
        if self._client is not None and self._client.gone:
            self._client.close()
            self._client = None


def _listen(host: str, port: int) -> socket.socket:
    family, kind, protocol, _, address = socket.getaddrinfo(
        host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )[0]
    listener = socket.socket(family, kind, protocol)
    try:
        if os.name == "posix":  # elsewhere this option lets two programs take one port
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(_WAITING)
    except BaseException:
        listener.close()
        raise
    return listener
