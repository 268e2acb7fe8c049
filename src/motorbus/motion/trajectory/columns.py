"""Trajectories as CSV, which every spreadsheet opens: a column of times, then one for each axis, units in the header.

    # A trajectory of motorbus: format = 1
    time (s),shoulder (deg),slide (mm)
    0,0,0
    0.005,0.1,0.02

What is wrong with a file is said once, with its line and its column, both counted from 1.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from typing import TYPE_CHECKING, Final, NamedTuple

from motorbus.core import units
from motorbus.core.register import shown
from motorbus.errors import RequestError
from motorbus.motion.machine.model import FARTHEST, NAME, POSITION
from motorbus.motion.machine.refusal import listed, nearest

if TYPE_CHECKING:
    from motorbus.motion.machine import AxisSpec

FORMAT: Final = 1
LONGEST: Final = 1 << 26
"""Characters a file may have."""
MOST_ROWS: Final = 1_000_000
CLOSEST: Final = 1e-7
"""s between two rows; nothing that moves is sampled finer."""
MOST_COLUMNS: Final = 257
HEAD: Final = f"# A trajectory of motorbus: format = {FORMAT}"
EXAMPLE: Final = "a header like time (s),shoulder (deg),slide (mm)"
NAMED: Final = "a lower case letter, then lower case letters, digits, _ and -, 40 at most"
_FORMAT: Final = re.compile(r"#.*\bformat\s*=\s*(\S+)")
_COLUMN: Final = re.compile(r"([^()]*?)\s*(?:\(([^()]*)\))?")
_DIGITS: Final = 12


class Column(NamedTuple):
    """A column of numbers: its name, its unit, and how much one of that is in the API's unit."""

    name: str
    unit: str
    scale: float


class Place(NamedTuple):
    """Where in a file, counted from 1; column 0 is the whole line."""

    line: int
    column: int = 0
    name: str = ""

    def refused(self, what: str, expected: str, advice: str) -> RequestError:
        """The error for what stands there."""
        where = f"line {self.line}" + (f", column {self.column}" if self.column else "")
        named = f" ({self.name})" if self.name else ""
        return RequestError(
            f"{where}{named}: {what}", expected=expected, advice=f"{advice}; nothing was moved"
        )


# -- reading -----------------------------------------------------------------------------------------------------------


def read(text: str, axes: Mapping[str, AxisSpec] | None = None) -> tuple[list[float], dict[str, list[float]]]:
    """Times (s, from 0 on) and positions (rad, m) by the names of axes. Raises RequestError.

    With `axes` there may be no other ones. Time is counted from the first row.
    """
    if len(text) > LONGEST:
        advice = "see that it is the right one"
        raise Place(1).refused(f"the file has more than {LONGEST} characters", "fewer", advice)
    lines = _lines(text)
    columns = _header(*next(lines, (1, [""])), axes)
    rows: list[list[float]] = []
    for line, cells in lines:
        row = _row(line, cells, columns)
        if rows and row[0] - rows[-1][0] < CLOSEST:
            raise Place(line, 1, "time").refused(
                f"{cells[0]} is not after the row before",
                "times that increase",
                "sort the rows by their time",
            )
        rows.append(row)
        if len(rows) > MOST_ROWS:
            raise Place(line).refused(f"there are more than {MOST_ROWS} rows", "fewer", "cut the file")
    if len(rows) < 2:
        count = "is one row" if rows else "are no rows"
        raise Place(len(text.splitlines()) or 1).refused(f"there {count}", "two or more", "add a row")
    times, *places = ([row[number] for row in rows] for number in range(len(columns)))
    names = (column.name for column in columns[1:])
    return [at - times[0] for at in times], dict(zip(names, places, strict=True))


def _lines(text: str) -> Iterator[tuple[int, list[str]]]:
    """The lines that say something, with their numbers, as cells."""
    for line, content in enumerate(text.removeprefix("\ufeff").split("\n"), 1):
        bare = content.strip()
        if bare.startswith("#"):
            _known_format(line, bare)
        elif bare:
            yield line, [cell.strip().strip('"').strip() for cell in bare.split(",")]


def _known_format(line: int, comment: str) -> None:
    said = _FORMAT.fullmatch(comment)
    if said and said[1] != str(FORMAT):
        advice = "a newer motorbus may read it: update motorbus"
        raise Place(line).refused(f"format {shown(said[1])} is not known", f"format = {FORMAT}", advice)


def _header(line: int, cells: Sequence[str], axes: Mapping[str, AxisSpec] | None) -> list[Column]:
    whole = Place(line)
    if len(cells) > MOST_COLUMNS:
        raise whole.refused(f"{len(cells)} columns are too many", f"at most {MOST_COLUMNS}", "leave some out")
    if len(cells) == 1 and ("\t" in cells[0] or ";" in cells[0]):
        advice = "separate columns by commas, and write numbers with a point"
        raise whole.refused("there is one column", EXAMPLE, advice)
    if not cells[0] or _number(cells[0]) is not None:
        raise whole.refused("the header is missing", EXAMPLE, "name the columns in the first line")
    columns = [_time(Place(line, 1), cells[0])]
    for number, cell in enumerate(cells[1:], 2):
        column = _axis(Place(line, number), cell, axes)
        if column.name in [other.name for other in columns]:
            raise Place(line, number).refused(
                f"{column.name} is there twice", "one column for each axis", "take one of them out"
            )
        columns.append(column)
    if len(columns) == 1:
        raise whole.refused("no axis is named", EXAMPLE, "add a column for each axis")
    return columns


