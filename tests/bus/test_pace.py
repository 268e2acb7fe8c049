"""What a link shows of its bit time: certain, shown by many replies, or refuted by one."""

from __future__ import annotations

import pytest

from motorbus.bus.pace import EARLY, SHOWN, Pace, byte_time, least_time
from motorbus.bus.pump import Bus
from motorbus.core.operation import ANY, Answer, CanFrame, Due, Exchange
from motorbus.families.feetech import FAMILY, sync_read
from motorbus.link.memory import MemoryLink
from motorbus.motion.safety import Gate
from tests.bus.script import position

LEAST = 0.0005


def test_where_it_is_certain_an_early_reply_is_always_suspect() -> None:
    pace = Pace(certain=True)
    for _ in range(3):
        assert pace.suspects(0.8 * EARLY * LEAST, LEAST)
        assert not pace.suspects(LEAST, LEAST)
        pace.refute()
    assert not pace.refuted


def test_where_it_is_not_one_early_reply_refutes_it() -> None:
    pace = Pace(certain=False)
    for _ in range(SHOWN - 1):
        assert not pace.suspects(LEAST, LEAST)
    assert not pace.suspects(0.1 * LEAST, LEAST)
    assert pace.refuted
    for _ in range(2 * SHOWN):
        assert not pace.suspects(LEAST, LEAST)
    assert not pace.suspects(0.1 * LEAST, LEAST)


def test_many_replies_show_it() -> None:
    pace = Pace(certain=False)
    for _ in range(SHOWN):
        assert not pace.suspects(LEAST, LEAST)
    assert pace.suspects(0.1 * LEAST, LEAST)
    assert not pace.suspects(EARLY * LEAST, LEAST)
    pace.refute()
    assert not pace.suspects(0.1 * LEAST, LEAST)


def test_nothing_behind_two_running_refutes_it_and_behind_one_does_not() -> None:
    pace = Pace(certain=False)
    for _ in range(SHOWN):
        pace.suspects(LEAST, LEAST)
    assert not pace.nothing_behind()
    assert not pace.suspects(LEAST, LEAST)
    assert not pace.nothing_behind(), "one that took its time came in between"
    assert pace.nothing_behind()
    assert pace.refuted


def test_where_it_is_certain_nothing_refutes_it() -> None:
    pace = Pace(certain=True)
    assert not any(pace.nothing_behind() for _ in range(5))


def test_the_least_time_of_frames_counts_no_stuffed_bit_of_the_answer() -> None:
    frame = CanFrame(0x601, bytes(8))
    asked = least_time(Exchange(frame, (Due(1, 1, 8),)), FAMILY, 1_000_000)
    alone = least_time(Exchange(frame, ()), FAMILY, 1_000_000)
    assert asked - alone == pytest.approx(111e-6), "47 bits of frame and 64 of data"


def test_the_least_time_of_bytes_is_their_air_time() -> None:
    for exchange in (position(1), Exchange(b"ask", ANY)):
        assert least_time(exchange, FAMILY, 9600) == FAMILY.air_time(exchange, 9600)


def test_whom_nobody_waits_for_makes_no_answer_early() -> None:
    """Of a group read in which one servo is away the others are all there sooner."""
    three: Exchange[Answer] = Exchange(b"ask", tuple(Due(node, node, 13) for node in (1, 2, 3)))
    two: Exchange[Answer] = Exchange(b"ask", tuple(Due(node, node, 13) for node in (1, 3)))
    assert least_time(three, FAMILY, 9600, without=(2,)) == least_time(two, FAMILY, 9600)
    assert least_time(three, FAMILY, 9600) > least_time(two, FAMILY, 9600)


def test_a_group_with_a_servo_that_is_away_is_read_at_once_on_a_line_that_takes_bit_time() -> None:
    simulator = FAMILY.simulator((1, 2, 3))
    with Bus(MemoryLink(simulator, pace=True), FAMILY, admit=Gate()) as bus:
        bus.run(sync_read(["present_position"], (1, 2, 3)))
        simulator.nodes[3].unplug()
        bus.run(sync_read(["present_position"], (1, 2, 3)))
        again = [bus.statistics.of(node).retries for node in (1, 2)]
        for _ in range(5):
            found = bus.run(sync_read(["present_position"], (1, 2, 3)))
            assert (set(found.values), set(found.errors)) == ({1, 2}, {3})
        assert [bus.statistics.of(node).retries for node in (1, 2)] == again
        assert bus.statistics.of(1).errors["early"] == 0


def test_a_byte_takes_its_share_of_the_air_time() -> None:
    for exchange in (position(1), Exchange(b"ask", ANY)):
        dues = () if exchange.replies is ANY else exchange.replies
        size = len(exchange.request) + sum(due.length for due in dues)
        assert byte_time(exchange, FAMILY, 9600) == FAMILY.air_time(exchange, 9600) / size
