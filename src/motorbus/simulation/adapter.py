"""The adapter's side of a protocol that carries CAN frames over bytes."""

from __future__ import annotations

from typing import Protocol

from motorbus.core.can_frame import CanFrame


class Adapter(Protocol):
    """The adapter's side of a protocol that carries CAN frames over bytes (slcan), for simulated buses.

    It does no I/O and has no clock. Nothing that a host sends makes it raise, or keep more than a few KiB.

    `open`         the host has opened the channel: frames pass
    `listen_only`  the host gets frames and may send none
    `bitrate`      bit/s that the host has set; None when it did not, or cannot with this protocol
    """

    open: bool
    listen_only: bool
    bitrate: int | None

    def feed(self, data: bytes, at: float = 0.0) -> list[CanFrame]:
        """Bytes of the host, cut anywhere, at this moment (s): the frames that it sends with them."""

    def take(self) -> bytes:
        """What is to be answered to the bytes that were fed."""

    def deliver(self, frame: CanFrame, at: float) -> bytes:
        """A frame of the bus, seen at this moment (s), as the host gets it; b"" when it does not."""
