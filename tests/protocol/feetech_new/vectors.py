"""FEETECH packets that are known from outside this project, kept as data in tests/vectors/feetech.

`manual` holds the 23 packets the vendor's manual prints, four of them wrong; `corrected` what five of them
should have been; `further` what the manual does not show. Sums of `further` were made by a separate script.
"""

from __future__ import annotations

from tests.protocol.vectors import Vector, load

MANUAL = load("feetech", "manual")
ALL = [*MANUAL, *load("feetech", "corrected"), *load("feetech", "further")]
VALID = [vector for vector in ALL if vector.valid]
INVALID = [vector for vector in ALL if not vector.valid]
REPLIES = [vector for vector in VALID if vector.direction == "status"]
REQUESTS = [vector for vector in VALID if vector.direction == "instruction"]


def name_of(value: object) -> str:
    """How a parametrised test is called."""
    return value.id if isinstance(value, Vector) else repr(value)
