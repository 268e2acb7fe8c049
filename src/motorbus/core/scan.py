"""Scan at several bit rates, with the rate of the bus restored."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

from motorbus.core.steps import Emit, Guard, Procedure, SetBitrate
from motorbus.errors import LinkError, LinkLost

T = TypeVar("T")


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


async def scan_rates(rates: Sequence[int], scan: Callable[[int], Procedure[list[T]]]) -> list[T]:
    """Run `scan(rate)` at each of these rates, and join the results. Run it in a `BitrateRestored`.

    A rate that the adapter does not have is reported as `Skipped`.
    """
    found: list[T] = []
    for rate in rates:
        try:
            await SetBitrate(rate)
        except LinkLost:
            raise
        except LinkError as error:
            await Emit(Skipped(rate, error.summary))
            continue
        found += await scan(rate)
    return found
