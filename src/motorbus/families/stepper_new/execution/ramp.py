"""One move: up from the start frequency, steady at the running frequency, and down again.

The manual gives the acceleration in Hz and does not say per what. Here the frequency grows by it in every tick of time,
1 ms by default; `slowest` also bounds the other readings. Assumptions: the move is symmetric; it is steady where the
running frequency is not above the start frequency or the acceleration is 0; a start frequency of 0 is taken for 1 Hz; a
move at speed 0 does not begin; pulses that are not whole are cut off; a distance of 0 does not move.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor, inf, log, sqrt
from typing import Final, NamedTuple

from motorbus.families.stepper_new.parameters import IMMEDIATE, Project, Step

TICK_MS: Final = 1.0
READINGS: Final = {"per pulse": 0.0, "per 1 ms": 1.0, "per 10 ms": 10.0}
"""Readings of the acceleration: ticks in ms, 0 for per pulse. The manual's example takes 0.82, 0.69 or 1.43 s."""
_NOISE: Final = 1e-9  # relative, of a pulse that is just due
_SUMMED: Final = 64  # periods that are added one by one


class Ramp(NamedTuple):
    """Frequencies (Hz) of the steps of one project: at the start, when running, and the growth."""

    start: float
    run: float
    growth: float

    def rate(self, tick_ms: float) -> float:
        """Growth in Hz/s."""
        return self.growth * 1000 / tick_ms


def ramp_of(project: Project, step: Step) -> Ramp:
    """The ramp of a step; `run` is 0 for a step that does not move."""
    run = step.speed * (project.pulses_per_turn or Fraction(0)) / 60
    return Ramp(step.start_frequency or 1.0, float(run), step.acceleration)


def pulses_of(project: Project, step: Step) -> int:
    """The pulses that a step sends; 0 at speed 0."""
    return floor(step.distance * (project.pulses_per_unit or Fraction(0))) if step.speed else 0


@dataclass(frozen=True, slots=True)
class Motion:
    """A move of so many pulses (None: endless) from time 0; `sign` is 1 forward, -1 in reverse.

    It rises from `start` to `peak` (Hz) by `rate` (Hz/s), is steady for `steady` s, then falls to `start`.
    """

    sign: int
    pulses: int | None
    start: float
    peak: float
    rate: float
    rises: bool
    steady: float
    falls: bool

    @property
    def ramp(self) -> float:
        """Duration (s) of one ramp."""
        return (self.peak - self.start) / self.rate if self.rate else 0.0

    @property
    def duration(self) -> float:
        """In s; infinite for an endless move."""
        return self.ramp * (self.rises + self.falls) + self.steady

    def frequency(self, at: float) -> float:
        """In Hz at this moment; 0 before the beginning and after the end."""
        if not 0 <= at < self.duration:
            return 0.0
        rise = self.ramp if self.rises else 0.0
        if at < rise:
            return self.start + self.rate * at
        return self.peak - self.rate * max(0.0, at - rise - self.steady)

    def done(self, at: float) -> int:
        """Pulses until this moment."""
        if self.pulses is not None and at >= self.duration:
            return self.pulses
        rise = self.ramp if self.rises else 0.0
        up = max(0.0, min(at, rise))
        even = max(0.0, min(at - rise, self.steady))
        down = max(0.0, at - rise - self.steady)
        found = self.start * up + self.rate * up * up / 2
        found += self.peak * (even + down) - self.rate * down * down / 2
        whole = floor(found + _NOISE * max(1.0, found))
        return whole if self.pulses is None else min(whole, self.pulses)

    def moment(self, pulses: int) -> float:
        """When so many pulses are done (s); infinite for more than there are."""
        if pulses <= 0:
            return 0.0
        if not self.peak or (self.pulses is not None and pulses > self.pulses):
            return inf
        low, high = 0.0, 1.0 if self.pulses is None else self.duration
        while self.done(high) < pulses:
            low, high = high, 2 * high
        for _ in range(80):  # more halves than a float has
            middle = (low + high) / 2
            low, high = (low, middle) if self.done(middle) >= pulses else (middle, high)
        return high

    def slowing(self, at: float) -> Motion | None:
        """The motion of a slow stop at this moment, down to the start frequency; None if it ends at once."""
        now = self.frequency(at)
        left = inf if self.pulses is None else self.pulses - self.done(at)
        if not self.rate or now <= self.start or left <= 0:
            return None
        pulses = floor((now * now - self.start * self.start) / (2 * self.rate))
        return Motion(self.sign, int(min(pulses, left)), self.start, now, self.rate, False, 0.0, True)


