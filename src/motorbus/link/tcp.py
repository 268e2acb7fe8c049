"""A serial line behind a raw TCP socket: a bridge with a network port, or a simulator.

Such a socket carries bytes and nothing else: no rate can be set, and nobody says how long a byte is under way.
"""

from __future__ import annotations

import ipaddress
import socket
import time
from typing import Final
from urllib.parse import urlsplit

from motorbus.core.operation import Data
from motorbus.errors import LinkError, PortNotFound, RequestError
from motorbus.link.lock import PortLock, taken
from motorbus.link.refusal import full, lost
from motorbus.link.waiting import wait_readable

CHUNK = 4096
CONNECT_TIME = 5.0  # s; a host of a local network that has not answered by then is not there
UNHEARD: Final = 1.0
"""s; a connection whose bytes nobody has acknowledged by then is given up, and they are not sent any more."""
LOOPBACK_LATENCY: Final = 0.002  # s; two processes of one machine have to be scheduled
NETWORK_LATENCY: Final = 0.005  # s; one Wi-Fi hop each way, and the bridge's own turn


def split_address(url: str) -> tuple[str, int]:
    """`scheme://host:port` -> host and port; an IPv6 address stands in brackets. Raises RequestError."""
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise _bad_address(url, str(error)) from None
    if not host or not port or parts.path not in ("", "/") or parts.query or parts.username is not None:
        raise _bad_address(
            url, "" if host and port else "the port is missing" if host else "the host is missing"
        )
    return host, port


def _bad_address(url: str, why: str) -> RequestError:
    scheme = url.partition("://")[0]
    return RequestError(
        f"{url!r} is not an address of a host and a port" + (f": {why}" if why else ""),
        expected=f"{scheme}://HOST:PORT",
        advice=f"for example {scheme}://10.0.0.7:4000 or {scheme}://[fe80::1]:4000",
    )


class TcpLink:
    """A raw TCP connection, `socket://host:port`. `rate` is what the line behind it is set to, for its air time.

    Raises RequestError for a bad address, PortNotFound when nobody listens there, PortBusy when another motorbus
    process of this machine has it. `kept` is a lock that we have already, maybe this one; a host is waited for so many
    s of `patience`.
    """

    paced = False  # what is behind it cannot be known
    virtual = False
    simulated = False
    warnings: tuple[str, ...] = ()

    def __init__(
        self, url: str, *, rate: int, kept: PortLock | None = None, patience: float = CONNECT_TIME
    ) -> None:
        self.name = url
        self.rate = rate
        host, port = split_address(url)
        self.lock = taken(url, kept)
        try:
            self._socket = _connected(url, host, port, patience)
        except BaseException:
            self.lock.release()
            raise
        self.latency = LOOPBACK_LATENCY if _is_loopback(self._socket) else NETWORK_LATENCY

    def now(self) -> float:
        return time.monotonic()

    def write(self, data: Data) -> None:
        assert isinstance(data, bytes)
        try:
            sent = self._socket.send(data)
        except BlockingIOError:
            sent = 0
        except OSError as error:
            raise lost(self.name, error) from error
        if sent != len(data):
            raise full(self.name, sent, len(data))

    def read(self, until: float) -> list[Data]:
        try:
            pause = until - time.monotonic()
            if pause > 0 and not wait_readable(self._socket.fileno(), pause):
                return []
            data = self._socket.recv(CHUNK)
        except BlockingIOError:
            return []
        except (OSError, ValueError) as error:  # ValueError: closed by another thread
            raise lost(self.name, error) from error
        if not data:
            raise lost(self.name, "the other end closed it")
        return [data]

    def tune(self, rate: int, listen_only: bool = False) -> None:
        if rate != self.rate:
            raise LinkError(
                f"{self.name}: a raw socket cannot change the rate to {rate} bit/s",
                advice="set it where the serial line is, or use a server that speaks rfc2217://",
            )

    def fileno(self) -> int | None:
        return self._socket.fileno()

    def close(self) -> None:
        self._socket.close()
        self.lock.release()


def _connected(url: str, host: str, port: int, patience: float) -> socket.socket:
    try:
        connection = socket.create_connection((host, port), timeout=patience)
    except TimeoutError as error:
        raise PortNotFound(f"{url}: no answer within {patience:g} s") from error
    except (OSError, UnicodeError) as error:
        raise PortNotFound(
            f"{url} cannot be reached: {error}",
            advice="is the bridge switched on, the simulator running, the port number right?",
        ) from error
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    give_up_soon(connection)
    connection.setblocking(False)
    return connection


def give_up_soon(connection: socket.socket) -> None:
    """Have the system drop what it cannot deliver, with the connection.

    By itself it tries for a quarter of an hour: an order would be obeyed when the network is there again. Only Linux
    can be told so (tcp(7), TCP_USER_TIMEOUT).
    """
    option = getattr(socket, "TCP_USER_TIMEOUT", None)
    if option is not None:
        connection.setsockopt(socket.IPPROTO_TCP, option, int(UNHEARD * 1000))


def _is_loopback(connection: socket.socket) -> bool:
    return ipaddress.ip_address(connection.getpeername()[0].partition("%")[0]).is_loopback
