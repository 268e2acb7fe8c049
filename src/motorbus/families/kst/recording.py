"""Decoder of recorded frames: kind, node and code of each frame, whichever direction it had."""

from __future__ import annotations

from typing import Any, Final

from motorbus.core.can_frame import ERROR_FLAG, CanFrame
from motorbus.core.recording import RecordedEvent, RecordedFrame
from motorbus.core.request import Noise
from motorbus.families.kst import sdo
from motorbus.families.kst.notifications import decode_notification, decode_start


class Recording:
    """Frames of servos and hosts; see `core.recording.RecordingReceiver`. The identifier gives the direction."""

    code_meaning: Final = (
        "of SDO frames specifier, index and sub-index as one number of 32 bits; of others the identifier without the "
        "node"
    )

    def __init__(self, direction: str = "") -> None: ...

    def feed(self, frame: Any) -> list[RecordedEvent]:
        """Take one CAN frame; return it, or noise."""
        return [classify(frame)]

    def flush(self) -> list[RecordedEvent]:
        """Nothing is held."""
        return []


def classify(frame: CanFrame) -> RecordedEvent:
    """Kind, node and code of a frame, in either identifier format; noise for other traffic."""
    data = frame.flat()
    request = sdo.decode_request(frame)
    if request is not None:
        if request.kind == "unknown":
            return Noise(data, "foreign")
        return RecordedFrame(data, "request", request.node, _code(frame.data))
    if (start := decode_start(frame)) is not None:
        return RecordedFrame(data, "request", start.node, 0)
    if (notification := decode_notification(frame)) is not None:
        base = ERROR_FLAG if frame.id & ERROR_FLAG else frame.id - notification.node
        return RecordedFrame(data, "notice", notification.node, base)
    node = frame.id - sdo.REPLY
    reply = sdo.decode_reply(frame.data) if node in sdo.NODES else None
    if reply is None:
        return Noise(data, "foreign")
    return RecordedFrame(data, "reply", node, _code(frame.data))


def _code(data: bytes) -> int:
    """Specifier, index and sub-index as one number."""
    return data[0] << 24 | data[2] << 16 | data[1] << 8 | data[3]
