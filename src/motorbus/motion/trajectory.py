"""A recorded movement: samples of positions, a CSV file, interpolation, smoothing, check against limits."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, isfinite, pi, sqrt
from os import PathLike
from pathlib import Path
from typing import Final, Literal, TypeAlias

from motorbus.core import units
from motorbus.core.register import shown
from motorbus.errors import LimitExceeded, RequestError
from motorbus.motion.machine import LARGEST, AxisConfig, nearest

Interpolation: TypeAlias = Literal["linear", "spline"]
TIMES: Final = ("time", "t", "timestamp", "time_from_start", "seconds", "secs", "elapsed")
COLUMN: Final = re.compile(r"(.*?)\s*(?:\(([^()]*)\)|\[([^\[\]]*)\])?")
MOST: Final = 1_000_000  # samples
CLOSEST: Final = 1e-6  # s between two samples
HALF_POWER: Final = sqrt(2**0.25 - 1)  # ω·τ where two passes of the filter let half of the power through
SLACK: Final = 1e-6  # share of a limit that rounding in a file makes


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Positions of axes (rad, m) at `times` (s, from 0, increasing, at least two). `notes` are about the recording.

    Raises RequestError for times and positions that do not fit together or are not finite.
    """

    times: Sequence[float]
    axes: Mapping[str, Sequence[float]]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not 2 <= len(self.times) <= MOST or not self.axes:
            raise RequestError(
                f"{len(self.times)} samples of {len(self.axes)} axes", expected=f"2 to {MOST}, 1 axis"
            )
        if self.times[0] != 0 or any(not later - at >= CLOSEST for at, later in pairwise(self.times)):
            raise RequestError("the times of a trajectory start at 0 and increase")
        for name, places in self.axes.items():
            if len(places) != len(self.times):
                raise RequestError(f"{name} has {len(places)} positions at {len(self.times)} times")
            if not all(abs(place) <= LARGEST for place in places):
                raise RequestError(f"{name} has a position beyond {LARGEST:g}, or none")

    @property
    def duration(self) -> float:
        """Its duration (s)."""
        return self.times[-1]

    def positions(self, at: float, kind: Interpolation = "linear") -> dict[str, float]:
        """Position of each axis at a time (s); before and after it, where it begins and ends."""
        times = self.times
        place = min(max(bisect_right(times, at) - 1, 0), len(times) - 2)
        span = times[place + 1] - times[place]
        share = min(max((at - times[place]) / span, 0.0), 1.0)
        found = {}
        for name, places in self.axes.items():
            start, end = places[place], places[place + 1]
            if kind == "spline":
                first, last = (_slope(times, places, index) * span for index in (place, place + 1))
                found[name] = _cubic(start, end, first, last, share)
            else:
                found[name] = start + share * (end - start)
        return found

    def sampled(self, rate: float, kind: Interpolation = "linear", speed: float = 1.0) -> Trajectory:
        """The goals that a loop of `rate` (Hz) sends for it, `speed` times as fast; the last sample is its end."""
        count = max(1, ceil(self.duration / speed * rate - 1e-9))
        if not count < MOST:
            raise RequestError(
                f"{self.duration:.6g} s at {rate:g} Hz are too many samples", expected=f"below {MOST}"
            )
        rows = [self.positions(number / rate * speed, kind) for number in range(count)]
        rows.append(self.positions(self.duration))
        times = [number / rate for number in range(count + 1)]
        return Trajectory(times, {name: [row[name] for row in rows] for name in self.axes}, self.notes)

    def smoothed(self, cutoff: float) -> Trajectory:
        """Without what is quicker than `cutoff` (Hz): tremor of a hand. Nothing is shifted in time."""
        if not (isfinite(cutoff) and cutoff > 0):
            raise RequestError(f"{cutoff} is not a frequency", expected="Hz, above 0")
        axes = {name: _smooth(self.times, places, cutoff) for name, places in self.axes.items()}
        return Trajectory(self.times, axes, self.notes)

    def check(self, axes: Mapping[str, AxisConfig]) -> None:
        """Raise LimitExceeded for the first sample beyond a limit of its axis, RequestError for an unknown axis."""
        for name in self.axes:
            if name not in axes:
                raise RequestError(f"no axis {name!r}", advice=nearest(name, axes))
        found = [
            error for name in self.axes if (error := self._first_violation(name, axes[name])) is not None
        ]
        if found:
            raise min(found, key=lambda error: error.at or 0.0)

    def _first_violation(self, name: str, axis: AxisConfig) -> LimitExceeded | None:
        times, places = self.times, self.axes[name]
        rates = [
            (end - start) / (later - at)
            for (at, later), (start, end) in zip(pairwise(times), pairwise(places), strict=True)
        ]
        rates = [0.0, *rates, 0.0]  # at rest before and after it
        for index, at in enumerate(times):
            span = (times[min(index + 1, len(times) - 1)] - times[max(index - 1, 0)]) / 2
            gain = (rates[index + 1] - rates[index]) / span
            what = ""
            if not axis.allows(places[index]):
                what = f"position {axis.show(places[index])} is outside its limits"
            elif abs(rates[index]) > axis.max_velocity * (1 + SLACK):
                what = f"velocity {axis.show(rates[index])}/s is above {axis.show(axis.max_velocity)}/s"
            elif abs(gain) > axis.acceleration * (1 + SLACK) + 1e-15 / span**2:
                what = f"acceleration {axis.show(gain)}/s² is above {axis.show(axis.acceleration)}/s²"
            if what:
                error = LimitExceeded(f"{name} at {at:.4g} s: {what}", advice="play it slower, or smooth it")
                error.at = at
                return error
        return None

    # -- CSV -------------------------------------------------------------------------------------------------------

    @classmethod
    def load(cls, path: str | PathLike[str], axes: Mapping[str, AxisConfig] | None = None) -> Trajectory:
        """Read a CSV file. Raises RequestError that names the file and the line."""
        try:
            return cls.parse(Path(path).read_text("utf-8"), axes)
        except (OSError, UnicodeDecodeError) as error:
            raise RequestError(f"{path}: {getattr(error, 'strerror', '') or 'not UTF-8 text'}") from None
        except RequestError as error:
            error.summary = f"{path}: {error.summary}"
            raise

    @classmethod
    def parse(cls, text: str, axes: Mapping[str, AxisConfig] | None = None) -> Trajectory:
        """Read the text of a CSV file: a header `time (s),NAME (unit),…`, then numbers.

        With `axes`, a column of another name is refused. Times are counted from the first row; a row equal to the row
        before is left out. Raises RequestError that names the line.
        """
        lines = _lines(text)
        line, header = next(lines, (1, [""]))
        columns = _columns(line, header, axes)
        rows: list[list[float]] = []
        for line, cells in lines:
            if len(cells) != len(header):
                raise RequestError(
                    f"line {line}: {len(cells)} columns", expected=f"{len(header)}, as in the header"
                )
            row = [_number(line, cell) * scale for cell, scale in zip(cells, columns.values(), strict=True)]
            rows += [row] if not rows or row != rows[-1] else []
        time = list(columns).index("time")
        for (at, *_), (later, *_) in pairwise([row[time:] for row in rows]):
            if later - at < CLOSEST:
                raise RequestError(f"time {later:.6g} s is not after {at:.6g} s", advice="sort the rows")
        if len(rows) < 2:
            raise RequestError(f"{len(rows)} rows of numbers", expected="at least 2")
        places = {name: [row[index] for row in rows] for index, name in enumerate(columns)}
        times = places.pop("time")
        return cls([at - times[0] for at in times], places)

    def text(self, axes: Mapping[str, AxisConfig] | None = None) -> str:
        """A CSV file; with `axes` in the display units."""
        units_of = {name: axes[name].display_unit if axes and name in axes else "" for name in self.axes}
        head = ["time (s)", *(f"{name} ({unit})" if unit else name for name, unit in units_of.items())]
        lines = [",".join(head)]
        for index, at in enumerate(self.times):
            cells = (f"{places[index] / _scale(units_of[name]):.12g}" for name, places in self.axes.items())
            lines.append(",".join([f"{at:.12g}", *cells]))
        return "\n".join(lines) + "\n"


