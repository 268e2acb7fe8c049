"""TCP links over real sockets."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator

import pytest

from motorbus.errors import LinkError, LinkLost, PortNotFound, RequestError
from motorbus.link.base import Link
from motorbus.link.tcp import ACKNOWLEDGE_TIME, LOOPBACK_LATENCY, TcpLink, split_address

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


def test_its_attributes(pair: tuple[TcpLink, socket.socket]) -> None:
    link: Link = pair[0]
    assert (link.paced, link.virtual, link.simulated, link.latency) == (False, False, False, LOOPBACK_LATENCY)
    assert link.fileno() == pair[0]._socket.fileno()
    assert pair[0]._socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
    if hasattr(socket, "TCP_USER_TIMEOUT"):  # else an order would be obeyed when the network is there again
        dropped = pair[0]._socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT)
        assert dropped == ACKNOWLEDGE_TIME * 1000


def test_a_reset_connection_is_lost(pair: tuple[TcpLink, socket.socket]) -> None:
    link, far = pair
    far.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    far.close()
    with pytest.raises(LinkLost):
        link.read(soon(link))
    with pytest.raises(LinkLost):
        link.write(PING)


def test_a_raw_socket_has_no_rate_to_set(pair: tuple[TcpLink, socket.socket]) -> None:
    link, _ = pair
    link.tune(1_000_000)
    with pytest.raises(LinkError, match="rfc2217"):
        link.tune(9600)


def test_without_a_server_there_is_no_port_and_no_lock(server: socket.socket) -> None:
    url = url_of(server)
    server.close()
    for _ in range(2):
        with pytest.raises(PortNotFound, match="cannot be reached"):
            TcpLink(url, rate=1_000_000)


def test_an_unknown_host() -> None:
    with pytest.raises(PortNotFound, match="cannot be reached"):
        TcpLink("socket://no-such-host.invalid:4000", rate=1_000_000)


def test_an_address_of_version_six() -> None:
    """Without an IPv6 loopback the address is still parsed."""
    try:
        listener = socket.create_server(("::1", 0), family=socket.AF_INET6)
    except OSError:
        with pytest.raises(PortNotFound):
            TcpLink("socket://[::1]:4000", rate=9600)
        return
    with listener:
        link = TcpLink(f"socket://[::1]:{listener.getsockname()[1]}", rate=9600)
        assert link.latency == LOOPBACK_LATENCY
        link.close()


@pytest.mark.parametrize(
    ("url", "parts"),
    [
        ("socket://10.0.0.7:4000", ("10.0.0.7", 4000)),
        ("socket://Bridge:1/", ("bridge", 1)),
        ("rfc2217://[fe80::1]:2217", ("fe80::1", 2217)),
    ],
)
def test_addresses(url: str, parts: tuple[str, int]) -> None:
    assert split_address(url) == parts


@pytest.mark.parametrize(
    "url",
    [
        "socket://",
        "socket://host",
        "socket://:4000",
        "socket://host:0",
        "socket://host:65536",
        "socket://host:port",
        "socket://[::1:4000",
        "socket://host:4000/path",
        "socket://host:4000?x=1",
        "socket://me@host:4000",
    ],
)
def test_invalid_addresses(url: str) -> None:
    with pytest.raises(RequestError, match="socket://HOST:PORT"):
        split_address(url)
