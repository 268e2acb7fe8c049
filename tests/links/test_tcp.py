"""TCP links over real sockets."""

from __future__ import annotations

import os
import socket
import struct
from collections.abc import Iterator

import pytest

from motorbus.errors import LinkError, LinkLost, PortNotFound, RequestError
from motorbus.link.base import Link
from motorbus.link.tcp import ACKNOWLEDGE_TIME, TcpLink, split_address

PING = bytes.fromhex("ff ff 01 02 01 fb")


@pytest.fixture
def server() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(30)
        yield listener


def url_of(server: socket.socket) -> str:
    return f"socket://127.0.0.1:{server.getsockname()[1]}"


@pytest.fixture
def pair(server: socket.socket) -> Iterator[tuple[TcpLink, socket.socket]]:
    """A link, and the far end of its connection."""
    link = TcpLink(url_of(server), rate=1_000_000)
    far, _ = server.accept()
    far.settimeout(30)
    yield link, far
    link.close()
    far.close()


def soon(link: Link) -> float:
    return link.now() + 30


def test_a_reset_connection_is_lost(pair: tuple[TcpLink, socket.socket]) -> None:
    link, far = pair
    far.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    far.close()
    with pytest.raises(LinkLost):
        link.read(soon(link))
    with pytest.raises(LinkLost):
        link.write(PING)


def test_without_a_server_there_is_no_port_and_no_lock(server: socket.socket) -> None:
    url = url_of(server)
    server.close()
    for _ in range(2):
        with pytest.raises(PortNotFound, match="cannot be reached"):
            TcpLink(url, rate=1_000_000)


@pytest.mark.parametrize(
    "url",
    [
        "socket://",
        "socket://host",
        "socket://host:65536",
        "socket://host:port",
        "socket://host:4000/path",
    ],
)
def test_invalid_addresses(url: str) -> None:
    with pytest.raises(RequestError, match="socket://HOST:PORT"):
        split_address(url)


def test_a_raw_socket_has_no_rate_to_set(pair: tuple[TcpLink, socket.socket]) -> None:
    link, _ = pair
    link.tune(1_000_000)
    with pytest.raises(LinkError, match="rfc2217"):
        link.tune(9600)


def test_bytes_that_nobody_acknowledges_are_dropped_in_time(pair: tuple[TcpLink, socket.socket]) -> None:
    """Else an old order would be obeyed when the network is there again."""
    link, _ = pair
    with socket.socket(fileno=os.dup(link.fileno() or 0)) as same:
        assert same.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
        limit = same.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT)
    assert limit == ACKNOWLEDGE_TIME * 1000
