"""What a family provides for recordings of its bus, which may hold both directions."""

from __future__ import annotations

from typing import Final, NamedTuple, Protocol, TypeAlias

from motorbus.core.request import Data, Noise

ABSENT: Final = -1  # node or code of a packet that has none


class RecordedFrame(NamedTuple):
    """One valid frame of a recording."""

    data: bytes  # the whole frame; a CAN frame as `CanFrame.flat()` serializes it
    kind: str  # "request", "reply", "notice" (unsolicited), or "either": a repeated request, its echo or a reply
    node: int  # sender or receiver; `ABSENT` if the frame does not contain it
    code: int  # content as a number of the family; `ABSENT` if the family has none


RecordedEvent: TypeAlias = RecordedFrame | Noise


class RecordingReceiver(Protocol):
    """Parses recorded data of one direction. The result does not depend on the boundaries between chunks."""

    def feed(self, data: Data, /) -> list[RecordedEvent]:
        """Take a chunk of bytes, or one CAN frame; return the events that are complete. Never raises."""

    def flush(self) -> list[RecordedEvent]:
        """End of data: return the frames in the held bytes, and the remainder as noise."""
