"""The parts of a movement: what is sent before the start, and what each of them tells afterwards."""

from __future__ import annotations

from math import radians, tau

import pytest

from motorbus.core.operation import Progress
from motorbus.session.robot import Robot
from tests.motion.machines import machine


def test_before_the_start_a_servo_gets_torque_where_it_stands_its_cap_and_its_speed() -> None:
    own = {"torque": 0.4, "max_velocity": "60 deg/s"}
    with machine(arm="1", axes={"a1": own}) as (made, sims), Robot.of(made) as robot:
        sims["arm"][1].raw_position = 2300
        robot.move({"a1": 0.0}, duration=2.0)
        memory = sims["arm"][1].memory
        assert memory["torque_enable"] == 1
        assert memory["torque_limit"] == 400
        assert memory["goal_velocity"] * tau / 4096 == pytest.approx(radians(60), rel=0.05)
        assert memory["acceleration"] == 0


def test_a_part_with_one_bus_moves_nobody_else() -> None:
    with machine(arm="1-2", can="0x25") as (made, sims), Robot.of(made) as robot:
        moved = robot.move({"a2": 0.4})
        assert list(moved.axes) == list(moved.tracks) == ["a2"]
        assert list(moved.cycles) == ["arm"]
        assert sims["arm"][1].memory["torque_enable"] == 0
        assert not robot["c1"].engaged


def test_the_first_goals_leave_earlier_by_the_time_that_they_take_on_the_wire() -> None:
    with machine(arm="1-6") as (made, _), Robot.of(made) as robot:
        moved = robot.move(dict.fromkeys(robot.axes, 0.3))
        # a packet for six servos has 26 bytes, and 10 bits for each at 1 Mbit/s
        assert moved.axes["a1"].started == pytest.approx(-26 * 10 / 1e6, abs=1e-6)


def test_an_axis_that_measures_tells_what_was_measured_and_not_what_was_asked() -> None:
    with machine(can="0x25") as (made, _), Robot.of(made) as robot:
        moved = robot.move({"c1": 0.3})
        assert moved.axes["c1"].goal == 0.3
        assert moved.axes["c1"].present == robot["c1"].position() != 0.3  # it has counts of 0.1 degrees
        assert moved.axes["c1"].ended == pytest.approx(moved.duration, abs=0.03)


def test_a_stepper_alone_tells_its_progress_and_its_track() -> None:
    events: list[object] = []
    with machine(lift=True) as (made, _), Robot.of(made, report=events.append) as robot:
        robot["lift"].declare(0.1)
        moved = robot.move({"lift": 0.08})
        track = moved.tracks["lift"]
        assert track.estimated
        assert (track.presents[0], track.presents[-1]) == pytest.approx((0.1, 0.08), abs=1e-4)
        assert list(track.presents) == sorted(track.presents, reverse=True)
        assert moved.axes["lift"].ended == pytest.approx(moved.duration, rel=0.01)
        assert not moved.cycles
        told = [event.done for event in events if isinstance(event, Progress) and event.what == "moving"]
        assert len(told) >= 3


def test_a_stepper_is_sent_again_to_where_it_stands_though_its_pulses_do_not_say_that_place_exactly() -> None:
    with machine(arm="1", lift=True) as (made, _), Robot.of(made) as robot:
        robot["lift"].declare(0.0)
        robot.move({"a1": 0.3, "lift": 0.0123457})
        stands = robot["lift"].estimated
        assert stands != 0.0123457
        moved = robot.move({"a1": 0.1, "lift": 0.0123457})
        assert (moved.axes["lift"].present, robot["lift"].estimated) == (stands, stands)
        assert (moved.axes["lift"].started, moved.axes["lift"].ended, moved.ended_apart) == (0.0, 0.0, 0.0)
        assert robot["a1"].position() == pytest.approx(0.1, abs=0.002)


def test_a_stepper_that_has_no_way_to_go_is_not_even_asked() -> None:
    with machine(arm="1", lift=True) as (made, sims), Robot.of(made) as robot:
        robot["lift"].declare(0.1)
        heard = 0
        receive = sims["stage"].simulator.receive

        def counted(data: object, at: float) -> None:
            nonlocal heard
            heard += 1
            receive(data, at)  # type: ignore[arg-type]

        sims["stage"].simulator.receive = counted  # type: ignore[method-assign]
        moved = robot.move({"a1": 0.3, "lift": 0.1})
        assert heard == 0
        assert moved.axes["lift"] == (0.1, 0.1, True, 0.0, 0.0, 0.1)
        assert robot["lift"].estimated == 0.1
        assert not robot["lift"].engaged
