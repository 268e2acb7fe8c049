"""A classic CAN frame, as links, buses and families exchange it."""

from __future__ import annotations

from enum import Enum
from typing import Final, NamedTuple

ERROR_FLAG: Final = 1 << 29
"""Set in the identifier of an adapter's report of a bus error, as in SocketCAN; such a frame is no data frame."""
REMOTE_FLAG: Final = 1 << 30  # set in the identifier of a remote frame


class Audience(Enum):
    """Receivers of a frame, seen from the simulated devices: none of them, only they, or all nodes of the bus."""

    NONE = "none"
    OURS = "ours"
    EVERYONE = "everyone"


class CanFrame(NamedTuple):
    """A classic CAN frame: identifier (with the flags above), 0 to 8 data bytes, 29-bit identifier or not."""

    id: int
    data: bytes
    extended: bool = False

    def __str__(self) -> str:
        return f"{self.id:0{8 if self.extended else 3}X}#{self.data.hex().upper()}"

    def flat(self) -> bytes:
        """Serialize as identifier (4 bytes, big-endian, top bit set for 29 bits), data length (1 byte), data."""
        return (self.id | self.extended << 31).to_bytes(4, "big") + bytes((len(self.data),)) + self.data
