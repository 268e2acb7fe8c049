"""Faults on a link that ends in a simulator of this process, in one call."""

from __future__ import annotations

from collections.abc import Iterable

from motorbus.errors import RequestError
from motorbus.link.base import Line, PerfectLine
from motorbus.link.memory import MemoryLink
from motorbus.simulation.faults.fault import Fault
from motorbus.simulation.faults.line import FaultyLine
from motorbus.simulation.faults.script import Script, requested
from motorbus.simulation.faults.world import World


def strike(link: MemoryLink, script: Script | str | Iterable[Fault]) -> FaultyLine:
    """Let this happen on a memory link from now on, in place of its line; gives the line that is there then.

    Raises RequestError for a bad script, for what these devices cannot do.
    """
    given = requested(script)
    world = World(link.simulator, port=link, now=link.now())
    line = FaultyLine(given, world)
    link.simulator, link.line = world, line
    return line


def is_calm(line: Line) -> bool:
    """Whether this line can do no harm."""
    return type(line) is PerfectLine or (isinstance(line, FaultyLine) and not line.faults)


def on_a_wire(port: str) -> RequestError:
    """Why there are no faults on this CAN bus: whatever else is on it may be real."""
    return RequestError(
        f"{port}: faults are refused on a CAN bus that may have real devices; nothing was changed",
        expected="a bus of programs alone: can://virtual, can://udp_multicast, or can://socketcan/vcan0 (vxcan0)",
        cause="what is done to frames there, other devices suffer or obey too",
        advice="serve the devices by --link or --tcp, or on can://socketcan/vcan0",
    )
