"""Looking for a controller on a line that somebody has called a stepper line: one frame, twice where nobody answers.

It says what it sends before it sends it. Other lines are never looked at, and nothing but "read project 1" is sent.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from motorbus.core.family import Found
from motorbus.core.request import Data, TimeoutClass
from motorbus.core.steps import Emit, Exclusive, Progress, SetBitrate, with_cleanup
from motorbus.errors import NoReply, WireError
from motorbus.families.stepper import wire
from motorbus.families.stepper.driver.node import Node, checked_id
from motorbus.families.stepper.driver.presence import identify
from motorbus.families.stepper.driver.reading import dump_once

PASSES: Final = 2


class Sends(NamedTuple):
    """An event: this request, and nothing else, is about to be sent at this rate (bit/s) to find out who is there."""

    request: Data
    rate: int


async def scan(ids: Sequence[int] = (), rates: Sequence[int] = (), motor: int = wire.MOTOR) -> list[Found]:
    """The controller of this line, if it answers; `rates` () is the present one, which is set again in the end.

    Reports `Sends`, `Progress` and `Found`. Raises RequestError for an id that no
    controller has. Writes nothing.
    """
    for node in ids:
        checked_id(node)
    present = await SetBitrate(0)
    if not rates or tuple(rates) == (present,):
        return await _at(present, motor)
    return await Exclusive(with_cleanup(_everywhere(rates, motor), lambda: SetBitrate(present)))


async def _everywhere(rates: Sequence[int], motor: int) -> list[Found]:
    found: list[Found] = []
    for rate in rates:
        await SetBitrate(rate)
        found += await _at(rate, motor)
    return found


async def _at(rate: int, motor: int) -> list[Found]:
    node = Node(motor=motor)
    for number in range(PASSES):
        asked = dump_once(node, 1, timeout=TimeoutClass.SCAN)
        await Emit(Sends(asked.wire, rate))
        await Emit(Progress(number, PASSES, f"reading project 1 at {rate} bit/s"))
        try:
            await asked
        except (NoReply, WireError):
            continue
        await Emit(Found(node.node, rate, None))
        return [Found(node.node, rate, await identify(node))]
    await Emit(Progress(PASSES, PASSES, f"nobody at {rate} bit/s"))
    return []
