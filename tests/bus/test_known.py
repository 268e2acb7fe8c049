"""Who is known to a stop, and how long a position counts."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.bus.known import FRESH, Known
from motorbus.core.operation import Answer, CanFrame, Effect, Exchange, Rank, Reply
from tests.bus.lanes import RATE, Lanes, move, read, said


def seen(node: int, at: float) -> Answer:
    return Answer((Reply(node, None, said(node, 0x40, 2, 7).data),), (), at)


@pytest.fixture
def known() -> Known:
    family: Any = Lanes()
    return Known(family, RATE)


def test_whoever_answered_is_known_and_at_which_rate(known: Known) -> None:
    known.hear(3, None, 125_000)
    known.hear(1, seen(1, 5.0), 250_000)
    assert list(known) == [3, 1]
    assert known.rate == 250_000
    assert len(known.frames.exchanges) == 2


def test_an_answer_without_a_position_leaves_the_last_one(known: Known) -> None:
    known.hear(1, seen(1, 5.0), RATE)
    known.hear(1, None, RATE)
    assert known[1] == seen(1, 5.0)


def test_a_position_is_fresh_for_a_while(known: Known) -> None:
    known.hear(1, seen(1, 5.0), RATE)
    assert known.fresh(5.0 + 0.99 * FRESH) == {1: seen(1, 5.0)}
    assert known.fresh(5.0 + 1.01 * FRESH) == {1: None}


def test_whoever_is_ordered_to_move_is_known_and_nowhere(known: Known) -> None:
    known.hear(1, seen(1, 5.0), RATE)
    known.hear(2, seen(2, 5.0), RATE)
    known.order(move(1, 100), RATE)
    known.order(move(4, 100), RATE)
    assert known.fresh(5.0) == {1: None, 2: seen(2, 5.0), 4: None}


def test_what_names_nobody_may_move_everybody(known: Known) -> None:
    known.hear(1, seen(1, 5.0), RATE)
    known.hear(2, seen(2, 5.0), RATE)
    known.order(Exchange(CanFrame(0x600, bytes(8)), effect=Effect.MOTION), RATE)
    assert known.fresh(5.0) == {1: None, 2: None}


def test_reading_keeping_and_stopping_move_nobody(known: Known) -> None:
    known.hear(1, seen(1, 5.0), RATE)
    known.order(read(1), RATE)
    known.order(move(1, 5, rank=Rank.STOP), RATE)
    known.order(Exchange(CanFrame(0x601, bytes(8)), effect=Effect.PERSISTENT), RATE)
    assert known.fresh(5.0) == {1: seen(1, 5.0)}


def test_frames_made_beforehand_tell_no_position(known: Known) -> None:
    known.hear(1, seen(1, 5.0), RATE)
    assert [exchange.effect for exchange in known.frames.exchanges] == [Effect.NONE]
