"""Several axes that start together and end together: the slowest decides, and the others go slower.

Each keeps its own shape within its own limits; only its time is stretched, by one factor, so that what was allowed
stays allowed. All durations are the same number, not nearly.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isclose, isfinite
from typing import Final, Literal, NamedTuple, TypeAlias

from motorbus.errors import RequestError
from motorbus.motion.profile.shapes import NOTHING, Limits, Profile, Trapezoid, minimum_jerk, trapezoid

Kind: TypeAlias = Literal["trapezoid", "minimum_jerk"]
Reason: TypeAlias = Literal["velocity", "acceleration", "duration", "nothing"]
KINDS: Final = ("trapezoid", "minimum_jerk")
ROUNDING: Final = 1e-9
"""Of a duration: what was meant to be the shortest one may fall short of it by so much, and is made the shortest."""


class Move(NamedTuple):
    """What one axis shall do: from `start` to `goal` (rad, m), from rest to rest, within its limits."""

    start: float
    goal: float
    limits: Limits


class Limiting(NamedTuple):
    """What decides how long a group takes: the `axis`, and which of its limits.

    With reason "duration" it is the duration that was asked for, with "nothing" no axis has a way to go; then `axis`
    is "".
    """

    axis: str
    reason: Reason


@dataclass(frozen=True, slots=True)
class Synchronised:
    """A movement of several axes, each with its profile, which all last `duration` (s). Made by `synchronised`."""

    profiles: Mapping[str, Profile]
    duration: float
    limited_by: Limiting

    def positions(self, at: float) -> dict[str, float]:
        """Where each axis is `at` seconds after the beginning (rad, m)."""
        return {name: profile.position(at) for name, profile in self.profiles.items()}

    def velocities(self, at: float) -> dict[str, float]:
        """How fast each axis is then, with its sign (rad/s, m/s)."""
        return {name: profile.velocity(at) for name, profile in self.profiles.items()}


def synchronised(
    moves: Mapping[str, Move], *, kind: Kind = "trapezoid", duration: float | None = None
) -> Synchronised:
    """All moves as one: as quick as the slowest axis can, or in `duration` (s), which must not be shorter than that.

    Raises RequestError, naming the axis, for figures that no profile takes, for a kind that is not known, and for a
    duration that is too short, with the shortest there is.
    """
    if kind not in KINDS:
        raise RequestError(f"{kind!r} is no kind of profile", expected=" or ".join(KINDS), advice=NOTHING)
    quickest = {name: _quickest(name, move, kind) for name, move in moves.items()}
    slowest = max(quickest, key=lambda name: quickest[name].duration, default="")
    shortest = quickest[slowest].duration if quickest else 0.0
    limited_by = Limiting("", "nothing")
    if shortest:
        limited_by = Limiting(slowest, _reason(quickest[slowest], moves[slowest].limits))
    if duration is not None:
        _long_enough(duration, shortest, limited_by)
        if duration > shortest:
            limited_by = Limiting("", "duration")
    whole = shortest if duration is None else max(duration, shortest)
    profiles = {name: _lasting(profile, whole) for name, profile in quickest.items()}
    return Synchronised(profiles, whole, limited_by)


def _quickest(name: str, move: Move, kind: Kind) -> Profile:
    limits = move.limits
    try:
        if kind == "trapezoid":
            return trapezoid(
                move.start,
                move.goal,
                velocity=limits.velocity,
                acceleration=limits.acceleration,
                deceleration=limits.deceleration,
            )
        return minimum_jerk(
            move.start,
            move.goal,
            velocity=limits.velocity,
            acceleration=min(limits.acceleration, limits.braking),
        )
    except RequestError as error:
        raise RequestError(f"{name}: {error.summary}", expected=error.expected, advice=NOTHING) from None


def _lasting(quickest: Profile, duration: float) -> Profile:
    if isinstance(quickest, Trapezoid):
        return quickest.lasting(duration)
    return minimum_jerk(quickest.start, quickest.goal, duration=duration)


def _reason(quickest: Profile, limits: Limits) -> Reason:
    """Which limit it runs into: a trapezoid is held by velocity while it goes at one."""
    if isinstance(quickest, Trapezoid):
        held = any(not phase.acceleration for phase in quickest.motion.phases)
    else:
        held = isclose(quickest.peak, limits.velocity, rel_tol=1e-9)
    return "velocity" if held else "acceleration"


def _long_enough(duration: float, shortest: float, limited_by: Limiting) -> None:
    if not isfinite(duration) or duration < 0:
        raise RequestError(f"duration is {duration}", expected="a finite number of s", advice=NOTHING)
    if duration < shortest * (1 - ROUNDING):
        needed = _rounded_up(shortest)
        raise RequestError(
            f"{duration:.6g} s is too short: {limited_by.axis} needs {needed} s",
            expected=f"{needed} s or more",
            cause=f"the {limited_by.reason} limit of {limited_by.axis}",
            advice="give it more time, or leave the duration out for the quickest; nothing was sent",
        )


def _rounded_up(duration: float) -> str:
    """Six digits that, given back as a duration, are long enough."""
    shown = f"{duration:.6g}"
    return shown if float(shown) >= duration * (1 - ROUNDING) else f"{duration * (1 + 1e-5):.6g}"
