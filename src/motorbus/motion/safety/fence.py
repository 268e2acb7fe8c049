"""The bounds of a machine file, set over the devices of a machine where nothing can walk around them: at the gates.

From then on they hold for every order on these buses, also for one that a program gives to a device by itself, a raw
write, or a group write.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from math import inf
from typing import TYPE_CHECKING, Any

from motorbus.core.steps import Runnable
from motorbus.errors import RequestError
from motorbus.motion.reckoning import UNDER_WAY, Reckoning
from motorbus.motion.safety.gate import Gate
from motorbus.motion.safety.guard import Bounds, Guard, untold
from motorbus.motion.safety.restarts import unknown

if TYPE_CHECKING:
    from motorbus.bus.base import BaseBus
    from motorbus.core.family import IdChanged
    from motorbus.motion.body import Body
    from motorbus.motion.capabilities import AxisVerbs
    from motorbus.motion.machine import AxisSpec


def fence(body: Body) -> None:
    """Set a guard over every axis of this machine, by what is known of it by now; endless motion is to be attended."""
    for name, bus in body.buses.items():  # axes of the file that were not opened are there all the same
        enclose(bus, {one: spec for one, spec in body.machine.axes.items() if spec.bus == name})
        if isinstance(bus.interlock, Gate):
            bus.interlock.attended, bus.interlock.origin = True, body.origins[name]
            here = [axis for axis in body.axes.values() if axis.spec.bus == name]
            for axis in here:
                bus.on_reconnect(partial(unknown, axis))
    for axis in body.axes.values():
        gate = body.buses[axis.spec.bus].interlock
        if isinstance(gate, Gate):
            gate.guards[axis.spec.node] = guard(axis)


def enclose(bus: BaseBus, axes: Mapping[str, AxisSpec]) -> None:
    """The same over the devices of a bus that is open by itself: these axes of a machine file are on it.

    Nothing is sent. Who they are is asked when the first of them is ordered to a place.
    """
    if not isinstance(bus.interlock, Gate):
        return
    _watched(bus, bus.interlock)
    for name, spec in axes.items():
        try:
            ask = _asking(bus, spec.node)
        except RequestError:  # an id that cannot be is nobody's
            continue
        bus.interlock.guards[spec.node] = _guard(name, spec, ask)


def _watched(bus: BaseBus, gate: Gate) -> None:
    bus.attach(gate)
    bus.on_id_change = partial(follow, bus, gate)


def follow(bus: BaseBus, gate: Gate, event: IdChanged) -> None:
    """A device is about to answer to another id: its guard holds, and its fault counts, under that one as well.

    An id that the machine file has bounds for keeps those. Where nobody knows which device it is, it may be any: the
    first bounds it, and any fault counts.
    """
    known = [node for node in gate.guards if event.node in (None, node)]
    for node in known:
        if event.new not in gate.guards:
            gate.guards[event.new] = _moved(bus, gate.guards[node], event.new)
        if node in gate.faults:
            gate.faults.setdefault(event.new, gate.faults[node])


def _moved(bus: BaseBus, guard: Guard, node: int) -> Guard:
    """The guard of a device that has another id now."""
    ask = None if guard.track is None else _asking(bus, node)
    return Guard(guard.name, guard.bounds, measures=ask is not None, ask=ask, show=guard.show)


def _asking(bus: BaseBus, node: int) -> Callable[[], Runnable[Any]] | None:
    """What asks a device of this bus where it is; None where devices of its family do not tell."""
    device = bus.family.devices.blocking(bus, node)
    position = getattr(type(device), "position", None)
    return None if position is None else partial(position.function, device)


def guard(axis: AxisVerbs) -> Guard:
    """The guard over one axis."""
    if axis.reckoning is not None:
        return _reckoned(axis, axis.reckoning)
    ask = partial(axis.able.position, axis.device) if "position" in axis.able else None
    return _guard(axis.name, axis.spec, ask, partial(_ordered, axis))


def _reckoned(axis: AxisVerbs, reckoning: Reckoning) -> Guard:
    """Of an axis whose device does not tell where it is: what is reckoned counts, until somebody else moves it."""

    def here() -> float | None:
        place = reckoning.departed if reckoning.position is None else reckoning.position
        return None if place is None else axis.spec.to_device(place)

    def leaves() -> None:
        if reckoning.why != UNDER_WAY:
            reckoning.forget("its device was ordered to move by itself, and not as an axis")

    return Guard(
        axis.name,
        bounds(axis.spec),
        measures=False,
        reckons=here,
        leaves=leaves,
        ordered=partial(_ordered, axis),
        show=_shown(axis.spec),
    )


def _ordered(axis: AxisVerbs, moves: bool) -> None:
    """Its device was ordered something, maybe by itself: it is left as the file says, and stopped with all that moves.

    Of what was ordered by itself nobody tells when it has come to its end: it is under way until it is stopped.
    """
    axis.engaged = True
    axis.under_way = axis.under_way or moves


def _guard(
    name: str,
    spec: AxisSpec,
    ask: Callable[[], Runnable[Any]] | None,
    ordered: Callable[[bool], None] = untold,
) -> Guard:
    """A guard over a device that tells where it is when it is asked so; None: it cannot be asked."""
    return Guard(name, bounds(spec), measures=ask is not None, ask=ask, ordered=ordered, show=_shown(spec))


def _shown(spec: AxisSpec) -> Callable[[float], str]:
    return lambda angle: spec.show(spec.from_device(angle))


def bounds(spec: AxisSpec) -> Bounds:
    """What the machine file says of an axis, in angles of its device."""
    low, high = spec.device_limits or (-inf, inf)
    step = inf if spec.max_step is None else abs(spec.rate_to_device(spec.max_step))
    return Bounds(low, high, step, abs(spec.rate_to_device(spec.max_velocity)))
