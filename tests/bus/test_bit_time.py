"""A reply that is there sooner than frames travel answers an older request; a link need not say that it takes time."""

from __future__ import annotations

import pytest

from motorbus.bus.pace import SHOWN
from motorbus.core.operation import Exchange, Timeout
from motorbus.errors import UnexpectedReply
from tests.bus.lanes import POSITION, READ, CanScript, number, read, said


def test_a_copy_that_comes_sooner_than_frames_travel_is_no_answer_to_the_next_question() -> None:
    script = CanScript(paced=True)
    script.submit(read(1))
    script.sent()
    script.feed(said(1, READ, POSITION, 7))
    flight = script.submit(read(1, timeout=Timeout.SCAN))
    script.sent()
    script.feed(said(1, READ, POSITION, 7), after=0.0003)
    script.time_out()
    with pytest.raises(UnexpectedReply, match="sooner"):
        flight.result()


def test_the_true_reply_behind_such_a_copy_is_the_answer() -> None:
    script = CanScript(paced=True)
    script.submit(read(1))
    script.sent()
    script.feed(said(1, READ, POSITION, 7))
    flight = script.submit(read(1))
    script.sent()
    script.feed(said(1, READ, POSITION, 7), after=0.0003)
    assert not flight.done
    script.feed(said(1, READ, POSITION, 8), after=0.0003)
    assert number(flight.result()) == 8
    assert script.turns.statistics.other["early"] == 1


def shown(script: CanScript, replies: int) -> None:
    """So many replies take their time."""
    for _ in range(replies):
        script.submit(read(1))
        script.sent()
        script.feed(said(1, READ, POSITION, 7))


def test_a_link_that_says_nothing_shows_that_it_takes_bit_time() -> None:
    script = CanScript(paced=None)
    shown(script, SHOWN)
    flight = script.submit(read(1))
    script.sent()
    script.feed(said(1, READ, POSITION, 7), after=0.0003)
    assert not flight.done, "a copy"
    script.feed(said(1, READ, POSITION, 8), after=0.0003)
    assert number(flight.result()) == 8


def test_a_link_that_answers_at_once_is_believed_at_once() -> None:
    script = CanScript(paced=None)
    shown(script, SHOWN - 1)
    for _ in range(3):
        flight = script.submit(read(1))
        script.sent()
        script.feed(said(1, READ, POSITION, 8), after=0.0001)
        assert number(flight.result()) == 8


def test_a_link_that_was_slow_for_a_while_loses_nothing_when_it_is_quick() -> None:
    script = CanScript(paced=None)
    shown(script, SHOWN)
    flight = script.submit(Exchange(read(1).request, read(1).replies, lane=1))
    script.sent()
    script.feed(said(1, READ, POSITION, 8), after=0.0001)
    assert not flight.done
    script.time_out()
    assert number(flight.result()) == 8, "nothing came behind it, and this must not be said twice"
    flight = script.submit(read(1))
    script.sent()
    script.feed(said(1, READ, POSITION, 9), after=0.0001)
    script.time_out()
    assert number(flight.result()) == 9, "nothing again: there is no bit time"
    flight = script.submit(read(1))
    script.sent()
    script.feed(said(1, READ, POSITION, 10), after=0.0001)
    assert number(flight.result()) == 10


def test_a_copy_behind_which_the_true_reply_is_lost_is_no_answer_either() -> None:
    script = CanScript(paced=None)
    shown(script, SHOWN)
    flight = script.submit(read(1))
    script.sent()
    script.feed(said(1, READ, POSITION, 7), after=0.0003)
    script.time_out()
    assert not flight.done, "asked again"
