"""One move: up from the start frequency, steady at the running frequency, and down again.

The manual gives the acceleration in Hz and does not say per what. Here the frequency grows by it in every tick
of time, 1 ms unless the bus has another `ramp_tick_ms`. A move at speed 0 does not begin.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import floor, inf, sqrt
from typing import Final, NamedTuple

from motorbus.families.stepper.parameters import IMMEDIATE, Project, Step

TICK_MS: Final = 1.0  # ms in which the frequency grows by the acceleration # assumption
_NOISE: Final = 1e-9  # relative, of a pulse that is just due


class Ramp(NamedTuple):
    """Frequencies (Hz) at the start and when running, and the growth (Hz/s)."""

    start: float
    run: float
    growth: float


def ramp_of(project: Project, step: Step, tick_ms: float = TICK_MS) -> Ramp:
    """The ramp of a step; `run` is 0 for a step that does not move."""
    run = step.speed * (project.pulses_per_turn or Fraction(0)) / 60
    start = step.start_frequency or 1.0  # start 0 is 1 Hz # assumption
    return Ramp(start, float(run), step.acceleration * 1000 / tick_ms)


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


def motion(ramp: Ramp, pulses: int | None, sign: int) -> Motion:
    """The move of so many pulses; None: endless."""
    start, run, rate = ramp
    if pulses == 0 or run <= 0:
        return Motion(sign, 0, ())
    if not rate or run <= start:  # then there is no ramp # assumption
        return Motion(sign, pulses, (Piece(run, 0.0, inf if pulses is None else pulses / run),))
    if pulses is None:
        return Motion(sign, None, (Piece(start, rate, (run - start) / rate), Piece(run, 0.0, inf)))
    peak = min(run, sqrt(start * start + rate * pulses))
    time = (peak - start) / rate
    steady = max(0.0, (pulses - (run * run - start * start) / rate) / run)
    down = Piece(peak, -rate, time)  # the ramp down is as steep as the ramp up # assumption
    return Motion(sign, pulses, (Piece(start, rate, time), Piece(peak, 0.0, steady), down))


def move_of(project: Project, step: Step, tick_ms: float = TICK_MS) -> Motion:
    """The move of a step."""
    return motion(ramp_of(project, step, tick_ms), pulses_of(project, step), step.sign)


def stop_seconds(project: Project, step: Step, tick_ms: float = TICK_MS) -> float:
    """Time (s) from a stop of a step at its running frequency to rest; 0 if a stop is immediate."""
    start, run, rate = ramp_of(project, step, tick_ms)
    return (run - start) / rate if project.stop_mode != IMMEDIATE and rate and run > start else 0.0
