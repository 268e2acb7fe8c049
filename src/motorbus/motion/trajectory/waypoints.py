"""Through waypoints, one after the other: when it is at each, and what it does in between.

Each stretch between two waypoints is a profile of its own. All kinds but `spline` never leave the range of the two
waypoints a stretch is between, so waypoints within the limits of an axis make a route within them. A `spline` is for
samples of a movement: it turns back beyond the outermost one, as the movement did.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf, isfinite
from typing import Final, Literal, NamedTuple, Protocol, TypeAlias

from motorbus.errors import RequestError
from motorbus.motion.machine.model import FARTHEST
from motorbus.motion.machine.refusal import listed
from motorbus.motion.profile.shapes import NOTHING, Profile, cubic, line, minimum_jerk

Interpolation: TypeAlias = Literal["linear", "cubic", "spline", "minimum_jerk"]


class Waypoint(NamedTuple):
    """Where axes shall be (rad, m), by their names, and when: `at` in s from the beginning, or by `speed`.

    `speed` (rad/s, m/s) is the mean one, on the way here, of the axis that has the farthest to go. The first waypoint
    needs neither, for it is the beginning.
    """

    positions: Mapping[str, float]
    at: float | None = None
    speed: float | None = None


class Stretches(Protocol):
    """The profiles of an axis, one from each waypoint to the next."""

    def __getitem__(self, place: int, /) -> Profile:
        """That of a stretch, counted from 0."""

    def __iter__(self) -> Iterator[Profile]:
        """Each, one after the other."""


@dataclass(frozen=True, slots=True)
class Route:
    """A movement through waypoints. Made by `interpolated`; `times` (s) are those of the waypoints."""

    times: tuple[float, ...]
    profiles: Mapping[str, Stretches]

    @property
    def duration(self) -> float:
        """How long it takes (s)."""
        return self.times[-1]

    def positions(self, at: float) -> dict[str, float]:
        """Where each axis is `at` seconds after the beginning (rad, m); before and after, where it begins and ends."""
        return self._each(at, lambda profile, since: profile.position(since))

    def velocities(self, at: float) -> dict[str, float]:
        """How fast each axis is then, with its sign (rad/s, m/s). Where it jumps, what it becomes."""
        return self._each(at, lambda profile, since: profile.velocity(since))

    def accelerations(self, at: float) -> dict[str, float]:
        """How much faster each axis gets then, with its sign (rad/s², m/s²). Where it jumps, what it becomes."""
        return self._each(at, lambda profile, since: profile.acceleration(since))

    def _each(self, at: float, asked: Callable[[Profile, float], float]) -> dict[str, float]:
        place = max(0, min(bisect_right(self.times, at), len(self.times) - 1) - 1)
        since = at - self.times[place] if at < self.duration else inf
        return {name: asked(profiles[place], since) for name, profiles in self.profiles.items()}


def interpolated(waypoints: Sequence[Waypoint], kind: Interpolation = "cubic") -> Route:
    """The route through waypoints, at least two, which name the same axes.

    `linear` goes at one velocity to each and jumps to the next one there: for what is slow, or finely sampled. `cubic`
    has a continuous velocity, begins and ends at rest, and rests where an axis turns back (Fritsch and Butland, 1984).
    `spline` does not rest there, and goes a little beyond the waypoint instead: for samples of what has really moved.
    `minimum_jerk` rests at each waypoint. Raises RequestError, naming the waypoint, counted from 0.
    """
    check_kind(kind)
    if len(waypoints) < 2:
        raise RequestError(f"{len(waypoints)} waypoints are no way", expected="two or more", advice=NOTHING)
    names = list(waypoints[0].positions)
    for number, waypoint in enumerate(waypoints):
        _complete(number, waypoint, names)
    times = _times(waypoints)
    columns = {name: [waypoint.positions[name] for waypoint in waypoints] for name in names}
    return Route(times, {name: MADE[kind](times, column) for name, column in columns.items()})


def joined(
    times: Sequence[float], axes: Mapping[str, Sequence[float]], kind: Interpolation = "spline"
) -> Route:
    """The route through the samples of a trajectory. Raises RequestError for a kind that is none."""
    check_kind(kind)
    return Route(tuple(times), {name: MADE[kind](times, places) for name, places in axes.items()})


def check_kind(kind: str) -> None:
    """Raise RequestError for a kind of interpolation that is none."""
    if kind not in MADE:
        raise RequestError(f"{kind!r} is no kind of route", expected=listed(MADE), advice=NOTHING)


# -- what it does in between -----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Cubics:
    """Cubics with these velocities (rad/s, m/s) at the waypoints. Made when asked for: a recording has very many."""

    times: Sequence[float]
    places: Sequence[float]
    velocities: Sequence[float]

    def __getitem__(self, place: int) -> Profile:
        """See `Stretches`."""
        (begin, end), (start, goal), (first, last) = (
            row[place : place + 2] for row in (self.times, self.places, self.velocities)
        )
        return cubic(start, goal, duration=end - begin, first=first, last=last)

    def __iter__(self) -> Iterator[Profile]:
        """See `Stretches`."""
        return (self[place] for place in range(len(self.times) - 1))


def _linear(times: Sequence[float], places: Sequence[float]) -> Stretches:
    return tuple(line(*ends, duration=lasts) for lasts, ends in _stretches(times, places))


def _minimum_jerk(times: Sequence[float], places: Sequence[float]) -> Stretches:
    return tuple(minimum_jerk(*ends, duration=lasts) for lasts, ends in _stretches(times, places))


def _cubic(times: Sequence[float], places: Sequence[float]) -> Stretches:
    means = _means(times, places)
    inner = (_passing(*before, *after) for before, after in pairwise(means))
    return Cubics(times, places, [0.0, *inner, 0.0])


def _spline(times: Sequence[float], places: Sequence[float]) -> Stretches:
    """Through samples of a movement: constant acceleration is met exactly, and a jump of it nearly.

    The velocity at a sample is that of a parabola through three neighbours. Of the three parabolas that there are the
    one in the middle counts, so none counts that goes across a jump. At its ends it rests: as if mirrored there.
    """
    means = _means(times, places)
    (first, slow), (last, fast) = means[0], means[-1]
    around = pairwise([(first, -slow), *means, (last, -fast)])
    bends = [(fast - slow) / (before + after) for (before, slow), (after, fast) in around]
    inner = [
        sorted(
            (slow + bends[place] * before, slow + bends[place + 1] * before, fast - bends[place + 2] * after)
        )[1]
        for place, ((before, slow), (after, fast)) in enumerate(pairwise(means))
    ]
    return Cubics(times, places, [0.0, *inner, 0.0])


def _means(times: Sequence[float], places: Sequence[float]) -> list[tuple[float, float]]:
    """How long each stretch lasts, and its mean velocity."""
    return [(lasts, (goal - start) / lasts) for lasts, (start, goal) in _stretches(times, places)]


def _passing(before: float, slow: float, after: float, fast: float) -> float:
    """The velocity at a waypoint: a harmonic mean of those around it, each with how long it lasts; 0 where it turns.

    It is at most three times the slower one, and that is what keeps a cubic from overshooting.
    """
    if slow * fast <= 0:
        return 0.0
    return 3 * (before + after) / ((2 * after + before) / slow + (after + 2 * before) / fast)


def _stretches(times: Sequence[float], places: Sequence[float]) -> list[tuple[float, tuple[float, float]]]:
    """How long each stretch lasts, and its two ends."""
    return [(end - begin, ends) for (begin, end), ends in zip(pairwise(times), pairwise(places), strict=True)]


MADE: Final[Mapping[str, Callable[[Sequence[float], Sequence[float]], Stretches]]] = {
    "linear": _linear,
    "cubic": _cubic,
    "spline": _spline,
    "minimum_jerk": _minimum_jerk,
}


# -- when it is where ------------------------------------------------------------------------------------------------


def _times(waypoints: Sequence[Waypoint]) -> tuple[float, ...]:
    times = [0.0]
    if waypoints[0].at not in (None, 0.0) or waypoints[0].speed is not None:
        raise _wrong(0, "it is the beginning and has another time, or a speed", "at = 0, or neither")
    for number, (before, waypoint) in enumerate(pairwise(waypoints), 1):
        at = waypoint.at if waypoint.speed is None else _reached(number, times[-1], before, waypoint)
        if at is None or (waypoint.at is not None and waypoint.speed is not None):
            raise _wrong(number, "it has no time, or two", "at, or speed")
        if not (isfinite(at) and at > times[-1]):
            raise _wrong(number, f"it is at {at:.6g} s, not after the one before", f"above {times[-1]:.6g} s")
        times.append(at)
    return tuple(times)


def _reached(number: int, since: float, before: Waypoint, waypoint: Waypoint) -> float:
    """When a waypoint with a speed is reached."""
    speed = waypoint.speed or 0.0
    if not (isfinite(speed) and speed > 0):
        raise _wrong(number, f"its speed is {speed}", "a finite number above 0")
    ways = (abs(place - before.positions[name]) for name, place in waypoint.positions.items())
    farthest = max(ways, default=0.0)
    if not farthest:
        raise _wrong(number, "no axis moves, so a speed says no time", "at, the time until which it waits")
    return since + farthest / speed


def _complete(number: int, waypoint: Waypoint, names: Sequence[str]) -> None:
    """Raise RequestError unless a waypoint says of each axis, and of no other one, where it is."""
    differ = sorted(set(names) ^ set(waypoint.positions))
    if differ or not names:
        what = f"it and the first differ in {', '.join(differ[:5])}" if names else "it names no axis"
        raise _wrong(number, what, "a position of each axis, in each waypoint")
    for name, place in waypoint.positions.items():
        if not abs(place) <= FARTHEST:
            raise _wrong(number, f"{name} is at {place}", f"-{FARTHEST:.0f} to {FARTHEST:.0f}")


def _wrong(number: int, what: str, expected: str) -> RequestError:
    return RequestError(f"waypoint {number}: {what}", expected=expected, advice=NOTHING)
