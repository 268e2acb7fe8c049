"""The moments at which the cycles of a loop begin, and how well it kept to them.

A loop has a fixed grid of robot time: slot 0 begins when it does, and each other one a period after the one before. No
slot is ever moved. A cycle that is not over when the next slot begins is an overrun; the next cycle begins late then,
inside its own slot, and slots that have gone by as a whole are skipped, and counted. So a loop that is too quick for
its bus shows it, and never becomes a slower loop in silence.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import ceil
from typing import Final

ROUNDING: Final = 1e-6
"""s; less than this is no lateness. A host tells no smaller times, and the sum of many periods is not exact."""


@dataclass(slots=True)
class Took:
    """How long something took, over many times: the longest, and the sum (s)."""

    most: float = 0.0
    total: float = 0.0
    count: int = 0

    def add(self, seconds: float) -> None:
        """Once more."""
        if seconds > self.most:
            self.most = seconds
        self.total += seconds
        self.count += 1

    @property
    def mean(self) -> float:
        """On average (s); 0 as long as there was none."""
        return self.total / self.count if self.count else 0.0


@dataclass(slots=True)
class Statistics:
    """What became of a loop so far.

    `rate`      that it was asked for, Hz
    `cycles`    that were carried out
    `overruns`  those of them that were not over when the next slot began: the host was held up, a bus took too long, or
                the body of the loop did
    `skipped`   slots in which no cycle began, because one before took so long
    `begun`     cycles of their own in which axes were given torque; they are no overruns
    `lost`      readings that did not come, by the name of the axis
    `suspect`   readings that cannot be believed: no motor can have come there so quickly; by name
    `unordered` cycles in which an axis that is led got no goal, because nobody knew where it was; by name
    `clamped`   goals that were brought within the limits of their axis, with the policy `clamp`; by name
    `lateness`  how long after the beginning of its slot a cycle began, s
    `cycle`     how long a cycle took from there until all was in, on all buses, s
    `buses`     the same of each bus alone, by its name
    """

    rate: float
    cycles: int = 0
    overruns: int = 0
    skipped: int = 0
    begun: int = 0
    lost: dict[str, int] = field(default_factory=dict)
    suspect: dict[str, int] = field(default_factory=dict)
    unordered: dict[str, int] = field(default_factory=dict)
    clamped: dict[str, int] = field(default_factory=dict)
    lateness: Took = field(default_factory=Took)
    cycle: Took = field(default_factory=Took)
    buses: dict[str, Took] = field(default_factory=dict)

    @classmethod
    def of(cls, rate: float, axes: Iterable[str], buses: Iterable[str]) -> Statistics:
        """Nothing yet."""
        none = dict.fromkeys(axes, 0)
        return cls(
            rate,
            lost=none,
            suspect=dict(none),
            unordered=dict(none),
            clamped=dict(none),
            buses={name: Took() for name in buses},
        )

    def __str__(self) -> str:
        return (
            f"{self.cycles} cycles at {self.rate:g} Hz, {self.overruns} overruns, {self.skipped} slots skipped; "
            f"a cycle took {self.cycle.mean * 1e3:.2f} ms, at most {self.cycle.most * 1e3:.2f} ms; "
            f"late by {self.lateness.mean * 1e3:.3f} ms, at most {self.lateness.most * 1e3:.3f} ms; "
            f"readings lost: {_counted(self.lost) or 'none'}"
            + "".join(f"; {what}: {told}" for what, told in self._seldom() if told)
        )

    def _seldom(self) -> list[tuple[str, str]]:
        """What is told only where there was some."""
        return [
            ("readings not believed", _counted(self.suspect)),
            ("not ordered", _counted(self.unordered)),
            ("clamped", _counted(self.clamped)),
        ]


def _counted(counts: dict[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.items() if count)


class Grid:
    """The slots of a loop. `now` is robot time (s); slot 0 begins at the `now` it is made with."""

    def __init__(self, statistics: Statistics, now: float) -> None:
        self.period: Final = 1.0 / statistics.rate
        self.number = -1
        self._start: Final = now
        self._statistics = statistics

    def begins(self, number: int) -> float:
        """When a slot begins (s of robot time)."""
        return self._start + number * self.period

    def upcoming(self, now: float) -> int:
        """The number of the slot that `take` would take."""
        number = self.number + 1
        late = now - self._start - number * self.period
        return number + int((late + ROUNDING) / self.period) if late > ROUNDING and number else number

    def take(self, now: float) -> float:
        """Take the next slot in which a cycle can begin, and give the moment it begins; `number` is then its number.

        Whatever has gone by is counted.
        """
        self.book(now)
        self.number += 1
        return self._start + self.number * self.period

    def book(self, now: float) -> None:
        """Count what has gone by until now, and take no slot yet."""
        number = self.number + 1
        late = now - self._start - number * self.period
        if late > ROUNDING and number:
            self._statistics.overruns += 1
            gone = int((late + ROUNDING) / self.period)
            self._statistics.skipped += gone
            self.number += gone

    def forgive(self, now: float) -> None:
        """What went by until now, and was not booked, was not the loop's to use: the next slot is the next to begin."""
        self.number = max(self.number, ceil((now - self._start - ROUNDING) / self.period) - 1)
