"""What was recorded of a FEETECH line, packet by packet: those of servos, of a host, or of both in one stream."""

from __future__ import annotations

from typing import Final

from motorbus.core.can_frame import CanFrame
from motorbus.core.capture import Captures, Run
from motorbus.core.request import Data, Noise
from motorbus.families.feetech.wire.bulk import packets, top
from motorbus.families.feetech.wire.sides import Sides
from motorbus.families.feetech.wire.stream import Stream


class Recording:
    """Packets of servos ("rx"), of a host ("tx"), or of both (""); see `core.capture.Cutter`."""

    __slots__ = ("_runs", "_stream", "tell")

    def __init__(self, way: str = "") -> None:
        self._stream: Stream[bytes] = Stream(top(way), bytes)
        self._runs = self._stream.runs
        self.tell: Final = Sides(way).tell
        """Kinds, ids and fifth bytes (instruction, or alarm bits) of the packets that were found next."""

    def feed(self, data: Data) -> list[Run]:
        """Take bytes, cut anywhere; give what is complete."""
        if isinstance(data, CanFrame):
            return [Noise(data.data, "foreign")]
        return self._runs(data)

    def flush(self) -> list[Run]:
        """Nothing more comes: give what can be made of the rest."""
        return self._stream.rest()


CAPTURES: Final = Captures(
    Recording, packets, "the fifth byte: the instruction of a request, the alarm bits of a reply"
)
