"""Simulated servos on one bus: rates, duplicate ids, arbitration, time, frames of other protocols."""

from __future__ import annotations

import pytest

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, Audience, CanFrame
from motorbus.core.request import Data
from motorbus.errors import RequestError
from motorbus.families.kst.simulator import simulate
from tests.simulators.kst.host import ERROR, MOVE, READ_ID, READ_POSITION, SAVE, SET_ID, Host, frame

POSITION = "5A5#4B02600000000000"
ID = "5A5#4F00300025000000"


def test_servo_at_another_rate_neither_receives_nor_is_received() -> None:
    host = Host(bit_rate=250_000, nmt="vendor")
    assert host.send(MOVE, "025#0100") == []
    assert host[0x25].memory["goal_position"] == 0
    host.bus.tune(0)
    assert host.send(READ_POSITION) == [POSITION], "no rate is the rate of each servo"
    host.bus.receive(frame(f"625#{READ_POSITION}"), host.now)
    host.bus.tune(500_000)
    assert host.wait(0.001) == [], "a reply after the host has changed its rate"


def test_duplicates_have_keys_of_their_own_and_follow_their_ids() -> None:
    host = Host(0x25, 0x25, 3)
    assert [(key, servo.unit) for key, servo in host.bus.nodes.items()] == [(0x25, 1), (1002, 2), (3, 3)]
    host[0x25].unplug()
    host.send(SET_ID, SAVE)
    host.wait(0.2)
    host[1002].power_cycle()
    assert [(key, servo.unit) for key, servo in host.bus.nodes.items()] == [(0x25, 1), (0x26, 2), (3, 3)]


def test_reply_has_the_identifier_format_of_its_request() -> None:
    host = Host()
    short, long = frame(f"625#{READ_ID}"), frame(f"625#{READ_ID}")._replace(extended=True)
    host.bus.receive(short, 1.0)
    host.bus.receive(long, 1.00005)
    replies = [reply for _, reply in host.bus.advance(1.01) if isinstance(reply, CanFrame)]
    assert [reply.extended for reply in replies] == [False, True]


def test_equal_replies_of_duplicates_are_one_frame_and_unequal_ones_break() -> None:
    host = Host(0x25, 0x25)
    assert host.send(READ_POSITION) == [POSITION]
    host[1002].raw_position = 5
    assert host.timed(READ_POSITION) == [(0.0001, ERROR)]


def test_duplicate_joins_a_running_bus_and_replies_later() -> None:
    host = Host()
    host.bus.duplicate(0x25)
    assert host.timed(READ_POSITION) == [(0.0001, POSITION), (0.0004, POSITION)]
    with pytest.raises(RequestError, match="no servo has the id 9"):
        host.bus.duplicate(9)


def test_servo_replies_in_turn_and_two_servos_at_once() -> None:
    host = Host(1, 2)
    replies = host.timed(*[f"601#{READ_ID}"] * 3, f"602#{READ_ID}")
    assert [(at, text[:3]) for at, text in replies] == [
        (0.0001, "581"),
        (0.0001, "582"),
        (0.0002, "581"),
        (0.0003, "581"),
    ]


def test_lower_identifier_goes_first() -> None:
    host = Host(9, 5, 7)
    replies = host.send(f"00000609#{READ_ID}", f"605#{READ_ID}", f"607#{READ_ID}")
    assert [text.split("#")[0] for text in replies] == ["00000589", "585", "587"]


def test_due_is_the_time_of_the_next_frame() -> None:
    host = Host(1, 2, profile="kst-ext")
    bus = host.bus
    assert bus.due() is None
    bus.receive(frame("001#0100"), 1.0)
    bus.receive(frame("002#0100"), 1.0)
    assert bus.due() == pytest.approx(1.02)
    assert [round(at, 9) for at, _ in bus.advance(1.0599)] == [1.02, 1.02, 1.04, 1.04]
    bus.receive(frame(f"601#{READ_ID}"), 1.0598)
    assert bus.now == 1.0599, "time never goes back"
    assert bus.due() == pytest.approx(1.06)
    bus.receive(frame("601#2200220003000000"), 1.06)
    bus.advance(1.0602)
    assert bus.due() == pytest.approx(1.063)
    bus.nodes[1].unplug()
    assert bus.due() == pytest.approx(1.08)
    bus.nodes[2].unplug()
    assert bus.due() is None


def test_foreign_frame_is_ignored() -> None:
    host = Host()
    data = bytes.fromhex(READ_POSITION)
    frames: list[Data] = [b"", b"\xff\xff\x01\x02\x01\xfb"]
    frames += [CanFrame(0x625 | flag, data) for flag in (ERROR_FLAG, REMOTE_FLAG)]
    frames += [CanFrame(identifier, data) for identifier in (0x5A5, 0x680, 0x7FF)]
    frames += [frame(text) for text in ("625#", "625#40", "000#01", "000#8125", "025#0300")]
    for other in frames:
        host.bus.receive(other, host.now)
    assert host.wait(1.0) == []
    assert host.send(READ_ID) == [ID]


def test_frame_has_an_audience() -> None:
    """An unplugged servo counts."""
    bus = simulate((0x25, 0x30), id_format="std")
    bus.nodes[0x25].unplug()
    audiences = {
        Audience.OURS: ("625#0000000000000000", "625#01", "025#0100", "000#0125"),
        Audience.EVERYONE: ("000#0200", "600#0000000000000000"),
        Audience.NONE: ("626#0000000000000000", "5A5#40", "680#40", "000#8125", "00000625#40", "00000600#40"),
    }
    for audience, texts in audiences.items():
        assert [bus.audience(frame(text)) for text in texts] == [audience] * len(texts)
    assert bus.audience(CanFrame(REMOTE_FLAG | 0x625, b"")) is Audience.OURS
    assert bus.audience(b"\0") is Audience.NONE
