"""The JSON Schema of a machine file: an editor that knows it completes and checks as one writes.

msgspec makes it from the types; here it learns what TOML has instead of numbers with a unit, and what a schema can say
of fields that depend on each other. Whether a pose is inside the limits, only reading tells.
"""

from __future__ import annotations

from typing import Any, Final

import msgspec

from motorbus.motion.machine import keys
from motorbus.motion.machine.keys import Key
from motorbus.motion.machine.model import FORMAT, NAME, AxisSpec, Description

DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"
_NUMBER: Final = r"([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?"


def schema() -> dict[str, Any]:
    """The schema as plain data; always the same."""
    _, parts = msgspec.json.schema_components([Description], ref_template="#/$defs/{name}")
    file, bus, axis, group = (parts[name] for name in ("Description", "BusSpec", "AxisSpec", "GroupSpec"))
    names: dict[str, dict[str, Any]] = {
        "bus": {"$ref": "#/$defs/bus"},
        "axis": {
            "if": {"type": "object", "required": ["travel"]},
            "then": {"$ref": "#/$defs/linear_axis"},
            "else": {"$ref": "#/$defs/turning_axis"},
        },
        "group": {"$ref": "#/$defs/group"},
        "pose": {"$ref": "#/$defs/pose"},
    }
    tables = {kind: _named(file["properties"][kind], of) for kind, of in names.items()}
    return {
        "$schema": DIALECT,
        "title": "A machine of motorbus",
        "type": "object",
        "required": ["format"],
        "additionalProperties": False,
        "properties": {
            "format": {"const": FORMAT, "description": "the kind of file this is"},
            "name": file["properties"]["name"],
            **tables,
        },
        "$defs": {
            "bus": {**bus, "title": "a bus"},
            "turning_axis": _axis(axis, linear=False),
            "linear_axis": _axis(axis, linear=True),
            "group": _group(group),
            "pose": _pose(),
        },
    }


def _named(made: dict[str, Any], of: dict[str, Any]) -> dict[str, Any]:
    """A table whose keys are names."""
    return {
        "type": "object",
        "description": made["description"],
        "propertyNames": {"pattern": f"^{NAME}$"},
        "additionalProperties": of,
    }


def _axis(made: dict[str, Any], *, linear: bool) -> dict[str, Any]:
    rows = [key for key in keys.AXIS.values() if linear or key.name != "travel"]
    properties = {key.name: _property(made["properties"][key.name], key, linear) for key in rows}
    return {
        "title": "an axis that moves along a line" if linear else "an axis that turns",
        "description": " ".join((AxisSpec.__doc__ or "").split()),
        "type": "object",
        "additionalProperties": False,
        "required": [key.name for key in rows if key.needed] + (["travel"] if linear else []),
        "properties": properties,
        "dependentRequired": {"low": ["high"], "high": ["low"]},
        "not": {"required": ["torque", "current"]},
        "if": {"required": ["exit"], "properties": {"exit": {"const": "park"}}},
        "then": {"required": ["park"]},
    }


def _property(made: dict[str, Any], key: Key, linear: bool) -> dict[str, Any]:
    """One key of an axis: what msgspec makes of its type, and text where it is a quantity."""
    default = key.usual[linear] or (key.default if key.default not in (None, msgspec.NODEFAULT) else None)
    usual = {} if default is None else {"default": default}
    if key.choices(linear):
        return {"description": key.says, "enum": list(key.choices(linear)), **usual}
    if key.measure is None:
        return made
    number = next(part for part in (made, *made.get("anyOf", ())) if part.get("type") == "number")
    return {
        "description": f"{key.says}; {key.range(linear)}",
        **({"anyOf": [_bare(number), _text(key, linear)]} if not key.needs_unit else _text(key, linear)),
        **usual,
    }


def _bare(number: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in number.items() if name not in ("description", "default")}


def _text(key: Key, linear: bool) -> dict[str, Any]:
    """A number with its unit as text, without it where none is needed; the sign is all that a pattern can say of a
    range."""
    positive = key.meta.gt == 0 or (key.meta.ge or -1) > 0
    some = "|".join(unit.replace("^", r"\^") for unit in key.units(linear))
    return {
        "type": "string",
        "pattern": rf"^\s*{'[+]?' if positive else '[+-]?'}{_NUMBER}\s*({some}){'' if key.needs_unit else '?'}\s*$",
    }


def _group(made: dict[str, Any]) -> dict[str, Any]:
    axes = {**made["properties"]["axes"], "uniqueItems": True}
    return {**made, "title": "a group", "properties": {"axes": axes}}


def _pose() -> dict[str, Any]:
    ways = [_text(keys.POSE, linear=False), _text(keys.POSE, linear=True)]
    return {
        "title": "a pose",
        "description": keys.FILE["pose"].says,
        "type": "object",
        "minProperties": 1,
        "propertyNames": {"pattern": f"^{NAME}$"},
        "additionalProperties": {"anyOf": ways},
    }
