"""What `motorbus monitor BUS --listen` prints: every frame of a CAN bus as it comes, explained; nothing is sent."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Final

from motorbus.cli import frame
from motorbus.cli.exits import Exit
from motorbus.cli.target import opened, target
from motorbus.core.can_frame import CanFrame
from motorbus.core.steps import Sleep
from motorbus.errors import NoReply, RequestError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from motorbus.bus.blocking import Bus
    from motorbus.bus.trace import TraceRecord
    from motorbus.cli.output import Output
    from motorbus.core.family import Explanation

LOOK: Final = 0.05
"""s between two looks at what has come."""
_DATA: Final = 5
"""Where the data of a frame begins in a run of bytes; see `CanFrame.flat()`."""


def listen(
    buses: tuple[str, ...], count: int, duration: float, options: Mapping[str, str], output: Output
) -> Exit:
    """Print what is heard, until Ctrl-C or `count` frames or `duration` s; 0 goes on.

    Raises RequestError for anything but one whole CAN bus, NoReply when the time is over and nothing was heard.
    """
    if len(buses) != 1 or "#" in buses[0]:
        raise RequestError("--listen hears one whole bus", expected="BUS", advice="nothing was sent")
    (bus, family, _) = target(buses[0])
    if family.link.kind != "frames":
        raise RequestError(
            f"--listen: {family.name} devices speak only when they are asked",
            expected="a CAN bus",
            advice="nothing was sent",
        )
    heard = 0
    with (
        suppress(KeyboardInterrupt),
        opened(bus, options, output) as opening,
    ):  # Ctrl-C: the usual way to end it
        seen = opening.trace.subscribe()
        began = opening.link.now()
        while not (0 < count <= heard) and not 0 < duration <= opening.link.now() - began:
            opening.run(_pause())
            for record in seen:
                if record.direction == "rx" and not 0 < count <= heard:
                    heard += 1
                    _tell(opening, bus, record, record.at - began, output)
    if not heard and duration:
        raise NoReply(
            f"{bus}: nothing was heard",
            cause="nobody speaks unless asked, or at another bit rate",
            advice="`motorbus scan BUS --bitrate all` looks for the rate where nothing depends on this bus",
        )
    return Exit.OK


async def _pause() -> None:
    await Sleep(LOOK)


def _tell(opening: Bus, bus: str, record: TraceRecord, at: float, output: Output) -> None:
    data = record.data.flat() if isinstance(record.data, CanFrame) else bytes(record.data)
    for one in opening.driver.decode(data):
        facts = {"title": one.title, "fault": one.fault, "parts": {p.name: p.meaning for p in one.parts}}
        output.document(
            "motorbus.monitor.heard/1",
            {"bus": bus, "time": at, **frame.facts(one.data, opening.family), **facts},
        )
        bad = f": BAD: {one.fault}" if one.fault else ""
        output.text(f"{at:10.3f} s  {frame.shown(one.data, opening.family)}  {one.title}{bad}{_values(one)}")


def _values(one: Explanation) -> str:
    """The data fields that the title does not tell already."""
    data = [part for part in one.parts if part.start >= _DATA and part.name != "reserved"]
    return "".join(f"; {part.name} {part.meaning}" for part in data if part.meaning not in one.title)
