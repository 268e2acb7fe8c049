"""TCP links over real sockets."""

from __future__ import annotations

import os
import socket
import struct
from collections.abc import Iterator

import pytest

from motorbus.errors import LinkError, LinkLost, PortBusy, PortNotFound, RequestError
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


def test_bytes_pass_both_ways(pair: tuple[TcpLink, socket.socket]) -> None:
    link, far = pair
    link.write(PING)
    assert far.recv(100) == PING
    far.sendall(b"answer")
    assert link.read(soon(link)) == [b"answer"]


def test_what_it_says_of_itself(pair: tuple[TcpLink, socket.socket]) -> None:
    link: Link = pair[0]
    assert (link.paced, link.virtual, link.simulated, link.latency) == (False, False, False, LOOPBACK_LATENCY)
    assert link.fileno() == pair[0]._socket.fileno()
    assert pair[0]._socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
    if hasattr(socket, "TCP_USER_TIMEOUT"):  # else an order would be obeyed when the network is there again
        dropped = pair[0]._socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT)
        assert dropped == ACKNOWLEDGE_TIME * 1000


def test_nothing_by_the_deadline_is_nothing(pair: tuple[TcpLink, socket.socket]) -> None:
    link, _ = pair
    until = link.now() + 0.002
    assert link.read(until) == []
    assert link.now() >= until


@pytest.mark.parametrize("until", [0.0, float("-inf")])
def test_a_deadline_in_the_past_asks_without_waiting(
    until: float, pair: tuple[TcpLink, socket.socket]
) -> None:
    link, far = pair
    assert link.read(until) == []
    far.sendall(b"x")
    while not (arrived := link.read(until)):
        pass
    assert arrived == [b"x"]


def test_the_other_end_closing_is_a_lost_link(pair: tuple[TcpLink, socket.socket]) -> None:
    link, far = pair
    far.close()
    with pytest.raises(LinkLost, match="hung up"):
        link.read(soon(link))


def test_a_reset_is_a_lost_link(pair: tuple[TcpLink, socket.socket]) -> None:
    link, far = pair
    far.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    far.close()
    with pytest.raises(LinkLost):
        link.read(soon(link))
    with pytest.raises(LinkLost):
        link.write(PING)


def test_what_came_before_the_end_is_read_first(pair: tuple[TcpLink, socket.socket]) -> None:
    link, far = pair
    far.sendall(b"last words")
    far.close()
    assert link.read(soon(link)) == [b"last words"]
    with pytest.raises(LinkLost):
        link.read(soon(link))


def test_an_end_that_does_not_read_blocks_nobody(pair: tuple[TcpLink, socket.socket]) -> None:
    link, _ = pair
    with pytest.raises(LinkError, match="takes no more bytes"):
        link.write(bytes(1 << 26))


def test_used_after_close_it_is_lost(pair: tuple[TcpLink, socket.socket]) -> None:
    link, _ = pair
    link.close()
    link.close()
    with pytest.raises(LinkLost):
        link.write(PING)
    with pytest.raises(LinkLost):
        link.read(soon(link))


def test_a_raw_socket_has_no_rate_to_set(pair: tuple[TcpLink, socket.socket]) -> None:
    link, _ = pair
    link.tune(1_000_000)
    with pytest.raises(LinkError, match="rfc2217"):
        link.tune(9600)


def test_one_process_one_owner(server: socket.socket, pair: tuple[TcpLink, socket.socket]) -> None:
    with pytest.raises(PortBusy) as refused:
        TcpLink(url_of(server), rate=1_000_000)
    assert refused.value.owner == os.getpid()
    pair[0].close()
    TcpLink(url_of(server), rate=1_000_000).close()


def test_nobody_listening_is_no_port_and_leaves_no_lock(server: socket.socket) -> None:
    url = url_of(server)
    server.close()
    for _ in range(2):
        with pytest.raises(PortNotFound, match="cannot be reached"):
            TcpLink(url, rate=1_000_000)


def test_a_host_that_does_not_exist_is_no_port() -> None:
    with pytest.raises(PortNotFound, match="cannot be reached"):
        TcpLink("socket://no-such-host.invalid:4000", rate=1_000_000)


def test_an_address_of_version_six() -> None:
    """Where the machine has no such loopback, the address is still understood and nobody is there."""
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
def test_what_is_no_address(url: str) -> None:
    with pytest.raises(RequestError, match="socket://HOST:PORT"):
        split_address(url)
