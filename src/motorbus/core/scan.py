"""Parts of a scan: the rate of the bus is restored, and a rate that the adapter lacks is reported."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

from motorbus.core.family import Found
from motorbus.core.steps import Emit, Guard, Procedure, SetBitrate
from motorbus.errors import LinkError, LinkLost


class Skipped(NamedTuple):
    """An event: nothing was sent at this rate (bit/s), and the reason."""

    rate: int
    why: str


class BitrateRestored(Guard):
    """The present bit rate of the bus (`rate`) is set again at the end of the block, which has its rate or this one.

    Reserve the bus.
    """

    rate = 0

    def __init__(self, in_block: int = 0) -> None:
        self._in_block = in_block

    async def enter(self) -> None:
        self.rate = await SetBitrate(0)
        if self._in_block:
            await SetBitrate(self._in_block)

    async def leave(self, error: BaseException | None) -> None:
        await SetBitrate(self.rate)


async def set_or_skip(rate: int) -> bool:
    """Set this bit rate. If the adapter lacks it, report it as `Skipped` and return False. Raises LinkLost."""
    try:
        await SetBitrate(rate)
    except LinkLost:
        raise
    except LinkError as error:
        await Emit(Skipped(rate, error.summary))
        return False
    return True


async def scan_rates(rates: Iterable[int], scan_at: Callable[[int], Procedure[list[Found]]]) -> list[Found]:
    """What `scan_at` finds at each of these bit rates; the present one is restored. Reserve the bus."""
    found = []
    async with BitrateRestored():
        for rate in rates:
            if await set_or_skip(rate):
                found += await scan_at(rate)
    return found
