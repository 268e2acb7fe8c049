"""Nine axes of three families on three buses: they start together and end together, judged by what the motors did.

Six servos on a line are led by small goals in one packet, two on CAN by a frame for each, and a stepper makes its move
by a profile of its own. The wires take bit time and deliver late by chance. The judge is not what the host saw but the
plants: the moment at which each motor left its place for the first time, and the one from which on it stayed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import pytest

from motorbus.motion.moving.moved import Moved
from motorbus.session.robot import Robot
from tests.support.machines import machine
from tests.support.noisy_line import NoisyLine
from tests.support.truth import Truth, Went, watched

APART = 0.005
"""s between the first start and the last, at most."""
SHARE = 0.02
"""Of the time that the movement takes, at most between the first end and the last."""
JITTER = 0.001
"""s by which anything on a wire may come late."""

WIDE = {
    "a1": 0.9,
    "a2": -0.7,
    "a3": 1.2,
    "a4": 0.3,
    "a5": -0.05,
    "a6": 0.6,
    "c1": 0.5,
    "c2": -0.3,
    "lift": 0.03,
}
SMALL = {
    "a1": 0.2,
    "a2": -0.01,
    "a3": 0.004,
    "a4": 0.1,
    "a5": -0.02,
    "a6": 0.05,
    "c1": 0.01,
    "c2": 0.2,
    "lift": 0.008,
}
BACK = dict.fromkeys(WIDE, 0.0)
GEARED: dict[str, dict[str, Any]] = {
    "a1": {"gear": 3.0, "low": "-50 deg", "high": "50 deg"},
    "a2": {"sign": -1},
    "a3": {
        "travel": "20 mm",
        "unit": "mm",
        "low": "-8 mm",
        "high": "8 mm",
        "max_velocity": "10 mm/s",
        "max_acceleration": "60 mm/s2",
    },
    "a4": {"gear": 0.5, "sign": -1, "max_velocity": "45 deg/s"},
    "c1": {"sign": -1, "gear": 1.5, "low": "-30 deg", "high": "30 deg"},
    "lift": {"sign": -1, "low": "-200 mm"},
}
TURNED = {
    "a1": 0.5,
    "a2": 0.7,
    "a3": 0.006,
    "a4": 0.4,
    "a5": 0.6,
    "a6": -0.6,
    "c1": 0.3,
    "c2": -0.3,
    "lift": 0.02,
}


class Case(NamedTuple):
    """Where to, and how; `axes` are what is special about some of them."""

    goals: Mapping[str, float]
    options: dict[str, Any]
    axes: Mapping[str, dict[str, Any]] = {}
    seed: int = 1


CASES = {
    "as quick as they can": Case(WIDE, {}),
    "other jitter": Case(WIDE, {}, seed=2),
    "other jitter again": Case(WIDE, {}, seed=3),
    "in four seconds": Case(WIDE, {"duration": 4.0}),
    "gently": Case(WIDE, {"kind": "minimum_jerk"}),
    "gently in six seconds": Case(WIDE, {"kind": "minimum_jerk", "duration": 6.0}, seed=4),
    "slowly": Case(WIDE, {"speed": 0.6}),
    "small ways": Case(SMALL, {}),
    "small ways in five seconds": Case(SMALL, {"duration": 5.0}, seed=5),
    "gears, signs and screws": Case(TURNED, {}, GEARED),
    "gears, signs and screws, gently": Case(TURNED, {"kind": "minimum_jerk"}, GEARED, seed=6),
}


@pytest.mark.parametrize("case", list(CASES.values())[::5], ids=list(CASES)[::5])
def test_nine_axes_start_within_5_ms_and_end_within_2_percent_of_the_time(case: Case) -> None:
    with machine(arm="1-6", can="0x25,0x26", lift=True, axes=case.axes) as (made, sims):
        for number, sim in enumerate(sims.values()):
            sim.pace = True
            sim.line = NoisyLine(100 * case.seed + number, delay=JITTER, toward=None)
        truths = watched({bus: sim.simulator for bus, sim in sims.items()})
        with Robot.of(made) as robot:
            robot["lift"].declare(0.0)
            judged(robot, truths, case.goals, case.options)
            judged(robot, truths, dict.fromkeys(case.goals, 0.0), case.options)


def judged(
    robot: Robot, truths: Mapping[tuple[str, int], Truth], goals: Mapping[str, float], options: dict[str, Any]
) -> None:
    """Move, say what each motor did, and judge it."""
    before = {name: bus.link.now() for name, bus in robot.buses.items()}
    moved = robot.move(goals, **options)
    found: dict[str, Went] = {}
    for name in goals:
        spec = robot.machine.axes[name]
        bus = spec.bus
        went = truths[bus, spec.node].went(before[bus], robot.buses[bus].link.now())
        assert went.way, f"{name} did not move"
        found[name] = Went(went.way, *(at - robot.origins[bus] for at in went[1:]))
    starts, ends = [one.first for one in found.values()], [one.last for one in found.values()]
    print(told(moved, found))
    assert max(starts) - min(starts) <= APART
    assert max(ends) - min(ends) <= SHARE * moved.duration
    assert max(ends) - min(starts) == pytest.approx(moved.duration, rel=SHARE)
    assert moved.started_apart <= APART
    assert moved.ended_apart <= SHARE * moved.duration + JITTER
    for name, goal in goals.items():
        assert moved.axes[name].present == pytest.approx(goal, abs=0.004)


def told(moved: Moved, found: Mapping[str, Went]) -> str:
    """A line for each axis: when its motor began and ended, in ms from the first start of all."""
    origin = min(one.first for one in found.values())
    lines = [str(moved), "axis      first ms    1 % ms   99 % ms   last ms  mean error"]
    for name, one in found.items():
        times = "".join(f"{1000 * (at - origin):10.2f}" for at in (one.first, one.one, one.most, one.last))
        lines.append(f"{name:8}{times}  {moved.tracks[name].error:.5f}")
    starts, ends = [one.first for one in found.values()], [one.last for one in found.values()]
    apart = max(ends) - min(ends)
    lines.append(
        f"starts {1000 * (max(starts) - min(starts)):.2f} ms apart, ends {1000 * apart:.2f} ms, "
        f"{100 * apart / moved.duration:.2f} % of {moved.duration:.3f} s"
    )
    return "\n".join(lines)
