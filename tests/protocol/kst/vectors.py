"""KST frames that are known from outside this project, the data of tests/vectors/kst.

`manual` has what the KST CAN protocol manual prints, `further` what CiA 301 and public drivers add, `unasked` frames
that servos send unsolicited and the frames that start them, `invalid` frames of no protocol. A script that does not
use motorbus wrote them.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

from hypothesis import strategies as st

from motorbus.core.can_frame import CanFrame
from motorbus.families.kst import sdo

FOLDER = Path(__file__).parents[2] / "vectors" / "kst"


class Vector(NamedTuple):
    """One frame, its direction, whether it is a frame of this protocol, and its fields."""

    id: str
    errata: str
    frame: CanFrame
    direction: str
    valid: bool
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
        """Index and sub-index."""
        return int(self.expected["index"], 16), int(self.expected["subindex"])


def load(name: str) -> list[Vector]:
    """The vectors of one file."""
    found = []
    for row in json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8")):
        identifier = int(row["can_id"], 16)
        frame = CanFrame(identifier, bytes.fromhex(row["hex"]), identifier > 0x7FF)
        valid = row["verdict"] == "valid"
        found.append(
            Vector(row["id"], row["errata"], frame, row["direction"], valid, row["source"], row["expected"])
        )
    return found


MANUAL = load("manual")
UNASKED = load("unasked")
ALL = [*MANUAL, *load("further"), *UNASKED, *load("invalid")]
VALID = [vector for vector in ALL if vector.valid]
INVALID = [vector for vector in ALL if not vector.valid]
NOTIFICATIONS = [vector for vector in UNASKED if vector.direction == "status"]
STARTS = [vector for vector in UNASKED if vector.direction == "instruction"]
REPLIES = [vector for vector in VALID if vector.direction == "status" and vector not in NOTIFICATIONS]
REQUESTS = [vector for vector in VALID if vector.direction == "instruction" and vector not in STARTS]

NODES = st.sampled_from(sdo.NODES)
FRAMES = st.builds(
    CanFrame,
    st.one_of(st.integers(0, 0x7FF), st.integers(0, 0xFFFF_FFFF)),
    st.binary(max_size=9),
    st.booleans(),
) | st.builds(
    CanFrame,
    st.sampled_from([0x000, 0x005, 0x585, 0x600, 0x625, 0x705]),
    st.binary(min_size=8, max_size=8),
)
"""Any frame, also an impossible one, often one of this protocol."""
