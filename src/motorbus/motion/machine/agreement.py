"""What the parts of a machine must agree on: limits that enclose what they limit, names that are there, one axis each.

Each refusal names the key to change, and what it disagrees with.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from motorbus.core.register import shown
from motorbus.errors import RequestError
from motorbus.motion.machine.keys import AXIS
from motorbus.motion.machine.model import HIGHEST_NODE, AxisSpec, Description
from motorbus.motion.machine.refusal import listed, nearest, path, refused

OUTSIDE: Final = "change it, or low and high of its axis"


def check(machine: Description) -> None:
    """Raise RequestError, naming the place in the file, for the first thing that does not fit with another."""
    _names(machine)
    _devices(machine)
    for name, axis in machine.axes.items():
        _unit(name, axis)
        _limits(name, axis)
        _leaving(name, axis)
        _caps(name, axis)
    _groups(machine)
    _poses(machine)


def _names(machine: Description) -> None:
    """A name stands for one thing, whoever types it: a bus, an axis or a group."""
    taken: dict[str, str] = {}
    for kind, names in (("bus", machine.buses), ("axis", machine.axes), ("group", machine.groups)):
        for name in names:
            if name in taken:
                raise refused(
                    path(kind, name),
                    f"this is the name of {path(taken[name], name)} too",
                    "a name for each bus, axis and group",
                    f"call it {name}_{kind}",
                )
            taken[name] = kind


def _devices(machine: Description) -> None:
    seen: dict[tuple[str, int], str] = {}
    for name, axis in machine.axes.items():
        where = path("axis", name, "device")
        if axis.bus not in machine.buses:
            raise refused(
                where,
                f"there is no bus {axis.bus}",
                listed(machine.buses, "a bus of the file, as [bus.arm]"),
                nearest(
                    axis.bus, machine.buses, f"add a table [bus.{axis.bus}], or change the name before #"
                ),
            )
        if axis.node > HIGHEST_NODE:
            raise refused(where, f"{axis.node} is no id", f"0 to {HIGHEST_NODE}", "give the id of the device")
        device = axis.bus, axis.node
        if device in seen:
            raise refused(
                where,
                f"{axis.device} moves {path('axis', seen[device])} already",
                "a device for each axis",
                "change the id in one of them",
            )
        seen[device] = name


def _unit(name: str, axis: AxisSpec) -> None:
    choices = AXIS["unit"].choices(axis.linear)
    if axis.unit not in choices:
        why = f"{axis.unit} is not possible"
        raise refused(
            path("axis", name, "unit"), why, listed(choices), f"unit = {AXIS['unit'].example[axis.linear]}"
        )


def _limits(name: str, axis: AxisSpec) -> None:
    low, high = axis.low, axis.high
    if low is None and high is None:
        return
    if low is None or high is None:
        missing, there = ("low", "high") if low is None else ("high", "low")
        raise refused(
            path("axis", name, missing),
            f"is missing, and {there} is there",
            "both, or none",
            f"add {missing}, or take {there} out",
        )
    if low == high:
        raise refused(
            path("axis", name, "high"),
            f"it is {axis.show(high)} like low, and leaves the axis no way",
            f"more than {axis.show(low)}",
            "set it higher, or leave both out",
        )
    if low > high:
        raise refused(
            path("axis", name, "low"),
            f"{axis.show(low)} is above high, which is {axis.show(high)}",
            "low below high",
            "exchange the two; the direction is what sign = -1 turns round",
        )


def _leaving(name: str, axis: AxisSpec) -> None:
    where = path("axis", name, "park")
    if axis.exit == "park" and axis.park is None:
        raise refused(
            where, 'is missing, and exit is "park"', f'park = "0 {axis.unit}", or another exit', "add it"
        )
    if axis.park is not None and not axis.allows(axis.park):
        raise refused(where, f"{axis.show(axis.park)} is outside the limits", _range(axis), OUTSIDE)


def _caps(name: str, axis: AxisSpec) -> None:
    if axis.torque is not None and axis.current is not None:
        raise refused(
            path("axis", name, "current"), "torque is there too", "torque or current", "take one of them out"
        )


def _groups(machine: Description) -> None:
    for name, group in machine.groups.items():
        for place, axis in enumerate(group.axes):
            where = f"{path('group', name, 'axes')}[{place}]"
            if axis not in machine.axes:
                raise no_axis(where, axis, machine.axes)
            if axis in group.axes[:place]:
                raise refused(where, f"{axis} is named twice", "each axis once", "take one of them out")


def no_axis(where: str, axis: str, axes: Mapping[str, AxisSpec]) -> RequestError:
    """The error for a name that no axis has."""
    advice = nearest(axis, axes, "add a table [axis.NAME] for it, or take the name out")
    return refused(where, f"there is no axis {shown(axis)}", listed(axes, "an axis of the file"), advice)


def _poses(machine: Description) -> None:
    for name, pose in machine.poses.items():
        for axis, position in pose.items():
            spec = machine.axes.get(axis)
            if spec is None:
                raise no_axis(path("pose", name, axis), axis, machine.axes)
            if not spec.allows(position):
                where = path("pose", name, axis)
                raise refused(where, f"{spec.show(position)} is outside the limits", _range(spec), OUTSIDE)


def _range(axis: AxisSpec) -> str:
    ends = (axis.low, axis.high) if axis.low is not None and axis.high is not None else None
    return f"{axis.show(ends[0])} to {axis.show(ends[1])}" if ends else "a finite position"
