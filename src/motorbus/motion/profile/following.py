"""Running after a goal that may change at any moment: a leader's hand, a slider, a camera.

Each new goal begins a new movement from where the axis is and as fast as it is, so velocity never jumps. Between two
goals all that is asked for lies on one curve: a step that comes late lands where it would have been.
"""

from __future__ import annotations

from math import isfinite
from typing import Protocol

from motorbus.errors import RequestError
from motorbus.motion.profile.shapes import NOTHING, Limits, Profile, trapezoid


class Follower(Protocol):
    """One axis and its goal. Made by `follower`; all of it is in rad (m on a linear axis) and s.

    It never leaves the stretch between where it began and the goals it was given.
    """

    @property
    def position(self) -> float:
        """Where it is now."""

    @property
    def velocity(self) -> float:
        """How fast it is now, with its sign."""

    @property
    def goal(self) -> float:
        """Where it is going."""

    @property
    def arrived(self) -> bool:
        """Whether it is at rest at its goal."""

    def step(self, elapsed: float, goal: float | None = None) -> float:
        """The position `elapsed` seconds later, on the way to `goal`, or to the one it has.

        Raises RequestError, and stays as it is, for a goal that is not finite and for time that runs backwards.
        """

    def halt(self) -> None:
        """Brake from now on as hard as is allowed: the goal becomes where that ends, on the way it is on."""

    def reset(self, position: float) -> None:
        """Be at rest at another position: after a stop, or when it was moved by hand. Raises RequestError."""


def follower(position: float, limits: Limits, *, jerk: float | None = None) -> Follower:
    """What keeps after a goal from `position` (rad, m) on, at rest, within `limits`.

    With a `jerk` (rad/s³, m/s³, above 0) acceleration does not jump either; that is worked out by ruckig, an extra:
    raises MotorbusError with its install line where it is missing. Raises RequestError for impossible figures.
    """
    if jerk is None:
        return TrapezoidFollower(position, limits)
    from motorbus.motion.profile.jerk import JerkFollower

    return JerkFollower(position, limits, jerk)


class TrapezoidFollower:
    """Follows by trapezoids. Acceleration is within the limits and may jump; see `Follower`."""

    def __init__(self, position: float, limits: Limits) -> None:
        self._limits = limits
        self._since = 0.0
        self._way: Profile = self._towards(position, position, 0.0)

    @property
    def position(self) -> float:
        """Where it is now."""
        return self._way.position(self._since)

    @property
    def velocity(self) -> float:
        """How fast it is now, with its sign."""
        return self._way.velocity(self._since)

    @property
    def goal(self) -> float:
        """Where it is going."""
        return self._way.goal

    @property
    def arrived(self) -> bool:
        """Whether it is at rest at its goal."""
        return self._since >= self._way.duration

    def step(self, elapsed: float, goal: float | None = None) -> float:
        """The position `elapsed` seconds later, on the way to `goal`, or to the one it has; see `Follower`."""
        check_elapsed(elapsed)
        if goal is not None and goal != self.goal:
            self._way = self._towards(self.position, goal, self.velocity)
            self._since = 0.0
        self._since += elapsed
        return self.position

    def halt(self) -> None:
        """Brake from now on; see `Follower`."""
        position, velocity = self.position, self.velocity
        end = position + velocity * abs(velocity) / (2 * self._limits.braking)
        self._way, self._since = self._towards(position, end, velocity), 0.0

    def reset(self, position: float) -> None:
        """Be at rest at another position."""
        self._way, self._since = self._towards(position, position, 0.0), 0.0

    def _towards(self, position: float, goal: float, velocity: float) -> Profile:
        limits = self._limits
        return trapezoid(
            position,
            goal,
            velocity=limits.velocity,
            acceleration=limits.acceleration,
            deceleration=limits.deceleration,
            initial=velocity,
        )


def check_elapsed(elapsed: float) -> None:
    """Raise RequestError for time that is not finite or runs backwards."""
    if not (isfinite(elapsed) and elapsed >= 0):
        raise RequestError(f"{elapsed} s have gone by", expected="a finite time, 0 or more", advice=NOTHING)
