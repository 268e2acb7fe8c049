"""The life of three buses in virtual time: polled, jogged, unplugged, opened anew, put to sleep, browned out.

Each bus is opened as a program opens it, on a simulation that outlives every host. What it must keep to is asked after
each hour: nothing written to EEPROM, ledgers that balance, and no more descriptors, threads, tasks and memory than at
the beginning.
"""

from __future__ import annotations

import asyncio
import gc
import os
import sys
import threading
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import motorbus
from motorbus.bus.pump import Bus
from motorbus.core.operation import CanFrame, Data, Pause
from motorbus.errors import LinkLost
from motorbus.families.stepper import Program
from tests.faults.scenes import STORED, Wire

FAMILIES: dict[str, dict[str, Any]] = {
    "feetech": {"ids": "1-2"},
    "kst": {"ids": "0x21-0x22", "profile": "kst-ext"},
    "stepper": {"ids": "1"},
}
KEPT = ("max_temperature", "min_position_limit", "max_position_limit", "return_delay")
"""The configuration of a servo that is applied again and again."""
SAVES = (b"\xff\xaa\x2e", b"\xff\xaa\x1e")
"""How a stepper controller is told to save a project, or to clear one."""
STORE = 0x1010
"""The object by which a KST servo is told to save."""


class Footprint(NamedTuple):
    """What a process holds: descriptors, threads, blocks of Python's memory, and KiB of the system's."""

    descriptors: int
    threads: int
    blocks: int
    kib: int


def held() -> tuple[int, int]:
    """Descriptors and threads."""
    return len(os.listdir("/proc/self/fd")), threading.active_count()


def footprint() -> Footprint:
    """What this process holds now, when all is given back that can be."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    kib = pages * os.sysconf("SC_PAGE_SIZE") // 1024
    return Footprint(*held(), sys.getallocatedblocks(), kib)


class Saving(Wire):
    """A wire that counts requests, and those that would have something saved. It keeps none of them."""

    def __init__(self) -> None:
        super().__init__()
        self.requests = self.saves = 0

    def heard(self, data: Data) -> None:
        self.requests += 1
        if isinstance(data, CanFrame):
            index = int.from_bytes(data.data[1:3], "little")
            self.saves += index == STORE and data.data[0] != 0x40
        else:
            self.saves += data[:3] in SAVES


class Life:
    """One bus of one family from its simulation to whoever uses it. `counts` says what has happened."""

    def __init__(self, family: str) -> None:
        self.family = family
        self.simulation = motorbus.simulate(family, **FAMILIES[family])
        self.wire = Saving()
        self.simulation.line = self.wire
        self.counts: Counter[str] = Counter()
        self.nodes: list[Any] = list(self.simulation.simulator.nodes.values())
        if family == "stepper":
            self.nodes[0].put(1, STORED)
        self.bus: Bus = motorbus.open(self.simulation.url)
        self.devices = self._devices()
        self.settings = self._settings()
        self.wire.saves = 0

    def _devices(self) -> list[Any]:
        make = self.bus.family.devices.blocking
        return [make(self.bus, node) for node in self.simulation.simulator.nodes]

    def _settings(self) -> Any:
        if self.family == "feetech":
            return [device.read(*KEPT) for device in self.devices]
        return [device.travel_limits() for device in self.devices] if self.family == "kst" else None

    @property
    def now(self) -> float:
        return self.bus.link.now()

    @property
    def worn(self) -> int:
        """Writes to EEPROM so far, of all devices; orders to save where a device does not tell."""
        if self.family == "feetech":
            return sum(node.memory.wear.total() for node in self.nodes)
        return self.wire.saves

    def balances(self) -> bool:
        """Whether what was sent is what was answered and what failed, for each node."""
        ledgers = self.bus.statistics.nodes.values()
        return all(one.sent == one.ok + sum(one.errors.values()) for one in ledgers)

    # -- what happens to it ---------------------------------------------------------------------------------

    def rest(self, seconds: float) -> None:
        """Nobody does anything."""
        self.bus.link.advance(seconds)  # type: ignore[attr-defined]

    def poll(self) -> None:
        """What a dashboard asks."""
        self.counts["polls"] += 1
        for device in self.devices:
            if self.family == "stepper":
                device.read_input(2)
            else:
                device.telemetry()

    def jog(self) -> None:
        """A little to and fro; it ends where it was told to."""
        self.counts["jogs"] += 1
        device = self.devices[self.counts["jogs"] % len(self.devices)]
        place = 0.1 * (self.counts["jogs"] % 3)
        if self.family == "stepper":
            device.jog(3.0, 0.2)
        elif self.family == "kst":
            device.move(place)
        else:
            device.enable_torque()
            device.move(3.0 + place)

    def configure(self) -> None:
        """The same configuration once more, as a program applies it that does not look first: each device does."""
        self.counts["configured"] += 1
        if self.family == "stepper":
            self.devices[0].write_project(Program(project=STORED))
            return
        for device, settings in zip(self.devices, self.settings, strict=True):
            if self.family == "kst":
                device.set_travel_limits(*settings)
            else:
                device.write(**settings)

    def reopen(self) -> None:
        """The program ends, and another one begins."""
        self.counts["opened"] += 1
        assert self.balances(), self.family
        self.bus.close()
        self.bus = motorbus.open(self.simulation.url)
        self.devices = self._devices()

    def unplug(self) -> None:
        """The adapter is pulled, and is back in a moment: whoever asks is told, and the next one is answered."""
        link: Any = self.bus.link
        link.unplug(seconds=0.01)
        with pytest.raises(LinkLost):
            self.poll()
        self.counts["unplugged"] += 1
        self.bus.run(iter(Pause(0.3)))
        self.poll()

    def brown_out(self) -> None:
        """The supply of every device dips."""
        self.counts["brown-outs"] += 1
        for node in self.nodes:
            node.power_cycle()
        self.rest(1.0)

    def awaited(self) -> None:
        """The same bus on an event loop for a moment, which must leave no task behind."""
        self.counts["tasks"] += 1
        self.bus.close()

        async def main() -> int:
            async with motorbus.open_async(self.simulation.url) as bus:
                make = bus.family.devices.awaiting
                await asyncio.gather(*(make(bus, node).ping() for node in self.simulation.simulator.nodes))
            return len(asyncio.all_tasks())

        assert asyncio.run(main()) == 1, "nothing but the main task itself"
        self.bus = motorbus.open(self.simulation.url)
        self.devices = self._devices()

    def close(self) -> None:
        assert self.balances(), self.family
        self.bus.close()
        self.simulation.close()