def _lines(text: str) -> Iterator[tuple[int, list[str]]]:
    for line, content in enumerate(text.removeprefix("\ufeff").splitlines(), 1):
        bare = content.strip()
        if bare and not bare.startswith("#"):
            yield line, [cell.strip().strip('"').strip() for cell in bare.split(",")]


def _columns(line: int, header: Sequence[str], axes: Mapping[str, AxisConfig] | None) -> dict[str, float]:
    """The factor to API units of each column, by name of the axis, or "time"."""
    if len(header) == 1 or header[0].replace(".", "").isdigit():
        raise RequestError(
            f"line {line}: no header", expected="time (s),shoulder (deg),…, separated by commas"
        )
    found: dict[str, float] = {}
    for cell in header:
        match = COLUMN.fullmatch(cell)
        assert match is not None
        name, unit = match[1].strip(), (match[2] or match[3] or "").strip()
        kinds: tuple[str, ...] = ("position", "length")
        if name.lower() in TIMES:
            name, kinds = "time", ("time",)
        elif axes is not None:
            if name not in axes:
                raise RequestError(f"line {line}: no axis {shown(name)}", advice=nearest(name, axes))
            kinds = ("length",) if axes[name].travel else ("position",)
        scales = {known: scale for kind in kinds for known, scale in units.SCALES[kind].items()}
        if unit and unit not in scales:
            raise RequestError(
                f"line {line}: {shown(cell)} has an unknown unit", advice=nearest(unit, scales)
            )
        if name in found:
            raise RequestError(f"line {line}: {name} is there twice")
        found[name] = scales[unit] if unit else 1.0
    if "time" not in found:
        raise RequestError(f"line {line}: no column of time", expected=f"one named {', '.join(TIMES)}")
    return found


