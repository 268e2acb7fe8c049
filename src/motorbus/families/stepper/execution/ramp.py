"""One move: up from the start frequency, steady at the running frequency, and down again.

The manual gives the acceleration in Hz and does not say per what. Here the frequency grows by it in every tick
of time, 1 ms by default; `slowest` also bounds the other readings. A move at speed 0 does not begin.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor, inf, log, sqrt
from typing import Final, NamedTuple

from motorbus.families.stepper.parameters import IMMEDIATE, Project, Step

TICK_MS: Final = 1.0  # ms in which the frequency grows by the acceleration # assumption
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
    return Ramp(step.start_frequency or 1.0, float(run), step.acceleration)  # start 0 is 1 Hz # assumption


def pulses_of(project: Project, step: Step) -> int:
    """The pulses that a step sends; 0 at speed 0."""
    exact = step.distance * (project.pulses_per_unit or Fraction(0))
    return floor(exact) if step.speed else 0  # the part of a pulse is cut off # assumption


class Piece(NamedTuple):
    """A part of a move: its first frequency (Hz), the slope (Hz/s) and the duration (s)."""

    start: float
    slope: float
    duration: float


@dataclass(frozen=True, slots=True)
class Motion:
    """A move of so many pulses (None: endless) from time 0; `sign` is 1 forward, -1 in reverse."""

    sign: int
    pulses: int | None
    pieces: tuple[Piece, ...]

    @property
    def duration(self) -> float:
        """In s; infinite for an endless move."""
        return sum(piece.duration for piece in self.pieces)

    @property
    def peak(self) -> float:
        """The highest frequency in Hz."""
        return max((one.start + max(0.0, one.slope * one.duration) for one in self.pieces), default=0.0)

    def frequency(self, at: float) -> float:
        """In Hz at this moment; 0 before the beginning and after the end."""
        for start, slope, duration in self.pieces if at >= 0 else ():
            if at < duration:
                return start + slope * at
            at -= duration
        return 0.0

    def done(self, at: float) -> int:
        """Pulses until this moment."""
        if self.pulses is not None and at >= self.duration:
            return self.pulses
        found = 0.0
        for start, slope, duration in self.pieces:
            time = max(0.0, min(at, duration))
            found += start * time + slope * time * time / 2
            at -= time
        whole = floor(found + _NOISE * max(1.0, found))
        return whole if self.pulses is None else min(whole, self.pulses)

    def moment(self, pulses: int) -> float:
        """When so many pulses are done (s); infinite for more than there are."""
        if pulses <= 0:
            return 0.0
        if not self.pieces or (self.pulses is not None and pulses > self.pulses):
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
        start, rate, _ = self.pieces[0] if self.pieces else Piece(0.0, 0.0, 0.0)
        left = inf if self.pulses is None else self.pulses - self.done(at)
        if rate <= 0 or now <= start or left <= 0:
            return None
        pulses = min(floor((now * now - start * start) / (2 * rate)), left)
        return Motion(self.sign, int(pulses), (Piece(now, -rate, (now - start) / rate),))


def motion(ramp: Ramp, pulses: int | None, sign: int, tick_ms: float = TICK_MS) -> Motion:
    """The move of so many pulses; None: endless."""
    start, run, _ = ramp
    if pulses == 0 or run <= 0:
        return Motion(sign, 0, ())
    rate = ramp.rate(tick_ms) if run > start else 0.0
    if not rate:  # no ramp if the start frequency is not below the running frequency # assumption
        return Motion(sign, pulses, (Piece(run, 0.0, inf if pulses is None else pulses / run),))
    if pulses is None:
        return Motion(sign, None, (Piece(start, rate, (run - start) / rate), Piece(run, 0.0, inf)))
    peak = min(run, sqrt(start * start + rate * pulses))
    time = (peak - start) / rate
    steady = max(0.0, (pulses - (run * run - start * start) / rate) / run)
    down = Piece(peak, -rate, time)  # the ramp down is as steep as the ramp up # assumption
    return Motion(sign, pulses, (Piece(start, rate, time), Piece(peak, 0.0, steady), down))


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
