"""How long a motion may take, who has stopped it, and what may not even be asked for."""

from __future__ import annotations

from math import inf
from random import Random

import pytest

from motorbus.core.operation import Operation, Pause
from motorbus.errors import Interrupted, RequestError
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.turning import (
    CLOCK,
    LOOK,
    SPARE,
    Watch,
    finite,
    longest,
    refuse_unless_idle,
    waited,
    within,
)
from motorbus.families.stepper.simulator.memory import EXAMPLE


def test_the_slowest_reading_counts() -> None:
    """The manual's example takes 0.69, 0.82 or 1.43 s, as its acceleration is meant."""
    assert longest(EXAMPLE, 1600) == pytest.approx(1.428 * CLOCK + SPARE, abs=0.002)
    assert longest(EXAMPLE, None) == inf


def test_a_stop_before_it_begins_lets_nothing_leave() -> None:
    node = Node()
    watch = Watch(node)
    node.memory.stops += 1
    assert isinstance(watch.refusal(lambda asked: 0), Interrupted)


def test_a_stop_that_only_ended_another_motion_is_none() -> None:
    node = Node()
    watch = Watch(node)
    node.memory.stops += 1
    node.memory.ends += 1
    assert watch.refusal(lambda asked: 3) is None


def test_a_stop_meanwhile_ends_it() -> None:
    left = [3]
    watch = Watch(Node())
    watch.check()
    assert watch.refusal(lambda asked: left[0]) is None
    watch.check()
    left[0] = 4
    with pytest.raises(Interrupted, match="by somebody else"):
        watch.check()


def test_a_project_that_may_run_refuses() -> None:
    node = Node()
    refuse_unless_idle(node, "jog")
    node.memory.owed = True
    with pytest.raises(RequestError, match="so jog\\(\\) is refused"):
        refuse_unless_idle(node, "jog")


def test_numbers_are_numbers() -> None:
    assert (within(2, 60, "time"), finite(-3.5, "angle")) == (2, -3.5)
    with pytest.raises(RequestError, match="time: 61 s"):
        within(61, 60, "time")
    with pytest.raises(RequestError, match="angle: inf"):
        finite(inf, "angle")


def looks(operation: Operation[None], now: float) -> int:
    """How often it asks for time to pass, on a clock that shows just what was asked for; fails when that has no end."""
    count, value = 0, None
    while count < 100:
        try:
            step = operation.send(value)
        except StopIteration:
            return count
        now += step.seconds if isinstance(step, Pause) else 0.0
        count += isinstance(step, Pause)
        value = now if isinstance(step, Pause) else None
    raise AssertionError(f"at {now} it waits for a moment that never comes")


def test_a_wait_ends_whatever_its_clock_shows() -> None:
    """What is left of a time, by subtraction, may be nothing while by addition it is not over."""
    chance = Random(8)
    for _ in range(20_000):
        seconds = chance.uniform(0.01, 2.0)
        assert looks(waited(Watch(Node()), seconds, "moving"), chance.uniform(0, 1e4)) <= seconds / LOOK + 3
