"""The JSON Schema of a program file, made from the rows: an editor that knows it completes and checks as one writes.

It says what a schema can: which fields there are, their kinds and ranges. Whether `0.3 turns` is a whole number of
units, only reading tells.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

from motorbus.core.register import Register
from motorbus.families.stepper.program import names, text
from motorbus.families.stepper.program.quantities import DISTANCES, LENGTH, SPEEDS
from motorbus.families.stepper.program.source import FORMAT
from motorbus.families.stepper.table import ENDLESS, INPUTS, OUTPUTS, PARAMETERS, STEPS, UNITS

DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"
_NUMBER: Final = r"([0-9]{1,20}(\.[0-9]{0,20})?|\.[0-9]{1,20})"
_SPELLINGS: Final = {
    "units": "units?", "pulses": "pulses?", "turns": "turns?", "deg": "(deg|degrees|°)", "rpm": "(rpm|RPM)",
}  # fmt: skip
"""What else a unit may be called."""
_NAMED: Final = rf"(?!input |output ){names.NAME.pattern}"
"""A name of the file; which words it may not be besides, only reading tells."""
_EXPERT: Final = (
    "steps may use inputs 3 and 4, and a number may be one that a controller holds and nobody should write, beyond the "
    "ranges here: a loop count of 255, 0 for what makes the geometry"
)


def schema() -> dict[str, Any]:
    """The schema as plain data; always the same."""
    return {
        "$schema": DIALECT,
        "title": "A project of the stepper controller",
        "type": "object",
        "required": ["format", "motor", "step"],
        "additionalProperties": False,
        "properties": {
            "format": {"const": FORMAT},
            "name": {"type": "string", "description": "what people call it"},
            "project": _integer(PARAMETERS["project"]),
            "repeat": {
                "description": PARAMETERS["project_loop"].note,
                "oneOf": [
                    {"type": "integer", "minimum": 0, "maximum": ENDLESS - 1},
                    {"const": "endless"},
                ],
            },
            "total_steps": _integer(PARAMETERS["total_steps"]),
            "expert": {"type": "boolean", "description": _EXPERT},
            "motor": _motor(),
            "loop": _loop(),
            "inputs": _names(INPUTS, "an input"),
            "outputs": _names(OUTPUTS, "an output"),
            "step": {"type": "array", "minItems": 1, "maxItems": STEPS, "items": _step()},
        },
    }


def _motor() -> dict[str, Any]:
    rows = PARAMETERS
    made = _object(
        {
            "microsteps": _integer(rows["microsteps"]),
            "step_angle": _quantity(("deg",), rows["step_angle"].note),
            "full_steps": {
                "type": "integer",
                "minimum": 1,
                "maximum": PARAMETERS["microsteps"].high * 36000,
                "description": "of one turn, instead of step_angle",
            },
            "turn_distance": _integer(rows["turn_distance"]),
            "unit": _said(
                rf"\s*(pulse|turn|\+?\s*{_NUMBER}\s*({_spelled([unit for unit in DISTANCES if unit != 'units'])}))\s*",
                "one user unit, instead of turn_distance: pulse, 0.001 mm",
            ),
            "lead": _quantity(LENGTH, "how far the load goes in one turn"),
            "stop": {"enum": list(text.STOPS), "description": "what a stop does"},
            "mode4": _integer(rows["mode4"]),
            "home_at_power_on": {"type": "boolean", "description": rows["power_on_home"].note},
        },
        required=("microsteps",),
    )
    return made | {
        "allOf": [
            {"oneOf": [{"required": ["step_angle"]}, {"required": ["full_steps"]}]},
            {"oneOf": [{"required": ["turn_distance"]}, {"required": ["unit"]}]},
        ]
    }


def _loop() -> dict[str, Any]:
    return _object({key: _integer(PARAMETERS[f"loop_{key}"]) for key in text.LOOP}, required=text.LOOP)


def _step() -> dict[str, Any]:
    hertz = ("Hz", "kHz")
    return _object(
        {
            "move": _quantity(DISTANCES, "how far, with a sign: reverse is negative", signed=True),
            "speed": _quantity(SPEEDS, PARAMETERS["speed"].note),
            "start": _quantity(hertz, PARAMETERS["start_frequency"].note),
            "acceleration": _quantity(hertz, PARAMETERS["acceleration"].note),
            "delay": _said(rf"(\s*{_NUMBER}\s*(ms|s|min|h)\s*)+", PARAMETERS["delay"].note),
            "output": _said(
                rf"\s*(none|(all|output [1-{OUTPUTS}]|{_NAMED}) (on|off))\s*",
                "none, all on, all off, output 1 on, or NAME off",
            ),
            "wait_for": _input("the step waits for it"),
            "stop_on": _input("it ends the motion of the step"),
        }
    )


def _object(properties: dict[str, Any], required: Iterable[str] = ()) -> dict[str, Any]:
    made: dict[str, Any] = {"type": "object", "additionalProperties": False, "properties": properties}
    return made | ({"required": list(required)} if required else {})


def _integer(row: Register) -> dict[str, Any]:
    described = "; ".join(part for part in (UNITS.get(row.name, ""), row.note) if part)
    made: dict[str, Any] = {"type": "integer", "minimum": row.low, "maximum": row.high}
    return made | ({"description": described} if described else {})


def _quantity(units: Iterable[str], described: str, *, signed: bool = False) -> dict[str, Any]:
    sign = "[+-]?" if signed else r"\+?"
    return _said(rf"\s*{sign}\s*{_NUMBER}\s*({_spelled(units)})\s*", described)


def _spelled(units: Iterable[str]) -> str:
    return "|".join(_SPELLINGS.get(unit, unit) for unit in units)


def _said(pattern: str, described: str) -> dict[str, Any]:
    return {"type": "string", "pattern": f"^{pattern}$", "description": described}


def _names(highest: int, what: str) -> dict[str, Any]:
    number = {"type": "integer", "minimum": 1, "maximum": highest}
    return {
        "type": "object",
        "additionalProperties": number,
        "propertyNames": {"pattern": f"^{_NAMED}$"},
        "maxProperties": highest,
        "description": f"a name for the number of {what}",
    }


def _input(described: str) -> dict[str, Any]:
    described = f"none, input 1, or NAME: {described}; 3 and 4 need `expert`"
    numbers = {"type": "integer", "minimum": 0, "maximum": INPUTS}
    return {"anyOf": [numbers, _said(rf"\s*(none|input [1-{INPUTS}]|{_NAMED})\s*", described)]}
