"""One list of verbs, two faces: what an axis of each family can be told, blocking and awaited."""

from __future__ import annotations

import asyncio
import inspect
from inspect import getattr_static

import pytest

from motorbus import AsyncRobot, LimitExceeded, NotHomed, Robot
from motorbus.motion.axis import AsyncAxis, Axis
from motorbus.motion.capabilities import ability
from tests.support.machines import machine

VERBS = {
    *("state", "position", "velocity", "load", "current", "voltage", "temperature"),
    *("enable_torque", "disable_torque", "stop", "stopped", "hold", "move", "move_by", "jog", "home", "run"),
}


def test_both_faces_have_the_same_verbs_and_each_says_what_it_does() -> None:
    for kind in (Axis, AsyncAxis):
        found = {name: one for name in dir(kind) if isinstance(one := getattr_static(kind, name), ability)}
        assert found.keys() == VERBS
        assert all(one.__doc__ for one in found.values())


def test_an_axis_of_each_family_goes_where_it_is_told() -> None:
    with machine(arm="1", can="0x25", lift=True) as (made, _), Robot.of(made) as robot:
        robot["lift"].declare(0.0)
        for name, goal in (("a1", 0.3), ("c1", -0.2), ("lift", 0.02)):
            robot[name].move(goal)
            assert robot.positions(name) == {name: pytest.approx(goal, abs=0.005)}
            assert robot[name].engaged
            assert not robot[name].under_way


def test_a_way_and_a_jog_are_in_the_direction_of_the_axis() -> None:
    axes = {"a1": {"sign": -1, "low": "-60 deg", "high": "60 deg"}}
    with machine(arm="1", can="0x25", axes=axes) as (made, _), Robot.of(made) as robot:
        for name in ("a1", "c1"):
            assert robot[name].move_by(0.2) == pytest.approx(0.2, abs=0.01)
            assert robot[name].jog(-0.5, 0.6) < -0.1
            assert robot[name].position() < 0.1


def test_what_nobody_knows_does_not_go_to_a_position() -> None:
    with machine(lift=True) as (made, _), Robot.of(made) as robot:
        with pytest.raises(NotHomed, match="nobody has said"):
            robot["lift"].move(0.01)
        with pytest.raises(LimitExceeded, match="lift"):
            robot["lift"].move(0.5)
        robot["lift"].declare(0.0)
        robot["lift"].move(0.01)
        assert robot["lift"].estimated == pytest.approx(0.01, abs=1e-4)


def test_on_an_async_axis_every_verb_is_awaited() -> None:
    async def main() -> None:
        with machine(arm="1") as (made, _):
            async with AsyncRobot.of(made) as robot:
                for verb in (robot["a1"].position, robot["a1"].stop):
                    coroutine = verb()
                    assert inspect.iscoroutine(coroutine)
                    await coroutine
                await robot["a1"].move(0.2)
                assert await robot["a1"].position() == pytest.approx(0.2, abs=0.01)

    asyncio.run(main())
