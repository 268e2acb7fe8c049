"""What a link shows of its bit time: certain, shown by many replies, or refuted by one."""

from __future__ import annotations

import pytest

from motorbus.bus.pace import EARLY, SHOWN, Pace, least_time
from motorbus.core.operation import ANY, CanFrame, Due, Exchange
from motorbus.families.feetech import FAMILY
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
