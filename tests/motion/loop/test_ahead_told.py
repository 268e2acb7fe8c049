"""A loop that is a cycle ahead tells what it has read, although the next cycle must not leave: that is raised later."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from math import radians
from typing import Any

import pytest

from motorbus.errors import Interrupted, LimitExceeded, LinkLost
from motorbus.motion.loop.faces import Loop
from motorbus.session.robot import Robot
from tests.motion.loop.test_ahead import ahead, goals
from tests.motion.loop.test_rounds import RATE, cycles
from tests.motion.machines import Heard, machine


def once_behind(loop: Loop, name: str, then: Callable[[], object]) -> None:
    """Do this once, right when this piece of work on a cycle is done: its answer is in, and the next has not left."""
    rounds: Any = loop._rounds
    work = getattr(rounds, name)

    def done(*given: Any) -> Any:
        setattr(rounds, name, work)
        found = work(*given)
        then()
        return found

    setattr(rounds, name, done)


@pytest.mark.parametrize(("before", "name"), [(0, "_taken"), (30, "_landed")])
def test_who_is_stopped_behind_a_reading_is_told_after_it(before: int, name: str) -> None:
    with ahead() as (robot, loop, sims):
        loop.goal["a1"] = 0.8
        last = cycles(loop, before).number if before else -1
        once_behind(loop, name, robot["a1"].stop)
        state = next(loop)
        assert state.number > last
        assert state.missing == frozenset()
        goals(sims["arm"].line)
        loop.goal["a1"] = 0.8  # by a program that knows nothing of the stop yet
        loop.goal["a2"] = 0.3
        with pytest.raises(Interrupted, match="a1: stopped from elsewhere"):
            next(loop)
        assert dict(loop.goal) == {"a2": 0.3}
        there = cycles(loop, 60).position
        assert not goals(sims["arm"].line)
        assert there["a2"] == pytest.approx(0.3, abs=0.02)
        loop.goal["a1"] = 0.8
        assert cycles(loop, 120).position["a1"] == pytest.approx(0.8, abs=0.02)


def test_a_goal_that_a_reading_forbids_is_refused_after_that_is_told() -> None:
    with ahead(how={"direct": True}, axes={"a1": {"max_step": "2 deg"}}) as (_, loop, _sims):
        cycles(loop, 3)
        loop.goal["a1"] = 0.0
        rounds: Any = loop._rounds
        place = rounds.places["a1"]
        once_behind(loop, "_taken", lambda: setattr(place, "position", radians(4)))
        first = next(loop)
        assert first.missing == frozenset()
        with pytest.raises(LimitExceeded, match="a1: .*0.0 deg"):
            next(loop)
        place.position = 0.0
        assert cycles(loop, 3).number > first.number


@pytest.mark.parametrize(("before", "name"), [(0, "_taken"), (30, "_landed")])
def test_a_port_that_goes_behind_a_reading_is_told_after_it(before: int, name: str) -> None:
    with ahead(arm="1") as (robot, loop, sims):
        link: Any = robot.buses["arm"].link
        loop.goal["a1"] = 2.0
        last = cycles(loop, before).number if before else -1
        once_behind(loop, name, link.unplug)
        assert next(loop).number > last
        loop.goal["a1"] = 2.0  # by a program that knows nothing of it yet
        link.plug()
        sims["arm"].line = line = Heard()
        with pytest.raises(LinkLost):
            next(loop)
        cycles(loop, 30)
        assert not goals(line)


@pytest.mark.parametrize("told", [False, True])
def test_what_kept_the_next_cycle_from_leaving_is_told_at_the_latest_when_the_loop_is_left(
    told: bool,
) -> None:
    def left() -> None:
        with machine(arm="1", exit="leave") as (made, _), Robot.of(made) as robot:
            link: Any = robot.buses["arm"].link
            with robot.loop(RATE, ahead=True, watch=False) as loop:
                loop.goal["a1"] = 2.0
                cycles(loop, 30)
                once_behind(loop, "_landed", link.unplug if told else robot["a1"].stop)
                next(loop)

    with pytest.raises(LinkLost) if told else nullcontext():
        left()
