"""An axis has what its device has, in units, zero and direction of its own."""

from __future__ import annotations

import asyncio
import inspect
from dataclasses import replace
from inspect import getattr_static
from math import tau

import pytest

from motorbus import AsyncRobot, NoReply, RequestError, Robot
from motorbus.core.family import AxisDriver, Quality
from motorbus.core.steps import Sleep
from motorbus.motion.axis import AsyncAxis, Axis
from motorbus.motion.body import Body
from motorbus.motion.capabilities import ability
from motorbus.simulation.named import Simulation
from tests.support.machines import Heard, listened, machine, said

TURNED = {"zero": "90 deg", "sign": -1, "gear": 2.0, "low": "-40 deg", "high": "40 deg"}


def test_an_axis_has_what_its_device_has() -> None:
    with machine(arm="1", can="0x25", lift=True) as (made, _), Robot.of(made) as robot:
        servo, can, lift = robot["a1"], robot["c1"], robot["lift"]
        assert {
            "position",
            "load",
            "temperature",
            "enable_torque",
            "stop",
            "hold",
            "feedback",
        } <= servo.capabilities
        assert {"position", "state", "stop", "hold", "feedback"} <= can.capabilities
        assert {"move_by", "jog", "home", "stop", "hold", "estimated"} <= lift.capabilities
        assert not {"position", "state", "enable_torque", "feedback"} & lift.capabilities
        assert not {"enable_torque", "home", "estimated", "run"} & can.capabilities


@pytest.mark.parametrize(
    ("axis", "verb"),
    [("c1", "enable_torque"), ("c1", "voltage"), ("lift", "position"), ("a1", "home"), ("a1", "declare")],
)
def test_what_a_device_lacks_its_axis_lacks(axis: str, verb: str) -> None:
    with machine(arm="1", can="0x25", lift=True) as (made, _), Robot.of(made) as robot:
        assert not hasattr(robot[axis], verb)
        with pytest.raises(AttributeError, match=f"{axis} has no {verb}"):
            getattr(robot[axis], verb)


def test_every_capability_is_a_verb_that_is_there() -> None:
    with machine(arm="1", can="0x25", lift=True) as (made, _), Robot.of(made) as robot:
        for axis in robot.axes.values():
            verbs = axis.capabilities - {"feedback", "estimated"}
            assert verbs == {
                name for name in dir(type(axis)) if _is_verb(type(axis), name) and hasattr(axis, name)
            }


def _is_verb(kind: type, name: str) -> bool:
    return isinstance(getattr_static(kind, name, None), ability)


def test_what_is_told_has_the_zero_the_direction_and_the_gear_of_the_axis() -> None:
    with machine(arm="1", axes={"a1": TURNED}) as (made, _), Robot.of(made) as robot:
        axis = robot["a1"]
        device = axis.device.position()
        assert axis.position() == pytest.approx((device - 1.570796) / -2)
        axis.enable_torque()
        axis.device.move(device - 1.0, velocity=1.0, wait=False)
        axis.bus.run(_pause(0.3))
        own, seen = axis.device.telemetry(), axis.state()
        assert own.velocity < -0.1
        assert seen.velocity == pytest.approx(own.velocity / -2, rel=0.2)
        assert seen.position == pytest.approx(axis.spec.from_device(own.position), abs=0.05)
        assert seen.temperature == own.temperature
        assert axis.velocity() > 0.05


def test_a_sample_says_how_far_it_can_be_trusted() -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        assert robot["a1"].state().quality is Quality.FRESH
        sims["arm"][1].raw_position = 3000
        jumped = robot["a1"].state()
        assert jumped.quality is Quality.CONFIRMED
        assert jumped.position == pytest.approx(robot["a1"].position())
        assert robot["a1"].state().quality is Quality.FRESH


