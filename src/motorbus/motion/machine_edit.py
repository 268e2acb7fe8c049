"""Machine files as text: a fresh file, changes that keep the comments, the JSON schema.

This is the only module that imports tomlkit.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from types import NoneType, UnionType
from typing import Annotated, Any, Final, Literal, Union, get_args, get_origin, get_type_hints

from msgspec import NODEFAULT, Meta, Struct, structs

from motorbus.core import units
from motorbus.errors import RequestError
from motorbus.motion.machine import (
    FORMAT,
    NAME,
    Acceleration,
    AxisConfig,
    BusConfig,
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
            _put(document, place, value)
    except (TOMLKitError, KeyError, TypeError) as error:
        raise RequestError(f"the file cannot be edited: {error}", advice="make this change by hand") from None
    edited = document.as_string()
    MachineConfig.parse(edited)
    return edited.replace("\n", ends)


def _put(document: Any, place: str, value: object) -> None:
    import tomlkit

    *tables, key = place.split(".")
    here = document
    for depth, name in enumerate(tables, 1):
        if name not in here:
            here[name] = tomlkit.table(is_super_table=depth < len(tables))
        here = here[name]
    if value is None:
        del here[key]
    elif isinstance(value, Mapping) and key in here:
        for name in [name for name in here[key] if name not in value]:
            del here[key][name]
        for name, inner in value.items():
            here[key][name] = inner
    elif isinstance(value, Mapping):
        if not tables:
            raise KeyError(place)
        table = tomlkit.table()
        for name, inner in value.items():
            table[name] = inner
        here[key] = table
    else:
        here[key] = value


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
    explained: set[str] = set()
    for name, axis in machine.axes.items():
        lines += ["", f"[axis.{name}]", *_axis_lines(axis, explained)]
    for name, members in machine.groups.items():
        lines += ["", f"[group.{name}]", f"axes = [{', '.join(map(_quoted, members))}]"]
    for name, pose in machine.poses.items():
        lines += ["", f"[pose.{name}]"]
        lines += [f"{axis} = {_quoted(_position(machine.axes[axis], place))}" for axis, place in pose.items()]
    return "\n".join(lines) + "\n"


def _axis_lines(axis: AxisConfig, explained: set[str]) -> list[str]:
    lines = []
    hints = get_type_hints(AxisConfig, include_extras=True)
    for field in structs.fields(AxisConfig):
        value = getattr(axis, field.name)
        if value is None or value == field.default:
            continue
        line = f"{field.name} = {_value(axis, field.name, value)}"
        description = description_of(hints[field.name])
        if description and field.name not in explained:
            line = f"{line:<30}  # {description}"
            explained.add(field.name)
        lines.append(line)
    return lines


def _value(axis: AxisConfig, key: str, value: Any) -> str:
    if isinstance(value, Quantity) and value.kind == "raw":
        return _quoted(f"{value:.12g} raw")
    if key == "zero":
        return _quoted(_text(value, "position", "deg"))
    if isinstance(value, Velocity):
        return _quoted(
            _text(value, "linear velocity" if axis.travel else "velocity", f"{axis.display_unit}/s")
        )
    if isinstance(value, Acceleration):
        kind = "linear acceleration" if axis.travel else "acceleration"
        return _quoted(_text(value, kind, f"{axis.display_unit}/s2"))
    if key == "travel":
        return _quoted(_text(value, "length", "mm"))
    if isinstance(value, Quantity):
        return _quoted(_position(axis, value))
    return json.dumps(value)


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


def schema() -> dict[str, Any]:
    """The JSON schema of a machine file, for editors."""
    members = {"type": "array", "items": {"type": "string"}, "minItems": 1}
    tables = {
        "bus": _struct_schema(BusConfig),
        "axis": _struct_schema(AxisConfig),
        "group": _object({"axes": members}, ["axes"]),
        "pose": {"type": "object", "additionalProperties": _type_schema(Position)},
    }
    properties = {name: _tables(table) for name, table in tables.items()}
    properties |= {"format": {"const": FORMAT}, "name": {"type": "string"}}
    title = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "motorbus machine file",
    }
    return title | _object(properties, ["format"])


def _object(properties: dict[str, Any], required: list[str]) -> dict[str, Any]:
    return {
        "type": "object",
        "additionalProperties": False,
        "required": required,
        "properties": properties,
    }


def _tables(table: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "propertyNames": {"pattern": NAME}, "additionalProperties": table}


def _struct_schema(kind: type[Struct]) -> dict[str, Any]:
    properties = {}
    for name, hint in get_type_hints(kind, include_extras=True).items():
        properties[name] = _type_schema(hint)
        if description := description_of(hint):
            properties[name]["description"] = description
    required = [field.encode_name for field in structs.fields(kind) if field.default is NODEFAULT]
    return _object(properties, required)


def split_hint(hint: Any) -> tuple[Any, tuple[Meta, ...]]:
    """The type of a key without None, and its annotations."""
    found: tuple[Meta, ...] = ()
    while get_origin(hint) in (Annotated, Union, UnionType):
        if get_origin(hint) is Annotated:
            found += tuple(one for one in hint.__metadata__ if isinstance(one, Meta))
            hint = hint.__origin__
        else:
            hint = next(one for one in get_args(hint) if one is not NoneType)
    return hint, found


def description_of(hint: Any) -> str:
    """What a key means."""
    return next((meta.description for meta in split_hint(hint)[1] if meta.description), "")


def _type_schema(hint: Any) -> dict[str, Any]:
    kind, metas = split_hint(hint)
    if get_origin(kind) is Literal:
        return {"enum": list(get_args(kind))}
    if issubclass(kind, Quantity):
        names = [unit for quantity in kind.kinds for unit in units.SCALES[quantity]]
        pattern = "|".join(map(re.escape, [*names, *(["raw"] if kind.counts else [])]))
        sign = "" if kind.above_zero else "-"
        return {"type": "string", "pattern": rf"^\s*[+{sign}]?{NUMBER}\s*({pattern})\s*$"}
    made: dict[str, Any] = {"type": {float: "number", bool: "boolean", str: "string"}[kind]}
    for meta in metas:
        bounds = {"exclusiveMinimum": meta.gt, "maximum": meta.le, "pattern": meta.pattern}
        made |= {name: bound for name, bound in bounds.items() if bound is not None}
    return made
