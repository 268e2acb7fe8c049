"""Stretches of one move, each a function of time in closed form: steady, a straight ramp, and a stair of pulses.

The manual says by how many Hz the frequency grows and falls, and not per what. So there are two ramps: one that grows
in time, which is a straight line, and one that grows with every pulse, which is a stair whose steps get shorter as
they get higher. A move is never stepped through, however many pulses it has.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, inf, log
from typing import Final, Protocol

_SUMMED: Final = 64
"""So many terms are added one by one, which is exact; more are a difference of two digamma values."""
_NOISE: Final = 1e-9
"""Relative; what binary arithmetic may have taken from a pulse that is just due."""


class Piece(Protocol):
    """A stretch of a move. Times count from its beginning (s)."""

    @property
    def duration(self) -> float:
        """How long it lasts; infinity when for ever."""

    @property
    def pulses(self) -> float:
        """How many pulses it has in all."""

    def done(self, at: float) -> float:
        """How many pulses are out after so long."""

    def frequency(self, at: float) -> float:
        """Pulses per second after so long."""


@dataclass(frozen=True, slots=True)
class Steady:
    """One frequency (Hz) for so long (s)."""

    rate: float
    duration: float

    @property
    def pulses(self) -> float:
        return self.rate * self.duration

    def done(self, at: float) -> float:
        return self.rate * at

    def frequency(self, at: float) -> float:
        return self.rate


@dataclass(frozen=True, slots=True)
class Straight:
    """A frequency that begins at `start` (Hz) and changes by `slope` (Hz/s) for so long (s)."""

    start: float
    slope: float
    duration: float

    @property
    def pulses(self) -> float:
        return self.done(self.duration)

    def done(self, at: float) -> float:
        return self.start * at + self.slope * at * at / 2

    def frequency(self, at: float) -> float:
        return self.start + self.slope * at


@dataclass(frozen=True, slots=True)
class Stair:
    """`count` pulses of which each next one is `rise` (Hz) faster, from `start` (Hz) on; or `falling`, the way back.

    A falling stair has the same frequencies in the opposite order, so it ends at `start`.
    """

    start: float
    rise: float
    count: int
    falling: bool = False

    @property
    def duration(self) -> float:
        return periods(self.start, self.rise, self.count)

    @property
    def pulses(self) -> float:
        return float(self.count)

    def moment(self, pulses: int) -> float:
        """When so many of its pulses are out."""
        if not self.falling:
            return periods(self.start, self.rise, pulses)
        return self.duration - periods(self.start, self.rise, self.count - pulses)

    def done(self, at: float) -> float:
        low, high = 0, self.count
        while low < high:
            middle = (low + high + 1) // 2
            if self.moment(middle) <= at * (1 + _NOISE):
                low = middle
            else:
                high = middle - 1
        return float(low)

    def frequency(self, at: float) -> float:
        step = min(int(self.done(at)), self.count - 1)
        return self.start + self.rise * (self.count - 1 - step if self.falling else step)


def whole(pulses: float) -> int:
    """The pulses that are out, of a number that may be short of one by the noise of arithmetic."""
    return floor(pulses + _NOISE * max(1.0, pulses))


def periods(start: float, rise: float, count: int) -> float:
    """The sum of 1 / (start + rise * i) for i from 0 below `count`: how long so many ever faster pulses take (s)."""
    if count <= _SUMMED or not rise:
        return sum(1 / (start + rise * i) for i in range(count)) if rise else count / start
    first = start / rise
    return (digamma(first + count) - digamma(first)) / rise


def digamma(x: float) -> float:
    """The logarithmic derivative of the gamma function, for x above 0, to about 15 digits.

    It grows by 1/x from x to x + 1, which is what makes a sum of periods of it; its series is good from 10 on.
    """
    shift = 0.0
    while x < 10.0:
        shift -= 1 / x
        x += 1
    y = 1 / (x * x)
    series = y * (1 / 12 - y * (1 / 120 - y * (1 / 252 - y * (1 / 240 - y * (1 / 132 - y * 691 / 32760)))))
    return shift + log(x) - 0.5 / x - series


FOREVER: Final = inf
