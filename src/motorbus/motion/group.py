"""What several axes of a machine do together: each is a function of a `Body` that gives the work on each bus.

The buses work at the same time. Every axis is visited whatever happens to some; what went wrong is raised at the end,
and names all whom it befell.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import Enum
from functools import partial
from typing import Any, TypeAlias

from motorbus.core.family import State
from motorbus.core.steps import Procedure
from motorbus.errors import MotorbusError, RequestError
from motorbus.motion import capabilities as one
from motorbus.motion import reckoning
from motorbus.motion.body import Body
from motorbus.motion.capabilities import AxisVerbs
from motorbus.motion.parallel import Parallel
from motorbus.motion.safety import standstill
from motorbus.motion.safety.standstill import Stopped
from motorbus.motion.several import Act, Told, everyone, insisted, of_each, raised

Names: TypeAlias = "str | Iterable[str] | None"
"""Names of axes, groups and buses; None: all axes that are open."""


def positions(body: Body, names: Names = None) -> Parallel[dict[str, float | None]]:
    """Where each is (rad, m), by name, as its device measures it or, where it does not, *estimated*: see `estimated`.

    None where nobody knows: a reckoned axis that was not homed. Raises what one of them raised, when all were asked.
    """
    axes = body.chosen(names)
    measured = {name: axis for name, axis in axes.items() if "position" in axis.able}

    def told(found: dict[str, Any]) -> dict[str, float | None]:
        return {name: found.get(name, axis.estimated) for name, axis in axes.items()}

    return _each(body, measured, one.position, told)


def states(body: Body, names: Names = None) -> Parallel[dict[str, State]]:
    """One sample of each that tells one, by name. Raises what one of them raised, when all were asked."""
    axes = {name: axis for name, axis in body.chosen(names).items() if "state" in axis.able}
    return _each(body, axes, one.state, dict)


def enable_torque(body: Body, names: Names = None) -> Parallel[None]:
    """Torque on, without a jump, for each that has a switch for it, with the caps of the machine file.

    Raises RequestError when none of them has one, else what one of them raised, when all were visited.
    """
    return _each(body, _able(body, names, "enable_torque"), one.enable_torque, _nothing)


def disable_torque(body: Body, names: Names = None) -> Parallel[None]:
    """Limp: each that has a switch for its torque, whatever happens. Raises as `enable_torque`."""
    return _each(body, _able(body, names, "disable_torque"), one.disable_torque, _nothing, insisted)


def stop(body: Body, names: Names = None) -> Parallel[dict[str, Enum]]:
    """Decelerate and stay, each of them, whatever happens; gives what each device promises, by name.

    An interruption, and what one of them raised, is raised when all were visited.
    """
    return _each(body, body.chosen(names), one.stop, dict, insisted)


def stopped(
    body: Body, names: Names = None, *, patience: float = standstill.PATIENCE
) -> Parallel[dict[str, Stopped]]:
    """As `stop`, then look whether they rest, for at most `patience` s; gives what was promised and what was seen.

    Everyone is stopped before anybody is looked at. That one was not seen to rest is no error: see `Stopped.rest`. An
    interruption ends the looking.
    """
    return _each(body, body.chosen(names), one.stop, dict, partial(_looked_at, patience=patience))


async def _looked_at(axes: Sequence[AxisVerbs], act: Act[Enum], patience: float) -> Told:
    told = await insisted(axes, act)
    heard = [axis for axis in axes if not isinstance(told[axis.name], MotorbusError)]
    looked = await everyone(heard, lambda axis: standstill.seen(axis, told[axis.name], patience))
    return {**told, **looked}


def hold(body: Body, names: Names = None) -> Parallel[None]:
    """Stay, with torque: torque on without a jump where there is a switch for it, else a stop. Raises as `stop`."""
    return _each(body, body.chosen(names), one.hold, _nothing)


def home(
    body: Body, names: Names = None, *, deadline: float | None = None, velocity: float | None = None
) -> Parallel[dict[str, float]]:
    """Send each that has a switch to go to there, at most for so long (s); gives where each is then (rad, m).

    The `velocity` (rad/s, m/s) is that of each; None: as its device is set, or `max_velocity` where that is less.
    Raises RequestError when none of them has one, else what one of them raised, when all have ended.
    """
    return _each(
        body, _able(body, names, "home"), partial(reckoning.home, deadline=deadline, velocity=velocity), dict
    )


def _each(
    body: Body,
    axes: Mapping[str, AxisVerbs],
    act: Act[Any],
    combined: Callable[[dict[str, Any]], Any],
    how: Callable[[list[AxisVerbs], Act[Any]], Procedure[Told]] = everyone,
) -> Parallel[Any]:
    """Do it to each of these, and make of what came of them what is wanted; in the order of the names."""
    parts = body.by_bus(axes)

    def combine(results: Mapping[str, Any]) -> Any:
        told = of_each(parts, results)
        return combined(raised({name: told[name] for name in axes}))

    return Parallel({bus: how(there, act) for bus, there in parts.items()}, combine)


def _able(body: Body, names: Names, needs: str) -> dict[str, AxisVerbs]:
    """Those of these axes that can. Raises RequestError when none of them can."""
    axes = body.chosen(names)
    found = {name: axis for name, axis in axes.items() if needs in axis.able}
    if not found:
        raise RequestError(
            f"none of {', '.join(axes)} has {needs.replace('_', ' ')}",
            expected="an axis whose device can do that",
            advice="`capabilities` of an axis tells what it has; nothing was sent",
        )
    return found


def _nothing(_: object) -> None:
    return None