def motion(ramp: Ramp, pulses: int | None, sign: int, tick_ms: float = TICK_MS) -> Motion:
    """The move of so many pulses; None: endless."""
    start, run, _ = ramp
    if pulses == 0 or run <= 0:
        return Motion(sign, 0, start, 0.0, 0.0, False, 0.0, False)
    rate = ramp.rate(tick_ms) if run > start else 0.0
    if not rate:
        return Motion(sign, pulses, run, run, 0.0, False, inf if pulses is None else pulses / run, False)
    if pulses is None:
        return Motion(sign, None, start, run, rate, True, inf, False)
    on_ramps = (run * run - start * start) / rate
    if on_ramps <= pulses:
        return Motion(sign, pulses, start, run, rate, True, (pulses - on_ramps) / run, True)
    return Motion(sign, pulses, start, sqrt(start * start + rate * pulses), rate, True, 0.0, True)


# -- bounds over the readings ----------------------------------------------------------------------------------------


def duration(ramp: Ramp, pulses: int, tick_ms: float) -> float:
    """Duration (s) of a move in one reading: growth per tick of so many ms, or per pulse (0)."""
    if tick_ms or pulses == 0 or not ramp.growth or ramp.run <= ramp.start:
        return motion(ramp, pulses, 1, tick_ms or TICK_MS).duration
    count = ceil((ramp.run - ramp.start) / ramp.growth)
    if 2 * count <= pulses:
        return 2 * _periods(ramp, count) + (pulses - 2 * count) / ramp.run
    half, odd = divmod(pulses, 2)
    return 2 * _periods(ramp, half) + odd / (ramp.start + ramp.growth * half)


def _periods(ramp: Ramp, count: int) -> float:
    """Duration (s) of so many pulses of which each is faster than the last by the growth."""
    exact = min(count, _SUMMED)
    total = sum(1 / (ramp.start + ramp.growth * i) for i in range(exact))
    if count > exact:  # the Euler-Maclaurin formula, which is an upper bound here
        first, last = ramp.start + ramp.growth * exact, ramp.start + ramp.growth * (count - 1)
        total += log(last / first) / ramp.growth + (1 / first + 1 / last) / 2
        total += ramp.growth / 12 * (1 / first**2 - 1 / last**2)
    return total


def slowest(project: Project, step: Step, pulses: int) -> float:
    """Duration (s) of a move with the speed of this step, in the slowest reading of its ramp."""
    return max(duration(ramp_of(project, step), pulses, tick) for tick in READINGS.values())


def slowest_stop(project: Project) -> float:
    """Time (s) from a stop to rest, from any step, in the slowest reading; 0 if a stop is immediate."""
    if project.stop_mode == IMMEDIATE:
        return 0.0
    steps = project.used or project.steps[:1]
    return max(_stop(ramp_of(project, step), tick) for step in steps for tick in READINGS.values())


def _stop(ramp: Ramp, tick_ms: float) -> float:
    if not ramp.growth or ramp.run <= ramp.start:
        return 0.0
    if tick_ms:
        return (ramp.run - ramp.start) / ramp.rate(tick_ms)
    return _periods(ramp, ceil((ramp.run - ramp.start) / ramp.growth))
