"""What a movement of several axes shall be, before it begins, and what came of a part of it afterwards.

A plan is asked once it is known where the axes stand. Every part of a movement asks it the same and gets the same, so
nobody has to be told what the others found out.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, Protocol

from motorbus.motion import limits
from motorbus.motion.moving.moved import Arrived, Cycles, Track
from motorbus.motion.profile import Limiting, Limits
from motorbus.motion.trajectory import Course


class Fact(NamedTuple):
    """Where an axis stands (rad, m), and of its device (rad) its own limits, and the smallest step that it can be told.

    `rate` (Hz) is that at which its goals will leave. Of an axis that moves by its own profile that step and the rate
    are 0: they are no matter there.
    """

    position: float
    device: limits.Device = None
    grain: float = 0.0
    rate: float = 0.0


class Planned(NamedTuple):
    """A course, where it ends (rad, m), and what decides how long it takes.

    `ways` are how far each axis goes on it (rad, m), `speeds` the highest of each, `limits` what each may do in this
    movement (rad/s, m/s and per s²).
    """

    course: Course
    goals: Mapping[str, float]
    ways: Mapping[str, float]
    speeds: Mapping[str, float]
    limits: Mapping[str, Limits]
    limited_by: Limiting


class Plan(Protocol):
    """What a movement shall be, once it is known where the axes stand."""

    @property
    def asked(self) -> float | None:
        """The duration (s) that somebody asked for."""

    def planned(self, facts: Mapping[str, Fact], duration: float | None = None) -> Planned:
        """The movement, as quick as it may be or in `duration` (s). Raises what refuses it; nothing has been sent."""


class Gone(NamedTuple):
    """What came of one part: of its axes, and of the cycles in which they were led."""

    axes: dict[str, Arrived]
    tracks: dict[str, Track]
    cycles: Cycles | None = None
