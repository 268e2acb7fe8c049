"""How one move runs: up from the start frequency, along at the running speed, and down again.

That it is symmetric, and that it runs steadily where the running speed is not above the start frequency or there is no
acceleration, are assumptions; so is a start frequency of 1 Hz where it is said to be 0. A move at speed 0 does not
begin. All of it is in closed form: asking where the motor is costs the same for one pulse and for 16 million.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, floor, inf, sqrt
from typing import Final

from motorbus.families.stepper.execution.pieces import FOREVER, Piece, Stair, Steady, Straight, whole

NONE: Final = "none"
CONSTANT: Final = "constant"
TRAPEZOID: Final = "trapezoid"
TRIANGLE: Final = "triangle"
LOWEST_START: Final = 1.0
"""Hz; what a start frequency of 0 is taken for, an assumption."""


@dataclass(frozen=True, slots=True)
class Ramp:
    """How the frequency grows: by `rate` Hz per second, or per pulse when `by_pulse`; 0: not at all."""

    start: float
    rate: float
    by_pulse: bool


@dataclass(frozen=True, slots=True)
class Motion:
    """A move of so many pulses (None: without an end) that begins at time 0; `sign` is 1 forward, -1 in reverse.

    `shape` is "none", "constant", "trapezoid" or "triangle", `peak` the highest frequency (Hz), `ramp` what a slow stop
    goes down by.
    """

    pieces: tuple[Piece, ...]
    pulses: int | None
    sign: int
    shape: str
    peak: float
    ramp: Ramp

    @property
    def duration(self) -> float:
        """How long it takes (s); infinity when it has no end."""
        return sum(piece.duration for piece in self.pieces)

    def done(self, at: float) -> int:
        """How many pulses are out so long after its beginning."""
        if self.pulses is not None and at >= self.duration:
            return self.pulses
        pulses = 0.0
        for piece in self.pieces:
            if at < piece.duration:
                pulses += piece.done(max(0.0, at))
                break
            pulses += piece.pulses
            at -= piece.duration
        return whole(pulses) if self.pulses is None else min(whole(pulses), self.pulses)

    def frequency(self, at: float) -> float:
        """Pulses per second at this moment; 0 before its beginning and behind its end."""
        if at < 0:
            return 0.0
        for piece in self.pieces:
            if at < piece.duration:
                return piece.frequency(at)
            at -= piece.duration
        return 0.0

    def moment(self, pulses: int) -> float:
        """When so many pulses are out; infinity when it has not so many."""
        if pulses <= 0:
            return 0.0
        if not self.pieces or (self.pulses is not None and pulses > self.pulses):
            return inf
        low, high = 0.0, self.duration if self.pulses is not None else 1.0
        while self.done(high) < pulses:
            low, high = high, 2 * high
        for _ in range(80):  # each one halves what is left; a float has no more halves
            middle = (low + high) / 2
            low, high = (low, middle) if self.done(middle) >= pulses else (middle, high)
        return high

    def slowing(self, at: float) -> Motion:
        """What a slow stop at this moment makes of it: down to the start frequency, then nothing."""
        now, ramp = self.frequency(at), self.ramp
        left = inf if self.pulses is None else self.pulses - self.done(at)
        if ramp.rate <= 0 or now <= ramp.start or left <= 0:
            return still(self.sign, ramp)
        piece = _down(now, ramp)
        pulses = min(floor(piece.pulses), left)
        return Motion((piece,), int(pulses), self.sign, TRIANGLE, now, ramp)


def still(sign: int = 1, ramp: Ramp | None = None) -> Motion:
    """No move at all: over when it begins."""
    return Motion((), 0, sign, NONE, 0.0, ramp or Ramp(LOWEST_START, 0.0, False))


def motion(pulses: int | None, run: float, ramp: Ramp, sign: int = 1) -> Motion:
    """The move of so many pulses (None: without an end) at `run` Hz; none of no pulses or at no speed."""
    if pulses == 0 or run <= 0:
        return still(sign, ramp)
    if run <= ramp.start or ramp.rate <= 0:
        duration = FOREVER if pulses is None else pulses / run
        return Motion((Steady(run, duration),), pulses, sign, CONSTANT, run, ramp)
    build = _stairs if ramp.by_pulse else _straights
    pieces, shape, peak = build(pulses, run, ramp)
    return Motion(pieces, pulses, sign, shape, peak, ramp)


def _straights(pulses: int | None, run: float, ramp: Ramp) -> tuple[tuple[Piece, ...], str, float]:
    start, rate = ramp.start, ramp.rate
    up = Straight(start, rate, (run - start) / rate)
    if pulses is None:
        return (up, Steady(run, FOREVER)), TRAPEZOID, run
    needed = (run * run - start * start) / rate  # up and down
    if needed <= pulses:
        down = Straight(run, -rate, up.duration)
        return (up, Steady(run, (pulses - needed) / run), down), TRAPEZOID, run
    peak = sqrt(start * start + rate * pulses)
    time = (peak - start) / rate
    return (Straight(start, rate, time), Straight(peak, -rate, time)), TRIANGLE, peak


def _stairs(pulses: int | None, run: float, ramp: Ramp) -> tuple[tuple[Piece, ...], str, float]:
    start, rise = ramp.start, ramp.rate
    count = ceil((run - start) / rise)
    up = Stair(start, rise, count)
    if pulses is None:
        return (up, Steady(run, FOREVER)), TRAPEZOID, run
    if 2 * count <= pulses:
        down = Stair(start, rise, count, falling=True)
        return (up, Steady(run, (pulses - 2 * count) / run), down), TRAPEZOID, run
    half, odd = divmod(pulses, 2)
    top = start + rise * half
    middle = (Steady(top, 1 / top),) if odd else ()
    pieces = (Stair(start, rise, half), *middle, Stair(start, rise, half, falling=True))
    return pieces, TRIANGLE, top if odd else top - rise


def _down(now: float, ramp: Ramp) -> Piece:
    if ramp.by_pulse:
        return Stair(ramp.start, ramp.rate, ceil((now - ramp.start) / ramp.rate), falling=True)
    return Straight(now, -ramp.rate, (now - ramp.start) / ramp.rate)
