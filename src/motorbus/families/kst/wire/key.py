"""What a reply has in common with its request, so that no reply is taken for the answer to something else.

The identifier tells the node (the lane); kind, index and sub-index must agree besides. A client that looks at the
specifier alone takes the acknowledgement of one write for that of another.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.request import Expected
from motorbus.families.kst.wire.frames import LENGTH, Multiplexer


class Key:
    """An upload or a download of one object, a segment with one toggle, or an abort of any of them.

    An abort does not say what it refuses, so it equals several requests: those of its index and sub-index; those of
    its index, whatever their sub-index, if it says sub-index 0 (the manual: "index as in the request", not a word on
    the sub-index); all, if it says 0:0; and every segment, since a segment names no object. Therefore equality is
    symmetric but not transitive, and the hash is one for all: a dictionary must get as far as comparing. No other two
    different keys are equal.
    """

    __slots__ = ("index", "kind", "subindex", "toggle")

    def __init__(self, kind: str, index: int = 0, subindex: int = 0, toggle: int = 0) -> None:
        self.kind: Final = kind
        self.index: Final = index
        self.subindex: Final = subindex
        self.toggle: Final = toggle

    @property
    def multiplexer(self) -> Multiplexer:
        """The object; 0:0 for a segment."""
        return Multiplexer(self.index, self.subindex)

    def __hash__(self) -> int:
        return 0x580

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Key):
            return NotImplemented
        if self.kind == other.kind:
            return (
                self.index == other.index and self.subindex == other.subindex and self.toggle == other.toggle
            )
        if self.kind == "abort":
            return _refuses(self, other)
        return other.kind == "abort" and _refuses(other, self)

    def __repr__(self) -> str:
        if self.kind == "segment":
            return f"<Key segment {self.toggle}>"
        return f"<Key {self.kind} 0x{self.index:04X}:{self.subindex}>"


def _refuses(abort: Key, request: Key) -> bool:
    """Can this abort be the answer to that request?"""
    if request.kind == "segment" or (abort.index, abort.subindex) == (0, 0):
        return True
    return abort.index == request.index and abort.subindex in (0, request.subindex)


def upload_due(node: int, index: int, subindex: int = 0) -> Expected:
    """The reply to `encode_upload`."""
    return Expected(node, Key("upload", index, subindex), LENGTH)


def download_due(node: int, index: int, subindex: int = 0) -> Expected:
    """The reply to `encode_download`."""
    return Expected(node, Key("download", index, subindex), LENGTH)


def segment_due(node: int, toggle: int) -> Expected:
    """The reply to `encode_segment`."""
    return Expected(node, Key("segment", toggle=int(toggle)), LENGTH)
