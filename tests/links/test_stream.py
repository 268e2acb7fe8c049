"""What a serial port and a TCP connection have in common, over a real pseudo-terminal and a real socket."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable, Iterator
from threading import Thread
from typing import NamedTuple

import pytest

from motorbus.errors import LinkError, LinkLost, PortBusy
from motorbus.link.base import Link
from motorbus.link.stream import wait_any
from motorbus.link.url import open_link
from motorbus.simulation.pty import PtyMaster

ALL_BYTES = bytes(range(256))


class Far(NamedTuple):
    """The other end of a link."""

    address: str
    descriptor: int
    send: Callable[[bytes], object]
    receive: Callable[[], bytes]
    close: Callable[[], object]


@pytest.fixture(params=["serial", "tcp"])
def pair(request: pytest.FixtureRequest, master: PtyMaster) -> Iterator[tuple[Link, Far]]:
    if request.param == "serial":
        link = open_link(master.slave_name, rate=1_000_000)
        yield link, Far(master.slave_name, master.fileno(), master.write, master.read, master.close)
        link.close()
        return
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"socket://127.0.0.1:{server.getsockname()[1]}"
        link = open_link(address, rate=1_000_000)
        far, _ = server.accept()
        with far:
            yield link, Far(address, far.fileno(), far.sendall, lambda: far.recv(4096), far.close)
        link.close()


def soon(link: Link) -> float:
    return link.now() + 30


def test_bytes_pass_both_ways_in_order(pair: tuple[Link, Far]) -> None:
    link, far = pair
    for start in range(0, 256, 16):
        link.write(ALL_BYTES[start : start + 16])
    received = b""
    while len(received) < 256:
        assert wait_any((far.descriptor,), 30)
        received += far.receive()
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
    errors: list[Exception] = []

    def wait() -> None:
        try:
            link.read(soon(link))
        except LinkError as error:
            errors.append(error)

    reader = Thread(target=wait)
    reader.start()
    far.close()
    reader.join(30)
    assert [type(error) for error in errors] == [LinkLost]


def test_bytes_before_the_end_are_read_first(pair: tuple[Link, Far]) -> None:
    link, far = pair
    far.send(b"last words")
    assert wait_any((link.fileno() or 0,), 30)
    assert link.read(soon(link)) == [b"last words"]
    far.close()
    with pytest.raises(LinkLost):
        link.read(soon(link))


def test_a_closed_link_is_lost(pair: tuple[Link, Far]) -> None:
    link, _ = pair
    link.close()
    link.close()
    with pytest.raises(LinkLost, match="closed"):
        link.write(b"x")
    with pytest.raises(LinkLost, match="closed"):
        link.read(soon(link))


def test_a_port_has_one_owner(pair: tuple[Link, Far]) -> None:
    link, far = pair
    with pytest.raises(PortBusy, match="this very program") as caught:
        open_link(far.address, rate=1_000_000)
    assert caught.value.owner == os.getpid()
    link.close()
    open_link(far.address, rate=1_000_000).close()


def test_a_full_buffer_does_not_block(pair: tuple[Link, Far]) -> None:
    link, _ = pair
    with pytest.raises(LinkError, match=r"takes no more bytes: \d+ of 67108864"):
        link.write(bytes(1 << 26))
