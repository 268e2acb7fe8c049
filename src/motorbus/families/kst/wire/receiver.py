"""What each frame on the bus is to whoever listens as the client: a reply, a notice, or neither.

One frame is one event, so nothing is ever held back. A CAN controller checks what it takes in, so a frame that makes
no sense is not a damaged one: it stands by itself and casts no doubt on others. That goes too for eight bytes under a
reply's identifier whose specifier is no reply's: if they came in place of an answer, the answer is missing, and that
is what makes the node doubtful.

An adapter that speaks text has no such check on its way to the host. One digit of a refusal, 80 that becomes 60, makes
an acknowledgement of it; but that carries nothing, so what acknowledges with the code of a refusal is no reply either.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data, Event, Noise, Reply
from motorbus.families.kst.wire.abort import ABORTS
from motorbus.families.kst.wire.frames import LENGTH, NODES, REPLY, TOGGLE
from motorbus.families.kst.wire.key import Key
from motorbus.families.kst.wire.notices import decode_notice
from motorbus.families.kst.wire.sdo import reply_kind

_KEY_KINDS: Final = tuple(reply_kind(specifier).removesuffix("-start") for specifier in range(256))
"""The kind of key for each byte 0; "" for what is no reply. An announced upload answers an upload."""
_REFUSALS: Final = frozenset(code.to_bytes(4, order) for code in ABORTS for order in ("little", "big"))
"""Bytes 4 to 7 of a refusal, also of a servo that sends its codes the wrong way round."""
STANDARD: Final = frozenset({False})


class FrameReceiver:
    """Replies, notices, and what is neither. `formats` holds the id formats expected: False 11, True 29 bits."""

    __slots__ = ("_formats",)

    def __init__(self, formats: frozenset[bool] = STANDARD) -> None:
        self._formats = formats

    @property
    def held(self) -> int:
        """A frame is an event, so nothing ever waits."""
        return 0

    def feed(self, data: Data) -> list[Event]:
        """Take one frame; give what it is. Never raises."""
        if not isinstance(data, CanFrame):
            return [Noise(data, "foreign")] if data else []
        identifier, payload, extended = data
        node = identifier - REPLY
        if len(payload) == LENGTH and 0 < node < NODES.stop and extended in self._formats:
            return [_reply(node, payload)]
        return [self._other(data)]

    def flush(self) -> list[Event]:
        """Nothing is held back."""
        return []

    def _other(self, frame: CanFrame) -> Event:
        notice = decode_notice(frame)
        if notice is not None and (frame.extended in self._formats or notice.node == 0):
            return notice
        return Noise(frame.data, "foreign")


def _reply(node: int, data: bytes) -> Event:
    specifier = data[0]
    kind = _KEY_KINDS[specifier]
    if not kind or (kind == "download" and data[4:] in _REFUSALS):
        return Noise(data, "foreign", node)
    if kind == "segment":
        return Reply(node, Key(kind, 0, 0, 1 if specifier & TOGGLE else 0), data)
    return Reply(node, Key(kind, data[1] | data[2] << 8, data[3]), data)
