"""How long somebody looks whether an axis rests: carried out by hand, step by step."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

from motorbus.core.family import Quality
from motorbus.core.operation import Pause
from motorbus.errors import MotorbusError, NoReply, RequestError
from motorbus.motion.safety.standstill import PAUSE, READS, Rest, Standstill, watched
from motorbus.motion.safety.track import Sample

SILENT = NoReply("silent")
BEGUN = 4.0


def looked(told: Iterable[float | MotorbusError], *patience: float) -> tuple[Rest, float | None, int, float]:
    """What came of it, where it was last, how often it was asked, and how long that took (s)."""
    answers, asked = iter(told), [0]

    def ask() -> Any:
        asked[0] += 1
        answer = next(answers)
        if isinstance(answer, MotorbusError):
            raise answer
        return answer
        yield

    work: Any = watched(ask, *patience)
    now = BEGUN
    step = next(work)
    while True:
        assert isinstance(step, Pause)
        assert step.seconds in (0, PAUSE)
        now += step.seconds
        try:
            step = work.send(now)
        except StopIteration as end:
            rest, place = end.value
            return rest, place, asked[0], now - BEGUN


def test_it_ends_with_the_reading_that_proves_rest() -> None:
    rest, place, asked, took = looked([1.0] * 50, 1.0)
    assert (rest, place, asked) == (Rest.STOPPED, 1.0, 6)
    assert took == pytest.approx(0.1)


@pytest.mark.parametrize("patience", [0.0, 0.001])
def test_it_is_asked_three_times_whatever_the_patience(patience: float) -> None:
    rest, place, asked, _ = looked([0.0, 0.02, 0.04, 0.06], patience)
    assert (rest, place, asked) == (Rest.MOVING, 0.04, READS)


def test_it_is_asked_until_the_patience_is_over_and_no_longer() -> None:
    moving = [number * 0.02 for number in range(50)]
    _, _, asked, took = looked(moving, 0.21)
    assert took == pytest.approx(0.22)
    assert asked == 12


def test_when_nobody_says_how_long_it_is_asked_for_a_second() -> None:
    rest, _, _, took = looked(number * 0.02 for number in range(200))
    assert rest is Rest.MOVING
    assert took == pytest.approx(1.0, abs=0.2)


def test_patience_that_is_over_at_this_very_moment_is_over() -> None:
    steps = BEGUN
    for _ in range(4):
        steps += PAUSE
    assert looked([number * 0.02 for number in range(50)], steps - BEGUN)[2] == 5


def test_silence_takes_back_what_was_seen_and_is_no_error() -> None:
    rest, place, asked, _ = looked([1.0, 1.0, 1.0, SILENT, *[1.0] * 50], 1.0)
    assert (rest, place, asked) == (Rest.STOPPED, 1.0, 4 + 6)
    assert looked([SILENT] * 50, 0.0)[:3] == (Rest.UNSEEN, None, READS)


def test_what_is_no_silence_is_raised() -> None:
    with pytest.raises(RequestError):
        looked([RequestError("no such thing")], 1.0)


def test_one_that_moved_and_is_seen_no_more_is_unseen() -> None:
    judge = Standstill(still=0.5, span=0.25, reads=3)
    judge.take(Sample(0.0, 0.0))
    judge.take(Sample(9.0, 0.1))
    told = [judge.rest]
    judge.take(Sample(9.0, 0.2, Quality.SUSPECT))
    assert [*told, judge.rest] == [Rest.MOVING, Rest.UNSEEN]
