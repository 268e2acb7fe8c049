"""A movement as samples: what was taught, what stands in a file, what a loop will send. A value, never a recorder.

Between two samples every axis goes straight, unless they are joined by something else. What makes another one of it
gives a new trajectory back.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, isfinite
from os import PathLike
from typing import TYPE_CHECKING, Final, Literal, Protocol, TypeAlias

from motorbus.errors import RequestError
from motorbus.motion.machine import source
from motorbus.motion.machine.model import FARTHEST
from motorbus.motion.profile.shapes import NOTHING
from motorbus.motion.trajectory import columns
from motorbus.motion.trajectory.smoothing import smooth
from motorbus.motion.trajectory.spline import spline

if TYPE_CHECKING:
    from motorbus.motion.machine import AxisSpec

Interpolation: TypeAlias = Literal["linear", "spline"]
INTERPOLATIONS: Final = ("linear", "spline")

MOST: Final = columns.MOST_ROWS
"""Samples a trajectory may have; an hour at 200 Hz has 720 000."""
CLOSEST: Final = columns.CLOSEST
LONGEST: Final = 1e6
"""s; more than eleven days."""
FASTEST: Final = 1e5
"""Hz of a loop."""


class Course(Protocol):
    """Whatever has a duration and says where its axes are: a trajectory, a spline, moves that are synchronised."""

    @property
    def duration(self) -> float:
        """How long it takes (s)."""

    def positions(self, at: float) -> Mapping[str, float]:
        """Where each axis is `at` seconds after the beginning (rad, m)."""


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Positions of axes at some moments: `times` in s, from 0 on and increasing, at least two of them.

    `axes` has the positions of each axis (rad, m) by its name, one for each time. Raises RequestError for what does not
    fit together, is not finite, or is longer, farther or finer than anything that moves.
    """

    times: Sequence[float]
    axes: Mapping[str, Sequence[float]]

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", tuple(self.times))
        object.__setattr__(self, "axes", {name: tuple(places) for name, places in self.axes.items()})
        _check(self)

    # -- from a file, and as one -----------------------------------------------------------------------------------

    @classmethod
    def parse(cls, text: str, axes: Mapping[str, AxisSpec] | None = None) -> Trajectory:
        """From the text of a CSV file; the page on trajectories says how it looks.

        With `axes`, as those of a machine, it may name no other ones, and each in a unit that measures it. Raises
        RequestError, naming line and column.
        """
        return cls(*columns.read(text, axes))

    @classmethod
    def load(cls, path: str | PathLike[str], axes: Mapping[str, AxisSpec] | None = None) -> Trajectory:
        """From a CSV file. Raises RequestError, beginning with its path, when it cannot be read or for what it says."""
        try:
            return cls.parse(_source(path), axes)
        except RequestError as error:
            error.summary = f"{path}: {error.summary}"
            raise

    def text(self, axes: Mapping[str, AxisSpec] | None = None) -> str:
        """A CSV file that is read as this trajectory, to the last digit.

        With `axes` each is in the unit in which people see it, with twelve digits. Raises RequestError for an axis
        that is none of them.
        """
        return columns.write(self.times, self.axes, axes)

    # -- where it is when --------------------------------------------------------------------------------------------

    @property
    def duration(self) -> float:
        """How long it takes (s)."""
        return self.times[-1]

    def positions(self, at: float) -> dict[str, float]:
        """Where each axis is `at` seconds after the beginning (rad, m); before and after, where it begins and ends."""
        place, share = self._place(at)
        return {
            name: places[place] if not share else places[place] + share * (places[place + 1] - places[place])
            for name, places in self.axes.items()
        }

    def velocities(self, at: float) -> dict[str, float]:
        """How fast each axis is then, with its sign (rad/s, m/s): that of the stretch which begins or goes on there."""
        if not 0 <= at < self.duration:
            return dict.fromkeys(self.axes, 0.0)
        place, _ = self._place(at)
        lasts = self.times[place + 1] - self.times[place]
        return {name: (places[place + 1] - places[place]) / lasts for name, places in self.axes.items()}

    def _place(self, at: float) -> tuple[int, float]:
        """The sample before, and which share of the stretch that begins there is over."""
        if at <= 0:
            return 0, 0.0
        if at >= self.duration:
            return len(self.times) - 1, 0.0
        place = bisect_right(self.times, at) - 1
        begin, end = self.times[place], self.times[place + 1]
        return place, (at - begin) / (end - begin)

    # -- what can be made of it --------------------------------------------------------------------------------------

    def joined(self, kind: Interpolation = "spline") -> Course:
        """What goes through its samples: straight between two, or a spline. Raises RequestError for another kind."""
        check_kind(kind)
        return self if kind == "linear" else spline(self.times, self.axes)

    def smoothed(self, cutoff: float) -> Trajectory:
        """Without what is quicker than `cutoff` (Hz, above 0): tremor of a hand, steps of a sensor.

        Half of the power at `cutoff` goes through, and nothing comes earlier or later. It begins and ends at rest,
        for which the ends may move a little, and it never leaves the range of each axis. Raises RequestError.
        """
        _above_nothing(cutoff=cutoff)
        return Trajectory(
            self.times, {name: smooth(self.times, places, cutoff) for name, places in self.axes.items()}
        )


