"""The shapes of a movement: the trapezoid, which is quick, and polynomials, of which minimum jerk is the gentle one.

A trapezoid is made of the phases of `core.plant`, so a simulated motor and a planned movement are the same mathematics.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, sqrt
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol

from motorbus.core.plant import Motion, Phase, move
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from motorbus.motion.machine import AxisSpec

PEAK: Final = 15 / 8
"""Highest velocity of minimum jerk, as a multiple of the mean one; it has it in the middle."""
STEEPEST: Final = 10 / sqrt(3)
"""Highest acceleration of minimum jerk, as a multiple of way / duration²."""
NOTHING: Final = "nothing was sent"


class Profile(Protocol):
    """A movement of one axis from `start` to `goal`, which takes `duration` (s). `peak` is its highest speed.

    A question about the time before gets the beginning, one about the time after the end: exactly `goal`, at rest.
    """

    @property
    def start(self) -> float:
        """Where it begins (rad or m)."""

    @property
    def goal(self) -> float:
        """Where it ends (rad or m)."""

    @property
    def duration(self) -> float:
        """How long it takes (s)."""

    @property
    def peak(self) -> float:
        """Its highest speed (rad/s or m/s), without a sign."""

    def position(self, at: float) -> float:
        """Where it is `at` seconds after its beginning."""

    def velocity(self, at: float) -> float:
        """How fast it is then, with its sign."""

    def acceleration(self, at: float) -> float:
        """How much faster it gets then, with its sign."""


class Limits(NamedTuple):
    """What an axis may do: velocity (rad/s, m/s) and acceleration (rad/s², m/s²), each above 0.

    `deceleration` is for braking; without it, it brakes as it accelerates.
    """

    velocity: float
    acceleration: float
    deceleration: float | None = None

    @classmethod
    def of(cls, axis: AxisSpec) -> Limits:
        """Those of an axis of a machine file."""
        return cls(axis.max_velocity, axis.max_acceleration)

    @property
    def braking(self) -> float:
        """The deceleration, said or not."""
        return self.acceleration if self.deceleration is None else self.deceleration


@dataclass(frozen=True, slots=True)
class Trapezoid:
    """Constant acceleration, constant velocity, constant deceleration; a triangle where the way is short.

    Made by `trapezoid`. `motion` are its phases, and `duration` is exact to the last digit where several end together.
    """

    motion: Motion
    duration: float
    start: float

    @property
    def goal(self) -> float:
        """Where it ends."""
        return self.motion.goal

    @property
    def peak(self) -> float:
        """Its highest speed, without a sign."""
        corners = ((one.velocity, one.velocity_after(one.duration)) for one in self.motion.phases)
        return max((max(abs(begins), abs(ends)) for begins, ends in corners), default=0.0)

    def position(self, at: float) -> float:
        """Where it is `at` seconds after its beginning; exactly at the goal from its end on."""
        return self.goal if at >= self.duration else self.motion.position(at)

    def velocity(self, at: float) -> float:
        """How fast it is then, with its sign."""
        return 0.0 if at >= self.duration else self.motion.velocity(at)

    def acceleration(self, at: float) -> float:
        """How much faster it gets then, with its sign."""
        return self.motion.acceleration(at) if 0 <= at < self.duration else 0.0

    def lasting(self, duration: float) -> Trapezoid:
        """The same way, all of it slower by one factor, so that it takes exactly `duration` (s); never shorter.

        Only for one that begins at rest, for a velocity at the beginning cannot be chosen. Raises RequestError.
        """
        if not self.motion.phases:
            return Trapezoid(self.motion, duration, self.start)
        if self.motion.phases[0].velocity or not isfinite(duration) or duration < self.duration:
            raise _refused(
                f"{duration:.6g} s is no duration for it",
                f"{self.duration:.6g} s or more, for a movement that begins at rest",
            )
        share = self.duration / duration
        phases = tuple(
            Phase(one.duration / share, one.position, one.velocity * share, one.acceleration * share**2)
            for one in self.motion.phases
        )
        return Trapezoid(Motion(0.0, phases, self.goal), duration, self.start)


def trapezoid(
    start: float,
    goal: float,
    *,
    velocity: float,
    acceleration: float,
    deceleration: float | None = None,
    initial: float = 0.0,
) -> Trapezoid:
    """The quickest way from `start` to `goal` (rad, m) within a velocity and an acceleration, each above 0.

    It may begin with an `initial` velocity: too fast to stop in time it goes past the goal and comes back, in the wrong
    direction it brakes first, faster than allowed it brakes down to what is. It brakes with `deceleration`, or as it
    accelerates. Raises RequestError for figures that are not finite or not above 0.
    """
    _finite(start=start, goal=goal, initial=initial)
    _positive(velocity=velocity, acceleration=acceleration)
    if deceleration is not None:
        _positive(deceleration=deceleration)
    motion = move(
        0.0,
        start,
        goal,
        velocity=initial,
        speed=velocity,
        acceleration=acceleration,
        deceleration=deceleration,
    )
    return Trapezoid(motion, _lasts(motion.done_at), start)


@dataclass(frozen=True, slots=True)
class Polynomial:
    """A movement whose position is a polynomial of the share of its duration that is over.

    Made by `minimum_jerk` and `cubic`. `coefficients` (rad or m) begin with the constant one.
    """

    start: float
    goal: float
    duration: float
    peak: float
    coefficients: tuple[float, ...]

    def position(self, at: float) -> float:
        """Where it is `at` seconds after its beginning; exactly at its ends outside."""
        if at <= 0:
            return self.start
        return self.goal if at >= self.duration else _horner(self.coefficients, at / self.duration)

    def velocity(self, at: float) -> float:
        """How fast it is then, with its sign; at its ends as fast as it comes in and goes out."""
        if not 0 <= at <= self.duration or not self.duration:
            return 0.0
        return _horner(_derived(self.coefficients), at / self.duration) / self.duration

    def acceleration(self, at: float) -> float:
        """How much faster it gets then, with its sign."""
        if not 0 <= at <= self.duration or not self.duration:
            return 0.0
        twice = _derived(_derived(self.coefficients))
        return _horner(twice, at / self.duration) / self.duration / self.duration


def minimum_jerk(
    start: float,
    goal: float,
    *,
    duration: float | None = None,
    velocity: float | None = None,
    acceleration: float | None = None,
) -> Polynomial:
    """The smoothest way from rest to rest: acceleration too begins and ends with 0 (Flash and Hogan, 1985).

    Give its `duration` (s), or a `velocity` and an `acceleration` that it keeps within: then it is as quick as one of
    them allows. Raises RequestError for both or neither, and for figures that are not finite or not above 0.
    """
    _finite(start=start, goal=goal)
    way = goal - start
    if duration is None:
        if velocity is None or acceleration is None:
            raise _refused("how fast it may be is not said", "a duration, or a velocity and an acceleration")
        _positive(velocity=velocity, acceleration=acceleration)
        duration = _lasts(max(PEAK * abs(way) / velocity, sqrt(STEEPEST * abs(way) / acceleration)))
    elif velocity is not None or acceleration is not None:
        raise _refused("how long it takes is said twice", "a duration, or a velocity and an acceleration")
    _long_enough(duration, way)
    peak = PEAK * abs(way) / duration if way else 0.0
    return Polynomial(start, goal, duration, peak, (start, 0.0, 0.0, 10 * way, -15 * way, 6 * way))


def cubic(start: float, goal: float, *, duration: float, first: float, last: float) -> Polynomial:
    """The cubic that begins with the velocity `first` and ends with `last` (rad/s, m/s). Raises RequestError."""
    _finite(start=start, goal=goal, first=first, last=last)
    _positive(duration=duration)
    way, begins, ends = goal - start, first * duration, last * duration
    square, cube = 3 * way - 2 * begins - ends, begins + ends - 2 * way
    turn = -square / (3 * cube) if cube else 0.0
    middle = begins - square * square / (3 * cube) if 0 < turn < 1 else 0.0
    peak = max(abs(begins), abs(ends), abs(middle)) / duration
    return Polynomial(start, goal, duration, peak, (start, begins, square, cube))


def _horner(coefficients: tuple[float, ...], share: float) -> float:
    value = 0.0
    for coefficient in reversed(coefficients):
        value = value * share + coefficient
    return value


def _derived(coefficients: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(power * coefficient for power, coefficient in enumerate(coefficients) if power)


# -- what is no movement ---------------------------------------------------------------------------------------------


def _refused(what: str, expected: str) -> RequestError:
    return RequestError(what, expected=expected, advice=NOTHING)


def _finite(**figures: float) -> None:
    for name, figure in figures.items():
        if not isfinite(figure):
            raise _refused(f"{name} is {figure}", "a finite number")


def _positive(**figures: float) -> None:
    for name, figure in figures.items():
        if not (isfinite(figure) and figure > 0):
            raise _refused(f"{name} is {figure}", "a finite number above 0")


def _long_enough(duration: float, way: float) -> None:
    """A duration may be 0 where there is no way to go."""
    if way:
        _positive(duration=duration)
    elif not (isfinite(duration) and duration >= 0):
        raise _refused(f"duration is {duration}", "a finite number, 0 or more")


def _lasts(duration: float) -> float:
    if not isfinite(duration):
        raise _refused("it would take longer than can be counted", "a shorter way, or higher limits")
    return duration
