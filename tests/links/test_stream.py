"""What a serial port, a TCP connection and an RFC 2217 server have in common, over real ports."""

from __future__ import annotations

import fcntl
import os
import socket
from collections.abc import Callable, Iterator
from threading import Timer
from typing import NamedTuple

import pytest

from motorbus.errors import LinkError, LinkLost, PortBusy, PortNotFound, RequestError
from motorbus.link.base import Link
from motorbus.link.stream import wait_any
from motorbus.link.tcp import ACKNOWLEDGE_TIME, split_address
from motorbus.link.url import open_link
from motorbus.simulation.pty import PtyMaster
from tests.links.rfc2217 import Server

ALL_BYTES = bytes(range(256))
RATE = 1_000_000


class Far(NamedTuple):
    """The other end of a link."""

    address: str
    send: Callable[[bytes], object]
    receive: Callable[[], bytes]
    close: Callable[[], object]


@pytest.fixture
def tcp() -> Iterator[tuple[Link, socket.socket]]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        link = open_link(f"socket://127.0.0.1:{server.getsockname()[1]}", rate=RATE)
        far, _ = server.accept()
        far.settimeout(30)
        with far:
            yield link, far
        link.close()


@pytest.fixture
def server() -> Iterator[Server]:
    serving = Server()
    yield serving
    serving.close()


@pytest.fixture(params=["serial", "tcp", "rfc2217"])
def pair(request: pytest.FixtureRequest) -> Iterator[tuple[Link, Far]]:
    if request.param == "tcp":
        link, far = request.getfixturevalue("tcp")
        yield link, Far(link.name, far.sendall, lambda: far.recv(4096), far.close)
    elif request.param == "serial":
        master: PtyMaster = request.getfixturevalue("master")
        link = open_link(master.slave_name, rate=RATE)
        yield link, Far(link.name, master.write, master.read, master.close)
        link.close()
    else:
        server: Server = request.getfixturevalue("server")
        link = open_link(server.url, rate=RATE)
        yield link, Far(link.name, server.say, server.take, server.hang_up)
        link.close()


def soon(link: Link) -> float:
    return link.now() + 30


def test_bytes_pass_both_ways_in_order(pair: tuple[Link, Far]) -> None:
    link, far = pair
    for start in range(0, 256, 16):
        link.write(ALL_BYTES[start : start + 16])
    received, end = b"", link.now() + 30
    while len(received) < 256 and link.now() < end:
        received += far.receive()
        os.sched_yield()
    assert received == ALL_BYTES
    far.send(ALL_BYTES)
    while len(received) < 512:
        received += b"".join(bytes(part) for part in link.read(soon(link)) if isinstance(part, bytes))
    assert received == ALL_BYTES * 2


def test_a_read_ends_at_its_deadline(pair: tuple[Link, Far]) -> None:
    link, _ = pair
    until = link.now() + 0.0025
    assert link.read(until) == []
    assert link.now() >= until


def test_the_other_end_closes_during_a_read(pair: tuple[Link, Far]) -> None:
    link, far = pair
    far.send(b"last words")
    Timer(0.05, far.close).start()
    assert link.read(soon(link)) == [b"last words"]
    with pytest.raises(LinkLost):
        link.read(soon(link))


def test_a_closed_link_is_lost(pair: tuple[Link, Far]) -> None:
    link, _ = pair
    link.close()
    link.close()
    for use in (lambda: link.write(b"x"), lambda: link.read(soon(link))):
        with pytest.raises(LinkLost, match="closed"):
            use()


def test_a_port_has_one_owner(pair: tuple[Link, Far]) -> None:
    link, far = pair
    with pytest.raises(PortBusy, match="this very program") as caught:
        open_link(far.address, rate=RATE)
    assert caught.value.owner == os.getpid()
    link.close()
    if not far.address.startswith("rfc2217"):  # that server takes one client
        open_link(far.address, rate=RATE).close()


@pytest.mark.parametrize("pair", ["serial", "tcp"], indirect=True)
def test_a_full_buffer_does_not_block(pair: tuple[Link, Far]) -> None:
    link, _ = pair
    with pytest.raises(LinkError, match=r"takes no more bytes: \d+ of 67108864"):
        link.write(bytes(1 << 26))


# -- servers ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", ["socket", "rfc2217"])
def test_without_a_server_there_is_no_port_and_no_lock(scheme: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = f"{scheme}://127.0.0.1:{server.getsockname()[1]}"
    for _ in range(2):
        with pytest.raises(PortNotFound, match="cannot be reached"):
            open_link(url, rate=RATE)


@pytest.mark.parametrize("place", ["", "host", "host:65536", "host:port", "host:4000/path"])
def test_invalid_addresses(place: str) -> None:
    with pytest.raises(RequestError, match="socket://HOST:PORT"):
        split_address(f"socket://{place}")


def test_a_raw_socket_has_no_rate_to_set(tcp: tuple[Link, socket.socket]) -> None:
    link, _ = tcp
    link.tune(RATE)
    with pytest.raises(LinkError, match="rfc2217"):
        link.tune(9600)


def test_bytes_that_are_not_acknowledged_are_dropped_in_time(tcp: tuple[Link, socket.socket]) -> None:
    """Else a device would receive an old command when the network is back."""
    link, _ = tcp
    with socket.socket(fileno=os.dup(link.fileno() or 0)) as same:
        assert same.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
        limit = same.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT)
    assert limit == ACKNOWLEDGE_TIME * 1000


def test_the_rate_is_set_at_an_rfc2217_server(server: Server) -> None:
    link = open_link(server.url, rate=RATE)
    assert server.rate == RATE
    link.tune(76_800)
    assert (server.rate, link.rate) == (76_800, 76_800)
    link.close()
    with pytest.raises(LinkLost, match="closed"):
        link.tune(9600)


# -- waiting ------------------------------------------------------------------------------------------------------


def test_a_wait_returns_the_readable_descriptors_of_any_number() -> None:
    (one, write_one), (two, write_two) = os.pipe(), os.pipe()
    high = fcntl.fcntl(two, fcntl.F_DUPFD, 1500)  # above the limit of select
    for second in (two, high):
        assert wait_any([one, second], 0.001) == []
    os.write(write_two, b"x")
    for second in (two, high):
        assert wait_any([one, second], float("inf")) == [second]
    os.write(write_one, b"x")
    for second in (two, high):
        assert wait_any([one, second], float("inf")) == [one, second]
    for descriptor in (one, write_one, two, write_two, high):
        os.close(descriptor)
    for closed in (one, high):
        with pytest.raises((OSError, ValueError)):
            wait_any([closed], 1.0)
