"""FEETECH packets that are known from outside this project, kept as data in tests/vectors/feetech.

`manual` holds the 23 packets the vendor's manual prints, four of them wrong; `corrected` what five of them
should have been; `further` what the manual does not show. Sums of `further` were made by a separate script.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

FOLDER = Path(__file__).parent.parent.parent / "vectors" / "feetech"


class Vector(NamedTuple):
    """One packet, which way it goes, whether it is one at all, and what its fields say."""

    id: str
    errata: str
    data: bytes
    direction: str
    valid: bool
    meaning: str
    source: str
    expected: dict[str, Any]

    @property
    def parameters(self) -> bytes:
        return bytes.fromhex(self.expected["parameters"])


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


MANUAL = load("manual")
ALL = [*MANUAL, *load("corrected"), *load("further")]
VALID = [vector for vector in ALL if vector.valid]
INVALID = [vector for vector in ALL if not vector.valid]
REPLIES = [vector for vector in VALID if vector.direction == "status"]
REQUESTS = [vector for vector in VALID if vector.direction == "instruction"]


def name_of(value: object) -> str:
    """How a parametrised test is called."""
    return value.id if isinstance(value, Vector) else repr(value)
