"""Scan all ids, at several bit rates, with the rate of the bus restored."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, TypeVar

from motorbus.core.family import Found, Identity
from motorbus.core.steps import Emit, Guard, Procedure, Progress, Runnable, SetBitrate
from motorbus.errors import DeviceError, LinkError, LinkLost, NoReply, WireError

T = TypeVar("T")

PASSES: Final = 2  # a silent id is pinged twice: a device may miss the first frame after power-up


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
    """Run `scan(rate)` at each of these rates, join the results and restore the rate of the bus.

    A rate that the adapter does not have is reported as `Skipped`.
    """
    found: list[T] = []
    async with BitrateRestored():
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


async def scan_ids(
    ids: Sequence[int],
    rate: int,
    ping: Callable[[int], Runnable[bool]],
    identify: Callable[[int], Runnable[Identity]],
) -> list[Found]:
    """Ping these ids one after the other and identify those that reply; a silent id is pinged in each pass.

    `rate` (bit/s) is the present one. Reports `Progress`, and `Found` at once. A device that cannot be identified, or
    whose replies are damaged (as those of two devices with one id), is found without identity.
    """

    async def find(node: int) -> Found | None:
        try:
            if not await ping(node):
                return None
        except NoReply:
            return None
        except WireError:
            pass
        try:
            return Found(node, rate, await identify(node))
        except (DeviceError, NoReply, WireError):
            return Found(node, rate, None)

    found: dict[int, Found] = {}
    for number in range(PASSES):
        for count, node in enumerate(ids, number * len(ids) + 1):
            if node not in found and (device := await find(node)):
                found[node] = device
                await Emit(device)
            await Emit(Progress(count, PASSES * len(ids), f"{rate} bit/s"))
    return [found[node] for node in ids if node in found]
