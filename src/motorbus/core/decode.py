"""Text for frames, field by field."""

from __future__ import annotations

from motorbus.core.family import Part


class Fields:
    """The parts of one frame in order. Each call consumes bytes, so the parts cover the frame."""

    def __init__(self, data: bytes) -> None:
        self.parts: list[Part] = []
        self._data = data
        self._start = 0

    @property
    def rest(self) -> bytes:
        """The bytes that no part covers yet."""
        return self._data[self._start :]

    def take(self, size: int, name: str, meaning: str) -> None:
        """Add a part of so many bytes; none for 0 bytes."""
        data = self._data[self._start : self._start + size]
        if data:
            self.parts.append(Part(self._start, data, name, meaning))
            self._start += len(data)

    def take_rest(self, name: str, meaning: str) -> None:
        """Add a part of all remaining bytes, if there are any."""
        self.take(len(self.rest), name, meaning)

    def take_reserved(self) -> None:
        """Add the remaining bytes as reserved, if there are any."""
        self.take_rest("reserved", "ignored, though not 0" if any(self.rest) else "0")


def counted(count: int, what: str = "byte") -> str:
    """`1 byte`, `2 bytes`."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"
