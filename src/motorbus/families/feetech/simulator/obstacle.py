"""A movement with obstacles: its parts of one direction, and where it ends when it meets an obstacle."""

from __future__ import annotations

from collections.abc import Iterator
from math import copysign, inf, sqrt
from typing import NamedTuple

from motorbus.core.plant import Motion, Phase


class Stretch(NamedTuple):
    """A part of a movement in one direction: begin and end (s), position and velocity at the begin, acceleration."""

    begin: float
    end: float
    position: float
    velocity: float
    acceleration: float

    @property
    def way(self) -> float:
        """Direction: 1.0 or -1.0, 0.0 at rest."""
        direction = self.velocity or self.acceleration
        return copysign(1.0, direction) if direction else 0.0


def stretches(motion: Motion, since: float = -inf) -> Iterator[Stretch]:
    """Yield the parts that end after `since` (s), in order; the last one, at rest or at `cruise`, ends at inf."""
    begin = motion.start
    for phase in motion.phases:
        end = begin + phase.duration
        turn = -phase.velocity / phase.acceleration if phase.acceleration else inf
        if 0 < turn < phase.duration:
            middle = begin + turn
            first = Stretch(begin, middle, *phase[1:])
            second = Stretch(middle, end, phase.position_after(turn), 0.0, phase.acceleration)
            yield from (part for part in (first, second) if part.end > since)
        elif end > since:
            yield Stretch(begin, end, *phase[1:])
        begin = end
    yield Stretch(begin, inf, motion.goal, motion.cruise, 0.0)


def obstructed(motion: Motion, low: float, high: float) -> Motion:
    """The same movement with obstacles at `low` and `high`: it ends at rest where it meets one.

    Beyond an obstacle only the way back is free. A movement that meets none is returned unchanged.
    """
    phases: list[Phase] = []
    for stretch in stretches(motion):
        bound = high if stretch.way > 0 else low
        ahead = (bound - stretch.position) * stretch.way if stretch.way else inf
        time = _time_over(max(0.0, ahead), stretch)
        if time is not None and stretch.begin + time < stretch.end:
            if time:
                phases.append(Phase(time, stretch.position, stretch.velocity, stretch.acceleration))
            return Motion(motion.start, tuple(phases), bound if ahead > 0 else stretch.position)
        if stretch.end < inf:
            phases.append(Phase(stretch.end - stretch.begin, *stretch[2:]))
    return motion


def _time_over(distance: float, stretch: Stretch) -> float | None:
    """Seconds in which a stretch covers this distance, even beyond its end; None if it never does."""
    if distance == inf:
        return None
    speed, gain = abs(stretch.velocity), stretch.acceleration * stretch.way
    square = speed**2 + 2 * gain * distance
    if square < 0 or not (speed or gain):
        return None
    return 2 * distance / (speed + sqrt(square)) if distance else 0.0
