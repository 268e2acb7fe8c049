"""Will a loop fit? Counted before there is anybody to ask: simulated devices stand in for those on the bus.

What a family sends in a loop depends on what its devices are, so they have to be asked. Simulated ones of the same ids
answer as real ones do, so the exchanges are the very ones that a loop would send, and no port is opened.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any, Final, NamedTuple

from motorbus.bus.blocking import Bus
from motorbus.core.family import PositionStream
from motorbus.motion.budget import BusBudget, counted
from motorbus.session import open, parse_address, prepare
from motorbus.simulation.named import Simulation

_NO_HABITS: Final = {"baud", "bitrate", "ids", "model"}
"""Options of an address that say nothing of how the devices on it behave."""


class Wanted(NamedTuple):
    """A bus in a loop: its `address`, and the names of its axes by the id of their devices.

    `model` is what these devices are, "" for the usual ones of their family.
    """

    address: str
    axes: Mapping[int, str]
    model: str = ""


class Counted(NamedTuple):
    """What a loop costs on one bus, and what of its time on the wire is for `goals` and for `readings` (s a cycle)."""

    budget: BusBudget
    goals: float
    readings: float


def count(wanted: Wanted, *, turnaround: float = 0.0) -> Counted | None:
    """What one cycle of a loop over these devices costs; None where nobody can lead them. Opens no port, sends nothing.

    `turnaround` is how long (s) each device thinks before it answers. Raises RequestError for an address, ids or a
    model that cannot be.
    """
    address = parse_address(wanted.address)
    opening = prepare(address.bus, {})
    driver, rate = opening.driver, opening.rate or opening.family.link.rate
    family = opening.family
    known = {option.name for option in (*family.simulator_options(), *family.link.settings)} - _NO_HABITS
    model = wanted.model or address.options.get("model", "")
    habits: dict[str, Any] = {name: said for name, said in address.options.items() if name in known}
    with (
        Simulation(family, tuple(wanted.axes), model=model, **habits) as simulation,
        open(simulation.url) as bus,
    ):
        train = _train(bus, tuple(wanted.axes), rate)
        if train is None:
            return None
        goals, readings = train.goals(_angles(bus, train)), train.positions
    names = tuple(wanted.axes.values())
    whole = counted(driver, rate, (*goals, *readings), names, turnaround)
    told, asked = (counted(driver, rate, part, names).wire for part in (goals, readings))
    return Counted(whole, told, asked)


def _train(bus: Bus, nodes: Sequence[int], rate: int) -> PositionStream | None:
    """The devices with these ids, as they would be led in a loop at this rate of the bus (bit/s)."""
    devices = [bus.family.devices.blocking(bus, node) for node in nodes]
    able = bus.driver.axis(devices[0].identify())
    return bus.run(able.stream(devices, rate=rate)) if "stream" in able else None


def _angles(bus: Bus, train: PositionStream) -> dict[int, float]:
    """An angle (rad) that each can be told: all goals are as long, so any will do to count."""
    found = {}
    for node in train.nodes:
        device = bus.family.devices.blocking(bus, node)
        able = bus.driver.axis(device.identify())
        low, high = bus.run(able.limits(device)) if "limits" in able else (-inf, inf)
        found[node] = min(max(0.0, low), high)
    return found
