"""Frames of the stepper controller that are known from outside this project, kept as data in tests/vectors/stepper.

`manual` holds the 27 example frames of the manual with their replies; `further` values that no example has; `dumps`
two whole projects; `invalid` what is no frame, first of all what the manual's own annotations would make of its frames.
Below `behaviour` are streams, motions and orders of steps. They were written by a separate script that knows nothing
of motorbus.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

FOLDER = Path(__file__).parent.parent.parent / "vectors" / "stepper"


class Vector(NamedTuple):
    """One frame, which way it goes, whether it is one at all, and what its fields say."""

    id: str
    errata: str
    data: bytes
    direction: str
    valid: bool
    meaning: str
    source: str
    expected: dict[str, Any]

    @property
    def command(self) -> str:
        return str(self.expected["command"])


def load(name: str) -> list[Vector]:
    """The vectors of one file."""
    rows = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    return [
        Vector(
            row["id"],
            row["errata"],
            bytes.fromhex(row["hex"]),
            row["direction"],
            row["verdict"] == "valid",
            row["meaning"],
            row["source"],
            row["expected"],
        )
        for row in rows
    ]


def behaviour(name: str) -> list[dict[str, Any]]:
    """What is no frame: streams, motion or order."""
    found: list[dict[str, Any]] = json.loads(
        (FOLDER / "behaviour" / f"{name}.json").read_text(encoding="utf-8")
    )
    return found


MANUAL = load("manual")
DUMPS = load("dumps")
ALL = [*MANUAL, *load("further"), *DUMPS, *load("invalid")]
VALID = [vector for vector in ALL if vector.valid]
INVALID = [vector for vector in ALL if not vector.valid]
REQUESTS = [vector for vector in VALID if vector.direction == "instruction"]
NOTICES = [vector for vector in VALID if "notice" in vector.expected]
REPLIES = [vector for vector in VALID if vector.direction == "status" and vector not in NOTICES]
DUMP_A, DUMP_B = (vector.data for vector in DUMPS)


def name_of(value: object) -> str:
    """How a parametrised test is called."""
    return value.id if isinstance(value, Vector) else repr(value)
