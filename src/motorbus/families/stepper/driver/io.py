"""Inputs and outputs.

The level of an input is one byte without checksum, and contacts bounce: it counts when two readings in a row agree.
Outputs cannot be read.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple

from motorbus.core.register import is_number, shown
from motorbus.core.request import Request
from motorbus.core.steps import Emit, Sleep
from motorbus.errors import FramingError, RequestError
from motorbus.families.stepper.driver.node import Node, command, ignore
from motorbus.families.stepper.parameters import ALL_OUTPUTS, INPUTS, OUTPUTS, check_value

PORTS: Final = tuple(range(1, INPUTS + 1))
READINGS: Final = 5  # of an input that changes each time


class InputChanged(NamedTuple):
    """An event: input 1 to 5 became active or inactive at this time (s, link clock), when it was first read so."""

    port: int
    active: bool
    at: float


class Levels:
    """Inputs by readings: a change counts when it was read twice in a row."""

    def __init__(self, levels: Mapping[int, bool]) -> None:
        self.settled = dict(levels)
        self._since: dict[int, float] = {}

    def take(self, port: int, active: bool, at: float) -> InputChanged | None:
        """Take one reading (time in s); return the change that it confirms."""
        if active is self.settled[port]:
            self._since.pop(port, None)
        elif port in self._since:
            self.settled[port] = active
            return InputChanged(port, active, self._since.pop(port))
        else:
            self._since[port] = at
        return None


def read_input(node: Node, port: int) -> Request[bool]:
    """Whether input 1 to 5 is active (item 24): one reading; `inputs` reads until two agree."""
    return command(node, "read_input", lambda reply: bool(reply[5]), port=port)


async def inputs(node: Node, ports: Iterable[int] = PORTS) -> dict[int, bool]:
    """Whether these inputs, 1 to 5, are active, each by two equal readings in a row.

    Raises RequestError for another port, FramingError for an input that changes at each of five readings.
    """
    return {port: await _level(node, port) for port in checked_ports(ports)}


async def _level(node: Node, port: int) -> bool:
    active = await read_input(node, port)
    for _ in range(READINGS - 1):
        before, active = active, await read_input(node, port)
        if before is active:
            return active
    raise FramingError(
        f"input {port} changed at each of {READINGS} readings",
        expected="two equal readings in a row",
        cause="the contact bounces, or the line damages bytes",
        advice="read it again at rest, or check cable and ground",
        node=node.node,
    )


async def watch_inputs(
    node: Node, ports: Iterable[int] = PORTS, seconds: float = 10.0
) -> tuple[InputChanged, ...]:
    """Read these inputs in turn for `seconds`; return and report each change at its second reading.

    A round takes 18 ms for each input; a change shorter than two rounds is missed. Raises RequestError for another
    port, or a time not above 0.
    """
    chosen = checked_ports(ports)
    check_seconds("seconds", seconds)
    levels = Levels(await inputs(node, chosen))
    changes = []
    now = begun = await Sleep(0)
    while now - begun < seconds:
        for port in chosen:
            active = await read_input(node, port)
            now = await Sleep(0)
            if change := levels.take(port, active, now):
                changes.append(change)
                await Emit(change)
    return tuple(changes)


async def set_output(node: Node, port: int, active: bool) -> None:
    """Set output 1 to 3, 4 for all three, 5 for both LEDs (item 23); active pulls it low.

    Raises RequestError for another port or level; OutcomeUnknown without an acknowledgement: its level is then unknown.
    """
    if active not in (False, True):
        raise RequestError(f"level {shown(active)} is not possible", expected="True or False")
    request = command(node, "set_output", ignore, port=port, level=int(active))
    ports = range(1, OUTPUTS + 1) if port == ALL_OUTPUTS else (port,)
    node.state.outputs.update(dict.fromkeys(ports))
    await request
    node.state.outputs.update(dict.fromkeys(ports, bool(active)))


def checked_ports(ports: Iterable[int]) -> tuple[int, ...]:
    """These inputs, each once, in order. Raises RequestError for another port than 1 to 5."""
    found = tuple(dict.fromkeys(ports))
    for port in found:
        check_value("port", port)
    return found


def check_seconds(name: str, seconds: float, longest: float = 1e9) -> None:
    """Raise RequestError unless this is a time (s) above 0 and at most `longest`."""
    if not is_number(seconds) or not 0 < seconds <= longest:
        raise RequestError(
            f"{name} {shown(seconds)} is not possible",
            expected=f"s, above 0 and at most {longest:g}",
        )
