"""The bounds of a machine file, set over the devices of a machine where nothing can walk around them: at the gates.

From then on they hold for every order on these buses, also for one that a program gives to a device by itself, a raw
write, or a group write.
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING

from motorbus.motion.safety.gate import Gate
from motorbus.motion.safety.guard import Bounds, Guard

if TYPE_CHECKING:
    from motorbus.motion.body import Body
    from motorbus.motion.capabilities import AxisVerbs


def fence(body: Body) -> None:
    """Set a guard over every axis of this machine, by what is known of it by now."""
    for bus in body.buses.values():
        if isinstance(bus.admit, Gate):
            bus.admit.watch(bus.turns.known.seen, bus.link.now)
            bus.turns.look = bus.admit.look
    for axis in body.axes.values():
        gate = body.buses[axis.spec.bus].admit
        if isinstance(gate, Gate):
            gate.guards[axis.spec.node] = guard(axis)


def guard(axis: AxisVerbs) -> Guard:
    """The guard over one axis."""
    spec = axis.spec

    def show(angle: float) -> str:
        return spec.show(spec.from_device(angle))

    if "position" not in axis.able:
        return Guard(axis.name, bounds(axis), measures=False, show=show)
    return Guard(axis.name, bounds(axis), ask=lambda: axis.able["position"](axis.device), show=show)


def bounds(axis: AxisVerbs) -> Bounds:
    """What the machine file says of it, in angles of its device."""
    spec = axis.spec
    low, high = spec.device_limits or (-inf, inf)
    step = inf if spec.max_step is None else abs(spec.rate_to_device(spec.max_step))
    return Bounds(low, high, step, abs(spec.rate_to_device(spec.max_velocity)))
