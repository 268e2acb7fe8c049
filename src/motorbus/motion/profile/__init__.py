"""How one axis gets from here to there, as a value: ask it where the axis is at any moment, in closed form.

    lift = trapezoid(0.0, 1.2, velocity=2.0, acceleration=8.0)
    lift.duration, lift.peak, lift.position(0.3)
    both = synchronised({"lift": Move(0.0, 1.2, limits), "grip": Move(0.0, 0.1, limits)})
    chase = Follower(0.0, limits)                # a goal that changes while the axis runs

Time is in s from the beginning of the profile, positions in rad (m on a linear axis) and everything else with them.
Nothing here has a clock.
"""

from __future__ import annotations

from motorbus.motion.profile.following import Follower
from motorbus.motion.profile.shapes import (
    Limits,
    Polynomial,
    Profile,
    Trapezoid,
    cubic,
    minimum_jerk,
    trapezoid,
)
from motorbus.motion.profile.together import Kind, Limiting, Move, Synchronised, synchronised

__all__ = [
    "Follower",
    "Kind",
    "Limiting",
    "Limits",
    "Move",
    "Polynomial",
    "Profile",
    "Synchronised",
    "Trapezoid",
    "cubic",
    "minimum_jerk",
    "synchronised",
    "trapezoid",
]
