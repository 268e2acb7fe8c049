"""Which axes of a machine are at fault, who says that it is over, and whom a change that was cut off has left in doubt.

A device whose guarded change did not come to its end may have another id, other limits or an open lock, and nobody
knows which. So its axis is at fault from the moment the machine is opened: it is not moved and gets no torque until
`motorbus recover` has ended the change. Everything else works, stopping above all.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from motorbus.bus.base import BaseBus
from motorbus.core.steps import READABLE
from motorbus.errors import MotorbusError, Refused, RequestError
from motorbus.journal import Change
from motorbus.motion.body import Body
from motorbus.motion.safety import canary
from motorbus.motion.safety.gate import Gate
from motorbus.session.keeping import unfinished


def faults(body: Body) -> dict[str, str]:
    """Why each axis is at fault that is, by its name."""
    return {name: text for name, axis in body.axes.items() if (text := canary.why(axis))}


def clear(body: Body, names: str | Iterable[str] | None) -> None:
    """Take the fault off these axes, None: all. Nothing is sent. Raises RequestError for a name that there is not,
    Refused, when none was cleared, for one whose guarded change is unfinished still."""
    axes = body.chosen(names)
    for axis in axes.values():
        if canary.why(axis).startswith(canary.UNTRUSTED) and (text := _in_doubt(body, axis)):
            raise Refused(
                f"{axis.name} is {text}",
                reason="fault",
                advice="end that change by `motorbus recover`, then open the machine anew; nothing was cleared",
                node=axis.spec.node,
            )
    for axis in axes.values():
        canary.cleared(axis)


def distrust(body: Body) -> None:
    """Put those at fault whose guarded change was cut off, as the journal of their bus tells. Nothing is sent."""
    for axis in body.axes.values():
        if text := _in_doubt(body, axis):
            canary.fault(axis, text)
    for bus in body.buses.values():
        distrust_on(bus)


def distrust_on(bus: BaseBus) -> None:
    """The same for the devices of a bus over which there are guards: by the old id and by the new one of the change,
    whether an axis has that or not. Nothing is sent."""
    gate, change = bus.interlock, _doubtful(bus)
    if change is None or not isinstance(gate, Gate):
        return
    concerned = _concerned(change)
    if concerned & gate.guards.keys():
        for node in concerned:
            gate.faults.setdefault(node, _told(change, f"{change.bus}#{change.node}"))


def _in_doubt(body: Body, axis: Any) -> str:
    """Why the device of this axis is not to be trusted; "" when it is."""
    change = _doubtful(body.buses[axis.spec.bus])
    if change is None or axis.spec.node not in _concerned(change):
        return ""
    return _told(change, axis.spec.device)


def _doubtful(bus: BaseBus) -> Change | None:
    """The change that was cut off on this bus, where nobody knows what it has left."""
    try:
        change = unfinished(bus)
    except MotorbusError:  # a later version wrote the journal; the bus has a warning for that
        return None
    return None if change is None or change.facts.get(READABLE) else change


def _told(change: Change, device: str) -> str:
    what = change.what or f"{change.verb}() of {device}"
    return f"{canary.UNTRUSTED}{what} did not come to its end; `motorbus recover {change.bus}` ends it"


def _concerned(change: Change) -> set[int]:
    """The ids that the device of a change may have by now."""
    try:
        found = {change.node}
    except RequestError:
        return set()
    new = change.facts.get("new")
    return found | ({new} if isinstance(new, int) and not isinstance(new, bool) else set())
