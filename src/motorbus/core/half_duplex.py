"""Defaults of a `BusDriver` for a half-duplex serial line: one request at a time, ten bits for each byte."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar, Final

from motorbus.core.family import BusDriver, Family, Found
from motorbus.core.request import ANY, Request, TimeoutClass
from motorbus.core.scan import scan_rates
from motorbus.core.steps import Emit, Exclusive, Progress, SetBitrate
from motorbus.errors import DeviceError, NoReply, WireError

PASSES: Final = 2  # of a scan: a device may miss the first frame after power-up
BITS: Final = 10  # bits of a byte on the wire: start, eight of data, stop


class HalfDuplexSerial(BusDriver):
    """Base of serial drivers; a subclass adds `receiver probe stop identify axis decode`, its ids and its times."""

    window = 1
    full_duplex = False
    probe_after = 128
    ids: ClassVar[Sequence[int]] = range(1, 254)  # all ids that a device can have
    delays: ClassVar[Mapping[TimeoutClass, float]] = {
        TimeoutClass.REPLY: 0.005,
        TimeoutClass.SCAN: 0.010,
        TimeoutClass.STORE: 0.100,
    }
    """Maximum s of a device between request and reply."""
    delay_per_reply: ClassVar[float] = 0.0  # maximum s added by each device that replies
    broadcast_delay: ClassVar[float] = 0.5
    """s in which all devices have replied to a request that expects `ANY`."""
    broadcast_bytes: ClassVar[int] = 1024  # bytes of all these replies
    longest_reply: ClassVar[int] = 256  # bytes
    longest_delay: ClassVar[float] = 0.040
    """s by which device, adapter and host together may delay a reply."""

    def __init__(self, family: Family) -> None:
        self.family = family

    def air_time(self, request: Request[Any], rate: int) -> float:
        replies = 0
        if request.expected is ANY:
            replies = self.broadcast_bytes
        else:
            for expected in request.expected:
                replies += expected.length
        return (len(request.wire) + replies) * BITS / rate

    def turnaround(self, request: Request[Any]) -> float:
        if request.expected is ANY:
            return self.broadcast_delay
        return self.delays[request.reply_within] + self.delay_per_reply * len(request.expected)

    def quiet_time(self, rate: int) -> float:
        return self.longest_reply * BITS / rate + self.longest_delay

    def echo_test(self) -> Request[Any] | None:
        """A probe: its echo has another length than its reply."""
        return self.probe(self.ids[0], 0)

    async def scan(self, ids: tuple[int, ...] = (), rates: tuple[int, ...] = ()) -> list[Found]:
        """Ping each id, a silent one twice; see `BusDriver.scan`. A rate that the adapter lacks is `Skipped`."""
        nodes = ids or tuple(self.ids)
        if rates:
            return await Exclusive(scan_rates(rates, partial(self._scan_ids, nodes)))
        return await self._scan_ids(nodes, await SetBitrate(0))

    async def _scan_ids(self, ids: tuple[int, ...], rate: int) -> list[Found]:
        found: dict[int, Found] = {}
        for number in range(PASSES):
            for count, node in enumerate(ids, number * len(ids) + 1):
                if node not in found and (device := await self._find(node, rate)):
                    found[node] = device
                    await Emit(device)
                await Emit(Progress(count, PASSES * len(ids), f"{rate} bit/s"))
        return [found[node] for node in ids if node in found]

    async def _find(self, node: int, rate: int) -> Found | None:
        """Ping an id; damaged replies, as those of two devices with one id, count as a device without identity."""
        try:
            if not await replace(self.probe(node, 0), reply_within=TimeoutClass.SCAN):
                return None
        except NoReply:
            return None
        except WireError:
            pass
        try:
            return Found(node, rate, await self.identify(node))
        except (DeviceError, NoReply, WireError):
            return Found(node, rate, None)
