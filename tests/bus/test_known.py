"""Who is known to a stop, and how long a position counts."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.bus.known import FRESH, Known, withdraws
from motorbus.core.goal import Later, Stays
from motorbus.core.operation import Answer, CanFrame, Effect, Exchange, Goal, Rank, Reply
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


def test_what_told_a_position_is_kept_with_its_answer_whatever_is_ordered_since(known: Known) -> None:
    telling: Exchange[Answer] = Exchange(b"", tells_position=True)
    known.heard([1], telling, seen(1, 5.0), RATE)
    known.heard([1], Exchange(b""), seen(1, 6.0), RATE)
    known.order(move(1, 100), RATE)
    assert known.seen == {1: (telling, seen(1, 5.0))}
    assert known[1] is None
    assert known.fresh(5.0) == {1: None}


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


def test_how_often_each_was_stopped_is_counted(known: Known) -> None:
    assert (known.stops(1), known.stops(2)) == (0, 0)
    known.order(move(1, 5, rank=Rank.STOP), RATE)
    known.order(move(1, 5), RATE)
    assert (known.stops(1), known.stops(2)) == (1, 0)
    known.order(Exchange(CanFrame(0x600, bytes(8)), effect=Effect.TORQUE, rank=Rank.STOP), RATE)
    assert (known.stops(1), known.stops(2)) == (2, 1)


def answered(known: Known, exchange: Exchange[Answer], at: float = 5.0) -> Answer:
    """It leaves, and everybody answers it."""
    known.order(exchange, RATE)
    assert isinstance(exchange.replies, tuple)
    answer = Answer((), (), at)
    known.heard([due.node for due in exchange.replies], exchange, answer, RATE)
    return answer


def test_a_stop_is_accepted_once_it_is_answered(known: Known) -> None:
    stop = move(1, 5, rank=Rank.STOP)
    known.order(stop, RATE)
    assert (known.stops(1), known.accepts(1)) == (1, 0)
    known.accept(stop, answered(known, stop))
    assert (known.accepts(1), known.accepts(2)) == (1, 0)
    known.accepted(2)
    assert known.accepts(2) == 1


def test_an_answer_that_is_taken_in_after_another_order_has_left_is_none_to_that(known: Known) -> None:
    stop = move(1, 5, rank=Rank.STOP)
    answer = answered(known, stop)
    known.order(move(1, 9), RATE)
    known.accept(stop, answer)
    assert known.accepts(1) == 0


@pytest.mark.parametrize(
    ("goal", "later", "accepts"),
    [
        (Goal(1, "velocity", 0.0, -9.0, 9.0), None, 1),
        (Goal(1, "velocity", 1.0, -9.0, 9.0), None, 0),
        (Goal(1, "position", 0.0, -9.0, 9.0), None, 0),
        (Goal(1, "position", 2.0, 2.0, 2.0, Stays.STILL), None, 1),
        (Goal(1, "torque", 1.0, 1.0, 1.0, Stays.ON), None, 0),
        (Goal(1, "velocity", 0.0, -9.0, 9.0), Later(1), 0),
    ],
)
def test_an_order_to_rest_counts_once_it_is_obeyed(
    known: Known, goal: Goal, later: Later | None, accepts: int
) -> None:
    plain = move(1, 5)
    order: Exchange[Answer] = Exchange(
        plain.request, plain.replies, effect=Effect.MOTION, goals=(goal,), later=later
    )
    known.accept(order, answered(known, order))
    assert known.accepts(1) == accepts


def test_a_stop_withdraws_what_would_move_its_node_and_nothing_else() -> None:
    stop = move(1, 5, rank=Rank.STOP)
    everybody: Exchange[Answer] = Exchange(CanFrame(0x600, bytes(8)), effect=Effect.TORQUE, rank=Rank.STOP)
    anybody: Exchange[Answer] = Exchange(CanFrame(0x600, bytes(8)), effect=Effect.TORQUE)
    assert withdraws(stop, move(1, 9))
    assert withdraws(stop, anybody)
    assert withdraws(everybody, move(2, 9))
    assert not withdraws(stop, move(2, 9))
    assert not withdraws(stop, stop)
    assert not withdraws(stop, read(1))
    assert not withdraws(read(1), move(1, 9))
