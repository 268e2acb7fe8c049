"""Frames of the stepper controller from outside this project, as data in tests/vectors/stepper.

`manual` holds the 27 example frames and their replies, `further` values that no example has, `dumps` two
projects, `invalid` what is no frame. `behaviour` has streams, motions and orders of steps. A separate script
that knows nothing of motorbus has written them.
"""

from __future__ import annotations

import json
from typing import Any

from tests.protocol.vectors import VECTORS, Vector, load


def behaviour(name: str) -> list[dict[str, Any]]:
    """Streams, motion or order."""
    path = VECTORS / "stepper" / "behaviour" / f"{name}.json"
    found: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))
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
    """The name of a parametrised test."""
    return value.id if isinstance(value, Vector) else repr(value)
