"""One frame of classic CAN, as links, buses and families hand it to each other."""

from __future__ import annotations

from enum import Enum
from typing import Final, NamedTuple

ERROR_FLAG: Final = 1 << 29
"""Set in the identifier of what is no data frame but the adapter's report of a bus error, as SocketCAN does it."""
REMOTE_FLAG: Final = 1 << 30
"""Set in the identifier of a remote frame."""


class Audience(Enum):
    """Whom a frame is for, as simulated devices see it: none of them, some of them alone, or everyone on the bus."""

    NOBODY = "nobody"
    OURS = "ours"
    EVERYONE = "everyone"


class CanFrame(NamedTuple):
    """One classic CAN frame: identifier (with the flags above), 0 to 8 data bytes, 29-bit identifier or not."""

    id: int
    data: bytes
    extended: bool = False

    def __str__(self) -> str:
        return f"{self.id:0{8 if self.extended else 3}X}#{self.data.hex().upper()}"

    def flat(self) -> bytes:
        """How a frame stands in a run of bytes: identifier (4, big-endian, top bit for 29 bits), count, data."""
        return (self.id | self.extended << 31).to_bytes(4, "big") + bytes((len(self.data),)) + self.data
