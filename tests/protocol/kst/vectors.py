"""KST frames that are known from outside this project, kept as data in tests/vectors/kst.

`manual` holds what the KST CAN protocol manual prints, a frame for each number it lets one choose; `further` what
CiA 301 and public drivers add; `unasked` reports, alarms and what starts them; `invalid` frames that are none. They
were written by a separate script that knows nothing of motorbus.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

from motorbus.core.can_frame import CanFrame

FOLDER = Path(__file__).parent.parent.parent / "vectors" / "kst"


class Vector(NamedTuple):
    """One frame, which way it goes, whether it is one of this protocol at all, and what its fields say."""

    id: str
    errata: str
    frame: CanFrame
    direction: str
    valid: bool
    meaning: str
    source: str
    expected: dict[str, Any]

    @property
    def kind(self) -> str:
        return str(self.expected["kind"])

    @property
    def payload(self) -> bytes:
        return bytes.fromhex(self.expected["data"])

    @property
    def object(self) -> tuple[int, int]:
        return int(self.expected["index"], 16), int(self.expected["subindex"])


def load(name: str) -> list[Vector]:
    """The vectors of one file."""
    rows = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    return [
        Vector(
            row["id"],
            row["errata"],
            _frame(row),
            row["direction"],
            row["verdict"] == "valid",
            row["meaning"],
            row["source"],
            row["expected"],
        )
        for row in rows
    ]


def _frame(row: dict[str, Any]) -> CanFrame:
    identifier = int(row["can_id"], 16)
    return CanFrame(identifier, bytes.fromhex(row["hex"]), identifier > 0x7FF)


MANUAL = load("manual")
UNASKED = load("unasked")
ALL = [*MANUAL, *load("further"), *UNASKED, *load("invalid")]
VALID = [vector for vector in ALL if vector.valid]
INVALID = [vector for vector in ALL if not vector.valid]
NOTICES = [vector for vector in UNASKED if vector.direction == "status"]
STARTS = [vector for vector in UNASKED if vector.direction == "instruction"]
REPLIES = [vector for vector in VALID if vector.direction == "status" and vector not in NOTICES]
REQUESTS = [vector for vector in VALID if vector.direction == "instruction" and vector not in STARTS]


def name_of(value: object) -> str:
    """How a parametrised test is called."""
    return value.id if isinstance(value, Vector) else repr(value)
