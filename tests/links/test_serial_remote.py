"""Links through a server that speaks RFC 2217."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from motorbus.errors import LinkLost, PortNotFound
from motorbus.link.base import Link
from motorbus.link.serial import PolledLink, open_stream
from tests.links.rfc2217 import Server

PING = bytes.fromhex("ff ff 01 02 01 fb")
ALL_BYTES = bytes(range(256))


def soon(link: Link) -> float:
    return link.now() + 30


@pytest.fixture
def server() -> Iterator[Server]:
    serving = Server()
    yield serving
    serving.close()


@pytest.fixture
def remote(server: Server) -> Iterator[PolledLink]:
    link = open_stream(server.url, rate=1_000_000)
    assert isinstance(link, PolledLink)
    yield link
    link.close()


def everything(link: Link, count: int) -> bytes:
    text = b""
    while len(text) < count:
        text += b"".join(part for part in link.read(soon(link)) if isinstance(part, bytes))
    return text


def test_bytes_pass_through_a_server_and_back(remote: PolledLink, server: Server) -> None:
    remote.write(PING + ALL_BYTES)
    assert everything(remote, 262) == PING + ALL_BYTES
    assert bytes(server.received) == PING + ALL_BYTES


def test_the_rate_is_set_at_the_server(remote: PolledLink, server: Server) -> None:
    assert server.rate == 1_000_000
    remote.tune(76_800)
    assert (server.rate, remote.rate) == (76_800, 76_800)


def test_a_server_that_hangs_up_is_a_lost_link(remote: PolledLink, server: Server) -> None:
    server.hang_up()
    with pytest.raises(LinkLost, match="is gone"):
        remote.read(soon(remote))


def test_no_server_is_no_port(server: Server) -> None:
    server.close()
    with pytest.raises(PortNotFound, match="cannot be reached"):
        open_stream(server.url, rate=1_000_000)


def test_a_closed_link_is_lost(remote: PolledLink) -> None:
    remote.close()
    remote.close()
    with pytest.raises(LinkLost, match="closed"):
        remote.read(remote.now())
    with pytest.raises(LinkLost, match="closed"):
        remote.write(PING)
    with pytest.raises(LinkLost, match="closed"):
        remote.tune(9600)
