"""The inputs, the only thing of a controller that can be watched: one level for each request, and no more than that.

A level is a byte without a checksum, 0 or 1, and a contact bounces. So a level is believed when two readings in a row
agree on it. What is shorter than two rounds is not seen, and nothing tells that it was there.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import inf
from typing import Final, NamedTuple

from motorbus.core.steps import Emit, Sleep
from motorbus.errors import FramingError, RequestError
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.reading import READINGS, read_input
from motorbus.families.stepper.driver.turning import within
from motorbus.families.stepper.table import INPUTS

PORTS: Final = tuple(range(1, INPUTS + 1))


class InputChanged(NamedTuple):
    """An event: input 1 to 5 has become active or inactive; `at` is when it was first read so (s, link's clock)."""

    port: int
    active: bool
    at: float


class Watched(NamedTuple):
    """What came of watching inputs.

    `levels`   how they were in the end
    `changes`  what was reported, in order
    `rounds`   how often each was read, in so many `seconds` (s)
    """

    levels: Mapping[int, bool]
    changes: tuple[InputChanged, ...]
    rounds: int
    seconds: float

    @property
    def rate(self) -> float:
        """Rounds per second, as measured: at 9600 baud 56 for one input at best, 11 for all five."""
        return self.rounds / self.seconds if self.seconds > 0 else 0.0


class Levels:
    """Inputs as they are read: a change is believed when it has been read twice in a row."""

    def __init__(self, levels: Mapping[int, bool]) -> None:
        self.believed = dict(levels)
        self._since: dict[int, float] = {}

    def take(self, port: int, active: bool, at: float) -> InputChanged | None:
        """A reading, and when (s); the change, if this one makes it believed."""
        if active is self.believed[port]:
            self._since.pop(port, None)
            return None
        if port not in self._since:
            self._since[port] = at
            return None
        self.believed[port] = active
        return InputChanged(port, active, self._since.pop(port))


async def inputs(node: Node, ports: Iterable[int] = PORTS) -> dict[int, bool]:
    """Whether these inputs, 1 to 5, are active: each read until two readings in a row agree, in 0.04 s or so.

    Raises RequestError for an input that there is not, FramingError for one that is another each time.
    """
    found = {}
    for port in checked(ports):
        found[port] = await _level(node, port)
    return found


async def _level(node: Node, port: int) -> bool:
    seen = await read_input(node, port)
    for _ in range(READINGS - 1):
        before, seen = seen, await read_input(node, port)
        if before is seen:
            return seen
    raise FramingError(
        f"input {port} was another one each of {READINGS} times it was read",
        expected="two readings in a row that agree",
        cause="a contact that bounces, or a line that changes bytes",
        advice="read it again when it rests, or see to the cable and its ground",
        node=node.node,
    )


async def watch_inputs(node: Node, ports: Iterable[int] = PORTS, seconds: float = 10.0) -> Watched:
    """Read these inputs, 1 to 5, in turn for so many seconds, and report an `InputChanged` for each change.

    A change is believed at the second reading that shows it, so it is reported a round late; one that is over within
    two rounds is not seen. Fewer inputs make it quicker, and `Watched.rate` says how quick it was. Each reading is one
    exchange, so a stop waits for at most one of them.

    Raises RequestError for an input that there is not and for a time that is none, and as `inputs`.
    """
    chosen = checked(ports)
    if not chosen:
        raise RequestError("no input is named", expected="some of 1 to 5", advice="nothing was sent")
    within(seconds, inf, "seconds")
    levels = Levels(await inputs(node, chosen))
    changes: list[InputChanged] = []
    rounds, began = 0, await Sleep(0)
    now = began
    while now - began < seconds:
        for port in chosen:
            active = await read_input(node, port)
            now = await Sleep(0)
            if (change := levels.take(port, active, now)) is not None:
                changes.append(change)
                await Emit(change)
        rounds += 1
    return Watched(dict(levels.believed), tuple(changes), rounds, now - began)


def checked(ports: Iterable[int]) -> Sequence[int]:
    """These inputs, each once, in order. Raises RequestError for one that there is not."""
    try:
        found = tuple(dict.fromkeys(ports))
    except TypeError:
        found = (ports,)  # type: ignore[assignment]  # a single number, or what is no input at all
    for port in found:
        if not isinstance(port, int) or isinstance(port, bool) or port not in PORTS:
            raise RequestError(
                f"there is no input {port!r}",
                expected=f"some of 1 to {INPUTS}, as (1, 2)",
                advice="nothing was sent",
            )
    return found
