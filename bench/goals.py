"""The table of goals: every row that was measured, what it was to be, and whether it is."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from types import ModuleType

from bench import rows as package
from bench.reasons import reason
from bench.row import Row, Say, called, met, shown, verdict

COLUMNS = ("measure", "against", "goal, stretch", "figure, min – max", "", "ours / theirs")
SHORT = 1e-2
Measure = Callable[[int, Say], list[Row]]


def modules() -> Iterator[ModuleType]:
    """Whatever lies in `bench/rows`."""
    for found in pkgutil.iter_modules(package.__path__):
        yield importlib.import_module(f"{package.__name__}.{found.name}")


def wanted(module: ModuleType, numbers: Sequence[str]) -> bool:
    """Whether one of these rows is measured there; no number asks for all.

    A module may tell its rows by NUMBERS; one that does not is measured to find out.
    """
    told: Sequence[str] = getattr(module, "NUMBERS", numbers)
    return not numbers or bool(set(numbers) & set(told))


def measured(
    rounds: int, say: Say, numbers: Sequence[str] = (), every: Sequence[ModuleType] | None = None
) -> tuple[list[Row], list[str]]:
    """The rows asked for in their order, and what could not be measured, in words."""
    found: list[Row] = []
    failures: list[str] = []
    for module in modules() if every is None else every:
        if wanted(module, numbers):
            try:
                found += module.rows(rounds, say)
            except Exception as failure:  # whatever it is, it is told, and the other rows are worth having
                said = str(failure).splitlines() or [type(failure).__name__]
                failures.append(f"{module.__name__}: {said[-1]}")
    asked = [row for row in found if not numbers or row.number in numbers]
    return sorted(asked, key=_place), failures


def _place(row: Row) -> tuple[int, str]:
    return (int(row.number), "") if row.number.isdigit() else (99, row.number)


def cells(row: Row) -> tuple[str, ...]:
    """One row of the table."""
    return (
        f"{row.number}: {row.measure}",
        row.peer,
        ", ".join(one for one in (row.goal, row.stretch) if one),
        f"{shown(row.value, row.unit)}, {row.least:.2f} – {row.greatest:.2f}",
        verdict(row),
        _seconds(row),
    )


def reasons(rows: Sequence[Row]) -> list[str]:
    """Why rows miss; it is too long for the table."""
    return _said((row, reason(row)) for row in rows if row.goal and not met(row))


def notes(rows: Sequence[Row]) -> list[str]:
    """What was measured besides, and belongs to a row."""
    return _said((row, row.note) for row in rows)


def _said(texts: Iterable[tuple[Row, str]]) -> list[str]:
    """Each text behind the rows that it is about; what is the same of several is said once."""
    about: dict[str, list[str]] = {}
    for row, text in texts:
        if text:
            about.setdefault(text, []).append(f"**{called(row)}**")
    return [f"{'; '.join(names)}: {text}." for text, names in about.items()]


def _seconds(row: Row) -> str:
    if row.ours is None or row.theirs is None:
        return ""
    unit, factor = ("µs", 1e6) if max(row.ours, row.theirs) < SHORT else ("ms", 1e3)
    return f"{row.ours * factor:.1f} / {row.theirs * factor:.1f} {unit}"


def summary(rows: Sequence[Row]) -> str:
    """How many are met, in one sentence; a row without a goal is only told."""
    judged = [row for row in rows if row.goal]
    missed = [row for row in judged if not met(row)]
    told = ", ".join(dict.fromkeys(row.number for row in missed))
    return f"{len(judged) - len(missed)} of {len(judged)} goals are met." + (
        f" Missed in rows: {told}." if told else ""
    )
