"""How a frame is written for people: bytes in hexadecimal, a CAN frame as candump writes it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame

if TYPE_CHECKING:
    from motorbus.core.family import Family

_HEAD: Final = 5
"""Bytes before the data of a CAN frame that stands in a run of bytes; see `CanFrame.flat()`."""
_EXTENDED: Final = 1 << 31


def can_frame(data: bytes) -> CanFrame | None:
    """The one CAN frame that these bytes are, or None when they are not exactly one."""
    if len(data) < _HEAD or len(data) != _HEAD + data[4]:
        return None
    head = int.from_bytes(data[:4], "big")
    return CanFrame(head & ~_EXTENDED, data[_HEAD:], bool(head & _EXTENDED))


def written(frame: CanFrame) -> str:
    """625#2203600084030000; 8 digits for a 29-bit identifier, #R for a remote frame."""
    identifier, width = frame.id & ~REMOTE_FLAG, 8 if frame.extended or frame.id & ERROR_FLAG else 3
    return f"{identifier:0{width}X}#{'R' if frame.id & REMOTE_FLAG else frame.data.hex().upper()}"


def shown(data: bytes, family: Family) -> str:
    """These bytes as people of this family write them."""
    frame = can_frame(data) if family.link.kind == "frames" else None
    return written(frame) if frame else data.hex(" ").upper()


def facts(data: bytes, family: Family) -> dict[str, str]:
    """The same as plain data: the bytes, and for CAN the frame."""
    frame = can_frame(data) if family.link.kind == "frames" else None
    return {"data": data.hex(" ").upper(), **({"frame": written(frame)} if frame else {})}