def _scale(unit: str) -> float:
    return {**units.SCALES["position"], **units.SCALES["length"], "": 1.0}[unit]


def _number(line: int, cell: str) -> float:
    try:
        value = units.real(cell)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise RequestError(f"line {line}: {shown(cell)} is not a number", advice="its unit is in the header")
    return value


# -- curves ----------------------------------------------------------------------------------------------------


def _slope(times: Sequence[float], places: Sequence[float], index: int) -> float:
    """The velocity of the spline at a sample, 0 at both ends."""
    if index in (0, len(times) - 1):
        return 0.0
    before, after = times[index] - times[index - 1], times[index + 1] - times[index]
    slow, fast = (places[index] - places[index - 1]) / before, (places[index + 1] - places[index]) / after
    return (slow * after + fast * before) / (before + after)


def _cubic(start: float, end: float, first: float, last: float, share: float) -> float:
    """Hermite cubic; `first` and `last` are the velocities at its ends, times its duration."""
    square, cube = 3 * (end - start) - 2 * first - last, first + last - 2 * (end - start)
    return start + share * (first + share * (square + share * cube))


def _smooth(times: Sequence[float], places: Sequence[float], cutoff: float) -> list[float]:
    """Solve y - τ²·y'' = x twice, at rest at both ends (Whittaker, 1923): each result is a mean of samples."""
    square = (HALF_POWER / (2 * pi * cutoff)) ** 2
    for _ in range(2):
        places = _filter(times, places, square)
    return list(places)


def _filter(times: Sequence[float], places: Sequence[float], square: float) -> list[float]:
    """The tridiagonal system of one pass, solved forwards and backwards."""
    gaps = [later - at for at, later in pairwise(times)]
    links, spans = [0.0, *(square / gap for gap in gaps), 0.0], [0.0, *gaps, 0.0]
    kept: list[float] = []
    found: list[float] = []
    for index, (left, right) in enumerate(pairwise(links)):
        weight = (spans[index] + spans[index + 1]) / 2
        before, value = (kept[-1], found[-1]) if index else (0.0, 0.0)
        whole = weight + right + left * (1 - before)
        kept.append(right / whole)
        found.append((weight * places[index] + left * value) / whole)
    for index in range(len(found) - 2, -1, -1):
        found[index] += kept[index] * found[index + 1]
    return found
