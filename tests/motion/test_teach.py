"""Teach, replay and follow, and the programs of shell commands about them."""

from __future__ import annotations

from itertools import pairwise
from math import cos, pi, radians, sin
from pathlib import Path
from typing import Any

import pytest

from motorbus.core.request import Data
from motorbus.errors import LimitExceeded, RequestError, Stalled
from motorbus.link.base import Delivery, Side
from motorbus.motion.commands import Follow, Replay, Teach
from motorbus.motion.robot import Robot
from motorbus.motion.trajectory import Trajectory
from tests.safety.decoders import COUNT, FeetechWitness
from tests.support.machines import listen, machine, orders

TIMES = [index * pi / 60 for index in range(121)]
WAVE = Trajectory(
    TIMES, {"a1": [0.2 + 0.15 * (1 - cos(at)) for at in TIMES], "c1": [0.1 * (cos(at) - 1) for at in TIMES]}
)


def course_of(sims: Any, node: int, robot: Robot) -> list[float]:
    """Positions of an axis of the arm, one for each state that is published from now on."""
    found: list[float] = []
    robot.publish = lambda: found.append(sims["arm"][node].raw_position)  # type: ignore[method-assign]
    return found


@pytest.mark.parametrize("kind", ["spline", "linear"])
def test_a_trajectory_is_played_from_its_start(kind: Any) -> None:
    with machine("1", "1") as (config, sims), Robot(config) as robot:
        result = robot.replay(WAVE, interpolation=kind, speed=0.8)
        assert result.positions["a1"] == pytest.approx(WAVE.axes["a1"][-1], abs=0.02)
        assert result.positions["c1"] == pytest.approx(WAVE.axes["c1"][-1], abs=0.03)
        assert 7.8 < result.duration < 10
        course = course_of(sims, 1, robot)
        robot.replay(WAVE, speed=1.0)
        highest = max(course) * 2 * pi / 4096 - pi
        assert highest == pytest.approx(0.5, abs=0.02)


def test_nothing_moves_when_a_goal_on_the_way_is_illegal() -> None:
    with machine("1", "1") as (config, sims), Robot(config) as robot:
        listen(sims)
        for wrong in (
            Trajectory([0, 5, 10], {"a1": [0, 9, 0]}),
            Trajectory([0, 0.2, 10], {"a1": [0, 1.0, 0]}),
            Trajectory([0, 5, 10], {"a1": [0, 1, 0], "c1": [0, 2, 0]}),
        ):
            with pytest.raises(LimitExceeded):
                robot.replay(wrong, interpolation="linear")
        with pytest.raises(RequestError):
            robot.replay(WAVE, speed=0)
        assert not orders(sims)


class Deaf(FeetechWitness):
    """Loses the replies of servo 1 while the host sends its goals of these numbers."""

    def __init__(self, first: int, last: int) -> None:
        super().__init__()
        self.gap = range(first, last)

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        found = super().carry(sender, data, at)
        goals = sum(target.node == 2 for target in self.targets)
        is_lost = goals in self.gap and sender is Side.DEVICE and data[2] == 1
        return [] if is_lost else found


def test_an_axis_that_was_silent_in_a_replay_returns_within_its_limits() -> None:
    times = [number * 0.5 for number in range(13)]
    swing = [0.5 * sin(at) for at in times]
    with machine("1-2", max_velocity="60 deg/s") as (config, sims), Robot(config) as robot:
        line = sims["arm"].line = Deaf(100, 103)
        result = robot.replay(Trajectory(times, {"a1": swing, "a2": swing}), rate=50)
        goals = [target.to for target in line.targets if target.node == 1]
        assert len(goals) < sum(target.node == 2 for target in line.targets), "it got no goals meanwhile"
        longest = max(abs(after - before) for before, after in pairwise(goals))
        assert longest <= radians(60) / 50 * 1.1 + 2 * COUNT
        assert result.positions["a1"] == pytest.approx(swing[-1], abs=0.02)


def test_a_blocked_shaft_ends_a_replay() -> None:
    with machine("1", "1") as (config, sims), Robot(config) as robot:
        robot.move({"a1": 0.2})
        sims["arm"][1].block_shaft()
        with pytest.raises(Stalled, match="a1"):
            robot.replay(WAVE)
        assert robot.stop("c1", verify=True).axes["c1"].at_rest


def test_teach_records_a_limp_arm_and_says_where_it_left_its_limits() -> None:
    with (
        machine("1-2", axes={"a1": {"low": "-10 deg", "high": "10 deg"}}) as (config, sims),
        Robot(config) as robot,
    ):
        robot.enable_torque()
        turns = iter(range(1000))

        def by_hand() -> bool:
            number = next(turns)
            if not number:
                sims["arm"][1].push_shaft(0.6)  # with 1 rad/s
            return number > 40

        made = robot.teach("a1", until=by_hand, rate=50)
        assert [sims["arm"][node].memory["torque_enable"] for node in (1, 2)] == [0, 1]
        assert made.axes["a1"][-1] > 0.2
        assert made.axes["a1"][0] == pytest.approx(0.0, abs=0.03)
        assert made.duration == pytest.approx(0.8, abs=0.1)
        assert [note.split(" is outside")[0] for note in made.notes] == ["a1"]
        with pytest.raises(RequestError, match="c1"):
            robot.teach("c1", seconds=1)


def test_teach_ends_by_ctrl_c_and_gives_what_was_taught() -> None:
    with machine("1") as (config, sims), Robot(config) as robot:
        listen(sims, 40)
        made = robot.teach()
        assert 10 < len(made.times) < 45


def test_followers_track_their_leaders_within_their_limits() -> None:
    axes = {"a2": {"low": "-30 deg", "high": "30 deg", "max_velocity": "45 deg/s"}}
    with machine("1-2", axes=axes) as (config, sims), Robot(config) as robot:
        robot.enable_torque()
        turns = iter(range(10_000))

        def by_hand() -> bool:
            number = next(turns)
            if not number:
                sims["arm"][1].push_shaft(1.0)
            return number > 250

        result = robot.follow({"a1": "a2"}, until=by_hand)
        assert sims["arm"][1].memory["torque_enable"] == 0
        assert result.positions["a2"] == pytest.approx(pi / 6, abs=0.01)
        for wrong in ({"a1": "a1"}, {}, {"a1": "a2", "a2": "a1"}):
            with pytest.raises(RequestError):
                robot.follow(wrong)


def test_the_commands_of_the_shell_write_and_play_a_file(tmp_path: Path) -> None:
    file = str(tmp_path / "nod.csv")
    with machine("1-2") as (config, _), Robot(config) as robot:
        recorded = robot.execute(Teach(file, 0.5, names=("a1",)))
        assert recorded.cycles > 20
        with pytest.raises(FileExistsError):
            robot.execute(Teach(file, 0.5))
        played = robot.execute(Replay(file, repeat=2))
        assert played.duration >= 1.0
        assert robot.execute(Follow({"a1": "a2"}, 0.3)).duration == pytest.approx(0.3, abs=0.05)
