"""Serial lines behind a raw TCP socket: a network bridge, or a simulator.

The socket carries bytes only: it can set no rate, and its delay is unknown.
"""

from __future__ import annotations

import contextlib
import ipaddress
import socket
from typing import Final
from urllib.parse import urlsplit

from motorbus.errors import LinkError, PortNotFound, RequestError
from motorbus.link.lock import PortLock, opening
from motorbus.link.stream import StreamLink

CONNECT_TIME = 5.0  # s; time-out for a host of the local network
ACKNOWLEDGE_TIME: Final = 1.0  # s; the system drops a connection whose bytes are not acknowledged by then
LOOPBACK_LATENCY: Final = 0.002  # s; two processes of one machine are scheduled
NETWORK_LATENCY: Final = 0.005  # s; one Wi-Fi hop each way, and the bridge itself


def split_address(url: str) -> tuple[str, int]:
    """Host and port of `scheme://host:port`; an IPv6 address is in brackets. Raises RequestError."""
    scheme = url.partition("://")[0]
    with contextlib.suppress(ValueError):
        parts = urlsplit(url)
        is_plain = parts.path in ("", "/") and not parts.query and parts.username is None
        if parts.hostname and parts.port and is_plain:
            return parts.hostname, parts.port
    raise RequestError(
        f"{url!r} is not an address of a host and a port",
        expected=f"{scheme}://HOST:PORT",
        advice=f"for example {scheme}://10.0.0.7:4000 or {scheme}://[fe80::1]:4000",
    )


class TcpLink(StreamLink):
    """A raw TCP connection, `socket://host:port`. `rate` is that of the serial line behind it, for its air time.

    `lock` is a lock that the caller already holds; `connect_time` is a time-out in s. Raises RequestError for a bad
    address, PortNotFound when no server answers, PortBusy when another motorbus process of this machine holds it.
    """

    paced = False  # what is behind the socket is unknown

    def __init__(
        self, url: str, *, rate: int, lock: PortLock | None = None, connect_time: float = CONNECT_TIME
    ) -> None:
        self.name = url
        self.rate = rate
        host, port = split_address(url)
        with opening(url, lock) as self.lock:
            try:
                self._socket = connection = socket.create_connection((host, port), timeout=connect_time)
            except TimeoutError as error:
                raise PortNotFound(f"{url}: no answer within {connect_time:g} s") from error
            except (OSError, UnicodeError) as error:
                raise PortNotFound(
                    f"{url} cannot be reached: {error}",
                    advice="is the bridge switched on, the simulator running, the port number right?",
                ) from error
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        send_at_once(connection)
        connection.setblocking(False)
        self.attach(connection.fileno(), connection.recv, connection.send)
        address = ipaddress.ip_address(connection.getpeername()[0].partition("%")[0])
        self.latency = LOOPBACK_LATENCY if address.is_loopback else NETWORK_LATENCY

    def tune(self, rate: int) -> None:
        if rate != self.rate:
            raise LinkError(
                f"{self.name}: a raw socket cannot change the rate to {rate} bit/s",
                advice="set it where the serial line is, or use a server that speaks rfc2217://",
            )

    def close(self) -> None:
        self.detach()
        self._socket.close()
        self.lock.release()


def send_at_once(connection: socket.socket) -> None:
    """Send without Nagle's delay (up to 40 ms), and drop the connection when bytes are not acknowledged in time.

    By default the system resends for a quarter of an hour, so a device could receive an old command when the network
    is back. Only Linux has the second option: tcp(7), TCP_USER_TIMEOUT.
    """
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    option = getattr(socket, "TCP_USER_TIMEOUT", None)
    if option is not None:
        connection.setsockopt(socket.IPPROTO_TCP, option, int(ACKNOWLEDGE_TIME * 1000))
