"""The bounds of the machine file over a bus that a command was given by its address.

Whoever writes a register of a device by its address means a joint of his machine all the same, where the file that
counts for the command says that it is one.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from motorbus.cli.line import same_line
from motorbus.cli.machine import machine_file, shown
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from motorbus.bus.base import BaseBus
    from motorbus.cli.output import Output


def fenced(bus: BaseBus, address: str, output: Output) -> None:
    """Set the bounds of the axes that the machine file has on this bus, and put those of them at fault whose guarded
    change was cut off; nothing is sent.

    A file that cannot be understood bounds nothing. That is said, and hinders nobody who works on a device.
    """
    file = machine_file()
    if file.path is None:
        return
    try:
        machine = file.machine
    except RequestError:
        output.note(f"note: {shown(file.path)} cannot be understood, so its limits bound nothing here")
        return
    from motorbus.motion.safety.fence import enclose
    from motorbus.session.faults import distrust_on

    there = {name for name, spec in machine.buses.items() if same_line(spec.address, address)}
    for name, spec in machine.axes.items():
        with suppress(RequestError):  # an id that cannot be bounds nobody, and stops no stop
            if spec.bus in there:
                enclose(bus, {name: spec})
    distrust_on(bus)


def pace(bus: BaseBus, nodes: Iterable[int]) -> float | None:
    """The greatest speed (rad/s) that the file allows to all of these; None where it bounds none of them."""
    guards = getattr(bus.interlock, "guards", {})
    speeds = [guards[node].bounds.speed for node in nodes if node in guards]
    return min(speeds, default=None)
