"""Clients of a simulated bus: who gets what, whole or not at all, and who is let in."""

from __future__ import annotations

import select
import socket
from contextlib import closing

import pytest

from motorbus.core.operation import CanFrame
from motorbus.errors import RequestError
from motorbus.link.base import PerfectLine
from motorbus.link.slcan import SlcanAdapter
from motorbus.link.socketcand import SocketcandAdapter
from motorbus.simulation.clients import MOST_CLIENTS, CanClient, Door, SerialClient
from motorbus.simulation.listener import TcpPort

FRAME = CanFrame(0x123, b"\1\2")


class Desk:
    """An endpoint with room for so many bytes."""

    def __init__(self, room: int = 1 << 20) -> None:
        self.room = room
        self.said = b""
        self.got = b""

    def fileno(self) -> int:
        return 0

    def read(self) -> bytes:
        said, self.said = self.said, b""
        return said

    def write(self, data: bytes) -> int:
        count = min(self.room, len(data))
        self.room -= count
        self.got += data[:count]
        return count

    def rate(self) -> int | None:
        return 115_200


def opened(desk: Desk) -> CanClient:
    client = CanClient(desk, SlcanAdapter())
    desk.said = b"S6\rO\r"
    assert client.read(0.0) == []
    client.flush()
    desk.got = b""
    return client


def test_bytes_pass_as_they_are_and_what_has_no_room_is_lost() -> None:
    desk = Desk(room=4)
    client = SerialClient(desk)
    desk.said = b"abc"
    assert client.read(0.0) == [b"abc"]
    assert client.read(0.0) == []
    client.tell(b"abc", 0.0)
    client.tell(b"def", 0.0)
    client.flush()
    assert (desk.got, client.lost, client.is_stuck(), client.is_gone()) == (b"abcd", 2, False, False)


@pytest.mark.parametrize(("follows", "rate"), [(True, 115_200), (False, None)])
def test_the_rate_of_a_serial_line_counts_when_asked_for(follows: bool, rate: int | None) -> None:
    assert SerialClient(Desk(), follows=follows).rate() == rate


def test_frames_pass_by_the_adapter() -> None:
    desk = Desk()
    client = opened(desk)
    desk.said = b"t12320102\r"
    assert client.read(0.0) == [FRAME]
    client.tell(FRAME, 0.0)
    client.flush()
    assert desk.got == b"z\rt12320102\r"


def test_the_rate_is_the_adapters_while_it_is_open() -> None:
    desk = Desk()
    client = CanClient(desk, SlcanAdapter())
    rates = []
    for desk.said in (b"S5\r", b"O\r", b"C\r", b"O\rt1230\rC\r", b"\r"):
        client.read(0.0)
        rates.append(client.rate())
    assert rates == [None, 250_000, None, 250_000, None]


def test_a_client_is_greeted() -> None:
    desk = Desk()
    CanClient(desk, SocketcandAdapter()).flush()
    assert desk.got == b"< hi >"


def test_a_frame_is_never_torn() -> None:
    desk = Desk()
    client = opened(desk)
    desk.room = 13
    for _ in range(3):
        client.tell(FRAME, 0.0)
        client.flush()
    assert client.is_stuck()
    assert client.lost == 1
    desk.room = 1000
    client.flush()
    assert not client.is_stuck()
    client.tell(FRAME, 0.0)
    client.flush()
    assert desk.got == b"t12320102\r" * 3


def test_who_never_reads_misses_answers_at_last_and_memory_stays_small() -> None:
    desk = Desk()
    client = opened(desk)
    desk.room = 0
    for _ in range(1000):
        desk.said = b"V\r" * 100
        client.read(0.0)
        client.tell(FRAME, 0.0)
        client.flush()
    assert len(client._out) < 4096 + 1000


def test_who_reads_late_gets_every_answer() -> None:
    desk = Desk()
    client = opened(desk)
    desk.room = 3
    client.tell(FRAME, 0.0)
    client.flush()
    desk.said = b"C\rV\r"
    client.read(0.0)
    desk.room = 1000
    client.flush()
    assert desk.got == b"t12320102\r\rV1013\r"


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(RequestError, match="CAN frames"):
        SerialClient(Desk()).tell(FRAME, 0.0)
    with pytest.raises(RequestError, match="bytes"):
        CanClient(Desk(), SlcanAdapter()).tell(b"abc", 0.0)


# A door.


def connected(door: Door) -> socket.socket:
    connection = socket.create_connection((door.port.host, door.port.port), timeout=10)
    assert select.select([door], (), (), 10)[0]
    door.admit()
    return connection


def test_a_door_lets_in_several_each_with_an_adapter_of_its_own() -> None:
    with closing(Door(TcpPort(), SlcanAdapter)) as door, closing(connected(door)), closing(connected(door)):
        one, other = door.clients
        assert one.adapter is not other.adapter


def test_nobody_knocks() -> None:
    with closing(Door(TcpPort(), SlcanAdapter)) as door:
        door.admit()
        assert door.clients == []


def test_too_many_are_turned_away() -> None:
    with closing(Door(TcpPort(), SlcanAdapter)) as door:
        connections = [connected(door) for _ in range(MOST_CLIENTS + 1)]
        assert len(door.clients) == MOST_CLIENTS
        assert connections[-1].recv(1) == b""
        for connection in connections:
            connection.close()


def test_who_leaves_is_forgotten() -> None:
    with closing(Door(TcpPort(), SlcanAdapter)) as door:
        connected(door).close()
        (client,) = door.clients
        assert select.select([client], (), (), 10)[0]
        assert client.read(0.0) == []
        assert client.is_gone()
        assert door.sweep() == [client]
        assert door.clients == []


def test_who_is_refused_gets_the_reason_and_is_hung_up_on() -> None:
    with closing(Door(TcpPort(), SocketcandAdapter)) as door, closing(connected(door)) as connection:
        (client,) = door.clients
        client.flush()
        connection.sendall(b"< open >")
        assert select.select([client], (), (), 10)[0]
        client.read(0.0)
        client.flush()
        door.sweep()
        assert connection.makefile("rb").read() == b"< hi >< error could not open bus >"


def test_closing_twice() -> None:
    door = Door(TcpPort(), SlcanAdapter)
    connection = connected(door)
    door.close()
    door.close()
    assert connection.recv(1) == b""
    connection.close()


@pytest.mark.parametrize("after", [None, PerfectLine()])
def test_half_a_command_outlives_what_lay_between(after: PerfectLine | None) -> None:
    desk = Desk()
    client = opened(desk)
    client.heed(PerfectLine())
    desk.said = b"t1232"
    assert client.read(0.0) == []
    client.heed(after)
    desk.said = b"0102\r"
    assert client.read(0.0) == [FRAME]
    client.heed(None)
    desk.said = b"t12320102\r"
    assert client.read(0.0) == [FRAME]
