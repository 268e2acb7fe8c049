"""Find frames in a stream of bytes: a header, a length, a checksum."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Final

from motorbus.core.request import Data, Event, Noise, Reply

LONGEST: Final = 4096  # bytes of a frame


class FrameParser:
    """Splits a stream into frames and noise; every byte is in exactly one of them, in order.

    `headers`  the bytes with which a frame begins, one of several
    `length`   bytes of a whole frame (at most `LONGEST`) by its first bytes; None: more are needed; 0: it is no frame
    `is_valid` whether the checksum of a whole frame is correct
    """

    def __init__(
        self,
        headers: tuple[bytes, ...],
        length: Callable[[bytes], int | None],
        is_valid: Callable[[bytes], bool],
    ) -> None:
        self._headers: Final = headers
        self._first_byte: Final = re.compile(b"|".join(re.escape(header[:1]) for header in headers))
        self._length: Final = length
        self._is_valid: Final = is_valid
        self._buffer = b""
        self._damaged = 0  # bytes of the buffer that are part of a frame with a wrong checksum

    @property
    def held(self) -> int:
        """Number of bytes of an incomplete frame."""
        return len(self._buffer)

    def feed(self, data: bytes, *, end: bool = False) -> list[tuple[bytes, str]]:
        """Take bytes; return frames with "", and noise with its fault, "checksum" or "framing".

        "checksum" are the bytes of a whole frame with a wrong checksum, however the stream was cut. `end`: no more
        bytes follow, so an incomplete frame is noise.
        """
        found: list[tuple[bytes, str]] = []
        buffer, start, noise = self._buffer + data, 0, 0
        while start < len(buffer):
            size: int | None = 0
            if buffer.startswith(self._headers, start):
                size = self._length(buffer[start : start + LONGEST])
            elif any(header.startswith(buffer[start : start + len(header)]) for header in self._headers):
                size = None
            if (size is None or size > len(buffer) - start) and not end:
                break
            frame = buffer[start : start + size] if size and size <= len(buffer) - start else b""
            if frame and self._is_valid(frame):
                self._add_noise(found, buffer, noise, start)
                found.append((frame, ""))
                start = noise = self._damaged = start + len(frame)
                continue
            if frame:
                if start >= self._damaged:
                    self._add_noise(found, buffer, noise, start)
                    noise = start
                self._damaged = max(self._damaged, start + len(frame))
            next_start = self._first_byte.search(buffer, start + 1)
            start = next_start.start() if next_start else len(buffer)
        self._add_noise(found, buffer, noise, start)
        self._buffer = buffer[start:]
        self._damaged = max(0, self._damaged - start)
        return found

    def _add_noise(self, found: list[tuple[bytes, str]], buffer: bytes, start: int, end: int) -> None:
        damaged = max(start, min(end, self._damaged))
        if start < damaged:
            found.append((buffer[start:damaged], "checksum"))
        if damaged < end:
            found.append((buffer[damaged:end], "framing"))


class FrameReceiver:
    """A `core.family.Receiver` of replies on a line with one lane; `key` identifies the reply by its frame."""

    def __init__(self, parser: FrameParser, key: Callable[[bytes], int]) -> None:
        self._parser: Final = parser
        self._key: Final = key

    @property
    def held(self) -> int:
        return self._parser.held

    def feed(self, data: Data) -> list[Event]:
        if not isinstance(data, bytes):
            return [Noise(data.data, "foreign")]
        return self._events(self._parser.feed(data))

    def flush(self) -> list[Event]:
        return self._events(self._parser.feed(b"", end=True))

    def _events(self, found: list[tuple[bytes, str]]) -> list[Event]:
        return [Noise(data, fault) if fault else Reply(0, self._key(data), data) for data, fault in found]
