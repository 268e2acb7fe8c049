"""What is known before a movement begins, as values."""

from __future__ import annotations

from motorbus.motion.moving.along import Along
from motorbus.motion.moving.moved import Arrived, Track
from motorbus.motion.moving.plan import Fact, Gone, Plan
from motorbus.motion.moving.verbs import PointToPoint
from motorbus.motion.trajectory import Trajectory


def test_an_axis_of_which_only_its_place_is_known_has_no_limits_no_grain_and_no_rate() -> None:
    assert Fact(0.5) == (0.5, None, 0.0, 0.0)


def test_a_part_without_led_axes_has_no_cycles() -> None:
    gone = Gone({"lift": Arrived(0.1, 0.1, True, 0.0, 1.0, 0.1)}, {"lift": Track(estimated=True)})
    assert gone.cycles is None


def test_there_are_two_kinds_of_plans_and_both_are_plans() -> None:
    plans: list[Plan] = [
        PointToPoint({}, {}, {}, "trapezoid", 2.0),
        Along({}, Trajectory([0.0, 1.0], {"a": [0.0, 0.0]})),
    ]
    assert [plan.asked for plan in plans] == [2.0, None]
    assert plans[0].planned({}, 2.0).course.duration == 2.0