def test_a_sample_that_nothing_confirms_is_suspect() -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        robot["a1"].state()
        inner = robot["a1"].able.state

        def twitching(device: object) -> object:
            sims["arm"][1].raw_position = 5000 - sims["arm"][1].raw_position
            return inner(device)

        robot["a1"].able = replace(robot["a1"].able, state=twitching)  # type: ignore[arg-type]
        sims["arm"][1].raw_position = 3500
        assert robot["a1"].state().quality is Quality.SUSPECT


def test_effort_has_the_direction_of_the_axis() -> None:
    with machine(arm="1", axes={"a1": TURNED}) as (made, _), Robot.of(made) as robot:
        axis = robot["a1"]
        axis.able = replace(axis.able, load=lambda _: _told(0.25), current=lambda _: _told(0.5))
        assert axis.load() == -0.25
        assert axis.current() == -0.5


async def _told(value: float) -> float:
    await Sleep(0)
    return value


async def _pause(seconds: float) -> float:
    return await Sleep(seconds)


def test_a_linear_axis_is_in_metres() -> None:
    with machine(lift=True) as (made, _), Robot.of(made) as robot:
        robot["lift"].declare(0.05)
        assert robot["lift"].estimated == 0.05
        assert "estimated at 50.00 mm" in repr(robot["lift"])


def test_engaged_is_what_was_given_torque_and_not_let_go() -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        axis = robot["a1"]
        axis.position()
        assert not axis.engaged
        axis.enable_torque()
        assert axis.engaged
        axis.disable_torque()
        assert not axis.engaged


def test_everything_an_axis_is_told_counts_as_an_order() -> None:
    with machine(arm="1", can="0x25") as (made, _), Robot.of(made) as robot:
        servo = robot["a1"]
        seen = [servo.orders]
        for verb in (servo.enable_torque, servo.stop, servo.hold, servo.disable_torque, servo.departs):
            verb()
            seen.append(servo.orders)
        assert sorted(set(seen)) == seen, "each of them counts"
        servo.arrives()
        servo.position()
        assert servo.orders == seen[-1], "reading does not"


def test_the_cap_of_the_file_is_set_before_the_torque() -> None:
    with machine(arm="1", torque=0.5) as (made, sims), Robot.of(made) as robot:
        listened(sims)
        robot["a1"].enable_torque()
        assert sims["arm"][1].memory["torque_limit"] == 500
        assert sims["arm"][1].memory["torque_enable"] == 1
        writes = [one for one in said(sims) if one.startswith("WRITE")]
        assert "torque_limit" in _parts(sims["arm"], writes[0]), "the cap comes first"


def _parts(sim: Simulation, title: str) -> str:
    assert isinstance(sim.line, Heard)
    frames = (data for data in sim.line.sent if isinstance(data, bytes))
    found = (one for data in frames for one in sim.family.open().decode(data) if one.title == title)
    return " ".join(f"{part.name} {part.meaning}" for part in next(found).parts)


def test_holding_is_torque_where_there_is_a_switch_and_else_a_stop() -> None:
    with machine(arm="1", can="0x25") as (made, sims), Robot.of(made) as robot:
        robot["a1"].hold()
        assert sims["arm"][1].memory["torque_enable"] == 1
        listened(sims)
        robot["c1"].hold()
        assert any("write goal_position" in one for one in said(sims))


def test_a_movement_that_was_refused_changes_nothing() -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        axis = robot["a1"]
        axis.departs()
        assert axis.engaged
        assert axis.under_way
        axis.stays()
        assert not axis.engaged
        assert not axis.under_way
        axis.departs()
        axis.fails("a wall")
        assert axis.under_way, "nobody knows whether it has stopped"
        axis.stop()
        assert not axis.under_way


@pytest.mark.parametrize("place", [float("nan"), float("inf"), 1e9, "here", True])
def test_a_place_that_is_none_is_not_declared(place: object) -> None:
    with machine(lift=True) as (made, _), Robot.of(made) as robot:
        with pytest.raises(RequestError, match="lift"):
            robot["lift"].declare(place)  # type: ignore[arg-type]
        assert robot["lift"].estimated is None
        robot["lift"].departs()
        with pytest.raises(RequestError, match="nobody knows that it rests"):
            robot["lift"].declare(0.0)
        robot["lift"].stop()
        robot["lift"].declare(0.0)
        assert robot["lift"].estimated == 0.0


