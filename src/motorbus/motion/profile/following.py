"""Running after a goal that may change at any moment: a leader's hand, a slider, a camera.

Each new goal begins a new movement from where the axis is and as fast as it is, so velocity never jumps. Between two
goals all that is asked for lies on one curve: a step that comes late lands where it would have been.
"""

from __future__ import annotations

from math import inf, isfinite, sqrt
from typing import TypeAlias

from motorbus.errors import RequestError
from motorbus.motion.profile.shapes import NOTHING, Limits, trapezoid

_Stretch: TypeAlias = "tuple[float, float, float, float, float]"
"""Of a way: when it ends and begins (s), where, how fast, and how much faster it gets."""


class Follower:
    """One axis and its goal, in rad (m on a linear axis) and s. It follows by trapezoids: acceleration may jump.

    It never leaves the stretch between where it began and the goals it was given.

    A loop asks it thousands of times a second for one step on a way that is new each time. So a way is kept as bare
    numbers here; it is the one that `trapezoid` makes, which is asked for wherever the usual case is not enough.
    """

    def __init__(self, position: float, limits: Limits) -> None:
        self._limits = limits
        self._alike = limits.acceleration == limits.braking
        self._fastest, self._hardest = limits.velocity, limits.acceleration
        self._position = self._goal = position
        self._velocity = self._since = 0.0
        self._phases: tuple[_Stretch, ...] = ()
        self.reset(position)

    @property
    def position(self) -> float:
        """Where it is now."""
        return self._position

    @property
    def velocity(self) -> float:
        """How fast it is now, with its sign."""
        return self._velocity

    @property
    def goal(self) -> float:
        """Where it is going."""
        return self._goal

    @property
    def arrived(self) -> bool:
        """Whether it is at rest at its goal."""
        return not self._phases or self._since >= self._phases[-1][0]

    def step(self, elapsed: float, goal: float | None = None) -> float:
        """The position `elapsed` seconds later, on the way to `goal`, or to the one it has.

        Raises RequestError, and stays as it is, for a goal that is not finite and for time that runs backwards.
        """
        if not 0.0 <= elapsed < inf:
            check_elapsed(elapsed)
        if goal is not None and goal != self._goal:
            self._phases = self._usual(goal) or self._any(goal)
            self._goal, self._since = goal, 0.0
        self._since = since = self._since + elapsed
        for ends, begins, position, velocity, acceleration in self._phases:
            if since < ends:
                at = since - begins
                self._velocity = velocity + acceleration * at
                self._position = place = position + at * (velocity + 0.5 * acceleration * at)
                return place
        self._position, self._velocity = self._goal, 0.0
        return self._goal

    def halt(self) -> None:
        """Brake from now on as hard as is allowed: the goal becomes where that ends, on the way it is on."""
        velocity = self._velocity
        goal = self._position + velocity * abs(velocity) / (2 * self._limits.braking)
        self._phases = self._any(goal)
        self._goal, self._since = goal, 0.0

    def reset(self, position: float) -> None:
        """Be at rest at another position: after a stop, or when it was moved by hand. Raises RequestError."""
        way = trapezoid(
            position, position, velocity=self._limits.velocity, acceleration=self._limits.acceleration
        )
        self._position = self._goal = way.goal
        self._velocity = self._since = 0.0
        self._phases = ()

    def _usual(self, goal: float) -> tuple[_Stretch, ...]:
        """The way as `core.plant.move` lays it, where it brakes as it accelerates; () where it cannot be said so."""
        begin, velocity, hardest = self._position, self._velocity, self._hardest
        halt = begin + velocity * abs(velocity) / (2 * hardest)
        if not self._alike or goal == halt or not isfinite(goal):
            return ()
        way = 1.0 if goal > halt else -1.0
        square = 0.5 * (2 * hardest * way * (goal - begin) + velocity * velocity)
        fastest = self._fastest
        peak = way * (fastest if square >= fastest * fastest else sqrt(square) if square > 0.0 else 0.0)
        gain = hardest if peak > velocity else -hardest
        first = (peak - velocity) / gain
        reached = begin + first * (velocity + 0.5 * gain * first)
        last = goal - peak * abs(peak) / (2 * hardest)
        along = first + (max(0.0, (last - reached) / peak) if square >= fastest * fastest else 0.0)
        ends = along + abs(peak) / hardest
        if not ends < inf:
            return ()
        return (
            (first, 0.0, begin, velocity, gain),
            (along, first, reached, peak, 0.0),
            (ends, along, last, peak, -way * hardest),
        )

    def _any(self, goal: float) -> tuple[_Stretch, ...]:
        limits = self._limits
        found = trapezoid(
            self._position,
            goal,
            velocity=limits.velocity,
            acceleration=limits.acceleration,
            deceleration=limits.deceleration,
            initial=self._velocity,
        )
        stretches, begins = [], 0.0
        for one in found.motion.phases:
            stretches.append((begins + one.duration, begins, one.position, one.velocity, one.acceleration))
            begins += one.duration
        return tuple(stretches)


def check_elapsed(elapsed: float) -> None:
    """Raise RequestError for time that is not finite or runs backwards."""
    if not (isfinite(elapsed) and elapsed >= 0):
        raise RequestError(f"{elapsed} s have gone by", expected="a finite time, 0 or more", advice=NOTHING)
