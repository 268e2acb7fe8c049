"""Frames of the stepper controller that are known from outside this project, kept as data in tests/vectors/stepper.

`manual` holds the 27 example frames of the manual with their replies; `further` values that no example has; `dumps`
two whole projects; `invalid` what is no frame, first of all what the manual's own annotations would make of its frames.
Below `behaviour` are streams, motions and orders of steps. They were written by a separate script that knows nothing
of motorbus.
"""

from __future__ import annotations

import json
from typing import Any

from tests.protocol.vectors import VECTORS, Vector, load

FOLDER = VECTORS / "stepper"


def behaviour(name: str) -> list[dict[str, Any]]:
    """What is no frame: streams, motion or order."""
    found: list[dict[str, Any]] = json.loads(
        (FOLDER / "behaviour" / f"{name}.json").read_text(encoding="utf-8")
    )
    return found


MANUAL = load("stepper", "manual")
DUMPS = load("stepper", "dumps")
ALL = [*MANUAL, *load("stepper", "further"), *DUMPS, *load("stepper", "invalid")]
VALID = [vector for vector in ALL if vector.valid]
INVALID = [vector for vector in ALL if not vector.valid]
REQUESTS = [vector for vector in VALID if vector.direction == "instruction"]
NOTICES = [vector for vector in VALID if "notice" in vector.expected]
REPLIES = [vector for vector in VALID if vector.direction == "status" and vector not in NOTICES]
DUMP_A, DUMP_B = (vector.data for vector in DUMPS)


def name_of(value: object) -> str:
    """How a parametrised test is called."""
    return value.id if isinstance(value, Vector) else repr(value)
