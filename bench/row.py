"""One line of the table of goals: what was measured against whom, what came out, what it was to be.

Each module of `bench/rows` has `rows(rounds, say)`, which measures and returns some of them; `python -m bench`
puts all of them into one table.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from bench.figures import Spread, spread

Say = Callable[[str], None]
"""Shows progress to whoever waits."""

SINGLE, PROCESS = 0.15, 0.25
"""Margin of a row in one thread of one process, and of one that takes two processes or more: what a shared machine
adds from run to run."""
SAMPLES, ROUNDS = 7, 5
"""Samples of the former, and the fewest shuffled rounds of the latter."""

_COMPARATORS = {"<=": operator.le, ">=": operator.ge, "<": operator.lt, ">": operator.gt, "=": operator.eq}
_GOAL = re.compile(r"(<=|>=|<|>|=) ?([0-9.]+)")


class Row(NamedTuple):
    """One measure, its figure and its goal.

    `number`    of the goal, "1" to "15", or a word where there is no number
    `measure`   what was measured, in words
    `peer`      against whom, "-" where there is none
    `unit`      of the figure: "x" for a ratio, "calls", "%", "ms", "s"
    `value`     the median; a ratio is ours by theirs where the goal is at most, theirs by ours where it is at least
    `least`, `greatest`  of the samples
    `goal`, `stretch`    comparator and number, "<= 0.85"; "" is none: such a row is told beside another, not judged
    `ours`, `theirs`     median seconds behind a ratio
    `samples`   how many
    `note`      what was measured in the same run and belongs to it, or what was left out; why it misses says `reasons`
    `margin`    share of the goal by which a figure may miss it and still count: SINGLE, PROCESS or 0 for a count
    """

    number: str
    measure: str
    peer: str
    unit: str
    value: float
    least: float
    greatest: float
    goal: str
    stretch: str = ""
    ours: float | None = None
    theirs: float | None = None
    samples: int = SAMPLES
    note: str = ""
    margin: float = SINGLE


def limit(goal: str) -> tuple[str, float]:
    """Comparator and number of a goal. Raises ValueError for anything else."""
    parts = _GOAL.fullmatch(goal)
    if parts is None:
        raise ValueError(f"{goal!r} is no goal: a comparator and a number were expected, like '<= 0.85'")
    return parts[1], float(parts[2])


def reaches(value: float, goal: str, margin: float = 0.0) -> bool:
    """Whether a figure keeps a goal, by this share less strictly. Raises ValueError."""
    sign, number = limit(goal)
    eased = number * (1 + margin if sign.startswith("<") else 1 - margin if sign.startswith(">") else 1)
    return bool(_COMPARATORS[sign](value, eased))


def met(row: Row) -> bool:
    """Whether the goal is kept within the margin of its kind of row, or there is none."""
    return not row.goal or reaches(row.value, row.goal, row.margin)


def verdict(row: Row) -> str:
    """In words: stretch, met, met within the margin, or MISSED; or that there is no goal."""
    if not row.goal:
        return "no goal"
    if row.stretch and reaches(row.value, row.stretch):
        return "met, stretch too"
    if reaches(row.value, row.goal):
        return "met"
    return f"met within {row.margin:.0%}" if met(row) else "MISSED"


def pairs(ours: Sequence[float], theirs: Iterable[float]) -> Spread:
    """Ours by theirs, round by round."""
    return spread(mine / other for mine, other in zip(ours, theirs, strict=True))


def shown(value: float, unit: str) -> str:
    """A figure with its unit, as people read it."""
    digits = 2 if abs(value) < 10 else 1
    return f"{value:.{digits}f}" if unit in ("x", "") else f"{value:.{digits}f} {unit}"


def called(row: Row) -> str:
    """What it is, and by whose figure it is judged if by anybody's, as `4: cycle / rustypot`."""
    against = "" if row.peer == "-" else f" / {row.peer}"
    return f"{row.number}: {row.measure}{against}"


def noted(*notes: str) -> str:
    """Several notes as one."""
    return "; ".join(note for note in notes if note)
