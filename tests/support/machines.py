"""Machines over simulations of all three families, in virtual time.

    with machine("1-6", "0x25-0x26", lift=True) as (config, sims), Robot(config) as robot:
        robot.move({"a1": 0.5})
        sims["arm"][3].unplug()

Axes of the bus `arm` are a1, a2 …, those of `can` c1, c2 …, and `lift` on the bus `stage` is linear. They form the
groups `all`, `upper` (arm) and `led` (arm and can). All stand at 0; the lift is not homed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any

import motorbus
from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.core.steps import Sleep
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.motion.machine import MachineConfig
from motorbus.motion.machine_edit import write
from motorbus.motion.program import OnBuses
from motorbus.session import parse_ids
from motorbus.simulation.named import Simulation

LIMITS = {"max_velocity": "90 deg/s", "max_acceleration": "360 deg/s2"}
ARM = {"zero": "180 deg", "low": "-150 deg", "high": "150 deg", **LIMITS}
CAN = {"low": "-50 deg", "high": "50 deg", **LIMITS}
LIFT = {
    "travel": "5 mm",
    "low": "0 mm",
    "high": "200 mm",
    "max_velocity": "20 mm/s",
    "max_acceleration": "100 mm/s2",
}
FAMILIES = {"arm": "feetech", "can": "kst", "stage": "stepper"}


class Recorded(PerfectLine):
    """A line without faults that keeps what the host sends; at the frames of these numbers Ctrl-C is pressed."""

    def __init__(self, *interrupts: int) -> None:
        self.sent: list[Data] = []
        self.interrupts = set(interrupts)

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        found = super().carry(sender, data, at)
        if sender is Side.HOST:
            self.sent.append(data)
            if len(self.sent) in self.interrupts:
                self.interrupts.discard(len(self.sent))
                raise KeyboardInterrupt
        return found


def listen(sims: Mapping[str, Simulation], *interrupts: int) -> None:
    """From now on `sent` knows what is sent; Ctrl-C is pressed at these frames of the first bus."""
    for number, sim in enumerate(sims.values()):
        sim.line = Recorded(*interrupts if not number else ())


def sent(sims: Mapping[str, Simulation]) -> list[Data]:
    """What was sent since `listen`, bus by bus."""
    return [data for sim in sims.values() if isinstance(sim.line, Recorded) for data in sim.line.sent]


def orders(sims: Mapping[str, Simulation]) -> list[Data]:
    """What was sent since `listen` and is not a question."""
    return [data for data in sent(sims) if not asks(data)]


def asks(data: Data) -> bool:
    """PING, READ, SYNC READ of FEETECH; an SDO upload; read project or read input of a stepper controller."""
    if isinstance(data, CanFrame):
        return data.id > 0x600 and data.data[0] & 0xE0 == 0x40
    if data[:2] == b"\xff\xff":
        return data[4] in (1, 2, 0x82)
    return data[2] in (0x3E, 0x00)


def wait(robot: Any, seconds: float) -> None:
    """Let time pass on all buses of a blocking robot."""

    async def sleep() -> None:
        await OnBuses({bus: Sleep(seconds) for bus in robot.buses.values()})

    robot.carry_out(sleep())


@contextmanager
def machine(
    arm: str = "",
    can: str = "",
    lift: bool = False,
    *,
    axes: Mapping[str, Mapping[str, Any]] | None = None,
    options: Mapping[str, Mapping[str, Any]] | None = None,
    extra: Mapping[str, Any] | None = None,
    **every: Any,
) -> Iterator[tuple[MachineConfig, dict[str, Simulation]]]:
    """A machine of these devices and its simulations by bus.

    `axes` are keys of axes by name, `every` keys of all (None leaves one out), `options` those of `motorbus.simulate`
    by bus, `extra` tables of the file.
    """
    ids = {"arm": arm, "can": can, "stage": "1" if lift else ""}
    with ExitStack() as stack:
        sims = {
            bus: stack.enter_context(
                motorbus.simulate(FAMILIES[bus], ids=nodes, **(options or {}).get(bus, {}))
            )
            for bus, nodes in ids.items()
            if nodes
        }
        yield (
            described(
                {bus: sim.url for bus, sim in sims.items()}, arm, can, lift, axes=axes, extra=extra, **every
            ),
            sims,
        )


def described(
    addresses: Mapping[str, str],
    arm: str = "",
    can: str = "",
    lift: bool = False,
    *,
    axes: Mapping[str, Mapping[str, Any]] | None = None,
    extra: Mapping[str, Any] | None = None,
    **every: Any,
) -> MachineConfig:
    """Such a machine on buses at these addresses."""
    rows: dict[str, dict[str, Any]] = {}
    for bus, ids, keys in (("arm", arm, ARM), ("can", can, CAN), ("stage", "1" if lift else "", LIFT)):
        for number, node in enumerate(parse_ids(ids) if ids else (), 1):
            name = "lift" if bus == "stage" else f"{bus[0]}{number}"
            row = {"device": f"{bus}#{node}", **keys, **every, **(axes or {}).get(name, {})}
            rows[name] = {key: value for key, value in row.items() if value is not None}
    groups = {
        "all": list(rows),
        "upper": [name for name in rows if name.startswith("a")],
        "led": [name for name in rows if name != "lift"],
    }
    tables = {
        "bus": {bus: {"address": address} for bus, address in addresses.items()},
        "axis": rows,
        "group": {name: {"axes": members} for name, members in groups.items() if members},
    }
    return MachineConfig.of({"format": 1, **tables, **(extra or {})})


def file_text(addresses: Mapping[str, str], *parts: Any, **keys: Any) -> str:
    """The file of such a machine, for a program of its own."""
    return write(described(addresses, *parts, **keys))