def test_people_see_what_it_is() -> None:
    with machine(arm="1", lift=True) as (made, _), Robot.of(made) as robot:
        assert repr(robot["a1"]) == "<Axis a1 arm#1 STS3215>"
        assert "position not known: nobody has said" in repr(robot["lift"])
        assert robot["a1"].estimated is None
        assert isinstance(robot["a1"], Axis)


def test_the_async_face_is_the_same() -> None:
    async def main() -> None:
        with machine(arm="1", lift=True) as (made, _):
            async with AsyncRobot.of(made) as robot:
                axis = robot["a1"]
                assert isinstance(axis, AsyncAxis)
                await axis.enable_torque()
                assert (await axis.state()).position == pytest.approx(await axis.position(), abs=0.002)
                await axis.stop()
                await axis.disable_torque()
                assert not axis.engaged
                assert not hasattr(axis, "home")
                robot["lift"].declare(0.1)
                assert robot["lift"].estimated == 0.1

    asyncio.run(main())


def test_an_axis_of_which_nothing_is_known_can_nothing() -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        bare = Axis(robot["a1"].bus, "a1", made.axes["a1"], robot["a1"].device, AxisDriver())
        assert bare.capabilities == frozenset()
        assert isinstance(robot, Body)


def test_a_verb_shows_what_it_is_called_and_what_it_takes() -> None:
    with machine(arm="1", lift=True) as (made, _), Robot.of(made) as robot:
        assert robot["a1"].move.__name__ == "move"
        assert robot["a1"].move.__qualname__ == "Axis.move"
        assert list(inspect.signature(robot["a1"].move).parameters) == [
            "to",
            "velocity",
            "acceleration",
            "duration",
            "tolerance",
            "timeout",
        ]
        assert list(inspect.signature(robot.positions).parameters) == ["names"]
        assert robot.positions.__name__ == "positions"


def test_what_an_axis_lacks_is_not_listed() -> None:
    with machine(arm="1", lift=True) as (made, _), Robot.of(made) as robot:
        assert {"temperature", "move", "name"} <= set(dir(robot["a1"]))
        assert not {"home", "run", "declare"} & set(dir(robot["a1"]))
        assert {"home", "run", "declare"} <= set(dir(robot["lift"]))
        assert not {"temperature", "position"} & set(dir(robot["lift"]))


def test_whatever_goes_wrong_names_the_axis() -> None:
    with machine(arm="1", lift=True) as (made, sims), Robot.of(made) as robot:
        robot["lift"].declare(0.1)
        with pytest.raises(RequestError, match="^lift: this move is less than one pulse"):
            robot["lift"].move_by(1e-9)
        with pytest.raises(RequestError, match="^lift: .* whole RPM"):
            robot.move({"lift": 0.05}, speed=0.001)  # slower than its device can be told
        sims["arm"][1].unplug()
        with pytest.raises(NoReply, match="^a1: "):
            robot["a1"].position()
        sims["arm"][1].plug()


def test_a_plain_position_is_judged_as_a_sample_is_and_one_that_jumped_is_read_again() -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        robot.positions()
        listened(sims)
        robot.positions("a1")
        once = len(said(sims))
        sims["arm"][1].raw_position = 3500
        assert robot.positions("a1")["a1"] == pytest.approx(
            robot["a1"].spec.from_device(3500 * tau / 4096), abs=0.01
        )
        assert len(said(sims)) == once + 2
        assert robot["a1"].state().quality is Quality.FRESH
        sims["arm"][1].raw_position = 600
        assert robot["a1"].state().quality is Quality.CONFIRMED
        sims["arm"][2].raw_position = 600
        assert robot["a2"].position() == pytest.approx(robot.positions()["a2"])
