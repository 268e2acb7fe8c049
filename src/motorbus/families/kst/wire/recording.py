"""What was recorded of a CAN bus with these servos, frame by frame. Each stands by itself, whichever way it went."""

from __future__ import annotations

from typing import Final

from motorbus.core.can_frame import CanFrame
from motorbus.core.capture import NOISE, Captures, PacketFacts, Run
from motorbus.core.request import Data, Noise
from motorbus.families.kst.wire.bulk import frames_in
from motorbus.families.kst.wire.said import code_of, said


class Recording:
    """Frames of servos and hosts alike; see `core.capture.Cutter`."""

    __slots__ = ("_found",)

    def __init__(self, way: str = "") -> None:
        self._found: list[tuple[int, int, int]] = []

    def feed(self, data: Data) -> list[Run]:
        """Take one frame; give what it is."""
        if not isinstance(data, CanFrame):
            return [Noise(data, "foreign")]
        what = said(data)
        if what.kind == NOISE:
            return [Noise(data.flat(), "foreign")]
        self._found.append((what.kind, what.node, code_of(what, data.data)))
        return [[data.flat()]]

    def flush(self) -> list[Run]:
        """Nothing is held back."""
        return []

    def tell(self, packets: list[bytes]) -> PacketFacts:
        """Kinds, nodes and codes of the frames that came next."""
        found, self._found = self._found[: len(packets)], self._found[len(packets) :]
        kinds, nodes, codes = ([one[column] for one in found] for column in range(3))
        return lambda: (kinds, nodes, codes)


CAPTURES: Final = Captures(
    Recording,
    frames_in,
    "of SDO frames specifier, index and sub-index as one number of 32 bits; of others the identifier without the node",
)
