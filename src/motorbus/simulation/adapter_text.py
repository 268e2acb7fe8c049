"""The text between a CAN adapter and its host, when something lies between them that does harm.

Nothing protects it: a frame has its check sum on the wire, and none from the adapter on. One command is one exchange,
and one line of text, either way, is one packet. Time does not pass here; whatever arrives does so at once.
"""

from __future__ import annotations

import re
from typing import Final

from motorbus.link.base import Line, Side

_LINES: Final = re.compile(rb"[^\r\a>]*[\r\a>]|[^\r\a>]+")
_ENDS: Final = (b"\r", b"\a", b">")
LONGEST: Final = 256
"""Bytes without an end that are kept to be a command; more are no command of any adapter."""


class Text:
    """What becomes of the text of one host and its adapter. `half` is what has come of a command so far."""

    def __init__(self, line: Line, half: bytes = b"") -> None:
        self._line = line
        self.half = half

    def said(self, data: bytes, at: float) -> bytes:
        """What reaches the adapter of this; half a command waits for its other half."""
        lines = _LINES.findall(self.half + data)
        self.half = b""
        if lines and not lines[-1].endswith(_ENDS) and len(lines[-1]) < LONGEST:
            self.half = lines.pop()
        return b"".join(self._carried(Side.HOST, line, at) for line in lines)

    def answered(self, data: bytes, at: float) -> bytes:
        """What reaches the host of this."""
        return b"".join(self._carried(Side.DEVICE, line, at) for line in _LINES.findall(data))

    def _carried(self, sender: Side, line: bytes, at: float) -> bytes:
        arrived = self._line.carry(sender, line, at)
        return b"".join(one.data for one in arrived if isinstance(one.data, bytes))
