"""One thing after the other, and every fault exactly as it is ordered."""

from __future__ import annotations

import pytest

from motorbus.families.stepper.simulator.line import Line
from motorbus.families.stepper.simulator.switches import Switches
from tests.families.stepper.vectors import DUMP_B

REPLY = bytes.fromhex("FFAA4E010000")
NOTICE = b"\xee\xdd"


def said(line: Line, to: float = 99.0) -> list[bytes]:
    return [data for _, data in line.speak(to)]


def faulty(**options: object) -> Line:
    return Line(Switches(**options))  # type: ignore[arg-type]  # switches by name


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


@pytest.mark.parametrize(
    ("fault", "pieces"),
    [
        ("none", [REPLY]),
        ("lost", []),
        ("late", [REPLY]),
        ("split", [REPLY[:3], REPLY[3:]]),
        ("noise", [b"\x00\x55\xff" + REPLY]),
        ("other", [bytes.fromhex("FFAA030D0000")]),
    ],
)
def test_what_happens_to_a_reply(fault: str, pieces: list[bytes]) -> None:
    line = faulty(reply_fault=fault, fault_time=0.25)
    line.reply(REPLY, 1.0)
    begun = line.speak(99.0)
    assert [data for _, data in begun] == pieces
    if fault in ("late", "split"):
        assert begun[-1][0] == 1.25


def test_another_command_is_another_one_than_that_too() -> None:
    line = faulty(reply_fault="other")
    line.reply(bytes.fromhex("FFAA030D0000"), 0.0)
    assert said(line) == [bytes.fromhex("FFAA030C0000")]


def test_one_bit_is_flipped_each_time_another_one() -> None:
    line = faulty(reply_fault="bit")
    for n in range(48):
        line.reply(REPLY, float(n))
    damaged = said(line)
    flips = [int.from_bytes(data, "big") ^ int.from_bytes(REPLY, "big") for data in damaged]
    assert all(bin(flip).count("1") == 1 for flip in flips)
    assert len(set(flips)) == 24


def test_only_the_so_many_th_reply_is_hit() -> None:
    line = faulty(reply_fault="lost", fault_every=3)
    for n in range(6):
        line.reply(REPLY, float(n))
    assert len(said(line)) == 4


@pytest.mark.parametrize(("fault", "count"), [("none", 1), ("lost", 0), ("doubled", 2), ("early", 0)])
def test_what_happens_to_a_notice(fault: str, count: int) -> None:
    line = faulty(notice_fault=fault)
    line.notice(1.0)
    assert said(line) == [NOTICE] * count


def test_a_notice_may_come_between_a_request_and_its_reply() -> None:
    line = faulty(notice_fault="early")
    line.notice(1.0)
    line.reply(REPLY, 5.0)
    assert said(line) == [NOTICE, REPLY]


@pytest.mark.parametrize(("fault", "dump"), [("short", DUMP_B[:113]), ("byte", DUMP_B[:60] + DUMP_B[61:])])
def test_a_dump_may_be_damaged_and_replies_are_not(fault: str, dump: bytes) -> None:
    line = faulty(dump_fault=fault)
    line.reply(DUMP_B, 0.0)
    line.reply(REPLY, 1.0)
    assert said(line) == [dump, REPLY]


def test_an_echo_is_what_was_sent() -> None:
    line = faulty(echo=True)
    line.echo(b"abc", 0.0)
    assert line.speak(0.0) == [(0.0, b"abc")]
