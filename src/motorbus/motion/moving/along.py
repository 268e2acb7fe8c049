"""Along a trajectory: what is judged is what will be sent, the goals at the slots of the grid on which axes are led.

Rows of a file may be farther apart than goals are, or lie between them, so rows say nothing about how hard the goals
are that are made of them. A bus that carries less has a grid of its own: its axes are judged by that.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

from motorbus.motion import limits
from motorbus.motion.moving.plan import Fact, Plan, Planned
from motorbus.motion.moving.stream import Grid
from motorbus.motion.profile import Limiting, Limits
from motorbus.motion.trajectory import Course, Trajectory
from motorbus.motion.trajectory.samples import check_sampled, taken

if TYPE_CHECKING:
    from motorbus.motion.capabilities import AxisVerbs
    from motorbus.motion.machine import AxisSpec


class Paced(NamedTuple):
    """A course that is gone along `speed` times as fast."""

    course: Course
    speed: float

    @property
    def duration(self) -> float:
        """How long it takes (s)."""
        return self.course.duration / self.speed

    def positions(self, at: float) -> Mapping[str, float]:
        """Where each axis is `at` seconds after the beginning (rad, m)."""
        return self.course.positions(at * self.speed if at < self.duration else self.course.duration)


class Led(NamedTuple):
    """The goals of several buses as one course: each has its own moments, all end at the same."""

    parts: Sequence[Trajectory]

    @property
    def duration(self) -> float:
        """How long it takes (s)."""
        return self.parts[0].duration

    def positions(self, at: float) -> dict[str, float]:
        """Where each axis shall be `at` seconds after the beginning (rad, m)."""
        return {name: place for part in self.parts for name, place in part.positions(at).items()}


def judged(course: Course, axes: Mapping[str, AxisSpec], rate: float) -> Trajectory:
    """The goals of these axes along a course, as they leave at `rate` (Hz), and the place where it begins.

    Raises LimitExceeded for the first one that goes beyond a limit, RequestError for more than can be judged.
    """
    check_sampled(course.duration, rate)
    grid = Grid.over(course.duration, rate)
    slots = [slot * grid.period for slot in range(grid.last + 1)]
    goals = taken(course, [*slots, course.duration], axes)
    limits.check_course(goals, axes)
    return goals


@dataclass(frozen=True, slots=True)
class Along:
    """Along a course, from where it begins on; all axes can be led. See `journey.Plan`."""

    axes: Mapping[str, AxisVerbs]
    course: Course
    asked: float | None = None
    _known: dict[tuple[float, frozenset[str]], Trajectory] = field(default_factory=dict)

    def led(self, rate: float, names: Collection[str]) -> Trajectory:
        """The goals of these axes at `rate` (Hz), which are judged once. Raises as `judged`."""
        key = (rate, frozenset(names))
        if key not in self._known:
            specs = {name: axis.spec for name, axis in self.axes.items() if name in key[1]}
            self._known[key] = judged(self.course, specs, rate)
        return self._known[key]

    def planned(self, facts: Mapping[str, Fact], duration: float | None = None) -> Planned:
        """The movement; raises LimitExceeded for the first goal that an axis or its device does not allow."""
        specs = {name: axis.spec for name, axis in self.axes.items()}
        devices = {name: fact.device for name, fact in facts.items()}
        rates = dict.fromkeys(facts[name].rate for name in self.axes)
        parts = [self.led(rate, [name for name in self.axes if facts[name].rate == rate]) for rate in rates]
        for part in parts:
            limits.check_reach(part, specs, devices)
        samples = {name: (part.times, part.axes[name]) for part in parts for name in part.axes}
        goals = {name: places[-1] for name, (_, places) in samples.items()}
        ways = {name: max(places) - min(places) for name, (_, places) in samples.items()}
        speeds = {name: _peak(times, places) for name, (times, places) in samples.items()}
        own = {name: Limits.of(spec) for name, spec in specs.items()}
        return Planned(Led(parts), goals, ways, speeds, own, Limiting("", "duration"))


class Approach(NamedTuple):
    """To where a trajectory begins. All of that is judged before anybody goes there. See `journey.Plan`."""

    way: Plan
    then: Along
    asked: float | None = None

    def planned(self, facts: Mapping[str, Fact], duration: float | None = None) -> Planned:
        """The movement to its beginning; raises LimitExceeded as either of the two does."""
        self.then.planned(facts)
        return self.way.planned(facts, duration)


def _peak(times: Sequence[float], places: Sequence[float]) -> float:
    """The highest speed between two goals (rad/s, m/s)."""
    ways = zip(pairwise(places), pairwise(times), strict=True)
    return max(abs(there - here) / (later - at) for (here, there), (at, later) in ways)
