"""What reading and writing a project costs on the line, told before it is done: commands, dumps, and seconds.

Time on the wire is exact. How long this controller thinks is measured, by reading the project, which comes first in
any case; so is a line without pace. How long it takes to save cannot be known before, and is assumed.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.core.steps import SetBitrate
from motorbus.families.stepper import wire
from motorbus.families.stepper.driver.line import BITS
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.reading import agreed, readings
from motorbus.families.stepper.table import REPLY

SAVES: Final = 0.03
"""s that saving takes before it is acknowledged, an assumption, no source."""
_COMMAND: Final = wire.REQUEST_LENGTH + wire.REPLY_LENGTH
_DUMP: Final = wire.REQUEST_LENGTH + wire.DUMP_LENGTH
"""Bytes on the wire, both ways."""


class Cost(NamedTuple):
    """What it takes on the line when all goes well: `writes` commands that change something, `reads` dumps, and s."""

    writes: int
    reads: int
    seconds: float

    def __str__(self) -> str:
        return (
            f"{_many(self.writes, 'command')} and {_many(self.reads, 'dump')}, about {_short(self.seconds)}"
        )


class Tempo(NamedTuple):
    """How fast this line is: `rate` in bit/s, and `dump`, the s that reading a project takes on it, all in all."""

    rate: int
    dump: float

    @property
    def turnaround(self) -> float:
        """s that the controller thinks; no more than is allowed for, for what takes longer was said twice."""
        return min(max(0.0, self.dump - self._air(_DUMP)), REPLY)

    def cost(self, writes: int, reads: int, saves: int = 0) -> Cost:
        """The cost of so many commands and dumps; `saves` of the commands save."""
        pace = min(1.0, self.dump / self._air(_DUMP))  # below 1: a line on which bytes take no time
        on_the_wire = self._air(writes * _COMMAND + reads * _DUMP) * pace
        return Cost(writes, reads, on_the_wire + (writes + reads) * self.turnaround + saves * SAVES)

    def _air(self, count: int) -> float:
        return count * BITS / self.rate


class Taken(NamedTuple):
    """A project as it was read: its 220 bytes, how many dumps that took, and how fast they came."""

    image: bytes
    dumps: int
    tempo: Tempo


async def taken(node: Node, project: int) -> Taken:
    """Read a project until two dumps agree, with a clock. Call it inside `Exclusive`. Raises as `dump`."""
    rate = await SetBitrate(0)
    lasted: list[float] = []
    seen = await readings(node, project, lasted)
    image = agreed(node, project, seen)[wire.REPLY_LENGTH :]
    # the quickest, for whatever held one of them up would be reckoned for every command to come
    return Taken(image, len(seen), Tempo(rate, min(lasted)))


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


def _short(seconds: float) -> str:
    return f"{seconds * 1000:.0f} ms" if seconds < 1 else f"{seconds:.1f} s"
