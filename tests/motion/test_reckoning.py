"""Where an axis stands that does not tell: added up from what came to its end, and forgotten when something did not."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from math import pi, tau

import pytest

from motorbus import AsyncRobot, Interrupted, LimitExceeded, MotorbusError, NotHomed, RequestError, Robot
from motorbus.core.steps import Sleep, catch, gather
from motorbus.families.stepper.parameters import Project, Step, with_steps
from motorbus.motion import capabilities as verbs
from motorbus.motion import reckoning
from motorbus.motion.parallel import Parallel
from motorbus.motion.reckoning import Movement, Reckoning, is_reckoned
from tests.support.machines import listened, machine, said

TURN = Step(distance=1600, speed=60, start_frequency=400, acceleration=100)
"""A turn in a little more than a second."""
FAR = {"lift": {"low": "0 mm", "high": "2000 mm", "max_step": "500 mm"}}


def built(step: Step) -> Project:
    """Project 1 with this step; a unit is a pulse."""
    return with_steps(
        Project(number=1, microsteps=8, step_angle=180, turn_distance=1600, stop_mode=1), (step,)
    )


def test_it_begins_unknown_and_is_what_was_declared_and_what_came_after() -> None:
    found = Reckoning()
    assert found.position is None
    assert "nobody has said" in str(found)
    found.declare(1.0)
    movement = Movement()
    movement.place = found.depart()
    assert found.position is None, "while it moves nobody knows"
    found.arrive(movement.after(0.5))
    assert found.position == 1.5
    assert "estimated" in str(found)


def test_what_is_unknown_stays_unknown_after_a_movement() -> None:
    found, movement = Reckoning(), Movement()
    movement.place = found.depart()
    found.arrive(movement.after(0.5))
    assert found.position is None
    assert "nobody has said" in found.why


def test_a_movement_that_was_refused_leaves_it_where_it_was() -> None:
    found = Reckoning()
    found.declare(1.0)
    found.arrive(found.depart())
    assert found.position == 1.0


def test_where_an_earlier_movement_did_not_say_how_it_ended_nobody_knows_where_the_next_one_began() -> None:
    found = Reckoning()
    found.declare(1.0)
    found.depart()
    assert found.depart() == (None, "a movement was interrupted")


def test_where_a_movement_began_is_known_while_it_goes_on_and_no_longer() -> None:
    found = Reckoning()
    found.depart()
    assert found.departed is None
    found.declare(1.0)
    place = found.depart()
    assert [found.position, found.departed] == [None, 1.0]
    found.arrive(place)
    assert [found.position, found.departed] == [1.0, None]
    found.depart()
    found.forget("somebody turned it")
    assert found.departed is None


@pytest.mark.parametrize(("begins", "mm"), [(0.190, 150.0), (0.010, 195.0), (None, 205.0)])
def test_a_program_that_leads_out_of_the_limits_is_judged_by_where_it_begins(
    begins: float | None, mm: float
) -> None:
    with machine(lift=True) as (made, sims), Robot.of(made) as robot:
        lift, sim = robot["lift"], sims["stage"][1]
        sim.put(1, built(replace(TURN, distance=round(1600 * mm / 5))))
        if begins is not None:
            lift.declare(begins)
        with pytest.raises(LimitExceeded):
            lift.run(1)
        assert sim.position == 0
        assert lift.estimated == begins
        assert not lift.under_way
        lift.declare(0.05)
        sim.put(1, built(replace(TURN, distance=round(1600 * 20.0 / 5))))
        lift.run(1)
        assert sim.position > 0


def test_what_needs_the_position_is_told_why_there_is_none() -> None:
    found = Reckoning()
    found.forget("program 2 has moved it")
    with pytest.raises(NotHomed, match="lift: where it is is not known") as caught:
        found.known("lift")
    assert "program 2 has moved it" in str(caught.value)
    assert "nothing was sent" in str(caught.value)
    found.declare(0.25)
    assert found.known("lift") == 0.25


def test_reckoned_is_what_moves_and_does_not_tell() -> None:
    assert is_reckoned({"move_by": 1, "stop": 1})
    assert is_reckoned({"keep_time": 1})
    assert not is_reckoned({"move_by": 1, "position": 1})
    assert not is_reckoned({"stop": 1})
    assert not is_reckoned({})


def test_moves_add_up_and_the_motor_is_where_they_say() -> None:
    with machine(lift=True) as (made, sims), Robot.of(made) as robot:
        lift = robot["lift"]
        lift.declare(0.0)
        before = sims["stage"][1].status()["load"]
        assert lift.move_by(0.010) == pytest.approx(0.010, abs=1e-5)
        assert lift.move_by(-0.004, velocity=0.01) == pytest.approx(-0.004, abs=1e-5)
        assert lift.jog(0.01, 0.2) == pytest.approx(0.002, abs=1e-5)
        assert lift.estimated == pytest.approx(0.008, abs=3e-5)
        turned = float(str(sims["stage"][1].status()["load"])) - float(str(before))
        assert turned == pytest.approx(0.008 / 0.005 * _pulses(robot), rel=0.01)
        assert robot.positions() == {"lift": lift.estimated}


def _pulses(robot: Robot) -> float:
    """Pulses for one turn, as project 1 of the device says."""
    return float(robot["lift"].device.read_project(1).project.pulses_per_unit)


def test_an_axis_against_its_device_goes_the_other_way() -> None:
    with machine(lift=True, axes={"lift": {"sign": -1}}) as (made, sims), Robot.of(made) as robot:
        robot["lift"].declare(0.1)
        robot["lift"].move_by(0.005)
        assert robot["lift"].estimated == pytest.approx(0.105, abs=1e-5)
        assert float(str(sims["stage"][1].status()["load"])) < 0


def test_homing_makes_it_known() -> None:
    with machine(lift=True, axes={"lift": {"zero": "-1 turn", "low": "-200 mm"}}) as (made, sims):
        sims["stage"].simulator.script("1.0 5 on")  # type: ignore[attr-defined]
        with Robot.of(made) as robot:
            with robot.attended():
                place = robot["lift"].home(deadline=20.0)
            assert place == pytest.approx(0.005), "the device is at its 0, the axis a turn from there"
            assert robot["lift"].estimated == place


def test_homing_that_found_no_switch_makes_it_unknown() -> None:
    with machine(lift=True) as (made, _), Robot.of(made) as robot:
        robot["lift"].declare(0.1)
        with pytest.raises(NotHomed), robot.attended():
            robot["lift"].home(deadline=2.0)
        assert robot["lift"].estimated is None
        assert "did not come to its end" in robot["lift"].reckoning.why  # type: ignore[union-attr]


@pytest.mark.parametrize("rank", ["stop", "estop"])
def test_a_stop_in_the_middle_makes_it_unknown(rank: str) -> None:
    with machine(lift=True, axes=FAR) as (made, _), Robot.of(made) as robot:
        lift = robot["lift"]
        lift.declare(0.0)

        async def stopped() -> None:
            await Sleep(1.0)
            if rank == "estop":
                lift.bus.estop()
            else:
                await verbs.stop(lift)

        async def both() -> list[object]:
            found = await gather(catch(reckoning.move_by(lift, 0.1)), catch(stopped()))
            return list(found)

        told: list[object] = robot.conductor.run(
            Parallel({"stage": both()}, lambda results: results["stage"])
        )
        assert isinstance(told[0], Interrupted), told
        assert lift.estimated is None
        assert "did not come to its end" in lift.reckoning.why  # type: ignore[union-attr]
        robot.reset()
        assert robot.positions() == {"lift": None}


def test_silence_in_the_middle_makes_it_unknown() -> None:
    with machine(lift=True) as (made, sims), Robot.of(made) as robot:
        robot["lift"].declare(0.0)
        robot["lift"].move_by(0.001)
        sims["stage"][1].unplug()
        with pytest.raises(MotorbusError):
            robot["lift"].move_by(0.001)
        assert robot["lift"].estimated is None
        assert robot["lift"].under_way, "it may be moving still"
        sims["stage"][1].plug()


@pytest.mark.parametrize(
    ("way", "velocity", "error"),
    [
        (0.3, None, LimitExceeded),
        (-0.01, None, LimitExceeded),
        (float("nan"), None, LimitExceeded),
        (0.01, 1.0, LimitExceeded),
        (0.01, -0.01, RequestError),
        (0.01, 0.0, RequestError),
        (1e-9, None, RequestError),
    ],
)
def test_what_must_not_be_is_refused_and_changes_nothing(
    way: float, velocity: float | None, error: type[MotorbusError]
) -> None:
    with machine(lift=True) as (made, sims), Robot.of(made) as robot:
        robot["lift"].declare(0.0)
        listened(sims)
        with pytest.raises(error, match="lift|pulse"):
            robot["lift"].move_by(way, velocity=velocity)
        assert robot["lift"].estimated == 0.0
        assert not robot["lift"].engaged
        assert all("Read" in one for one in said(sims)), "nothing was written"


def test_a_jog_keeps_to_the_same_limits() -> None:
    with machine(lift=True) as (made, _), Robot.of(made) as robot:
        robot["lift"].declare(0.0)
        for velocity, seconds in ((1.0, 0.1), (-0.01, 1.0), (0.01, float("nan"))):
            with pytest.raises(LimitExceeded, match="lift"):
                robot["lift"].jog(velocity, seconds)
        assert robot["lift"].estimated == 0.0


def test_an_axis_that_nobody_knows_may_move_but_not_more_than_its_way() -> None:
    with machine(lift=True) as (made, _), Robot.of(made) as robot:
        robot["lift"].move_by(0.005)
        assert robot["lift"].estimated is None, "it moved, and still nobody knows"
        with pytest.raises(LimitExceeded, match="more than all its way"):
            robot["lift"].move_by(0.201)


def test_max_step_holds_for_it_too() -> None:
    with machine(lift=True, max_step="5 mm") as (made, _), Robot.of(made) as robot:
        for declared in (False, True):
            if declared:
                robot["lift"].declare(0.0)
            with pytest.raises(LimitExceeded, match="5.00 mm"):
                robot["lift"].move_by(0.006)


def test_a_program_makes_it_unknown() -> None:
    with machine(lift=True) as (made, _), Robot.of(made) as robot:
        lift = robot["lift"]
        lift.declare(0.0)
        lift.able = replace(lift.able, run=lambda _, number, **__: _ran(number))
        assert lift.run(2) == "project 2 ran"
        assert lift.estimated is None
        assert "program 2" in lift.reckoning.why  # type: ignore[union-attr]


async def _ran(number: int) -> str:
    await Sleep(0.1)
    return f"project {number} ran"


def test_a_turn_of_a_turning_axis_is_a_turn_of_its_device() -> None:
    turning = {"travel": None, "unit": "deg", "low": "-720 deg", "high": "720 deg"}
    rates = {"max_velocity": "360 deg/s", "max_acceleration": "360 deg/s2"}
    with machine(lift=True, axes={"lift": {**turning, **rates}}) as (made, _), Robot.of(made) as robot:
        robot["lift"].declare(0.0)
        assert robot["lift"].move_by(tau / 2, velocity=pi) == pytest.approx(pi, abs=0.01)
        assert robot["lift"].estimated == pytest.approx(pi, abs=0.01)


def test_the_async_face_is_the_same() -> None:
    async def main() -> None:
        with machine(lift=True) as (made, sims):
            sims["stage"].simulator.script("1.0 5 on\n3.0 5 off")  # type: ignore[attr-defined]
            async with AsyncRobot.of(made) as robot:
                async with robot.attended():
                    await robot["lift"].home(deadline=10.0)
                await robot["lift"].move_by(0.005)
                assert robot["lift"].estimated == pytest.approx(0.005, abs=1e-5)
                assert await robot.positions() == {"lift": robot["lift"].estimated}

    asyncio.run(main())
