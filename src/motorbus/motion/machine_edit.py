"""Machine files as text: a fresh file, changes that keep the comments, the JSON schema.

This is the only module that imports tomlkit.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

import msgspec
from msgspec import Meta, Struct, structs

from motorbus.core import units
from motorbus.errors import RequestError
from motorbus.motion.machine import (
    FORMAT,
    NAME,
    Acceleration,
    AxisConfig,
    BusConfig,
    GroupConfig,
    MachineConfig,
    Position,
    Quantity,
    Velocity,
)

HEAD: Final = (
    "# A machine: its buses, its axes, and how far and how fast these may move. Quantities have a unit."
)
NUMBER: Final = r"(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"
DIGITS: Final = 12


def edit(text: str, changes: Mapping[str, object]) -> str:
    """The text with other values: `{"axis.pan.zero": "12 deg", "pose.ready": {"pan": "5 deg"}, "pose.old": None}`.

    A place is the names of tables and key with points between; None takes it out. Comments and order stay. Raises
    RequestError for a place that is not there to be taken out, and when the result is not a machine.
    """
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    ends = "\r\n" if "\r\n" in text else "\n"
    try:
        document = tomlkit.parse(text.replace("\r\n", "\n"))
        for place, value in changes.items():
            here: Any = document
            *tables, key = place.split(".")
            for depth, name in enumerate(tables, 1):
                if name not in here:
                    here[name] = tomlkit.table(is_super_table=depth < len(tables))
                here = here[name]
            if value is None or isinstance(value, Mapping):
                here.pop(key) if value is None or key in here else None
            if value is not None:
                here[key] = value
    except (TOMLKitError, KeyError, TypeError) as error:
        raise RequestError(f"the file cannot be edited: {error}", advice="make this change by hand") from None
    edited = document.as_string()
    MachineConfig.parse(edited)
    return edited.replace("\n", ends)


def pose_change(machine: MachineConfig, name: str, positions: Mapping[str, float]) -> dict[str, object]:
    """The change of a file that adds a pose, or replaces it, in the display units."""
    if not re.match(NAME, name):
        raise RequestError(f"{name!r} is not a name of a pose", expected="a-z, then a-z 0-9 _ -")
    return {f"pose.{name}": {axis: _position(machine.axes[axis], place) for axis, place in positions.items()}}


def write(machine: MachineConfig) -> str:
    """The text of a file that describes this machine."""
    lines = [HEAD, f"format = {FORMAT}"]
    if machine.name:
        lines.append(f"name = {_quoted(machine.name)}")
    for name, bus in machine.buses.items():
        lines += ["", f"[bus.{name}]", f"address = {_quoted(bus.address)}"]
    for name, axis in machine.axes.items():
        lines += ["", f"[axis.{name}]"]
        for field in structs.fields(AxisConfig):
            value = getattr(axis, field.name)
            if value is not None and value != field.default and (field.name != "zero" or value):
                lines.append(f"{field.name} = {_value(axis, field.name, value)}")
    for name, members in machine.groups.items():
        lines += ["", f"[group.{name}]", f"axes = [{', '.join(map(_quoted, members))}]"]
    for name, pose in machine.poses.items():
        lines += ["", f"[pose.{name}]"]
        lines += [f"{axis} = {_quoted(_position(machine.axes[axis], place))}" for axis, place in pose.items()]
    return "\n".join(lines) + "\n"


def _value(axis: AxisConfig, key: str, value: Any) -> str:
    unit = axis.display_unit
    if key == "zero":
        return _quoted(_text(value, "position", "deg"))
    if key == "travel":
        return _quoted(_text(value, "length", "mm"))
    if isinstance(value, Velocity):
        return _quoted(_text(value, value.kind, f"{unit}/s"))
    if isinstance(value, Acceleration):
        return _quoted(_text(value, value.kind, f"{unit}/s2"))
    return _quoted(_position(axis, value)) if isinstance(value, Quantity) else json.dumps(value)


def _position(axis: AxisConfig, value: float) -> str:
    return _text(value, "length" if axis.travel else "position", axis.display_unit)


def _text(value: float, quantity: str, unit: str) -> str:
    """The fewest digits in `unit`, or in the API unit, that are read as the same number."""
    number = value / units.SCALES[quantity][unit]
    for digits in range(1, DIGITS):
        text = f"{float(f'{number:.{digits}g}'):.{DIGITS}g}"
        if float(text) * units.SCALES[quantity][unit] == value:
            return f"{text} {unit}"
    return f"{float(value)!r} {next(iter(units.SCALES[quantity]))}"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


# -- schema ----------------------------------------------------------------------------------------------------

Name = Annotated[str, Meta(pattern=NAME)]


class _File(Struct, forbid_unknown_fields=True):
    format: Literal[1]
    name: str = ""
    bus: dict[Name, BusConfig] = {}
    axis: dict[Name, AxisConfig] = {}
    group: dict[Name, GroupConfig] = {}
    pose: dict[Name, dict[str, Position]] = {}


def schema() -> dict[str, Any]:
    """The JSON schema of a machine file, for editors."""
    made = msgspec.json.schema(_File, schema_hook=_quantity_schema)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "motorbus machine file",
        **made,
    }


def _quantity_schema(kind: type[Quantity]) -> dict[str, Any]:
    names = [re.escape(unit) for quantity in kind.kinds for unit in units.SCALES[quantity]]
    sign = "" if kind.above_zero else "-"
    return {"type": "string", "pattern": rf"^\s*[+{sign}]?{NUMBER}\s*({'|'.join(names)})\s*$"}
