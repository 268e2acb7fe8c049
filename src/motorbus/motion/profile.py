"""Profiles of a move from rest to rest, their synchronization, and a generator that follows a changing target.

Positions are in rad or m, times in s.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isclose, isfinite, sqrt
from typing import Final, Literal, NamedTuple, TypeAlias

from motorbus.core.plant import Motion, Phase
from motorbus.core.plant import move as plan
from motorbus.errors import RequestError

Kind: TypeAlias = Literal["trapezoid", "minimum_jerk"]
KINDS: Final = ("trapezoid", "minimum_jerk")
PEAK: Final = 15 / 8  # highest velocity of minimum jerk, as a multiple of the mean
STEEPEST: Final = 10 / sqrt(3)  # its highest acceleration, as a multiple of distance / duration²
ROUNDING: Final = 1e-9


class Limits(NamedTuple):
    """Highest velocity (rad/s, m/s) and acceleration (rad/s², m/s²), each above 0."""

    velocity: float
    acceleration: float


class Move(NamedTuple):
    """A move of one axis from `start` to `goal` (rad, m), from rest to rest, within its limits."""

    start: float
    goal: float
    limits: Limits


@dataclass(frozen=True, slots=True)
class Trapezoid:
    """Constant acceleration, constant velocity, constant deceleration; a triangle over a short distance."""

    start: float
    motion: Motion
    duration: float

    @property
    def goal(self) -> float:
        """Where it ends."""
        return self.motion.goal

    @property
    def peak(self) -> float:
        """Its highest speed."""
        return max((abs(phase.velocity_after(phase.duration)) for phase in self.motion.phases), default=0.0)

    def position(self, at: float) -> float:
        """Position `at` s after the start; exactly the goal from the end on."""
        return self.goal if at >= self.duration else self.motion.position(at)

    def stretched(self, duration: float) -> Trapezoid:
        """The same move in exactly `duration` s, not shorter than its own."""
        if not self.motion.phases:
            return Trapezoid(self.start, self.motion, duration)
        share = self.duration / duration
        phases = tuple(
            Phase(
                phase.duration / share, phase.position, phase.velocity * share, phase.acceleration * share**2
            )
            for phase in self.motion.phases
        )
        return Trapezoid(self.start, Motion(0.0, phases, self.goal), duration)


@dataclass(frozen=True, slots=True)
class MinimumJerk:
    """The smoothest move: the acceleration, too, begins and ends at 0 (Flash and Hogan, 1985)."""

    start: float
    goal: float
    duration: float

    @property
    def peak(self) -> float:
        """Its highest speed."""
        return PEAK * abs(self.goal - self.start) / self.duration if self.duration else 0.0

    def position(self, at: float) -> float:
        """Position `at` s after the start; exactly the goal from the end on."""
        if at >= self.duration:
            return self.goal
        share = max(0.0, at / self.duration)
        return self.start + (self.goal - self.start) * share**3 * (10 - 15 * share + 6 * share**2)

    def stretched(self, duration: float) -> MinimumJerk:
        """The same move in `duration` s."""
        return MinimumJerk(self.start, self.goal, duration)


Profile: TypeAlias = Trapezoid | MinimumJerk


def trapezoid(move: Move) -> Trapezoid:
    """The fastest move within the limits."""
    motion = plan(
        0.0, move.start, move.goal, speed=move.limits.velocity, acceleration=move.limits.acceleration
    )
    return Trapezoid(move.start, motion, motion.done_at)


def minimum_jerk(move: Move) -> MinimumJerk:
    """The fastest minimum-jerk move within the limits."""
    distance = abs(move.goal - move.start)
    by_velocity = PEAK * distance / move.limits.velocity
    by_acceleration = sqrt(STEEPEST * distance / move.limits.acceleration)
    return MinimumJerk(move.start, move.goal, max(by_velocity, by_acceleration))


@dataclass(frozen=True, slots=True)
class Synchronized:
    """Moves that start and end together. `limited_by` names the axis and limit that decide the duration."""

    profiles: Mapping[str, Profile]
    duration: float
    limited_by: str

    def positions(self, at: float) -> dict[str, float]:
        """Position of each axis `at` s after the start."""
        return {name: profile.position(at) for name, profile in self.profiles.items()}


def synchronize(
    moves: Mapping[str, Move],
    *,
    kind: Kind = "trapezoid",
    duration: float | None = None,
    shortest: float = 0.0,
) -> Synchronized:
    """All moves as one, in `duration` s, or as quick as the slowest axis can, not below `shortest` s.

    Each profile is stretched in time, so its limits hold. Raises RequestError for a kind or duration that is not
    possible, and names the axis.
    """
    if kind not in KINDS:
        raise RequestError(f"{kind!r} is not a profile", expected=" or ".join(KINDS))
    fastest = {name: _fastest(name, move, kind) for name, move in moves.items()}
    slowest = max(fastest, key=lambda name: fastest[name].duration, default="")
    least = fastest[slowest].duration if fastest else 0.0
    limited_by = _reason(slowest, fastest[slowest], moves[slowest].limits) if least else ""
    if shortest > least:
        least, limited_by = shortest, "a self-timed axis"
    if duration is not None:
        if not isfinite(duration) or duration < least * (1 - ROUNDING):
            raise RequestError(
                f"{duration:.6g} s is too short",
                expected=f"at least {least:.4g} s",
                cause=f"limit: {limited_by}",
            )
        if duration > least:
            least, limited_by = duration, "the given duration"
    profiles = {name: profile.stretched(least) for name, profile in fastest.items()}
    return Synchronized(profiles, least, limited_by)


def _fastest(name: str, move: Move, kind: Kind) -> Profile:
    if not (isfinite(move.start) and isfinite(move.goal)):
        raise RequestError(f"{name}: {move.start} to {move.goal} is not a move", expected="finite numbers")
    return trapezoid(move) if kind == "trapezoid" else minimum_jerk(move)


def _reason(name: str, profile: Profile, limits: Limits) -> str:
    held = isclose(profile.peak, limits.velocity, rel_tol=1e-9)
    return f"{'velocity' if held else 'acceleration'} of {name}"


class SetpointGenerator:
    """Follows a target that may change at each step, within the limits of one axis; its velocity never jumps."""

    __slots__ = ("_motion", "_since", "goal", "limits", "position", "velocity")

    def __init__(self, position: float, limits: Limits) -> None:
        self.limits = limits
        self.reset(position)

    def reset(self, position: float) -> None:
        """Be at rest at this position."""
        self.position = self.goal = position
        self.velocity = self._since = 0.0
        self._motion = Motion(0.0, (), position)

    @property
    def arrived(self) -> bool:
        """It is at rest at its goal."""
        return not self._motion.moving(self._since)

    def step(self, elapsed: float, goal: float) -> float:
        """The position `elapsed` s later, on the way to `goal`. Raises RequestError for a goal that is not finite."""
        if goal != self.goal:
            if not isfinite(goal):
                raise RequestError(f"{goal} is not a target", expected="a finite number")
            self._head_for(goal)
        self._since += elapsed
        self.position, self.velocity, _ = self._motion.state(self._since)
        return self.position

    def brake(self) -> float:
        """Brake at once within the limits; gives the position where that ends, the new goal."""
        self._head_for(self.position + self.velocity * abs(self.velocity) / (2 * self.limits.acceleration))
        return self.goal

    def _head_for(self, goal: float) -> None:
        limits = self.limits
        self._motion = plan(
            0.0,
            self.position,
            goal,
            velocity=self.velocity,
            speed=limits.velocity,
            acceleration=limits.acceleration,
        )
        self.goal, self._since = goal, 0.0
