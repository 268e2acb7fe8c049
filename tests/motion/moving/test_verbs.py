"""The verbs that move: several axes as one, poses, trajectories, and one axis at a time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from math import inf, nan, radians
from typing import Any

import pytest

from motorbus.core.steps import Progress
from motorbus.errors import LimitExceeded, NotHomed, RequestError
from motorbus.motion.moving.verbs import Crisp
from motorbus.motion.profile import Limiting, Limits, Move, synchronised
from motorbus.motion.trajectory import Trajectory
from motorbus.session.robot import Robot
from motorbus.simulation.named import Simulation
from tests.support.machines import machine

POSES = """
[pose.ready]
a1 = "30 deg"
c1 = "-10 deg"
"""


@contextmanager
def robot(**options: Any) -> Iterator[tuple[Robot, dict[str, Simulation]]]:
    """Two servos on a line and one on CAN, unless something else is asked for."""
    with (
        machine(**{"arm": "1-2", "can": "0x25", "extra": POSES, **options}) as (made, sims),
        Robot.of(made) as it,
    ):
        yield it, sims


class Traffic:
    """Counts what arrives at the devices of some buses."""

    def __init__(self, sims: Mapping[str, Simulation]) -> None:
        self.count = 0
        for sim in sims.values():
            self._listen(sim.simulator)

    def _listen(self, simulator: Any) -> None:
        receive = simulator.receive

        def counted(data: Any, at: float) -> None:
            self.count += 1
            receive(data, at)

        simulator.receive = counted


# -- several axes ------------------------------------------------------------------------------------------------------


def test_axes_of_two_buses_arrive_together_where_they_were_sent() -> None:
    with robot() as (it, _):
        moved = it.move({"a1": 0.5, "a2": -0.3, "c1": 0.2})
        assert it.positions() == pytest.approx({"a1": 0.5, "a2": -0.3, "c1": 0.2}, abs=0.002)
        assert {name: one.present for name, one in moved.axes.items()} == pytest.approx(
            it.positions(), abs=1e-9
        )
        # 0.5 rad at 90 deg/s and 360 deg/s²: a trapezoid of way / v + v / a
        assert moved.duration == pytest.approx(0.5 / radians(90) + 0.25)
        assert moved.limited_by == Limiting("a1", "velocity")
        assert moved.ended_apart < 0.02 * moved.duration + 0.01
        assert not any(one.under_way for one in it.axes.values())
        assert all(one.engaged for one in it.axes.values())


def test_a_track_tells_goal_and_present_in_units_of_the_axis() -> None:
    with robot() as (it, _):
        moved = it.move({"a1": 0.5}, duration=1.0)
        track = moved.tracks["a1"]
        assert len(track.times) == len(track.goals) == len(track.presents) > 95
        assert (track.goals[0], track.goals[-1]) == pytest.approx((0.0, 0.5), abs=0.002)
        assert track.worst < 0.03
        assert moved.cycles["arm"].skipped == moved.cycles["arm"].lost == 0
        assert moved.cycles["arm"].done == 100


def test_a_duration_that_was_asked_for_is_kept_and_too_short_a_one_refused() -> None:
    with robot() as (it, sims):
        assert it.move({"a1": 0.1, "c1": 0.1}, duration=1.5).duration == 1.5
        traffic = Traffic(sims)
        with pytest.raises(RequestError, match=r"0\.1 s is too short: a1 needs") as told:
            it.move({"a1": 0.8}, duration=0.1)
        assert "nothing was sent" in str(told.value)
        assert traffic.count < 10  # positions were read, and nothing else
        assert it.positions("a1") == pytest.approx({"a1": 0.1}, abs=0.002)


def test_speed_makes_all_of_it_slower() -> None:
    with robot() as (it, _):
        whole = it.move({"a1": 0.5}).duration
        assert it.move({"a1": 0.0}, speed=0.5).duration == pytest.approx(2 * whole, rel=0.01)


def test_a_gentle_movement_takes_longer_and_arrives_too() -> None:
    with robot() as (it, _):
        quick = it.move({"a1": 0.5}).duration
        gentle = it.move({"a1": 0.0}, kind="minimum_jerk")
        assert gentle.duration > 1.1 * quick
        assert it.positions("a1") == pytest.approx({"a1": 0.0}, abs=0.002)


def test_an_axis_that_is_there_already_holds_and_is_no_matter() -> None:
    with robot() as (it, sims):
        moved = it.move({"a1": 0.0, "c1": 0.0})
        assert (moved.duration, moved.limited_by) == (0.0, Limiting("", "nothing"))
        assert sims["arm"][1].memory["torque_enable"] == 1
        assert it.move({"a1": 0.3, "a2": 0.0}).axes["a2"].ended == 0.0


def test_progress_is_told_by_one_bus_a_few_times_a_second() -> None:
    events: list[object] = []
    with machine(arm="1", can="0x25") as (made, _), Robot.of(made, report=events.append) as it:
        it.move({"a1": 0.5, "c1": 0.5}, duration=2.0)
    told = [event for event in events if isinstance(event, Progress) and event.what == "moving"]
    assert told[0] == (0, 2000, "moving")
    assert told[-1] == (2000, 2000, "moving")
    assert 6 <= len(told) <= 12
    assert [event.done for event in told] == sorted(event.done for event in told)


@pytest.mark.parametrize(
    ("goals", "options", "error", "match"),
    [
        ({}, {}, RequestError, "no axis is named"),
        ({"nobody": 0.1}, {}, RequestError, "nobody"),
        ({"all": 0.1}, {}, RequestError, "not an axis"),
        ({"a1": 0.1, "a2": nan}, {}, LimitExceeded, "a2: its goal is nan"),
        (
            {"a1": 0.1, "c1": 5.0},
            {},
            LimitExceeded,
            "c1: the goal 286.5 deg is outside -50.0 deg to 50.0 deg",
        ),
        ({"a1": 0.1}, {"speed": 0.0}, RequestError, "speed is 0"),
        ({"a1": 0.1}, {"speed": 1.5}, RequestError, "speed is 1.5"),
        ({"a1": 0.1}, {"kind": "sine"}, RequestError, "no kind of profile"),
        ({"a1": 0.1}, {"duration": 0.0}, RequestError, "duration is 0"),
        ({"a1": 0.1}, {"duration": inf}, RequestError, "duration is inf"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_sent(
    goals: dict[str, float], options: dict[str, Any], error: type[Exception], match: str
) -> None:
    with robot() as (it, sims):
        traffic = Traffic(sims)
        with pytest.raises(error, match=match):
            it.move(goals, **options)
        assert traffic.count == 0
        assert not any(axis.engaged for axis in it.axes.values())


def test_a_limit_of_a_device_counts_too_and_nobody_moves() -> None:
    with robot(axes={"a1": {"low": None, "high": None}}) as (it, sims):
        with pytest.raises(LimitExceeded, match="a1: the goal 286"):
            it.move({"a1": 5.0, "c1": 0.2})
        assert sims["arm"][1].memory["torque_enable"] == 0
        assert it.positions() == pytest.approx({"a1": 0.0, "a2": 0.0, "c1": 0.0}, abs=0.002)


def test_an_axis_of_which_nobody_knows_where_it_is_is_not_moved_and_neither_are_the_others() -> None:
    with robot(lift=True) as (it, sims):
        with pytest.raises(NotHomed, match="lift: where it is is not known"):
            it.move({"a1": 0.2, "c1": 0.2, "lift": 0.01})
        assert sims["arm"][1].memory["torque_enable"] == 0
        assert it.positions(["a1", "c1"]) == pytest.approx({"a1": 0.0, "c1": 0.0}, abs=0.002)
        assert not any(axis.engaged or axis.under_way for axis in it.axes.values())


def test_an_axis_with_a_profile_of_its_own_ends_with_the_others_and_is_called_estimated() -> None:
    with robot(lift=True) as (it, _):
        it["lift"].declare(0.0)
        moved = it.move({"a1": 0.3, "c1": 0.2, "lift": 0.02}, duration=3.0)
        assert moved.axes["lift"].estimated
        assert moved.estimated
        assert not moved.axes["a1"].estimated
        assert it["lift"].estimated == pytest.approx(0.02, abs=1e-4)
        assert moved.started_apart < 0.005
        assert moved.duration == pytest.approx(3.0, rel=0.1)
        assert moved.ended_apart < 0.02 * moved.duration
        assert moved.tracks["lift"].estimated
        assert moved.tracks["lift"].presents[-1] == pytest.approx(0.02, abs=1e-4)


def test_a_device_that_needs_longer_decides_how_long_it_takes() -> None:
    with robot(lift=True) as (it, _):
        it["lift"].declare(0.0)
        moved = it.move({"a1": 0.1, "lift": 0.05})
        assert moved.limited_by.axis == "lift"
        assert moved.duration > 2.5  # 50 mm at 20 mm/s
        with pytest.raises(RequestError, match="is too short: lift needs"):
            it.move({"a1": 0.0, "lift": 0.0}, duration=2.9)
        assert it["lift"].estimated == pytest.approx(0.05, abs=1e-4)


# -- poses and parking -------------------------------------------------------------------------------------------------


def test_a_pose_is_a_movement_with_goals_from_the_file() -> None:
    with robot() as (it, _):
        it.pose("ready", duration=1.0)
        assert it.positions() == pytest.approx({"a1": radians(30), "a2": 0.0, "c1": radians(-10)}, abs=0.002)
        with pytest.raises(RequestError, match="no pose 'nowhere'"):
            it.pose("nowhere")


def test_parking_goes_where_the_file_says() -> None:
    with robot(axes={"a1": {"park": "20 deg"}}) as (it, _):
        it.park()
        assert it.positions() == pytest.approx({"a1": radians(20), "a2": 0.0, "c1": 0.0}, abs=0.002)
        with pytest.raises(RequestError, match="a2, c1 has no place to park"):
            it.park(["a2", "c1"])
    with robot() as (it, _), pytest.raises(RequestError, match="has no place to park"):
        it.park()


# -- trajectories ------------------------------------------------------------------------------------------------------

WAVE = Trajectory([0.0, 1.0, 2.0], {"a1": [0.2, 0.5, 0.1], "c1": [0.0, 0.2, 0.1]})


def test_a_trajectory_is_gone_along_from_its_first_sample_on() -> None:
    with robot() as (it, _):
        moved = it.replay(WAVE)
        assert moved.duration == pytest.approx(2.0)
        assert it.positions(["a1", "c1"]) == pytest.approx({"a1": 0.1, "c1": 0.1}, abs=0.002)
        track = moved.tracks["a1"]
        assert track.presents[0] == pytest.approx(0.2, abs=0.003)
        assert max(track.presents) == pytest.approx(0.5, abs=0.01)
        assert track.error < 0.01


def test_half_the_speed_takes_twice_the_time() -> None:
    with robot() as (it, _):
        assert it.replay(WAVE, speed=0.5).duration == pytest.approx(4.0)
        with pytest.raises(LimitExceeded, match="acceleration|velocity"):
            it.replay(WAVE, speed=4.0)
        with pytest.raises(RequestError, match="speed is 0"):
            it.replay(WAVE, speed=0.0)


def test_the_rate_of_a_replay_may_be_chosen_as_far_as_the_wire_carries_it() -> None:
    with robot() as (it, _):
        assert it.replay(WAVE, rate=40.0).cycles["arm"].rate == pytest.approx(40.0)
        with pytest.raises(RequestError, match="20000 Hz is not possible") as told:
            it.replay(WAVE, rate=20000.0)
        assert "at most" in str(told.value)


def test_a_trajectory_beyond_a_limit_is_refused_and_nobody_goes_to_its_beginning() -> None:
    far = Trajectory([0.0, 4.0, 8.0], {"a1": [0.5, 0.6, 4.0]})
    with robot() as (it, _):
        with pytest.raises(LimitExceeded, match=r"a1: its position at 6\.\d+ s is 150\.\d+ deg"):
            it.replay(far)
        assert it.positions("a1") == pytest.approx({"a1": 0.0}, abs=0.002)


def test_an_axis_that_goes_from_point_to_point_only_cannot_be_in_a_trajectory() -> None:
    with robot(lift=True) as (it, _):
        it["lift"].declare(0.0)
        with pytest.raises(RequestError, match="lift cannot go along a trajectory") as told:
            it.replay(Trajectory([0.0, 5.0], {"lift": [0.0, 0.01]}))
        assert "point to point only" in str(told.value) or "from point to point" in str(told.value)


# -- one axis ----------------------------------------------------------------------------------------------------------


def test_one_axis_moves_within_what_was_asked_for() -> None:
    with robot() as (it, _):
        moved = it["a1"].move(0.5, velocity=0.5, acceleration=2.0)
        assert moved.duration == pytest.approx(0.5 / 0.5 + 0.5 / 2.0)
        assert moved.axes["a1"].present == pytest.approx(0.5, abs=0.002)
        assert it["c1"].move(0.2, duration=1.0).duration == 1.0
        with pytest.raises(LimitExceeded, match="a1: the velocity"):
            it["a1"].move(0.0, velocity=3.0)
        with pytest.raises(LimitExceeded, match="a1: the goal"):
            it["a1"].move(3.0)


def test_a_stepper_axis_moves_to_a_position_once_it_is_known_where_it_is() -> None:
    with robot(lift=True) as (it, _):
        with pytest.raises(NotHomed):
            it["lift"].move(0.01)
        it["lift"].declare(0.02)
        moved = it["lift"].move(0.01)
        assert moved.axes["lift"].estimated
        assert it["lift"].estimated == pytest.approx(0.01, abs=1e-4)


def test_a_way_from_here_is_gone_and_measured() -> None:
    with robot() as (it, _):
        assert it["a1"].move_by(0.3) == pytest.approx(0.3, abs=0.002)
        assert it["a1"].move_by(-0.1, velocity=0.2) == pytest.approx(-0.1, abs=0.002)
        assert it["a1"].position() == pytest.approx(0.2, abs=0.003)
        with pytest.raises(LimitExceeded, match="a1: the goal"):
            it["a1"].move_by(3.0)
        with pytest.raises(LimitExceeded, match="its way is nan"):
            it["a1"].move_by(nan)


def test_a_jog_starts_and_stops_within_its_time() -> None:
    with robot() as (it, _):
        before = it.buses["arm"].link.now()
        # up to 0.5 rad/s at 360 deg/s², and down again: 0.5 * (1 - 0.5 / a)
        assert it["a1"].jog(0.5, 1.0) == pytest.approx(0.5 * (1 - 0.5 / radians(360)), abs=0.002)
        assert it.buses["arm"].link.now() - before == pytest.approx(1.05, abs=0.1)
        assert it["a1"].jog(-1.0, 0.1) == pytest.approx(-radians(360) * 0.05**2, abs=0.002)


def test_a_jog_that_would_lead_out_of_the_limits_is_refused() -> None:
    with robot() as (it, _):
        it["c1"].move(radians(40))
        with pytest.raises(LimitExceeded, match="c1: the goal"):
            it["c1"].jog(1.0, 2.0)
        assert it["c1"].position() == pytest.approx(radians(40), abs=0.002)
        for velocity, seconds in ((0.0, 1.0), (0.5, 0.0), (0.5, nan)):
            with pytest.raises(RequestError, match="is no jog"):
                it["c1"].jog(velocity, seconds)
        with pytest.raises(LimitExceeded, match="velocity"):
            it["c1"].jog(9.0, 1.0)


def test_a_stepper_axis_jogs_and_moves_by_its_own_means() -> None:
    with robot(lift=True) as (it, _):
        it["lift"].declare(0.05)
        assert it["lift"].move_by(0.01) == pytest.approx(0.01, abs=1e-4)
        assert it["lift"].jog(-0.01, 1.0) < 0
        assert it["lift"].estimated is not None


# -- ends that can be seen ---------------------------------------------------------------------------------------------


def test_the_first_order_and_the_last_one_are_a_grain_from_the_ends() -> None:
    own = Limits(1.0, 4.0)
    whole = synchronised(
        {"far": Move(0.0, -1.0, own), "near": Move(1.0, 1.01, own), "none": Move(0.5, 0.5, own)}, duration=4.0
    )
    crisp = Crisp(whole, {"far": 0.002, "near": 0.02, "none": 0.002})
    assert crisp.duration == 4.0
    assert crisp.positions(0.0) == {"far": 0.0, "near": 1.0, "none": 0.5}
    assert crisp.positions(1e-6) == pytest.approx({"far": -0.002, "near": 1.01, "none": 0.5})
    assert crisp.positions(2.0) == pytest.approx({"far": -0.5, "near": 1.01, "none": 0.5})
    assert crisp.positions(4.0 - 1e-6) == pytest.approx({"far": -0.998, "near": 1.01, "none": 0.5})
    assert crisp.positions(4.0) == pytest.approx({"far": -1.0, "near": 1.01, "none": 0.5})


def test_a_way_of_a_grain_and_a_half_begins_with_a_grain_and_ends_with_the_rest() -> None:
    whole = synchronised({"a": Move(0.0, 0.003, Limits(1.0, 4.0))}, duration=1.0)
    crisp = Crisp(whole, {"a": 0.002})
    assert [crisp.positions(at)["a"] for at in (0.01, 0.5, 0.99, 1.0)] == [0.002, 0.002, 0.002, 0.003]
