"""One axis of a machine: a device, seen in rad or m, with its limits, and with no more verbs than the device has.

What a device cannot do its axis lacks: `hasattr(axis, "temperature")` tells, and no verb is there only to raise.
`Axis` and `AsyncAxis` are two-line classes over one list of verbs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeAlias, TypeVar

from motorbus.core.family import State
from motorbus.core.operation import Operation, Runnable
from motorbus.core.verbs import Awaiting, Blocking, verb
from motorbus.motion.machine import AxisSpec

if TYPE_CHECKING:
    from enum import Enum

P = ParamSpec("P")
T = TypeVar("T")

Able: TypeAlias = "Mapping[str, Callable[..., Runnable[Any]]]"
"""What a device can do; see `core.family.Family.axis`."""


class ability(verb[P, T]):  # noqa: N801 - reads as a word in a list of verbs
    """A verb that an axis has only if its device has the capability that it `needs`."""

    def __init__(self, needs: str, function: Callable[Concatenate[Any, P], Runnable[T]]) -> None:
        super().__init__(function)
        self.needs = needs

    if not TYPE_CHECKING:

        def __get__(self, axis: Any, owner: type) -> Any:
            if axis is not None and self.needs not in axis.able:
                raise AttributeError(f"{axis.name} has no {self.needs.replace('_', ' ')}")
            return super().__get__(axis, owner)


class AxisVerbs:
    """What an axis can do, blocking or async. Positions are in rad (m on a linear axis).

    `name` and `spec` are those of the machine file, `able` is what its device can do. `engaged` becomes true when it
    is given torque or moved from here: then its exit policy counts.
    """

    def __init__(self, bus: Any, name: str, spec: AxisSpec, device: Any, able: Able) -> None:
        self.bus = bus
        self.name = name
        self.spec = spec
        self.device = device
        self.able = able
        self.engaged = False


def state(axis: AxisVerbs) -> Operation[State]:
    """One sample of everything it tells; position and velocity in rad and rad/s (m, m/s on a linear axis)."""
    found: State = yield from axis.able["state"](axis.device)
    spec = axis.spec
    return replace(
        found,
        position=None if found.position is None else spec.from_device(found.position),
        velocity=None if found.velocity is None else spec.rate_from_device(found.velocity),
    )


def position(axis: AxisVerbs) -> Operation[float]:
    """Where it is, as its device measures it (rad, m)."""
    return axis.spec.from_device((yield from axis.able["position"](axis.device)))


def enable_torque(axis: AxisVerbs) -> Operation[None]:
    """Torque on without a jump, with the cap of the machine file."""
    axis.engaged = True
    yield from axis.able["enable_torque"](axis.device)


def disable_torque(axis: AxisVerbs) -> Operation[None]:
    """Limp."""
    yield from axis.able["disable_torque"](axis.device)


def stop(axis: AxisVerbs) -> Operation[Enum]:
    """Decelerate and stay; gives what the device promises."""
    promise: Enum = yield from axis.able["stop"](axis.device)
    return promise


class _Verbs(AxisVerbs):
    state = ability("state", state)
    position = ability("position", position)
    enable_torque = ability("enable_torque", enable_torque)
    disable_torque = ability("disable_torque", disable_torque)
    stop = ability("stop", stop)


class Axis(_Verbs, Blocking):
    """An axis of a `Robot`."""


class AsyncAxis(_Verbs, Awaiting):
    """An axis of an `AsyncRobot`: every verb is awaited."""
