"""The machine of `motorbus web --demo`: nine simulated axes in real time, with faults on order."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from msgspec import structs

from motorbus import families
from motorbus.errors import RequestError
from motorbus.motion.machine import BusConfig, MachineConfig
from motorbus.session.address import parse_address
from motorbus.simulation.control import carry_out
from motorbus.simulation.named import Simulation


class SimulatedMachine:
    """The simulated buses of a machine by name."""

    def __init__(self, buses: dict[str, Simulation]) -> None:
        self._buses = buses

    def inject(self, bus: str, order: str) -> dict[str, Any]:
        """Carry out an order in the words of the control socket; `faults SCRIPT` sets faults of the wire."""
        if bus not in self._buses:
            raise RequestError(f"no simulated bus {bus!r}", expected=f"one of {', '.join(self._buses)}")
        simulation = self._buses[bus]
        word, _, script = order.partition(" ")
        if word == "faults" and script:
            simulation.faults = "" if script == "off" else script
            return {"ok": True, "faults": str(simulation.faults.script)}
        reply = carry_out(simulation, order)  # type: ignore[arg-type]  # it needs the simulator only
        if "error" in reply:
            raise RequestError(reply["error"], expected=reply["expected"])
        return reply


@contextmanager
def simulated(config: MachineConfig) -> Iterator[tuple[MachineConfig, SimulatedMachine]]:
    """The same machine on simulated buses of this process, in real time."""
    with ExitStack() as stack:
        simulations: dict[str, Simulation] = {}
        for name, bus in config.buses.items():
            nodes = tuple(sorted({axis.node for axis in config.axes.values() if axis.bus == name}))
            family = families.load(parse_address(bus.address).family)
            simulations[name] = stack.enter_context(Simulation(family, nodes, clock="real"))
        buses = {name: BusConfig(one.url) for name, one in simulations.items()}
        yield structs.replace(config, buses=buses), SimulatedMachine(simulations)
