"""A movement ends in position within a tolerance, in time, or in an error that says by how much it is not there."""

from __future__ import annotations

import asyncio
from math import inf, nan, radians
from typing import Any

import pytest

from motorbus.errors import RequestError, Stalled
from motorbus.motion.moving.stream import SETTLE
from motorbus.session.robot import AsyncRobot, Robot
from tests.support.machines import listened, machine, said

BLOCKED = (2000, 2048 + 240)
"""Counts: 21.1 degrees up."""
GOAL = radians(23)


def test_a_stall_is_judged_by_the_tolerance_and_the_timeout_that_were_asked_for() -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        sims["arm"][1].blocked = BLOCKED
        clock = robot.buses["arm"].link.now
        for timeout in (0.3, None, 2.5):
            robot.move({"a1": 0.0, "a2": 0.0})
            begun = clock()
            with pytest.raises(
                Stalled, match="a1 is not in position: its goal is 23.0 deg.*21.1 deg"
            ) as told:
                robot.move({"a1": GOAL, "a2": 0.2}, duration=1.0, tolerance=radians(1), timeout=timeout)
            patience = SETTLE if timeout is None else timeout
            assert f"within 1.0 deg of it, {patience:g} s after the end" in told.value.expected
            assert 1.0 + patience <= clock() - begun < 1.0 + patience + 0.2
        robot.move({"a1": 0.0, "a2": 0.0})
        moved = robot.move({"a1": GOAL}, tolerance=radians(3))  # near enough for who says so
        assert moved.axes["a1"].present == pytest.approx(radians(21.1), abs=0.002)


def test_one_axis_takes_them_too_and_so_does_an_async_robot() -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        sims["arm"][1].blocked = BLOCKED
        with pytest.raises(Stalled, match="a1 is not in position") as told:
            robot["a1"].move(GOAL, tolerance=0.03, timeout=0.2)
        assert "0.2 s after the end" in told.value.expected
        robot["a1"].move(GOAL, tolerance=0.06)

    async def run() -> None:
        with machine(arm="1") as (made, sims):
            sims["arm"][1].blocked = BLOCKED
            async with AsyncRobot.of(made) as robot:
                with pytest.raises(Stalled, match=r"(?s)a1 is not in position.*0.2 s after the end"):
                    await robot.move({"a1": GOAL}, tolerance=0.03, timeout=0.2)

    asyncio.run(run())


def test_the_tolerance_of_a_linear_axis_is_in_metres_of_the_axis() -> None:
    screw = {"travel": "5 mm", "low": "0 mm", "high": "2 mm", "unit": "mm"}
    linear = {"max_velocity": "2 mm/s", "max_acceleration": "10 mm/s2"}
    with machine(arm="1", axes={"a1": {**screw, **linear}}) as (made, sims), Robot.of(made) as robot:
        sims["arm"][1].blocked = (0, 2048 + 800)  # 0.977 mm
        robot["a1"].move(0.001, tolerance=0.00005)
        robot["a1"].move(0.0)
        with pytest.raises(Stalled, match=r"(?s)1\.00 mm, and it stands at 0\.98 mm.*within 0\.01 mm"):
            robot["a1"].move(0.001, tolerance=0.00001)


@pytest.mark.parametrize("what", ["tolerance", "timeout"])
@pytest.mark.parametrize("value", [0.0, -1.0, nan, inf, True, "much"])
def test_what_is_none_of_either_is_refused_and_nothing_is_sent(what: str, value: object) -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        listened(sims)
        how: dict[str, Any] = {what: value}
        with pytest.raises(RequestError, match=what):
            robot.move({"a1": 0.1}, **how)
        with pytest.raises(RequestError, match=what):
            robot["a1"].move(0.1, **how)
        assert said(sims) == []
