"""Trajectories as values: what is made of one, sample by sample, and what is none."""

from __future__ import annotations

from math import inf, nan, sin
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.motion.profile import Limits, Move, synchronised
from motorbus.motion.trajectory import Trajectory, sampled

RAMP = Trajectory([0.0, 1.0, 3.0], {"lift": [0.0, 2.0, 1.0], "turn": [5.0, 5.0, 7.0]})


@st.composite
def trajectories(draw: st.DrawFn) -> Trajectory:
    gaps = draw(st.lists(st.floats(0.001, 10), min_size=1, max_size=20))
    times = [0.0]
    for gap in gaps:
        times.append(times[-1] + gap)
    names = draw(st.sets(st.sampled_from(["lift", "turn", "grip"]), min_size=1))
    places = st.lists(st.floats(-100, 100), min_size=len(times), max_size=len(times))
    return Trajectory(times, {name: draw(places) for name in sorted(names)})


def test_between_samples_it_goes_straight() -> None:
    assert RAMP.duration == 3.0
    assert RAMP.positions(0.5) == {"lift": 1.0, "turn": 5.0}
    assert RAMP.positions(2.0) == {"lift": 1.5, "turn": 6.0}
    assert [RAMP.positions(at)["lift"] for at in (-1.0, 0.0, 1.0, 3.0, 9.0)] == [0.0, 0.0, 2.0, 1.0, 1.0]
    assert RAMP.velocities(0.5) == {"lift": 2.0, "turn": 0.0}
    assert RAMP.velocities(1.0) == {"lift": -0.5, "turn": 1.0}
    assert [RAMP.velocities(at)["lift"] for at in (-1.0, 3.0)] == [0.0, 0.0]


def test_it_is_a_value_of_its_own() -> None:
    times, lift = [0.0, 1.0], [0.0, 1.0]
    taken = Trajectory(times, {"lift": lift})
    lift[1] = times[1] = 9.0
    assert taken == Trajectory((0.0, 1.0), {"lift": (0.0, 1.0)})


@given(trajectories(), st.floats(0.5, 200))
def test_a_loop_gets_a_sample_each_round_and_the_exact_end(one: Trajectory, rate: float) -> None:
    plan = sampled(one, rate)
    assert plan.times == tuple(number / rate for number in range(len(plan.times)))
    assert plan.duration - 1 / rate < one.duration * (1 + 1e-9)
    assert plan.duration >= one.duration * (1 - 1e-9)
    for number, at in enumerate(plan.times[:-1]):
        assert {name: places[number] for name, places in plan.axes.items()} == one.positions(at)
    assert plan.positions(plan.duration) == one.positions(one.duration)


def test_whatever_has_a_duration_can_be_sampled() -> None:
    moves = synchronised({"lift": Move(0.0, 1.0, Limits(1.0, 4.0)), "turn": Move(2.0, 2.0, Limits(1.0, 1.0))})
    plan = sampled(moves, 100)
    assert plan.positions(plan.duration) == {"lift": 1.0, "turn": 2.0}
    assert plan.axes["lift"][50] == moves.positions(0.5)["lift"]


def test_smoothed_it_is_gentle_and_at_the_same_time() -> None:
    times = [number / 100 for number in range(601)]
    shaky = Trajectory(times, {"lift": [sin(at) + 0.05 * sin(90 * at) for at in times]})
    calm = shaky.smoothed(3.0)
    assert calm.times == shaky.times
    middle = range(100, 500)
    assert max(abs(calm.axes["lift"][n] - sin(times[n])) for n in middle) < 0.02


def test_a_file_is_loaded_and_names_itself_where_it_is_wrong(tmp_path: Path) -> None:
    file = tmp_path / "wave.csv"
    file.write_text(RAMP.text(), encoding="utf-8")
    assert Trajectory.load(file) == RAMP
    file.write_text("time (s),lift\n0,1\n0,2\n", encoding="utf-8")
    with pytest.raises(RequestError, match=r"wave.csv: line 3, column 1 \(time\)"):
        Trajectory.load(str(file))
    file.write_bytes(b"time\xff")
    with pytest.raises(RequestError, match="wave.csv: it is no text") as refused:
        Trajectory.load(file)
    assert refused.value.expected == "CSV in UTF-8"
    assert refused.value.advice.startswith("save it as UTF-8, ")
    with pytest.raises(RequestError, match="cannot be read: no such file") as refused:
        Trajectory.load(tmp_path / "none.csv")
    assert refused.value.expected == "a CSV file of a trajectory"


@pytest.mark.parametrize(
    ("times", "axes", "says"),
    [
        ([0.0], {"lift": [1.0]}, "1 samples of 1 axes are no trajectory"),
        ([0.0, 1.0], {}, "2 samples of 0 axes are no trajectory"),
        ([1.0, 2.0], {"lift": [1.0, 1.0]}, "it is from 1 s"),
        ([0.0, inf], {"lift": [1.0, 1.0]}, "it is from 0 s to inf s"),
        ([0.0, 2e6], {"lift": [1.0, 1.0]}, "it is from 0 s to 2e.06 s"),
        ([0.0, nan], {"lift": [1.0, 1.0]}, "it is from 0 s to nan s"),
        ([0.0, nan, 1.0], {"lift": [1.0, 1.0, 1.0]}, "the time nan s comes after 0.0 s"),
        ([0.0, 1.0, 1.0], {"lift": [1.0, 1.0, 1.0]}, "the time 1.0 s comes after 1.0 s"),
        ([0.0, 1.0, 0.5, 2.0], {"lift": [1.0] * 4}, "the time 0.5 s comes after 1.0 s"),
        ([0.0, 1.0], {"lift": [1.0]}, "lift has 1 positions, and there are 2 times"),
        ([0.0, 1.0], {"lift": [1.0, nan]}, "lift is at nan at 1 s"),
        ([0.0, 1.0], {"lift": [inf, 1.0]}, "lift is at inf at 0 s"),
    ],
)
def test_what_does_not_fit_together_is_refused(
    times: list[float], axes: dict[str, list[float]], says: str
) -> None:
    with pytest.raises(RequestError, match=f"^{says}") as refused:
        Trajectory(times, axes)
    assert refused.value.expected


@pytest.mark.parametrize("figure", [0.0, -1.0, nan, inf])
def test_figures_are_finite_and_above_nothing(figure: float) -> None:
    with pytest.raises(RequestError, match="^cutoff is "):
        RAMP.smoothed(figure)
    with pytest.raises(RequestError, match="^rate is "):
        sampled(RAMP, figure)


def test_an_interpolation_is_one_of_two() -> None:
    kind: Any = "cubic"
    with pytest.raises(RequestError, match="'cubic' is no interpolation") as refused:
        RAMP.joined(kind)
    assert refused.value.expected == "one of linear, spline"


@pytest.mark.parametrize("rate", [1e6, 99_999.0])
def test_too_many_samples_are_refused(rate: float) -> None:
    with pytest.raises(RequestError, match="cannot be sampled"):
        sampled(Trajectory([0.0, 30.0], {"lift": [0.0, 1.0]}), rate)


def test_what_takes_no_time_cannot_be_sampled() -> None:
    with pytest.raises(RequestError, match="cannot be sampled"):
        sampled(synchronised({"lift": Move(1.0, 1.0, Limits(1.0, 1.0))}), 100)
