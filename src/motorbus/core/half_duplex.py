"""Defaults of a `BusDriver` for a half-duplex serial line: one request at a time, ten bits for each byte."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Final

from motorbus.core.family import BusDriver, Family, Found
from motorbus.core.request import ANY, Request, TimeoutClass
from motorbus.core.scan import scan_ids, scan_rates
from motorbus.core.steps import Exclusive, Procedure, SetBitrate

BITS: Final = 10  # bits of a byte on the wire: start, eight of data, stop


class HalfDuplexSerial(BusDriver):
    """Base of serial drivers; a subclass adds `receiver probe stop identify axis decode`, its ids and its figures."""

    window = 1
    full_duplex = False
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
    longest_gap: ClassVar[float] = 0.040
    """s that a device, the adapter and the host together may hold back a reply."""

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
        return self.longest_reply * BITS / rate + self.longest_gap

    def echo_test(self) -> Request[Any] | None:
        """A probe: its echo has another length than its reply."""
        return self.probe(self.ids[0], 0)

    async def scan(self, ids: tuple[int, ...] = (), rates: tuple[int, ...] = ()) -> list[Found]:
        """Probe each id twice; see `BusDriver.scan`."""

        def ping(node: int) -> Request[bool]:
            probe = self.probe(node, 0)
            within = TimeoutClass.SCAN
            return Request(probe.wire, probe.expected, probe.decode, reply_within=within, repeatable=True)

        def scan_at(rate: int) -> Procedure[list[Found]]:
            return scan_ids(ids or tuple(self.ids), rate, ping, self.identify)

        if not rates:
            return await scan_at(await SetBitrate(0))
        return await Exclusive(scan_rates(rates, scan_at))
