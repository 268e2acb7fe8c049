"""A spline through the samples of a trajectory."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from motorbus.motion.profile.shapes import cubic


@dataclass(frozen=True, slots=True)
class Spline:
    """Cubics between samples: `times` (s), positions and velocities (rad, rad/s; m, m/s) of each axis."""

    times: Sequence[float]
    positions_of: Mapping[str, Sequence[float]]
    velocities_of: Mapping[str, Sequence[float]]

    @property
    def duration(self) -> float:
        """Duration (s)."""
        return self.times[-1]

    def positions(self, at: float) -> dict[str, float]:
        """Position of each axis at a time (s); outside of the duration that of the nearer end (rad, m)."""
        place = max(0, min(bisect_right(self.times, at), len(self.times) - 1) - 1)
        begin, end = self.times[place : place + 2]
        positions = {}
        for name, places in self.positions_of.items():
            (start, goal), (first, last) = (
                row[place : place + 2] for row in (places, self.velocities_of[name])
            )
            piece = cubic(start, goal, duration=end - begin, first=first, last=last)
            positions[name] = piece.position(at - begin)
        return positions


def spline(times: Sequence[float], axes: Mapping[str, Sequence[float]]) -> Spline:
    """The spline through samples of a movement, with velocity 0 at both ends.

    It meets a constant acceleration exactly. It leaves the range of the samples a little where an axis turns back.
    """
    return Spline(times, axes, {name: _velocities(times, places) for name, places in axes.items()})


def _velocities(times: Sequence[float], places: Sequence[float]) -> list[float]:
    """The velocity at each sample: the median of three parabolas, so none counts that crosses a jump."""
    means = [
        (end - begin, (goal - start) / (end - begin))
        for (begin, end), (start, goal) in zip(pairwise(times), pairwise(places), strict=True)
    ]
    (first, slow), (last, fast) = means[0], means[-1]
    around = pairwise([(first, -slow), *means, (last, -fast)])
    bends = [(fast - slow) / (before + after) for (before, slow), (after, fast) in around]
    inner = [
        sorted(
            (slow + bends[place] * before, slow + bends[place + 1] * before, fast - bends[place + 2] * after)
        )[1]
        for place, ((before, slow), (after, fast)) in enumerate(pairwise(means))
    ]
    return [0.0, *inner, 0.0]
