"""Whether a trajectory is within the limits of its axes, judged by what will be sent: its samples.

Velocity is judged over each stretch between two samples, acceleration from one stretch to the next, and from rest and
to rest at its ends. Of a smooth movement these are never above the true ones. So sample a route at the rate of the loop
before it is judged; a corner between two samples is then as hard as the loop would make it. Rows of a file are no such
samples, unless they are as fine: a replay joins them, and has the goals judged that it makes of them (`moving.along`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Final, Literal, NamedTuple, TypeAlias

from motorbus.core import units
from motorbus.errors import LimitExceeded, RequestError
from motorbus.motion.machine import AxisSpec
from motorbus.motion.machine.model import ACCELERATION, FARTHEST, POSITION, VELOCITY, Measure
from motorbus.motion.machine.refusal import listed, nearest
from motorbus.motion.profile.shapes import NOTHING
from motorbus.motion.trajectory.samples import Trajectory

What: TypeAlias = Literal["position", "velocity", "acceleration"]
SLACK: Final = 1e-6
"""Of a limit: rounding in a file makes as much of it."""
ROUNDING: Final = 4e-16
"""Of a position: what a difference of two of them may be wrong by."""
_MEASURES: Final[Mapping[What, tuple[Measure, str]]] = {
    "position": (POSITION, ""),
    "velocity": (VELOCITY, "/s"),
    "acceleration": (ACCELERATION, "/s²"),
}
_ADVICE: Final[Mapping[What, str]] = {
    "position": "change it, or low and high of the axis",
    "velocity": "make it slower: speed=0.5 takes twice the time",
    "acceleration": "make it slower or smoother: speed=0.5, or smoothed(5)",
}


class Violation(NamedTuple):
    """That an `axis` goes beyond a limit: in what, when (s), how far, and what the limit is (rad, m, and per s, s²)."""

    axis: str
    what: What
    at: float
    value: float
    limit: float

    def told(self, axis: AxisSpec) -> str:
        """It in one line, in the unit in which people see the axis."""
        measure, per = _MEASURES[self.what]
        unit = f"{axis.unit}{per}"
        scale = units.SCALES[measure.of(axis.linear)][unit]
        value, limit = (f"{figure / scale:.6g} {unit}" for figure in (self.value, self.limit))
        return f"{self.axis}: its {self.what} at {self.at:.6g} s is {value}, and its limit is {limit}"


def first_violation(trajectory: Trajectory, axes: Mapping[str, AxisSpec]) -> Violation | None:
    """The first sample that goes beyond a limit of its axis, or None. Raises RequestError for an axis not in `axes`."""
    found = [next(_violations(trajectory, name, _spec(name, axes)), None) for name in trajectory.axes]
    return min((one for one in found if one is not None), key=lambda one: one.at, default=None)


def check(trajectory: Trajectory, axes: Mapping[str, AxisSpec]) -> None:
    """Raise LimitExceeded for the first sample that goes beyond a limit; RequestError for an axis not in `axes`."""
    found = first_violation(trajectory, axes)
    if found is not None:
        error = LimitExceeded(
            found.told(axes[found.axis]),
            expected="a trajectory within the limits of its axes",
            advice=f"{_ADVICE[found.what]}; {NOTHING}",
        )
        error.at = found.at
        raise error


def _spec(name: str, axes: Mapping[str, AxisSpec]) -> AxisSpec:
    if name not in axes:
        raise RequestError(
            f"there is no axis {name!r}",
            expected=listed(axes, "an axis of the machine"),
            advice=nearest(name, axes, NOTHING),
        )
    return axes[name]


def _violations(trajectory: Trajectory, name: str, spec: AxisSpec) -> Iterator[Violation]:
    """What an axis does wrong, in the order of time; at one moment, position before velocity before acceleration."""
    times, places = trajectory.times, trajectory.axes[name]
    rates = _rates(times, places)
    for place, at in enumerate(times):
        position, rate, gain = places[place], rates[place], _gain(times, rates, place)
        if not spec.allows(position):
            yield Violation(name, "position", at, position, _bound(spec, position))
        if abs(rate) > spec.max_velocity * (1 + SLACK):
            yield Violation(name, "velocity", at, rate, spec.max_velocity)
        noise = ROUNDING * max(1.0, abs(position)) / _span(times, place) ** 2
        if abs(gain) > spec.max_acceleration * (1 + SLACK) + noise:
            yield Violation(name, "acceleration", at, gain, spec.max_acceleration)


def _rates(times: Sequence[float], places: Sequence[float]) -> list[float]:
    """The velocity on the way to each sample, and 0 for the first one and behind the last one."""
    stretches = zip(pairwise(times), pairwise(places), strict=True)
    return [0.0, *((goal - start) / (end - begin) for (begin, end), (start, goal) in stretches), 0.0]


def _gain(times: Sequence[float], rates: Sequence[float], place: int) -> float:
    return (rates[place + 1] - rates[place]) / _span(times, place)


def _span(times: Sequence[float], place: int) -> float:
    """From the middle of the stretch before a sample to that of the one behind it; s."""
    begin, end = times[max(0, place - 1)], times[min(len(times) - 1, place + 1)]
    return (end - begin) / 2


def _bound(spec: AxisSpec, position: float) -> float:
    low = -FARTHEST if spec.low is None else spec.low
    high = FARTHEST if spec.high is None else spec.high
    return low if position < low else high
