"""One thing after the other, each at its moment; what faults do to it is put in its place."""

from __future__ import annotations

import pytest

from motorbus.families.stepper.simulator.harm import Harm
from motorbus.families.stepper.simulator.line import Line
from motorbus.families.stepper.simulator.switches import Switches
from tests.protocol.stepper.vectors import DUMP_B

REPLY = bytes.fromhex("FFAA4E010000")
NOTICE = b"\xee\xdd"


def said(line: Line, to: float = 99.0) -> list[bytes]:
    return [data for _, data in line.speak(to)]


def faulty(**options: object) -> Line:
    switches = Switches(**options)  # type: ignore[arg-type]  # switches by name
    return Line(switches, Harm(switches, str))


def test_what_is_due_while_something_is_said_comes_behind_it() -> None:
    line = faulty()
    line.reply(DUMP_B, 1.0)
    line.notice(1.1)
    assert line.speak(1.0) == [(1.0, DUMP_B)]
    assert line.due() == 1.1
    assert said(line) == [NOTICE]
    assert line.due() == float("inf")


def test_earlier_moments_come_first_whenever_they_were_told() -> None:
    line = faulty()
    line.reply(REPLY, 2.0)
    line.notice(1.0)
    assert said(line) == [NOTICE, REPLY]


def test_without_supply_nothing_is_said() -> None:
    line = faulty(notice_fault="early")
    line.reply(REPLY, 1.0)
    line.notice(1.0)
    line.hush()
    assert said(line) == []
    line.reply(REPLY, 1.0)
    assert said(line) == [REPLY]


def test_pieces_begin_at_their_moments() -> None:
    line = faulty(reply_fault="split", fault_time=0.25)
    line.reply(REPLY, 1.0)
    assert line.speak(99.0) == [(1.0, REPLY[:3]), (1.25, REPLY[3:])]


def test_a_reply_may_come_twice_or_not_at_all() -> None:
    for fault, count in (("doubled", 2), ("lost", 0)):
        line = faulty(reply_fault=fault)
        line.reply(REPLY, 1.0)
        assert said(line) == [REPLY] * count


@pytest.mark.parametrize(
    ("fault", "count"), [("none", 1), ("lost", 0), ("doubled", 2), ("early", 0), ("inside_dump", 0)]
)
def test_what_happens_to_a_notice(fault: str, count: int) -> None:
    line = faulty(notice_fault=fault)
    line.notice(1.0)
    assert said(line) == [NOTICE] * count


def test_a_notice_may_come_between_a_request_and_its_reply() -> None:
    line = faulty(notice_fault="early")
    line.notice(1.0)
    line.reply(REPLY, 5.0)
    assert said(line) == [NOTICE, REPLY]


def test_a_notice_may_be_late() -> None:
    line = faulty(notice_fault="late", fault_time=0.25)
    line.notice(1.0)
    assert line.speak(99.0) == [(1.25, NOTICE)]


def test_a_notice_may_come_in_the_middle_of_a_dump_and_waits_for_one() -> None:
    line = faulty(notice_fault="inside_dump")
    line.notice(1.0)
    line.notice(1.1)
    line.reply(REPLY, 2.0)
    assert said(line) == [REPLY]
    line.reply(DUMP_B, 3.0)
    (dump,) = said(line)
    assert (len(dump), dump[:6]) == (226 + 2 * 2, DUMP_B[:6])
    assert dump != DUMP_B + 2 * NOTICE
    line.reply(DUMP_B, 4.0)
    assert said(line) == [DUMP_B]


def test_a_notice_that_waits_for_a_dump_is_released_by_a_change() -> None:
    line = faulty(notice_fault="inside_dump")
    line.notice(1.0)
    line.change(Switches())
    line.reply(REPLY, 2.0)
    assert said(line) == [NOTICE, REPLY]


def test_a_notice_that_nothing_has_caused_meets_no_fault_of_notices() -> None:
    line = faulty(notice_fault="lost")
    line.spurious(1.0)
    assert said(line) == [NOTICE]


def test_what_the_device_says_may_be_damaged_and_an_echo_is_not() -> None:
    line = faulty(byte_errors=1.0, echo="yes")
    line.echo(REPLY, 1.0)
    line.reply(REPLY, 2.0)
    line.notice(3.0)
    echo, reply, notice = said(line)
    assert echo == REPLY
    assert (len(reply), len(notice)) == (6, 2)
    assert all(one != other for one, other in zip(reply + notice, REPLY + NOTICE, strict=True))


@pytest.mark.parametrize(("fault", "dump"), [("short", DUMP_B[:113]), ("byte", DUMP_B[:60] + DUMP_B[61:])])
def test_a_dump_may_be_damaged_and_replies_are_not(fault: str, dump: bytes) -> None:
    line = faulty(dump_fault=fault)
    line.reply(DUMP_B, 0.0)
    line.reply(REPLY, 1.0)
    assert said(line) == [dump, REPLY]


def test_an_echo_is_what_was_sent() -> None:
    line = faulty(echo="yes")
    line.echo(b"abc", 0.0)
    assert line.speak(0.0) == [(0.0, b"abc")]
