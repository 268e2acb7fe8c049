"""CAN adapters with a text protocol, over our own serial and TCP links."""

from __future__ import annotations

import time
from re import Match, Pattern

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.link.errors import full
from motorbus.link.serial import ByteLink

LONGEST = 512  # bytes kept of a line without end; the longest line has fewer than 60


class TextCodec:
    """A text protocol. Subclasses encode frames and decode lines; nothing that arrives raises an error.

    `line` matches one whole line; `cancel` makes an unfinished line invalid. The codec counts `damaged` lines and
    frames or commands that the adapter `refused`.
    """

    line: Pattern[bytes]
    cancel: bytes

    def __init__(self) -> None:
        self.damaged = 0
        self.refused = 0
        self._rest = b""

    def encode(self, frame: CanFrame) -> bytes:
        """The text that sends this frame."""
        raise NotImplementedError

    def decode(self, line: Match[bytes]) -> CanFrame | None:
        """The frame of a line; None for a reply or a damaged line."""
        raise NotImplementedError

    def feed(self, data: bytes) -> list[CanFrame]:
        """The frames that these bytes of the adapter complete, cut anywhere."""
        text = self._rest + data
        frames = []
        end = 0
        for line in self.line.finditer(text):
            end = line.end()
            frame = self.decode(line)
            if frame is not None:
                frames.append(frame)
        self._rest = text[end:]
        if len(self._rest) > LONGEST:
            self._rest = b""
            self.damaged += 1
        return frames


class TextChannel:
    """An open adapter that speaks a text protocol."""

    def __init__(self, name: str, link: ByteLink, codec: TextCodec) -> None:
        self.name = name
        self.latency = link.latency
        self.warnings = link.warnings
        self._link = link
        self._codec = codec
        self._reported = 0, 0
        self._unfinished = False
        """A line was sent in part. It must not become a frame later, so `cancel` is sent after it."""

    def configure(self, rate: int, listen_only: bool) -> None:
        """Set up the adapter again, at this rate in bit/s. Raises LinkError when it refuses."""

    def read(self, until: float) -> list[Data]:
        frames: list[Data] = []
        while not frames:
            for data in self._link.read(until):
                assert isinstance(data, bytes)
                frames += self._codec.feed(data)
            if time.monotonic() >= until:
                break
        return frames

    def write(self, frame: CanFrame) -> None:
        self.send(self._codec.encode(frame))

    def send(self, text: bytes) -> None:
        """Send a whole line. Raises LinkLost, or LinkFull: a line that was sent in part is no frame."""
        cancel = self._codec.cancel
        if self._unfinished and self._link.send(cancel) == len(cancel):
            self._unfinished = False
        written = 0 if self._unfinished else self._link.send(text)
        if written != len(text):
            self._unfinished = self._unfinished or written > 0
            raise full(self.name, 0, len(text))

    def trouble(self) -> str:
        """What the adapter has reported since the last call; "" for nothing."""
        refused, damaged = self._codec.refused, self._codec.damaged
        before, self._reported = self._reported, (refused, damaged)
        if refused > before[0]:
            return (
                f"the adapter refused {refused - before[0]} frames: no node on the bus acknowledges them, the bit rate "
                "is another, or its buffer is full"
            )
        if damaged > before[1]:
            return f"{damaged - before[1]} lines of the adapter were damaged: its cable, or another program on its port"
        return ""

    def fileno(self) -> int | None:
        return self._link.fileno()

    def close(self) -> None:
        self._link.close()
