"""What came of a movement: when each axis began and ended, where it is now, and how the goal was followed on the way.

It is what the host has seen, no more. An axis that measures was seen in each cycle, so a moment is known to a cycle; of
one that is reckoned all is *estimated*, and says so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf
from typing import Final, NamedTuple

from motorbus.motion.profile import Limiting

STILL: Final = 0.0009
"""rad of the device; less than the smallest count there is (0.088 degrees): two readings that differ, differ more."""
NOTHING: Final = Limiting("", "nothing")


class Track(NamedTuple):
    """An axis over time: `times` in s after the start, where it should have been then and where it was (rad, m).

    `presents` of an axis that is `estimated` are reckoned.
    """

    times: Sequence[float] = ()
    goals: Sequence[float] = ()
    presents: Sequence[float] = ()
    estimated: bool = False

    @property
    def error(self) -> float:
        """How far it was from where it should have been, in the mean over the samples (rad, m)."""
        apart = [abs(goal - present) for goal, present in zip(self.goals, self.presents, strict=True)]
        return sum(apart) / len(apart) if apart else 0.0

    @property
    def worst(self) -> float:
        """How far it was from where it should have been, at most (rad, m)."""
        return max(
            (abs(goal - present) for goal, present in zip(self.goals, self.presents, strict=True)),
            default=0.0,
        )

    def rested(self, still: float) -> float:
        """When (s) it was first seen where it ends, to stay there; `still` is rad or m."""
        if not self.times:
            return 0.0
        end = self.presents[-1]
        seen = pairwise(zip(self.times, self.presents, strict=True))
        return max((at for (_, there), (at, _) in seen if abs(there - end) > still), default=self.times[0])


class Arrived(NamedTuple):
    """One axis: its `goal` and where it is at `present` (rad, m), `estimated` or measured.

    `started` and `ended` are s after the common start: when the order was gone that set it moving, acknowledged where
    that is done, and when it was first seen where it rests; both 0 where it had less than two of its counts to go.
    Orders leave as much before the start as they take on the wire. A servo may think before it moves, or not have heard
    the first one: nobody sees when it does. Of an axis that is estimated, when its own profile began
    and ended. `stood` is where it was before (rad, m).
    """

    goal: float
    present: float
    estimated: bool
    started: float
    ended: float
    stood: float


class Cycles(NamedTuple):
    """How one bus led its axes: at which `rate` (Hz), how many cycles, slots of the grid `skipped`, readings `lost`."""

    rate: float
    done: int
    skipped: int = 0
    lost: int = 0


@dataclass(frozen=True, slots=True)
class Moved:
    """A movement that came to its end.

    `duration`    s, as agreed by all
    `axes`        what came of each, by its name
    `limited_by`  which axis, or the duration asked for, decided how long it took
    `tracks`      how each followed its goals
    `cycles`      of each bus with axes that were led
    """

    duration: float
    axes: Mapping[str, Arrived]
    limited_by: Limiting = NOTHING
    tracks: Mapping[str, Track] = field(default_factory=dict)
    cycles: Mapping[str, Cycles] = field(default_factory=dict)

    @property
    def started_apart(self) -> float:
        """s between the first order and the last that set one moving, of those that had a way to go."""
        return _apart([one.started for one in self._moved()])

    @property
    def ended_apart(self) -> float:
        """s between the first end and the last of those, as far as the host can see."""
        return _apart([one.ended for one in self._moved()])

    def _moved(self) -> list[Arrived]:
        return [one for one in self.axes.values() if one.ended > one.started]

    @property
    def estimated(self) -> bool:
        """Whether there is an axis of which nothing is measured."""
        return any(one.estimated for one in self.axes.values())

    def __str__(self) -> str:
        count = f"{len(self.axes)} {'axis' if len(self.axes) == 1 else 'axes'}"
        text = f"{count} moved in {self.duration:.3f} s"
        if len(self.axes) > 1:
            text += f", orders left within {_shown(self.started_apart)} and ended within {_shown(self.ended_apart)}"
        skipped = sum(one.skipped for one in self.cycles.values())
        if skipped:
            text += f"; {skipped} {'slot was' if skipped == 1 else 'slots were'} skipped"
        reckoned = [name for name, one in self.axes.items() if one.estimated]
        return f"{text} ({', '.join(reckoned)} estimated)" if reckoned else text


def _apart(moments: Sequence[float]) -> float:
    return max(moments, default=-inf) - min(moments, default=-inf) if moments else 0.0


def _shown(seconds: float) -> str:
    return f"{seconds * 1000:.1f} ms"
