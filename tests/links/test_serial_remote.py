"""Links through a server that speaks RFC 2217."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from threading import Thread

import pytest

from motorbus.errors import LinkError, LinkLost, PortBusy, PortNotFound
from motorbus.link import serial
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


def test_its_attributes(remote: PolledLink, server: Server) -> None:
    link: Link = remote
    assert (link.name, link.fileno(), link.paced, link.virtual) == (server.url, None, False, False)
    assert link.latency > 0.01
    connection = getattr(remote._serial, "_socket")  # noqa: B009 - serialx does not offer it
    assert connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


def test_nothing_from_a_server_is_nothing(remote: PolledLink) -> None:
    until = remote.now() + 0.002
    assert remote.read(until) == []
    assert remote.now() >= until
    assert remote.read(float("-inf")) == []


def test_a_reader_that_waits_does_not_keep_a_writer_out(remote: PolledLink) -> None:
    arrived: list[bytes] = []
    reader = Thread(target=lambda: arrived.append(everything(remote, 6)))
    reader.start()
    remote.write(PING)
    reader.join(30)
    assert arrived == [PING]


def test_a_server_that_hangs_up_is_a_lost_link(remote: PolledLink, server: Server) -> None:
    server.hang_up()
    with pytest.raises(LinkLost, match="is gone"):
        remote.read(soon(remote))


def test_used_after_close_a_remote_link_is_lost(remote: PolledLink) -> None:
    remote.close()
    remote.close()
    with pytest.raises(LinkLost):
        remote.write(PING)
    with pytest.raises(LinkLost):
        remote.read(0.0)


def test_a_remote_port_has_one_owner(remote: PolledLink, server: Server) -> None:
    with pytest.raises(PortBusy, match="this very program"):
        open_stream(server.url, rate=1_000_000)


def test_no_server_is_no_port(server: Server) -> None:
    server.close()
    with pytest.raises(PortNotFound, match="cannot be reached"):
        open_stream(server.url, rate=1_000_000)


def test_a_server_without_rfc2217(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial, "CONNECT_TIME", 0.05)
    with socket.create_server(("127.0.0.1", 0)) as raw, pytest.raises(LinkError, match="socket://"):
        open_stream(f"rfc2217://127.0.0.1:{raw.getsockname()[1]}", rate=1_000_000)
