"""Packets that are known from outside this project, kept as data in tests/vectors, one folder a family."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

VECTORS = Path(__file__).parents[1] / "vectors"


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
        """Of a FEETECH packet."""
        return bytes.fromhex(self.expected["parameters"])

    @property
    def command(self) -> str:
        """Of the stepper controller."""
        return str(self.expected["command"])


def load(family: str, name: str) -> list[Vector]:
    """The vectors of one file."""
    rows = json.loads((VECTORS / family / f"{name}.json").read_text(encoding="utf-8"))
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
