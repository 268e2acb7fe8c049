"""What a frame on the bus is, whoever listens: by its identifier, its length and its first bytes.

The identifier says which way a frame went, and to or from whom. Both formats of identifiers are taken, for a recording
does not say which one its servos speak. A frame of other traffic, or whose specifier is nobody's, is nothing.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.core.can_frame import ERROR_FLAG, CanFrame
from motorbus.core.capture import ABSENT, NOISE, NOTICE, REPLY, REQUEST
from motorbus.families.kst.wire.frames import REPLY as REPLIES
from motorbus.families.kst.wire.notices import decode_notice, decode_start
from motorbus.families.kst.wire.sdo import decode_reply, decode_request


class Said(NamedTuple):
    """The kind and the node of a frame. Its code is so much (a mask) of its first four bytes; if 0, it is `code`."""

    kind: int
    node: int
    mask: int
    code: int = 0


_NOTHING: Final = Said(NOISE, ABSENT, 0, ABSENT)
_WHOLE: Final = 0xFFFF_FFFF
_SPECIFIER: Final = 0xFF00_0000


def said(frame: CanFrame) -> Said:
    """What a frame is, by its identifier, its length and its first bytes."""
    request = decode_request(frame)
    if request is not None:
        mask = _SPECIFIER if request.kind == "segment" else _WHOLE
        return Said(REQUEST, request.node, mask) if request.kind != "unknown" else _NOTHING
    if (start := decode_start(frame)) is not None:
        return Said(REQUEST, start.node, 0)
    if (notice := decode_notice(frame)) is not None:
        base = ERROR_FLAG if frame.id & ERROR_FLAG else frame.id - notice.node
        return Said(NOTICE, notice.node, 0, base)
    node = frame.id - REPLIES
    reply = decode_reply(frame.data) if 0 < node < 128 else None
    if reply is None:
        return _NOTHING
    return Said(REPLY, node, _SPECIFIER if reply.kind == "segment" else _WHOLE)


def code_of(what: Said, data: bytes) -> int:
    """Specifier, index and sub-index as one number."""
    if not what.mask:
        return what.code
    return (data[0] << 24 | data[2] << 16 | data[1] << 8 | data[3]) & what.mask
