"""What several axes do together: the buses at the same time, everyone visited, and one error that names all."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from motorbus import AsyncRobot, MotorbusError, NoReply, OutcomeUnknown, RequestError, Robot
from motorbus.simulation.named import Simulation
from tests.support.machines import listened, machine, said


@contextmanager
def nine() -> Iterator[tuple[Robot, dict[str, Simulation]]]:
    with machine(arm="1-6", can="0x25,0x26", lift=True) as (made, sims), Robot.of(made) as robot:
        yield robot, sims


def torques(sims: dict[str, Simulation]) -> list[int]:
    return [sims["arm"][node].memory["torque_enable"] for node in sims["arm"].simulator.nodes]


def test_positions_are_in_the_order_of_the_file_and_none_where_nobody_knows() -> None:
    with nine() as (robot, _):
        places = robot.positions()
        assert list(places) == list(robot.axes)
        assert places.pop("lift") is None
        assert all(place == pytest.approx(0.0, abs=0.01) for place in places.values())
        robot["lift"].declare(0.02)
        assert robot.positions("lift") == {"lift": 0.02}


def test_states_are_of_those_that_tell_one() -> None:
    with nine() as (robot, _):
        assert list(robot.states()) == [name for name in robot.axes if name != "lift"]
        assert list(robot.states(["can", "a2"])) == ["c1", "c2", "a2"]


def test_names_are_axes_groups_and_buses() -> None:
    with nine() as (robot, _):
        assert list(robot.positions("upper")) == [f"a{number}" for number in range(1, 7)]
        assert list(robot.positions(["c1", "stage"])) == ["c1", "lift"]
        with pytest.raises(RequestError, match="there is no axis, group or bus 'elbow'"):
            robot.positions("elbow")


def test_torque_goes_on_where_there_is_a_switch() -> None:
    with nine() as (robot, sims):
        robot.enable_torque()
        assert torques(sims) == [1] * 6
        assert [name for name, axis in robot.axes.items() if axis.engaged] == [f"a{n}" for n in range(1, 7)]
        robot.disable_torque("a1")
        assert torques(sims) == [0, 1, 1, 1, 1, 1]
        robot.disable_torque()
        assert torques(sims) == [0] * 6


def test_what_none_of_them_has_is_refused_before_anything_is_sent() -> None:
    with nine() as (robot, sims):
        listened(sims)
        for verb, names in (("enable_torque", "can"), ("disable_torque", "lift"), ("home", "led")):
            with pytest.raises(RequestError, match=f"none of .* has {verb.replace('_', ' ')}"):
                getattr(robot, verb)(names)
        assert said(sims) == []


def test_stop_tells_what_each_device_promises() -> None:
    with nine() as (robot, _):
        promises = robot.stop()
        assert list(promises) == list(robot.axes)
        assert {name: promise.name for name, promise in promises.items() if name in ("a1", "c1", "lift")} == {
            "a1": "HOLD_ACCEPTED",
            "c1": "HOLD_REQUESTED",
            "lift": "STOP_ACCEPTED",
        }


def test_a_dead_axis_keeps_nobody_from_being_stopped() -> None:
    with nine() as (robot, sims):
        robot.enable_torque()
        for axis in robot.axes.values():
            axis.departs()
        sims["arm"][2].unplug()
        sims["can"][0x26].unplug()
        with pytest.raises(MotorbusError) as caught:
            robot.stop()
        told = "\n".join([str(caught.value), *caught.value.__notes__])
        assert "a2: " in told
        assert "c2: " in told
        assert "a1: " not in told
        still = [name for name, axis in robot.axes.items() if axis.under_way]
        assert still == ["a2", "c2"], "all others have stopped"
        sims["arm"][2].plug()
        sims["can"][0x26].plug()


def test_a_dead_axis_keeps_nobody_from_being_limp() -> None:
    with nine() as (robot, sims):
        robot.enable_torque()
        sims["arm"][1].unplug()
        with pytest.raises(OutcomeUnknown, match="^a1: "):
            robot.disable_torque()
        assert torques(sims)[1:] == [0] * 5
        assert robot["a1"].engaged, "nobody knows"


def test_one_that_lost_its_power_in_between_is_named_and_the_others_get_torque() -> None:
    with nine() as (robot, sims):
        sims["arm"][4].unplug()
        with pytest.raises(NoReply, match="^a4: "):
            robot.enable_torque()
        assert torques(sims)[:3] == [1] * 3
        sims["arm"][4].plug()
        sims["arm"][4].power_cycle()
        robot.hold()
        assert torques(sims) == [1] * 6


def test_one_with_an_alarm_is_stopped_and_let_go_too() -> None:
    with machine(arm="1-3", options={"arm": {}}) as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()
        _overheat(sims["arm"][2])
        assert robot.states()["a2"].alarm, "it has one"
        assert list(robot.stop()) == ["a1", "a2", "a3"]
        robot.disable_torque()
        assert torques(sims) == [0] * 3


def _overheat(servo: Any) -> None:
    servo.temperature = 90.0


def test_holding_is_torque_or_a_stop() -> None:
    with nine() as (robot, sims):
        listened(sims)
        robot.hold()
        assert torques(sims) == [1] * 6
        assert any("write goal_position" in one for one in said(sims))


def test_homing_gives_where_each_is() -> None:
    with nine() as (robot, sims):
        sims["stage"].simulator.script("1.0 5 on")  # type: ignore[attr-defined]
        with robot.attended():
            assert robot.home(deadline=20.0) == {"lift": 0.0}
        assert robot.positions("lift") == {"lift": 0.0}


def test_the_async_face_is_the_same() -> None:
    async def main() -> None:
        with machine(arm="1-2", can="0x25", lift=True) as (made, sims):
            async with AsyncRobot.of(made) as robot:
                assert list(await robot.positions()) == ["a1", "a2", "c1", "lift"]
                await robot.enable_torque()
                assert torques(sims) == [1, 1]
                sims["arm"][2].unplug()
                with pytest.raises(MotorbusError, match="^a2: "):
                    await robot.stop()
                with pytest.raises(OutcomeUnknown, match="^a2: "):
                    await robot.disable_torque()
                assert torques(sims)[0] == 0
                sims["arm"][2].plug()
                await robot.disable_torque()
                assert torques(sims) == [0, 0]

    asyncio.run(main())
