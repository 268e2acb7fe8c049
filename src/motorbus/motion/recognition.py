"""What the devices of a machine are, asked when it is opened: without that nobody knows what its axes can do.

Only reads are sent. What the file asks of a device that cannot do it is refused here, before anything moves: a person
who wrote down a cap or a way to end relies on it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from motorbus.core.family import Identity
from motorbus.core.steps import Runnable
from motorbus.errors import DeviceError, LimitExceeded, MotorbusError, NoReply, RequestError
from motorbus.motion.body import Body
from motorbus.motion.capabilities import AxisVerbs
from motorbus.motion.limits import Device, check_goal
from motorbus.motion.machine.refusal import of_file
from motorbus.motion.parallel import Parallel
from motorbus.motion.several import everyone, of_each, raised

ASKED: Final = "nothing was sent but questions"
_SLACK: Final = 1e-6
"""Of the travel: a limit in degrees is rounded."""


def recognise(body: Body) -> Parallel[None]:
    """Ask each device what it is, the buses at the same time, and tell its axis what it can do.

    Raises NoReply, naming axis, device and address, for one that does not answer; RequestError for one of which nobody
    has said what it can do, or that lacks what the file asks of it. Everyone is asked first, and all are named.
    """
    parts = body.by_bus(body.axes)

    def combine(results: Mapping[str, Any]) -> None:
        told = of_each(parts, results)
        for name, one in told.items():
            axis = body.axes[name]
            told[name] = _unheard(axis, body, one) if isinstance(one, NoReply) else _judged(axis, one)
        with of_file(body.machine.file):
            raised(told)

    return Parallel({bus: everyone(there, _asked) for bus, there in parts.items()}, combine)


class Asked(NamedTuple):
    """What a device is; its own limits, or why it has none, where it has to be known whether it can be parked; and its
    travel, where the file has limits."""

    identity: Identity
    limits: Device | MotorbusError = None
    travel: Device = None


async def _asked(axis: AxisVerbs) -> Asked:
    identify: Runnable[Identity] = type(axis.device).identify.function(axis.device)
    identity = await identify
    able = axis.bus.driver.axis(identity)
    travel: Device = None
    if axis.spec.device_limits is not None and "travel" in able:
        travel = await able.travel(axis.device)
    if axis.spec.exit != "park" or "limits" not in able:
        return Asked(identity, travel=travel)
    try:
        limits: Device = await able.limits(axis.device)
    except (RequestError, DeviceError) as error:
        return Asked(identity, error, travel)
    return Asked(identity, limits, travel)


def _unheard(axis: AxisVerbs, body: Body, silence: NoReply) -> NoReply:
    address = body.machine.buses[axis.spec.bus].address
    found = NoReply(
        f"{axis.spec.device} does not answer on {address}",
        sent=silence.sent,
        received=silence.received,
        expected=f"the device with the id {axis.spec.node}",
        cause=silence.cause or "it has no power, another id or another rate, or its cable is off",
        advice=f"see to that, or open the machine with other axes only; {ASKED}",
        node=axis.spec.node,
    )
    found.__cause__ = silence
    return found


def _judged(axis: AxisVerbs, told: Any) -> MotorbusError | None:
    """Tell the axis what its device can do; the error when that does not do."""
    if isinstance(told, MotorbusError):
        return told
    model = told.identity.model
    axis.recognised(axis.bus.driver.axis(told.identity), model)
    if not axis.able.names:
        return RequestError(
            f"{axis.spec.device} is {model}, of which nobody has said what it can do",
            expected="a device that moves",
            advice=f"take the axis out of the file, or use its own commands; {ASKED}",
        )
    return _lacking(axis) or _beyond(axis, told.travel) or _unreachable(axis, told.limits)


def _lacking(axis: AxisVerbs) -> RequestError | None:
    """The error for what the machine file asks of this axis and its device cannot."""
    spec, able = axis.spec, axis.able
    wants = (
        ("torque", "a cap of its torque", spec.torque is not None, ("cap_torque",), "take torque out"),
        ("current", "a cap of its current", spec.current is not None, ("cap_current",), "take current out"),
        ("exit", "a switch for its torque", spec.exit == "torque_off", ("disable_torque",), 'exit = "hold"'),
        ("exit", "a way to its place", spec.exit == "park", ("stream", "keep_time"), 'exit = "hold"'),
    )
    for key, what, wanted, needs, instead in wants:
        if wanted and not any(one in able for one in needs):
            another = "=" in instead
            return RequestError(
                f"axis.{axis.name}.{key}: {spec.device} ({axis.model}) does not have {what}",
                expected=f"a key that its device can follow, as {instead}" if another else "no such key",
                advice=f"write {instead}; {ASKED}" if another else f"{instead} of the file; {ASKED}",
                node=spec.node,
            )
    return None


def _beyond(axis: AxisVerbs, travel: Device) -> RequestError | None:
    """The error for limits of the file beyond the travel of the device (rad of it)."""
    spec = axis.spec
    if travel is None:
        return None
    first, last = sorted(spec.from_device(end) for end in travel)
    slack = _SLACK * (last - first)
    for key, value in (("low", spec.low), ("high", spec.high)):
        if value is not None and not first - slack <= value <= last + slack:
            return RequestError(
                f"axis.{axis.name}.{key}: {spec.show(value)} is outside the travel of {spec.device} ({axis.model}), "
                f"{spec.show(first)} to {spec.show(last)}",
                expected=f"{spec.show(first)} to {spec.show(last)}",
                advice=f"change {key}, or zero, sign or gear of the axis; {ASKED}",
                node=spec.node,
            )
    return None


def _unreachable(axis: AxisVerbs, device: Device | MotorbusError) -> RequestError | None:
    """The error for a place to park beyond the limits of the device (rad of it), or where it has none that can be told:
    it would be found out at the end."""
    spec = axis.spec
    if spec.exit != "park" or spec.park is None:
        return None
    if isinstance(device, MotorbusError):
        return _unlimited(axis, device)
    try:
        check_goal(axis.name, spec, spec.park, device=device)
    except LimitExceeded as error:
        return RequestError(
            f"axis.{axis.name}.park: {spec.show(spec.park)} is outside the limits of {spec.device} ({axis.model})",
            expected=error.expected,
            advice=f'change park, or write exit = "hold"; {ASKED}',
            node=spec.node,
        )
    return None


def _unlimited(axis: AxisVerbs, why: MotorbusError) -> RequestError:
    """The error for a device that is to park, and of which nobody knows how far it goes. To leave it alone is always
    possible, and lets no arm sag; to hold, such a servo would have to be told where it is, within its limits."""
    instead = 'exit = "leave"'
    found = RequestError(
        f"axis.{axis.name}.exit: {axis.spec.device} ({axis.model}) cannot be parked: {why.summary}",
        sent=why.sent,
        received=why.received,
        expected=f"{why.expected or 'a device that tells its limits'}, or {instead}",
        cause=why.cause,
        advice=f"write {instead}; {ASKED}",
        node=axis.spec.node,
    )
    found.__cause__ = why
    return found
