"""Decoder of recorded frames: kind, node and code of each frame, whichever direction it had."""

from __future__ import annotations

from typing import Final

from motorbus.core.can_frame import ERROR_FLAG, CanFrame
from motorbus.core.capture import ABSENT, NOISE, NOTICE, REPLY, REQUEST, Captures, PacketFacts, Run
from motorbus.core.request import Data, Noise
from motorbus.families.kst import sdo
from motorbus.families.kst.notifications import decode_notification, decode_start


class Recording:
    """Frames of servos and hosts; see `core.capture.Cutter`."""

    __slots__ = ("_found",)

    def __init__(self, way: str = "") -> None:
        self._found: list[tuple[int, int, int]] = []

    def feed(self, data: Data) -> list[Run]:
        """Take one frame; return it, or noise."""
        if not isinstance(data, CanFrame):
            return [Noise(data, "foreign")]
        kind, node, code = classify(data)
        if kind == NOISE:
            return [Noise(data.flat(), "foreign")]
        self._found.append((kind, node, code))
        return [[data.flat()]]

    def flush(self) -> list[Run]:
        """Nothing is held."""
        return []

    def tell(self, packets: list[bytes]) -> PacketFacts:
        """Kinds, nodes and codes of the next frames."""
        found, self._found = self._found[: len(packets)], self._found[len(packets) :]
        kinds, nodes, codes = ([one[column] for one in found] for column in range(3))
        return lambda: (kinds, nodes, codes)


def classify(frame: CanFrame) -> tuple[int, int, int]:
    """Kind, node and code of a frame, in either identifier format; NOISE for other traffic."""
    request = sdo.decode_request(frame)
    if request is not None:
        code = _code(frame.data, request.kind)
        return (NOISE, ABSENT, ABSENT) if request.kind == "unknown" else (REQUEST, request.node, code)
    if (start := decode_start(frame)) is not None:
        return REQUEST, start.node, 0
    if (notification := decode_notification(frame)) is not None:
        base = ERROR_FLAG if frame.id & ERROR_FLAG else frame.id - notification.node
        return NOTICE, notification.node, base
    node = frame.id - sdo.REPLY
    reply = sdo.decode_reply(frame.data) if node in sdo.NODES else None
    return (NOISE, ABSENT, ABSENT) if reply is None else (REPLY, node, _code(frame.data, reply.kind))


def _code(data: bytes, kind: str) -> int:
    """Specifier, index and sub-index as one number; of a segment the specifier alone."""
    head = data[0] << 24
    return head if kind == "segment" else head | data[2] << 16 | data[1] << 8 | data[3]


CAPTURES: Final = Captures(
    Recording,
    None,
    "of SDO frames specifier, index and sub-index as one number of 32 bits; of others the identifier without the node",
)
