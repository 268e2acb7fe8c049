"""Moves against the vectors, against exact arithmetic, and against themselves."""

from __future__ import annotations

from fractions import Fraction
from math import inf
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from motorbus.families.stepper import execution
from motorbus.families.stepper.execution import Behaviour, Ramp, motion, still
from motorbus.families.stepper.table import Project, Step
from tests.protocol.stepper.execution import exact
from tests.protocol.stepper.vectors import behaviour

VECTORS = behaviour("motion")
RAMPS = ("time", "pulse")


@pytest.mark.parametrize("ramp", RAMPS)
@pytest.mark.parametrize("vector", VECTORS, ids=lambda v: f"{v['distance']}-{v['speed']}rpm")
def test_a_known_move_takes_as_long_as_it_should(vector: dict[str, Any], ramp: str) -> None:
    how = Behaviour(ramp=ramp)
    project = Project(**{name: vector[name] for name in ("microsteps", "step_angle", "turn_distance")})
    step = Step(**{name: vector[name] for name in ("distance", "start_frequency", "acceleration", "speed")})
    pulses, _ = execution.pulses(project, step, how)
    assert pulses == vector["pulses"]
    assert execution.frequency(project, step) == pytest.approx(vector["frequency"], abs=5e-4)
    move = execution.move(project, step, pulses, how)
    assert move.duration == pytest.approx(vector[ramp], abs=6e-7)
    assert move.shape == vector["shape"]
    if vector["peak"] and ramp == "time":
        assert move.peak == pytest.approx(vector["peak"], abs=5e-3)


@st.composite
def moves(draw: st.DrawFn) -> tuple[int, int, int, Fraction]:
    """Pulses, start, acceleration (Hz) and running frequency."""
    pulses, start = draw(st.integers(0, 3000)), draw(st.integers(0, 2000))
    return (
        pulses,
        start,
        draw(st.integers(0, 500)),
        Fraction(draw(st.integers(0, 60_000)), draw(st.integers(1, 9))),
    )


@given(moves())
def test_a_straight_ramp_takes_exactly_as_long_as_it_should(move: tuple[int, int, int, Fraction]) -> None:
    pulses, start, rise, run = move
    ramp = Ramp(float(max(start, 1)), rise * 1000.0, False)
    found = motion(pulses, float(run), ramp).duration
    assert found == pytest.approx(
        float(exact.straight_time(pulses, start, Fraction(rise * 1000), run)), rel=1e-9
    )


@given(moves())
def test_a_stair_takes_exactly_as_long_as_its_pulses(move: tuple[int, int, int, Fraction]) -> None:
    pulses, start, rise, run = move
    found = motion(pulses, float(run), Ramp(float(max(start, 1)), float(rise), True)).duration
    assert found == pytest.approx(float(exact.stair_time(pulses, start, rise, run)), rel=1e-9)


@pytest.mark.parametrize("by_pulse", [False, True])
@given(moves())
def test_pulses_only_grow_and_all_come(by_pulse: bool, move: tuple[int, int, int, Fraction]) -> None:
    pulses, start, rise, run = move
    made = motion(pulses, float(run), Ramp(float(max(start, 1)), rise * 1.0, by_pulse))
    counts = [made.done(made.duration * n / 40) for n in range(41)]
    assert counts == sorted(counts)
    assert counts[-1] == (pulses if run else 0)
    assert made.done(made.duration + 1) == counts[-1]
    assert all(0 <= made.frequency(made.duration * n / 40) <= made.peak + 1e-6 for n in range(41))
    assert made.frequency(-1) == made.frequency(made.duration + 1) == 0


@pytest.mark.parametrize("by_pulse", [False, True])
@given(moves(), st.floats(0, 1))
def test_a_slow_stop_is_never_longer_than_the_move(
    by_pulse: bool, move: tuple[int, int, int, Fraction], share: float
) -> None:
    pulses, start, rise, run = move
    made = motion(pulses, float(run), Ramp(float(max(start, 1)), rise * 1.0, by_pulse))
    at = made.duration * share
    slowing = made.slowing(at)
    assert made.done(at) + (slowing.pulses or 0) <= pulses
    assert slowing.duration <= made.duration - at + 1e-6 + (1 / made.peak if made.peak else 0)
    assert slowing.sign == made.sign


def test_a_slow_stop_takes_what_the_formula_says() -> None:
    made = motion(8000, 8000.0, Ramp(50.0, 30_000.0, False))
    slowing = made.slowing(0.6)
    assert made.frequency(0.6) == 8000
    assert slowing.duration == pytest.approx((8000 - 50) / 30_000)
    assert slowing.pulses == int((8000**2 - 50**2) / 60_000)


def test_below_the_start_frequency_there_is_nothing_to_slow_down() -> None:
    made = motion(100, 50.0, Ramp(500.0, 30_000.0, False))
    assert made.shape == "constant"
    assert made.slowing(1.0) == still(1, made.ramp)


@pytest.mark.parametrize("by_pulse", [False, True])
def test_without_an_end_it_runs_on(by_pulse: bool) -> None:
    made = motion(None, 2000.0, Ramp(50.0, 30.0 if by_pulse else 30_000.0, by_pulse), -1)
    assert (made.duration, made.pulses, made.sign) == (inf, None, -1)
    assert made.frequency(10.0) == 2000
    assert made.done(11.0) - made.done(10.0) in (1999, 2000, 2001)
    slowing = made.slowing(10.0)
    assert slowing.pulses is not None
    assert 60 <= slowing.pulses <= 70


@pytest.mark.parametrize(("pulses", "run"), [(0, 100.0), (None, 0.0), (100, 0.0)])
def test_a_move_of_nothing_or_at_no_speed_does_not_begin(pulses: int | None, run: float) -> None:
    made = motion(pulses, run, Ramp(50.0, 30.0, True))
    assert (made.shape, made.duration, made.done(1.0), made.frequency(0.0)) == ("none", 0, 0, 0)


@given(st.integers(1, 10**12), st.integers(1, 10**6))
def test_however_long_it_is_in_closed_form(pulses: int, run: int) -> None:
    assume(run > 50)
    for ramp in (Ramp(50.0, 30_000.0, False), Ramp(50.0, 1.0, True)):
        made = motion(pulses, float(run), ramp)
        half = made.done(made.duration / 2)
        assert abs(half - pulses / 2) <= 2 + pulses * 1e-6


@pytest.mark.parametrize("by_pulse", [False, True])
@pytest.mark.parametrize("pulses", [None, 1, 100, 8000])
def test_the_moment_of_a_pulse_is_when_it_is_out(by_pulse: bool, pulses: int | None) -> None:
    made = motion(pulses, 8000.0, Ramp(50.0, 30.0 if by_pulse else 30_000.0, by_pulse))
    for count in (1, 2, 50, 51, 99, 100, 4000, 8000, 20_000):
        at = made.moment(count)
        if pulses is not None and count > pulses:
            assert at == inf
            continue
        assert made.done(at) >= count
        assert made.done(at * (1 - 1e-6)) < count
    assert made.moment(0) == 0
    assert still().moment(1) == inf
