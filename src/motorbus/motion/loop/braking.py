"""How a loop is left: those that follow a goal and are on their way brake, as hard as they may, and stay there.

Positions are read meanwhile, so that an axis that does not come along is seen; one that is silent for too long is left
at its last small goal. Whatever befalls one, the others brake; what went wrong is told when they rest.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from motorbus.core.request import Request
from motorbus.errors import Interrupted, LimitExceeded, MotorbusError
from motorbus.motion.loop.cycle import Part
from motorbus.motion.loop.grid import Grid
from motorbus.motion.parallel import Parallel, settled


async def braked(parts: Mapping[str, Part], grid: Grid) -> None:
    """Brake, by the slots of the grid. Who was told something from elsewhere is left alone, and so is a bus that fails.

    Raises what went wrong when all others rest. What was sent direct is the last that its device knows.
    """
    for part in parts.values():
        part.watch = None
        part.release_lost()
        for place in part.places.values():
            place.halt()
    failures: dict[str, MotorbusError] = {}
    while left := {bus: part for bus, part in parts.items() if bus not in failures and _brakes(part)}:
        grid.forgive(latest(left.values()))
        await _cycle(left, grid.take(latest(left.values())), failures)
    for bus, part in parts.items():
        part.release_lost()
        for place in part.places.values():
            if place.follows and bus not in failures:
                place.axis.arrives()
    settled({**failures, **refusals(parts)})


def _brakes(part: Part) -> bool:
    part.release_silent()
    return part.brakes()


async def _cycle(parts: Mapping[str, Part], moment: float, failures: dict[str, MotorbusError]) -> None:
    """One cycle of it; who was told something from elsewhere meanwhile does not keep the others from braking."""
    orders: dict[str, Sequence[Request[Any]]] = {}
    for bus, part in parts.items():
        try:
            orders[bus] = part.orders(1)
        except MotorbusError as error:
            failures[bus] = error
    told: Mapping[str, Any] = await Parallel(
        {bus: parts[bus].cycle(sent, moment) for bus, sent in orders.items()}, dict
    )
    for bus, found in told.items():
        if not isinstance(found, MotorbusError):
            parts[bus].take(found)
        elif not (isinstance(found, Interrupted) and parts[bus].release_lost()):
            failures[bus] = found


def refusals(parts: Mapping[str, Part]) -> dict[str, LimitExceeded]:
    """Why axes were held back since this was asked last."""
    found = {str(error): error for part in parts.values() for error in part.refused}
    for part in parts.values():
        part.refused.clear()
    return found


def latest(parts: Iterable[Part]) -> float:
    """Robot time (s), by the latest clock of these buses."""
    return max([part.now for part in parts])
