"""A low pass that shifts nothing in time: each sample is drawn to its neighbours on both sides alike.

It is the solution of y - τ²·y'' = x, at rest at both ends, taken twice (Whittaker's smoothing, 1923, of first order).
That is one tridiagonal system: as many steps as samples however low the cutoff is, at whatever times they were taken;
each result is a mean of what came in, so it stays in its range.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import pi, sqrt
from typing import Final

HALF_POWER: Final = sqrt(2**0.25 - 1)
"""ω·τ where two passes, each 1 / (1 + (ω·τ)²), let half of the power through."""


def smooth(times: Sequence[float], places: Sequence[float], cutoff: float) -> list[float]:
    """The places at these times (s, increasing, two or more) without what is quicker than `cutoff` (Hz)."""
    square = (HALF_POWER / (2 * pi * cutoff)) ** 2
    low, high = min(places), max(places)
    once = _drawn(times, places, square)
    return [min(high, max(low, place)) for place in _drawn(times, once, square)]


def _drawn(times: Sequence[float], places: Sequence[float], square: float) -> list[float]:
    """Solve weight·y + links·(differences of y) = weight·x from the front to the back, and back again."""
    gaps = [after - before for before, after in pairwise(times)]
    links = [0.0, *(square / gap for gap in gaps), 0.0]
    spans = [0.0, *gaps, 0.0]
    kept: list[float] = []
    found: list[float] = []
    for place, (left, right) in enumerate(pairwise(links)):
        weight = (spans[place] + spans[place + 1]) / 2
        before, drawn = (kept[-1], found[-1]) if place else (0.0, 0.0)
        whole = weight + right + left * (1 - before)
        kept.append(right / whole)
        found.append((weight * places[place] + left * drawn) / whole)
    for place in range(len(found) - 2, -1, -1):
        found[place] += kept[place] * found[place + 1]
    return found