def _time(place: Place, cell: str) -> Column:
    name, unit = _split(place, cell)
    if name != "time":
        raise place.refused(f"{shown(cell)} is not time", "time (s)", "make time the first column")
    return Column(name, unit or "s", _scale(place, name, unit or "s", ("time",)))


def _axis(place: Place, cell: str, axes: Mapping[str, AxisSpec] | None) -> Column:
    name, unit = _split(place, cell)
    if axes is not None and name not in axes:
        advice = nearest(name, axes, "take the column out, or add the axis to the machine")
        raise place.refused(f"there is no axis {shown(name)}", listed(axes, "an axis of the machine"), advice)
    if not re.fullmatch(NAME, name):
        raise place.refused(f"{shown(name)} is no name of an axis", NAMED, "give it another name")
    quantities = ("position", "length") if axes is None else (POSITION.of(axes[name].linear),)
    return Column(name, unit, _scale(place, name, unit, quantities) if unit else 1.0)


def _split(place: Place, cell: str) -> tuple[str, str]:
    """Name and unit, as in `shoulder (deg)`; "" where there is none."""
    match = _COLUMN.fullmatch(cell)
    if match is None or not match[1]:
        what = f"{shown(cell)} is no name with a unit" if cell else "the column has no name"
        raise place.refused(what, EXAMPLE, "write the unit behind the name, in brackets")
    return match[1], (match[2] or "").strip()


def _scale(place: Place, name: str, unit: str, quantities: Sequence[str]) -> float:
    for quantity in quantities:
        if unit in units.SCALES[quantity]:
            return units.SCALES[quantity][unit]
    known = [known for quantity in quantities for known in units.SCALES[quantity]]
    advice = nearest(unit, known, "give a unit that measures it")
    raise place.refused(f"{name} has the unit {shown(unit)}", listed(known), advice)


def _row(line: int, cells: Sequence[str], columns: Sequence[Column]) -> list[float]:
    if len(cells) != len(columns):
        less = len(cells) < len(columns)
        missing = ", ".join(column.name for column in columns[len(cells) :][:5])
        advice = f"add {missing}" if less else "write numbers with a point, not with a comma"
        there = "is 1 column" if len(cells) == 1 else f"are {len(cells)} columns"
        raise Place(line).refused(f"there {there}", f"{len(columns)}, as in the header", advice)
    return [
        _value(cell, line, number, column)
        for number, (cell, column) in enumerate(zip(cells, columns, strict=True), 1)
    ]


def _value(cell: str, line: int, number: int, column: Column) -> float:
    value = _number(cell)
    place = Place(line, number, column.name)
    if value is None:
        what = f"{shown(cell)} is no number" if cell else "the number is missing"
        unit = f" in {column.unit}" if column.unit else ""
        advice = "write the number only; its unit stands in the header" if cell else "fill the gap"
        raise place.refused(what, f"a number{unit}", advice)
    if not (isfinite(value) and abs(value * column.scale) <= FARTHEST):
        raise place.refused(
            f"{cell} is out of range", f"a finite number, {FARTHEST:.0f} at most in rad, m or s", "correct it"
        )
    return value * column.scale


def _number(cell: str) -> float | None:
    try:
        return None if "_" in cell else float(cell)
    except ValueError:
        return None


# -- writing -----------------------------------------------------------------------------------------------------------


def write(
    times: Sequence[float],
    places: Mapping[str, Sequence[float]],
    axes: Mapping[str, AxisSpec] | None = None,
) -> str:
    """The text of a file; with `axes`, in the units in which people see them. Raises RequestError."""
    columns = [_seen(name, axes) for name in places]
    names = [f"{column.name} ({column.unit})" if column.unit else column.name for column in columns]
    lines = [HEAD, ",".join(["time (s)", *names])]
    lines += (
        ",".join([_exact(at), *(_written(place, column) for place, column in zip(row, columns, strict=True))])
        for at, *row in zip(times, *places.values(), strict=True)
    )
    return "\n".join(lines) + "\n"


def _seen(name: str, axes: Mapping[str, AxisSpec] | None) -> Column:
    if axes is None:
        if not re.fullmatch(NAME, name):
            raise RequestError(
                f"{shown(name)} is no name of an axis", expected=NAMED, advice="nothing was written"
            )
        return Column(name, "", 1.0)
    if name not in axes:
        raise RequestError(
            f"there is no axis {name!r}",
            expected=listed(axes, "an axis of the machine"),
            advice=nearest(name, axes, "nothing was written"),
        )
    unit = axes[name].unit
    return Column(name, unit, units.SCALES[POSITION.of(axes[name].linear)][unit])


def _written(place: float, column: Column) -> str:
    return _exact(place) if column.scale == 1.0 else f"{place / column.scale:.{_DIGITS}g}"


def _exact(number: float) -> str:
    return repr(float(number)).removesuffix(".0")
