"""What a controller tells: its projects, and the level of an input. Nothing here writes.

A dump has 226 bytes and no checksum. So it is read twice, and believed when both are the same. Two that differ show a
line that changes bytes, and from then on each byte must have been the same in three readings, of at most five: of a
line that changes one byte in a hundred that lets one dump in a million pass wrong, of one that changes one in a hundred
thousand one in ten thousand millions. What is beyond that is said to be a bad line, and no value.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Final

from motorbus.core.register import Register, Value
from motorbus.core.request import Request, TimeoutClass
from motorbus.core.steps import Sleep
from motorbus.errors import FramingError, RequestError, UnexpectedReply
from motorbus.families.stepper import wire
from motorbus.families.stepper.driver.exchanges import command
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.program import Program
from motorbus.families.stepper.table import INPUTS, STEPS, row_value

READINGS: Final = 5
"""How often a dump is read at most until it is believed."""
_ALIKE: Final = 3
"""Of so many readings each byte is the same, once two have differed: more than half of them all."""


def dump_once(node: Node, project: int, timeout: TimeoutClass | None = None) -> Request[bytes]:
    """The 226 bytes of a project, 1 to 4, as they come once."""
    return command(node, "read_project", bytes, project=project, timeout=timeout)


async def dump(node: Node, project: int = 1) -> bytes:
    """The 226 bytes of a project, 1 to 4, as two readings agree on them; about 0.5 s.

    Raises FramingError when the line is too bad for that, UnexpectedReply when what came twice is the image of another
    project. Reading changes nothing; with unsaved edits it shows those, or so it is assumed.
    """
    return agreed(node, project, await readings(node, project))


async def image(node: Node, project: int) -> bytes:
    """The 220 bytes of a project, 1 to 4, without the six before them. Raises as `dump`."""
    return (await dump(node, project))[wire.REPLY_LENGTH :]


async def readings(node: Node, project: int, lasted: list[float] | None = None) -> list[bytes]:
    """As many dumps of a project as it takes until they agree, at most five: `agreed` says what holds of them.

    How long each has `lasted` (s) is added to that list.
    """
    seen: list[bytes] = []
    while len(seen) < READINGS and not vote(seen):
        began = await Sleep(0)
        seen.append(await dump_once(node, project))
        if lasted is not None:
            lasted.append(await Sleep(0) - began)
    return seen


def agreed(node: Node, project: int, seen: Sequence[bytes]) -> bytes:
    """What of these dumps of a project holds. Raises as `dump`."""
    found = vote(seen)
    if not found:
        raise FramingError(
            f"project {project} came differently each of {READINGS} times it was read",
            expected="two readings that agree, or three that agree on each byte",
            cause="the line changes bytes, and a dump has no checksum",
            advice="see to the cable and its ground; nothing was written",
            node=node.node,
        )
    _plausible(node, found, project)
    return found


def vote(readings: Sequence[bytes]) -> bytes:
    """What of these dumps holds: two that are the same; of more, byte by byte, what three say. b"" if not all do."""
    if len(readings) < 2:
        return b""
    due = min(len(readings), _ALIKE)
    found = bytearray()
    for column in zip(*readings, strict=True):
        ((value, times),) = Counter(column).most_common(1)
        if times < due:
            return b""
        found.append(value)
    return bytes(found)


def _plausible(node: Node, data: bytes, project: int) -> None:
    number, total = data[wire.REPLY_LENGTH :][:2]
    if number not in (0, project) or total > STEPS:
        raise UnexpectedReply(
            f"the dump of project {project} says project {number} with {total} steps",
            received=data,
            expected=f"project {project}, or 0 when it was cleared, and up to {STEPS} steps",
            cause="a line that changes the same byte each time, or another device",
            advice="see that this port leads to a stepper controller",
            node=node.node,
        )


async def read_project(node: Node, project: int = 1) -> Program:
    """A stored project, 1 to 4, as a program: checked, timed, drawn and kept as a file like any other.

    Raises RequestError when it holds what no project can, FramingError and UnexpectedReply as `dump`.
    """
    return Program.from_dump(await dump(node, project), name=f"project {project}", order=node.order)


async def read(node: Node, /, *names: str, project: int = 1) -> dict[str, Value]:
    """Parameters of a project in API units by name, all when none is named.

    Raises as `dump`, and RequestError for an unknown name.
    """
    raws = await read_raw(node, *names, project=project)
    return {name: node.value(node.table[name], raw) for name, raw in raws.items()}


async def read_raw(node: Node, /, *names: str, project: int = 1) -> dict[str, int]:
    """The same as raw values."""
    rows: list[Register] = [node.table[name] for name in names or node.table]
    held = await image(node, project)
    return {row.name: row_value(held, row, node.order) for row in rows}


def read_input(node: Node, port: int) -> Request[bool]:
    """Whether an input, 1 to 5, is active. Raises RequestError for another.

    One reading, and nothing vouches for its one bit; `inputs` reads until two agree.
    """
    if not isinstance(port, int) or port not in range(1, INPUTS + 1):
        raise RequestError(f"there is no input {port}", expected=f"1 to {INPUTS}", advice="nothing was sent")
    kept = node.kept.get(port)
    if kept is None:
        kept = node.kept[port] = command(node, "read_input", lambda reply: bool(reply[5]), port=port)
    return kept