def check_kind(kind: str) -> None:
    """Raise RequestError for an unknown kind of interpolation."""
    if kind not in INTERPOLATIONS:
        raise _refused(f"{kind!r} is no interpolation", f"one of {', '.join(INTERPOLATIONS)}")


def sampled(course: Course, rate: float) -> Trajectory:
    """A course as a loop of `rate` (Hz, above 0) sends it: one sample each 1/rate s, the last one at its end or next.

    Raises RequestError for a rate that is none, for a course of no duration, and for more samples than fit.
    """
    check_sampled(course.duration, rate)
    rounds = max(1, ceil(course.duration * rate * (1 - 1e-12)))
    return taken(course, [number / rate for number in range(rounds + 1)])


def taken(course: Course, times: Sequence[float], names: Iterable[str] | None = None) -> Trajectory:
    """Samples of a course at these times (s), the last one where it ends; of all axes or of those named."""
    rows = [course.positions(at) for at in times[:-1]]
    rows.append(course.positions(course.duration))
    return Trajectory(times, {name: [row[name] for row in rows] for name in names or rows[0]})


def check_sampled(duration: float, rate: float) -> None:
    """Raise RequestError for a rate (Hz) that is none, for no duration (s), and for more samples than fit."""
    _above_nothing(rate=rate)
    if not 0 < duration <= LONGEST or rate > FASTEST or duration * rate > MOST - 2:
        raise _refused(
            f"{duration:.6g} s at {rate:.6g} Hz cannot be sampled",
            f"above 0 s, at most {FASTEST:.0f} Hz and {MOST} samples",
        )


def _source(path: str | PathLike[str]) -> str:
    return source(path, longest=columns.LONGEST, kind="CSV", expected="a CSV file of a trajectory")


# -- what is no trajectory -------------------------------------------------------------------------------------------


def _check(trajectory: Trajectory) -> None:
    times = trajectory.times
    if not 2 <= len(times) <= MOST or not trajectory.axes:
        raise _refused(
            f"{len(times)} samples of {len(trajectory.axes)} axes are no trajectory",
            f"2 to {MOST} samples, of one axis or more",
        )
    if times[0] != 0 or not isfinite(times[-1]) or times[-1] > LONGEST:
        raise _refused(
            f"it is from {times[0]:.6g} s to {times[-1]:.6g} s", f"from 0 s, to {LONGEST:.0f} s at most"
        )
    for before, at in pairwise(times):
        if not at - before >= CLOSEST:
            raise _refused(f"the time {at} s comes after {before} s", "times that increase")
    for name, places in trajectory.axes.items():
        if len(places) != len(times):
            raise _refused(
                f"{name} has {len(places)} positions, and there are {len(times)} times", "one for each time"
            )
        for at, place in zip(times, places, strict=True):
            if not abs(place) <= FARTHEST:
                raise _refused(f"{name} is at {place} at {at:.6g} s", f"-{FARTHEST:.0f} to {FARTHEST:.0f}")


def _above_nothing(**figures: float) -> None:
    for name, figure in figures.items():
        if not (isfinite(figure) and figure > 0):
            raise _refused(f"{name} is {figure}", "a finite number above 0")


def _refused(what: str, expected: str) -> RequestError:
    return RequestError(what, expected=expected, advice=NOTHING)
