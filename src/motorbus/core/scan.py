"""Parts of a scan: the rate of the bus is restored, and a rate that the adapter lacks is reported."""

from __future__ import annotations

from typing import NamedTuple

from motorbus.core.steps import Guard, SetBitrate


class Skipped(NamedTuple):
    """An event: nothing was sent at this rate (bit/s), and the reason."""

    rate: int
    why: str


class BitrateRestored(Guard):
    """The bit rate of the bus (`rate`, bit/s) is set again at the end of the block."""

    rate = 0

    async def enter(self) -> None:
        self.rate = await SetBitrate(0)

    async def leave(self, error: BaseException | None) -> None:
        await SetBitrate(self.rate)
