"""The device's ear: requests out of bytes, with what a device can know, which is header, checksum and pauses.

After something that is no request it looks on byte by byte for the next header, and it forgets a beginning whose rest
does not come: both are assumptions, the manual says nothing of either.
"""

from __future__ import annotations

from typing import NamedTuple

from motorbus.families.stepper import wire


class Heard(NamedTuple):
    """Whole requests, and how many others were given up for their checksum."""

    requests: list[bytes]
    bad: int


class Ear:
    """Takes bytes with their moments (s); `gap` s of silence end what has begun."""

    def __init__(self, gap: float) -> None:
        self._gap = gap
        self._rest = b""
        self._last = 0.0

    def feed(self, data: bytes, at: float) -> Heard:
        """These bytes came now."""
        if at - self._last > self._gap:
            self._rest = b""
        self._last = at
        rest, found, bad = self._rest + data, [], 0
        while (start := _header(rest)) is not None:
            rest = rest[start:]
            if len(rest) < wire.REQUEST_LENGTH:
                break
            request = rest[: wire.REQUEST_LENGTH]
            if wire.is_sound(request):
                found.append(request)
                rest = rest[wire.REQUEST_LENGTH :]
            else:
                bad += 1
                rest = rest[1:]
        self._rest = rest[-(wire.REQUEST_LENGTH - 1) :] if _header(rest) is not None else b""
        return Heard(found, bad)

    def forget(self) -> None:
        """The supply was away."""
        self._rest = b""


def _header(data: bytes) -> int | None:
    """Where a request may begin: at FF AA, or at an FF that is the last byte."""
    start = data.find(wire.HEADER)
    if start >= 0:
        return start
    return len(data) - 1 if data.endswith(wire.HEADER[:1]) else None
