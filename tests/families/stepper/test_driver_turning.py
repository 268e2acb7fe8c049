"""How long a motion may take, who has stopped it, and what may not even be asked for."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan
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
    slowing,
    waited,
    within,
)
from motorbus.families.stepper.simulator.memory import EXAMPLE
from motorbus.families.stepper.table import Project
from tests.families.stepper.loans import MINE


def test_the_slowest_reading_counts() -> None:
    """The manual's example takes 0.69, 0.82 or 1.43 s, as its acceleration is meant."""
    assert longest(EXAMPLE, 1600) == pytest.approx(1.428 * CLOCK + SPARE, abs=0.002)
    assert longest(EXAMPLE, None) == inf


def test_a_stop_before_it_begins_lets_nothing_leave() -> None:
    """From its first word on: whether it is accepted is another matter."""
    node = Node()
    watch = Watch(node)
    node.memory.wanted += 1
    assert isinstance(watch.refusal(lambda asked: 0), Interrupted)


def test_a_stop_that_only_ended_another_motion_is_none() -> None:
    node = Node()
    watch = Watch(node)
    node.memory.stops += 1
    assert watch.refusal(lambda asked: 3) is None


def test_a_stop_that_has_not_left_yet_ends_it_as_well() -> None:
    node = Node()
    watch = Watch(node)
    assert watch.refusal(lambda asked: 3) is None
    node.memory.wanted += 1
    with pytest.raises(Interrupted, match="by somebody else"):
        watch.check()


def test_a_stop_meanwhile_ends_it() -> None:
    left = [3]
    watch = Watch(Node())
    watch.check()
    assert watch.refusal(lambda asked: left[0]) is None
    watch.check()
    left[0] = 4
    with pytest.raises(Interrupted, match="by somebody else"):
        watch.check()


def test_what_may_turn_refuses_until_its_time_is_over() -> None:
    node = Node()
    looks(refuse_unless_idle(node, "jog()"), 5.0)
    node.memory.turning = 5.1
    with pytest.raises(RequestError, match="a move may not be over, so jog\\(\\) is refused") as told:
        looks(refuse_unless_idle(node, "jog()"), 5.0)
    assert told.value.advice == "wait 0.1 s more, or say stop() first; nothing was sent"
    looks(refuse_unless_idle(node, "jog()"), 5.1)
    node.memory.owed = True
    with pytest.raises(RequestError, match="may still run, so jog\\(\\) is refused") as told:
        looks(refuse_unless_idle(node, "jog()"), 1e6)
    assert "a project that runs until it is stopped has none" in told.value.advice, (
        "it may be waited for in vain"
    )


def test_the_slowest_reading_counts_for_slowing_down_too() -> None:
    """From 2400 Hz to 60 Hz by 40 Hz every 10 ms, and in step 2 from 3200 Hz to 50 Hz by 30 Hz."""
    assert slowing(MINE) == pytest.approx(1.05, abs=0.01)
    assert slowing(replace(MINE, total_steps=1)) == pytest.approx(0.585, abs=0.01)
    assert slowing(replace(MINE, stop_mode=1)) == 0.0
    assert slowing(Project()) == 0.0


def test_numbers_are_numbers() -> None:
    assert (within(2, 60, "time"), finite(-3.5, "angle")) == (2, -3.5)
    with pytest.raises(RequestError, match="time: 61 s"):
        within(61, 60, "time")
    for bad in (inf, -inf, nan, 10**400, "1", None, True):
        with pytest.raises(RequestError, match="angle: "):
            finite(bad, "angle")  # type: ignore[arg-type]


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
