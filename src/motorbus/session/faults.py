"""Axes at fault: list them, clear them, and find devices whose guarded change is unfinished.

After an interrupted change a device may have another id, other limits or an open lock. So its axis is at fault when the
machine is opened: it does not move and gets no torque until `motorbus recover` has ended the change.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from motorbus.bus.base import BaseBus
from motorbus.core.steps import READABLE
from motorbus.errors import MotorbusError, Refused, RequestError
from motorbus.journal import Change
from motorbus.motion.body import Body
from motorbus.motion.safety import restarts
from motorbus.motion.safety.gate import Gate
from motorbus.session.journals import unfinished


def faults(body: Body) -> dict[str, str]:
    """The reason of each axis that is at fault, by name."""
    return {name: text for name, axis in body.axes.items() if (text := restarts.why(axis))}


def clear(body: Body, names: str | Iterable[str] | None) -> None:
    """Clear the fault of these axes, None: all. Sends nothing.

    Raises RequestError for an unknown name; Refused, and clears none, if a guarded change of one is unfinished."""
    axes = body.chosen(names)
    for axis in axes.values():
        if restarts.why(axis).startswith(restarts.UNTRUSTED) and (text := _in_doubt(body, axis)):
            raise Refused(
                f"{axis.name} is {text}",
                reason="fault",
                advice="end that change by `motorbus recover`, then open the machine again; nothing was cleared",
                node=axis.spec.node,
            )
    for axis in axes.values():
        restarts.cleared(axis)


def distrust(body: Body) -> None:
    """Set the fault of axes whose guarded change is unfinished by the journal of their bus. Sends nothing."""
    for axis in body.axes.values():
        if text := _in_doubt(body, axis):
            restarts.fault(axis, text)
    for bus in body.buses.values():
        distrust_on(bus)


def distrust_on(bus: BaseBus) -> None:
    """Set the fault of the devices on one bus with guards, by the old and the new id of the change. Sends nothing."""
    gate, change = bus.interlock, _doubtful(bus)
    if change is None or not isinstance(gate, Gate):
        return
    concerned = _concerned(change)
    if concerned & gate.guards.keys():
        for node in concerned:
            gate.faults.setdefault(node, _reason(change, f"{change.bus}#{change.node}"))


def _in_doubt(body: Body, axis: Any) -> str:
    """The unfinished change of the device of this axis, as text; "" without one."""
    change = _doubtful(body.buses[axis.spec.bus])
    if change is None or axis.spec.node not in _concerned(change):
        return ""
    return _reason(change, axis.spec.device)


def _doubtful(bus: BaseBus) -> Change | None:
    """The unfinished change on this bus, unless it only reads."""
    try:
        change = unfinished(bus)
    except MotorbusError:  # a later version wrote the journal; the bus warns of that
        return None
    return None if change is None or change.facts.get(READABLE) else change


def _reason(change: Change, device: str) -> str:
    what = change.what or f"{change.verb}() of {device}"
    return f"{restarts.UNTRUSTED}{what} is unfinished; `motorbus recover {change.bus}` ends it"


def _concerned(change: Change) -> set[int]:
    """The ids that the device of a change may have."""
    try:
        found = {change.node}
    except RequestError:
        return set()
    new = change.facts.get("new")
    return found | ({new} if isinstance(new, int) and not isinstance(new, bool) else set())
