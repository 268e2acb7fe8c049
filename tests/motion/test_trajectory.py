"""Trajectories: CSV as people have it, curves, smoothing, limits."""

from __future__ import annotations

from itertools import pairwise
from math import pi, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import LimitExceeded, RequestError
from motorbus.motion.machine import MachineConfig
from motorbus.motion.trajectory import Trajectory

AXES = MachineConfig.of(
    {
        "format": 1,
        "bus": {"b": {"address": "kst:sim"}},
        "axis": {
            "pan": {"device": "b#1", "low": "-90 deg", "high": "90 deg", "max_velocity": "90 deg/s"},
            "lift": {"device": "b#2", "travel": "5 mm", "max_velocity": "20 mm/s"},
        },
    }
).axes
GOOD = (
    "time (s),pan (deg),lift (mm)\n0,0,1\n1,90,2\n",
    "\ufeffTime,pan,lift\n5.0,0,0.001\n6,1.5707963267948966,0.002",
    "# taught\n  \nTIMESTAMP,pan [deg],lift(mm)\n1.7e9,0,1\n1700000001,90,2\n",
    "t (ms),lift (mm),pan (deg)\n0,1,0\n0,1,0\n500,1.5,45\n1000,2,90\n1000,2,90\n",
    "pan (turn),time_from_start,lift\n0,3,0.001\n0.25,4,0.002\n",
)


@pytest.mark.parametrize("text", GOOD)
def test_files_of_other_programs_are_read(text: str) -> None:
    made = Trajectory.parse(text, AXES)
    assert made.duration == pytest.approx(1.0)
    assert made.axes["pan"][-1] == pytest.approx(pi / 2)
    assert [made.axes["lift"][0], made.axes["lift"][-1]] == pytest.approx([0.001, 0.002])


WRONG = {
    "": "line 1: no header",
    "0,1\n1,2\n": "line 1: no header",
    "pan,lift\n0,1\n": "line 1: no column of time",
    "time,t,pan\n0,0,1\n": "line 1: time is there twice",
    "time,pam\n0,1\n1,2": "line 1: no axis 'pam'",
    "time,pan,pan\n0,1,1\n1,2,2": "line 1: pan is there twice",
    "time,pan (mm)\n0,1\n1,2": "line 1: 'pan .mm.' has an unknown unit",
    "time,pan\n0,1\n1": "line 3: 1 columns",
    "time,pan\n0,1\n1,x": "line 3: 'x' is not a number",
    "time,pan\n0,1\n1,nan": "line 3: 'nan' is not a number",
    "time,pan\n0,1\n0.5,1\n0.5,2": "time 0.5 s is not after 0.5 s",
    "time,pan\n1,1\n0.5,2": "time 0.5 s is not after 1 s",
    "time,pan\n1,1": "1 rows of numbers",
}


@pytest.mark.parametrize("text", WRONG)
def test_a_wrong_file_is_refused_with_its_line(text: str) -> None:
    with pytest.raises(RequestError, match=WRONG[text]):
        Trajectory.parse(text, AXES)


@given(st.lists(st.floats(-100, 100), min_size=2, max_size=20), st.sampled_from([None, AXES]))
def test_a_written_file_is_read_as_the_same_trajectory(places: list[float], axes: object) -> None:
    made = Trajectory([index / 50 for index in range(len(places))], {"pan": places})
    again = Trajectory.parse(made.text(axes), axes)  # type: ignore[arg-type]
    assert again.axes["pan"] == pytest.approx(places, abs=1e-9)
    assert again.times == pytest.approx(made.times)


@pytest.mark.parametrize("kind", ["linear", "spline"])
def test_curves_go_through_the_samples(kind: str) -> None:
    times = [0.0, 0.1, 0.3, 0.35, 1.0]
    made = Trajectory(times, {"pan": [sin(at * 3) for at in times]})
    for at in times:
        assert made.positions(at, kind)["pan"] == pytest.approx(sin(at * 3))  # type: ignore[arg-type]
    assert made.positions(-1.0)["pan"] == 0
    assert made.positions(9.0)["pan"] == pytest.approx(sin(3))
    dense = [made.positions(step / 1000, kind)["pan"] for step in range(1001)]  # type: ignore[arg-type]
    assert max(abs(b - a) for a, b in pairwise(dense)) < 0.006
    half = made.sampled(20, speed=0.5)
    assert half.duration == pytest.approx(2.0)
    assert half.positions(0.2)["pan"] == pytest.approx(made.positions(0.1)["pan"])


def test_smoothing_removes_tremor_and_shifts_nothing() -> None:
    times = [index / 100 for index in range(400)]
    slow = [sin(at) for at in times]
    shaken = [place + 0.05 * sin(at * 2 * pi * 20) for at, place in zip(times, slow, strict=True)]
    smooth = Trajectory(times, {"pan": shaken}).smoothed(3).axes["pan"]
    inner = range(60, 340)
    assert max(abs(smooth[index] - slow[index]) for index in inner) < 0.01
    assert max(smooth) <= max(shaken)
    assert min(smooth) >= min(shaken)


@pytest.mark.parametrize(
    ("times", "places", "error"),
    [
        ([0, 5, 10], [0.0, 0.1, 1.6], "pan at 10 s: position 91.7 deg"),
        ([0, 1], [-1.5, 1.5], "pan at 1 s: velocity 171.9 deg/s is above 90.0 deg/s"),
        ([0, 0.1, 0.2], [0.0, 0.14, 0.0], "pan at 0 s: acceleration"),
    ],
)
def test_a_trajectory_beyond_a_limit_says_when(times: list[float], places: list[float], error: str) -> None:
    made = Trajectory(times, {"pan": places})
    with pytest.raises(LimitExceeded, match=error) as caught:
        made.check(AXES)
    assert caught.value.at is not None
    with pytest.raises(RequestError, match="no axis"):
        Trajectory([0, 1], {"pam": [0, 0]}).check(AXES)
