"""An adapter takes few frames before the first is on the wire: every node of a crowd gets its request and its stop."""

from __future__ import annotations

import asyncio
import threading
import time
from typing import Any

import pytest

from motorbus.core.family import Family
from motorbus.core.request import Data
from motorbus.core.steps import catch, gather
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.link.errors import full
from motorbus.link.memory import MemoryLink
from tests.support.subjects import FAMILIES
from tests.support.world import World, said, switch_on, world

NODES = tuple(range(1, 17))
WAY = 0.6
"""rad; some servos turn 44° to either side and no more."""


class Wire(PerfectLine):
    """Keeps the moments (s) at which data of the host have left."""

    def __init__(self) -> None:
        self.ends: list[float] = []

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST:
            self.ends.append(at)
        return super().carry(sender, data, at)


class Adapter(MemoryLink):
    """An adapter that takes `size` requests before the first has left; as on CAN, it does not report when that was.

    It takes nothing before `full_until` (s). `taken` are the requests that it took.
    """

    size = 1
    clock_kind = "virtual"

    def __init__(self, simulator: Any, *, rate: int, line: object) -> None:
        self.wire = Wire()
        virtual = self.clock_kind == "virtual"
        super().__init__(simulator, rate=rate, line=self.wire, pace=True, virtual=virtual)
        self.paced = False
        self.full_until = 0.0
        self.taken: list[Data] = []

    def write(self, data: Data) -> None:
        now = self.now()
        self.wire.ends = [end for end in self.wire.ends if end > now]
        if len(self.wire.ends) >= self.size or now < self.full_until:
            raise full(self.name, 0, 1)
        super().write(data)
        self.taken.append(data)


class Known(Adapter):
    """An adapter that tells how much it takes."""

    @property
    def queue(self) -> int:
        """Requests that it takes."""
        return self.size


def adapter(size: int, kind: type[Adapter] = Adapter, clock: str = "virtual") -> type[Adapter]:
    return type("Queue", (kind,), {"size": size, "clock_kind": clock})


def positions(there: World) -> tuple[Any, ...]:
    """Of all nodes, read at the same time where the bus allows it; an error counts as a value."""
    found: tuple[Any, ...] = there.bus.run(
        gather(*[catch(said(there.device(node), "position")) for node in there.ids])
    )
    return found


@pytest.mark.parametrize("kind", [Adapter, Known])
@pytest.mark.parametrize("size", [1, 2, 10])
def test_a_group_read_answers_for_all(mover: Family, size: int, kind: type[Adapter]) -> None:
    with world(mover, ids=NODES, link=adapter(size, kind)) as there:
        for _ in range(3):
            found = positions(there)
            assert [value for value in found if not isinstance(value, float)] == []
        assert not any(any(count.errors.values()) for count in there.bus.statistics.nodes.values())


@pytest.mark.parametrize("size", [1, 2, 10])
def test_every_node_gets_its_stop(mover: Family, size: int) -> None:
    with world(mover, ids=NODES, link=adapter(size)) as there:
        for node in there.ids:
            switch_on(there.device(node))
        begin = positions(there)
        for node, position in zip(there.ids, begin, strict=True):
            there.device(node).move(position + WAY, wait=False)
        there.link.advance(0.05)
        outcome = there.bus.estop()
        assert (set(outcome.acknowledged), outcome.silent) == (set(there.ids), ())
        there.link.advance(2.0)
        ways = [abs(end - start) for start, end in zip(begin, positions(there), strict=True)]
        assert all(way < WAY / 2 for way in ways), ways


@pytest.mark.parametrize("can", [one for one in FAMILIES.values() if one.link.kind == "frames"])
def test_a_stop_during_a_request_writes_every_frame(can: Family) -> None:
    """Another thread waits for a silent node: the frames leave without its help, and none is lost."""
    with world(can, ids=NODES, link=adapter(1, clock="real")) as there:
        link: Any = there.link
        for node in there.ids:
            assert there.device(node).ping() is True
        silent = there.device(there.ids[-1])
        there.bus.estop()  # a bus that has been stopped has the thread that stops
        there.bus.reset()
        there.simulator.nodes[there.ids[-1]].unplug()
        there.bus.latency = 0.5
        time.sleep(0.05)  # no position is fresh
        link.taken.clear()
        reader = threading.Thread(target=lambda: there.bus.run(catch(said(silent, "position"))))
        reader.start()
        while not link.taken:
            time.sleep(0.001)
        end, stopper = time.monotonic() + 0.4, threading.Thread(target=there.bus.estop)
        stopper.start()
        requests = there.family.open().stop(dict.fromkeys(there.ids)).requests
        blind = {one.wire for one in requests if not one.expected} or {one.wire for one in requests}
        while blind - set(link.taken) and time.monotonic() < end:
            time.sleep(0.001)
        assert blind <= set(link.taken)
        there.bus.latency = 0.0
        stopper.join(30)
        reader.join(30)


def test_a_repeated_read_waits_for_a_full_adapter(mover: Family) -> None:
    with world(mover, link=adapter(1)) as there:
        link: Any = there.link
        device = there.device(there.ids[0])
        for _ in range(5):
            here = device.position()
            link.full_until = link.now() + 0.005
            assert device.position() == pytest.approx(here, abs=1e-3)

        async def read() -> None:
            bus = there.async_bus()
            other = there.family.devices.awaiting(bus, there.ids[0])
            for _ in range(5):
                link.full_until = link.now() + 0.005
                assert await other.position() == pytest.approx(here, abs=1e-3)

        asyncio.run(read())
        assert there.bus.engine.losses == 0


def test_an_adapter_that_stays_full_costs_each_request_its_own_time(mover: Family) -> None:
    with world(mover, ids=NODES, link=adapter(0)) as there:
        begun = there.bus.now()
        found = positions(there)
        assert {type(value).__name__ for value in found} == {"LinkFull"}
        assert there.bus.now() - begun < 1.0
        there.link.size = 1  # type: ignore[attr-defined]
        assert all(isinstance(value, float) for value in positions(there))
        assert there.bus.engine.losses == 0
