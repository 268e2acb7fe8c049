"""How near a move comes to a duration: over many angles and durations, never faster or steeper than it may be."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from math import inf, tau
from random import Random
from typing import NamedTuple

import pytest

from motorbus.errors import RequestError
from motorbus.families.stepper import execution
from motorbus.families.stepper.driver.pacing import (
    first_pulse,
    fitted,
    lasts,
    moved,
    nearest,
    quickest,
)
from motorbus.families.stepper.execution import USUAL, Behaviour
from motorbus.families.stepper.program.plan import READINGS
from motorbus.families.stepper.table import Project
from tests.families.stepper.loans import MINE

TURN = 1600


class Asked(NamedTuple):
    """A move, and so many times as long as it takes at least."""

    angle: float
    velocity: float
    acceleration: float | None
    longer: float


def lots(count: int, seed: int = 1) -> Iterator[Asked]:
    """From a twentieth of a turn to a hundred of them."""
    lot = Random(seed)
    for _ in range(count):
        yield Asked(
            lot.choice((1, -1)) * tau * 10 ** lot.uniform(-1.3, 2),
            10 ** lot.uniform(-0.5, 1.9),
            lot.choice((None, None, 6.3, 30.0, 200.0)),
            lot.uniform(1.0, 4.0),
        )


def steepest(project: Project) -> float:
    """rad/s² of the steepest place of its ramp, in the reading in which that is steepest."""
    step, turn = project.step(1), float(project.pulses_per_turn or 0)
    found = 0.0
    for changes in READINGS.values():
        how = replace(USUAL, **changes)
        ramp = execution.ramp_of(step, how)
        peak = execution.move(project, step, moved(project).pulses, how).peak
        found = max(found, ramp.rate * peak if ramp.by_pulse else ramp.rate)
    return found * tau / turn


def rad_per_s(project: Project) -> float:
    """Of the motor that it really is, which has 1600 pulses a turn."""
    return execution.frequency(project, project.step(1)) / TURN * tau


def test_it_fits_and_keeps_to_what_it_may(rounds: Callable[[int], int]) -> None:
    worst = {"slow": (0.0, ""), "quick": (0.0, "")}
    for asked in lots(rounds(150)):
        quick = quickest(MINE, asked.angle, asked.velocity, asked.acceleration)
        seconds = lasts(quick) * asked.longer
        found = fitted(quick, seconds)
        assert moved(found).pulses == round(abs(asked.angle) / tau * TURN), asked
        assert moved(found).sign == (1 if asked.angle > 0 else -1)
        assert rad_per_s(found) <= rad_per_s(quick) * (1 + 1e-9)
        assert rad_per_s(quick) <= asked.velocity * (1 + 1e-9)
        assert found.step(1).acceleration <= quick.step(1).acceleration
        assert found.step(1).start_frequency <= quick.step(1).start_frequency
        if asked.acceleration is not None and quick.step(1).acceleration > 1:
            assert steepest(quick) <= asked.acceleration * 1.001
        slowest = rad_per_s(found) < tau / 60
        if lasts(found) >= seconds or not slowest:
            off = lasts(found) / seconds - 1
            assert off >= 0, asked
            kind = "slow" if rad_per_s(found) < 8 * tau / 60 else "quick"
            worst[kind] = max(worst[kind], (off, f"{off:.3%} for {asked}"))
    print("longer than asked, at worst: ", worst)
    assert worst["quick"][0] < 0.05
    assert worst["slow"][0] < 0.15


@pytest.mark.parametrize("turns", [1.0, 3.3, 10.0])
def test_from_a_usual_speed_on_it_is_as_long_as_was_asked(turns: float) -> None:
    """Within half a hundredth, from 20 RPM on."""
    quick = quickest(MINE, turns * tau, 20.0, None)
    most = 60 * turns / 20
    wants = [lasts(quick) + number / 60 * (most - lasts(quick)) for number in range(60)]
    off = [(lasts(fitted(quick, seconds)) / seconds - 1, seconds) for seconds in wants]
    print(f"{turns} turns: {max(off)[0]:.3%} longer than asked, at worst")
    assert all(0 <= one < 0.005 for one, _ in off), max(off)


def test_what_was_offered_is_made_when_it_is_agreed() -> None:
    for asked in lots(30, seed=2):
        quick = quickest(MINE, asked.angle, asked.velocity, asked.acceleration)
        offered = lasts(fitted(quick, lasts(quick) * asked.longer))
        assert lasts(nearest(quick, offered)) == offered


def test_what_others_need_is_met_from_below_where_that_is_nearer() -> None:
    quick = quickest(MINE, 20 * tau, 0.3, None)  # 1 or 2 RPM and some between
    over = lasts(fitted(quick, 900.0))
    just_over = lasts(fitted(quick, 900.0)) + 0.5
    assert over < just_over < lasts(fitted(quick, just_over))
    assert lasts(nearest(quick, just_over)) == pytest.approx(over, rel=1e-3)


def test_a_motor_of_another_step_angle_sends_as_many_pulses_and_no_fewer() -> None:
    """Whatever way the controller reckons them, for they are whole."""
    quick = quickest(MINE, tau / 3, 1.0, None)
    found = fitted(quick, 3.6)
    assert (found.step_angle, found.microsteps) != (MINE.step_angle, MINE.microsteps)
    assert found.microsteps == MINE.microsteps, "a driver may hang on these"
    assert found.pulses_per_unit == 1
    for rounding in ("trunc", "nearest", "carry"):
        sent, left = execution.pulses(found, found.step(1), Behaviour(rounding=rounding))
        assert (sent, float(left)) == (round(TURN / 3), 0.0)


def test_one_whose_turn_is_not_of_whole_pulses_keeps_time_too() -> None:
    odd = replace(MINE, step_angle=175)
    quick = quickest(odd, 5.0, 3.0, None)
    found = fitted(quick, 5.0)
    assert lasts(found) == pytest.approx(5.0, rel=0.01)
    assert moved(found).pulses == moved(quick).pulses == round(5.0 / tau * Fraction(11520, 7))


def test_one_that_has_too_many_pulses_for_a_unit_has_its_own_step_angle_only() -> None:
    fine = replace(MINE, microsteps=65535, step_angle=1)
    quick = quickest(fine, 1.0, 3.0, None)
    assert fitted(quick, 2.0).step_angle == 1
    assert lasts(fitted(quick, 2.0)) >= 2.0


def test_one_pulse_takes_no_time_and_less_than_one_is_refused() -> None:
    quick = quickest(MINE, tau / TURN, 3.0, None)
    assert (moved(quick).pulses, lasts(quick)) == (1, 0.0)
    assert moved(fitted(quick, 5.0)).pulses == 1
    with pytest.raises(RequestError, match="less than one pulse"):
        quickest(MINE, 0.4 * tau / TURN, 3.0, None)


def test_the_first_pulse_comes_at_the_end_of_a_period() -> None:
    quick = quickest(MINE, tau, 10.0, None)
    assert 0.004 < first_pulse(quick) < 1 / 50
    assert lasts(quick) == pytest.approx(moved(quick).duration - first_pulse(quick))


@pytest.mark.parametrize(
    ("angle", "velocity", "acceleration"),
    [
        (tau, 0.1, None), (tau, 0.0, None), (tau, -1.0, None), (tau, inf, None), (inf, 1.0, None),
        (tau, 1.0, 0.0), (tau, 1.0, -1.0), (tau, 1.0, inf), (1e9, 1.0, None),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(angle: float, velocity: float, acceleration: float | None) -> None:
    with pytest.raises(RequestError) as caught:
        quickest(MINE, angle, velocity, acceleration)
    assert "nothing was sent" in caught.value.advice


def test_the_gentlest_ramp_is_1_though_less_was_asked_for() -> None:
    assert quickest(MINE, tau, 10.0, 1e-3).step(1).acceleration == 1
    assert quickest(MINE, tau, 10.0, 1e9).step(1).acceleration == 0xFFFF
