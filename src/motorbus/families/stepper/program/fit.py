"""Which reading of the acceleration a device has, by the time of a few runs; nothing else could tell.

Somebody starts projects of known numbers without waits and takes the time from the acknowledgement of the start to the
notice of the end. Each run takes what the model says plus something fixed, as the turnaround. With two runs or more of
unlike speeds both come out: how long a tick is (or that the frequency grows with every pulse) and what is fixed. Runs
that differ in length only tell nothing, once they reach their speed: their ramps are the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import exp, isfinite, log, sqrt
from typing import Final, NamedTuple

from motorbus.errors import RequestError
from motorbus.families.stepper.execution import USUAL, Behaviour
from motorbus.families.stepper.program.plan import estimate, seconds_of
from motorbus.families.stepper.table import Project

SHORTEST: Final = 1e-3
"""ms; ticks are looked for from here on."""
LONGEST: Final = 1e4
_GRID: Final = 71
_GOLDEN: Final = (sqrt(5) - 1) / 2


class Run(NamedTuple):
    """A project that was run, and how long that took (s)."""

    project: Project
    seconds: float


class Fit(NamedTuple):
    """One reading and how well it fits: ms of its tick (0: per pulse), s that every run takes besides, s it is off."""

    how: Behaviour
    tick_ms: float
    overhead: float
    off: float


def fit(runs: Sequence[Run], how: Behaviour = USUAL) -> list[Fit]:
    """Both readings, the better one first; `off` is the root of the mean square of what is left.

    Raises RequestError for fewer than two runs, for one without an end or with waits, and for times that are none.
    """
    _check(runs, how)
    found = [_per_pulse(runs, how), _per_tick(runs, how)]
    return sorted(found, key=lambda one: one.off)


def _check(runs: Sequence[Run], how: Behaviour) -> None:
    if len(runs) < 2:
        raise RequestError(f"{len(runs)} runs tell nothing", expected="two runs or more, unlike in speed")
    for number, run in enumerate(runs, start=1):
        found = estimate(run.project, how)
        if not (isfinite(run.seconds) and run.seconds > 0):
            raise RequestError(f"run {number}: {run.seconds} s is no time", expected="seconds, more than 0")
        if found.endless or found.waits or found.cuts or not isfinite(found.seconds):
            raise RequestError(
                f"run {number} has no time of its own",
                expected="a project that ends by itself, without waits and stop inputs",
            )


def _per_pulse(runs: Sequence[Run], how: Behaviour) -> Fit:
    reading = replace(how, ramp="pulse")
    overhead, off = _left(runs, reading)
    return Fit(reading, 0.0, overhead, off)


def _per_tick(runs: Sequence[Run], how: Behaviour) -> Fit:
    def off(at: float) -> float:
        return _left(runs, replace(how, ramp="time", ramp_tick_ms=exp(at)))[1]

    low, high = log(SHORTEST), log(LONGEST)
    step = (high - low) / (_GRID - 1)
    best = min((low + step * n for n in range(_GRID)), key=off)
    tick = exp(_lowest(off, max(low, best - step), min(high, best + step)))
    reading = replace(how, ramp="time", ramp_tick_ms=tick)
    overhead, rest = _left(runs, reading)
    return Fit(reading, tick, overhead, rest)


def _left(runs: Sequence[Run], how: Behaviour) -> tuple[float, float]:
    """What every run takes besides, on average, and what is left then."""
    left = [run.seconds - seconds_of(run.project, how) for run in runs]
    overhead = sum(left) / len(left)
    return overhead, sqrt(sum((one - overhead) ** 2 for one in left) / len(left))


def _lowest(of: Callable[[float], float], low: float, high: float) -> float:
    """Where a function with one valley is lowest, by golden section."""
    left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_left, at_right = of(left), of(right)
    for _ in range(60):
        if at_left <= at_right:
            high, right, at_right = right, left, at_left
            left = high - _GOLDEN * (high - low)
            at_left = of(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + _GOLDEN * (high - low)
            at_right = of(right)
    return (low + high) / 2
