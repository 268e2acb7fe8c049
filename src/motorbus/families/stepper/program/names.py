"""The names a file gives to inputs and outputs, and what a step says with them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

from motorbus.core.register import shown
from motorbus.families.stepper.program.quantities import refuse
from motorbus.families.stepper.table import INPUTS, OUTPUTS, PARAMETERS, STEP_INPUTS, step_output_of

NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9 _-]{0,31}", re.ASCII)
"""What a file may call an input or an output."""
_TAKEN: Final = frozenset({"none", "all", "input", "output", "on", "off"})
_HIGHEST: Final = {"input": INPUTS, "output": OUTPUTS}


def named(table: object, kind: str) -> dict[str, int]:
    """The names of a table such as `[inputs]`: name -> number. Raises RequestError, naming what is none."""
    where = f"[{kind}s]"
    if not isinstance(table, Mapping):
        raise refuse(f"{where} is no table", f"lines such as button = 1, the number of an {kind}")
    found: dict[str, int] = {}
    for name, number in table.items():
        if (
            not NAME.fullmatch(name)
            or name.lower() in _TAKEN
            or name.lower().startswith(("input ", "output "))
        ):
            raise refuse(
                f"{where}: {shown(name)} is no name",
                "letters, digits, space, - and _, and no word of its own",
            )
        if not isinstance(number, int) or isinstance(number, bool) or not 1 <= number <= _HIGHEST[kind]:
            raise refuse(f"{where}: {name} = {shown(number)} is no {kind}", f"1 to {_HIGHEST[kind]}")
        if number in found.values():
            raise refuse(f"{where}: {kind} {number} has two names", "one name for each")
        found[name] = number
    return found


def input_of(said: object, where: str, names: Mapping[str, int], *, expert: bool = False) -> int:
    """`button`, `input 1`, 1 or `none` -> the number of an input, 0 for none.

    Raises RequestError for one that a step may not use: 3 and 4 are for an `expert`, they start and stop projects.
    """
    number = _number_of(said, where, names)
    may = range(1, INPUTS + 1) if expert else STEP_INPUTS
    if number and number not in may:
        hint = (
            "" if number > INPUTS or number < 0 else "inputs 3 and 4 start and stop projects: expert = true"
        )
        which = f"{shown(said)}{f' is input {number}, and that' if said in names else ''}"
        listed = ", ".join(str(port) for port in may)
        raise refuse(f"{where}: {which} is not possible", f"none, or an input: {listed}", hint)
    return number


def _number_of(said: object, where: str, names: Mapping[str, int]) -> int:
    if isinstance(said, int) and not isinstance(said, bool):
        return said
    if isinstance(said, str):
        word = said.strip()
        if word == "none":
            return 0
        if word in names:
            return names[word]
        if (match := re.fullmatch(r"input (\d{1,3})", word)) is not None:
            return int(match[1])
    raise refuse(f"{where}: there is no input {shown(said)}", _one_of("none", "input 1", *names))


def output_of(said: object, where: str, names: Mapping[str, int]) -> int:
    """`gripper on`, `output 2 off`, `all off` or `none` -> the action of a step."""
    text = said.strip() if isinstance(said, str) else ""
    if text == "none":
        return 0
    what, _, level = text.rpartition(" ")
    match = re.fullmatch(r"output (\d{1,3})", what)
    number = 0 if what == "all" else names.get(what, int(match[1]) if match else -1)
    if level not in ("on", "off") or not 0 <= number <= OUTPUTS or (match is not None and not number):
        raise refuse(
            f"{where}: {shown(said)} is nothing a step can do to its outputs",
            _one_of("none", "all on", "all off", "output 1 on", *(f"{name} on" for name in names)),
        )
    return int(step_output_of(number, level == "on"))


def input_name(number: int, names: Mapping[str, int]) -> str:
    """How a file says this input."""
    if not number:
        return "none"
    return next((name for name, other in names.items() if other == number), f"input {number}")


def output_name(action: int, names: Mapping[str, int]) -> str:
    """How a file says this action of a step."""
    text = PARAMETERS["output"].choices[action]
    for name, number in names.items():
        text = re.sub(rf"^output {number} ", f"{name} ", text)
    return text


def _one_of(*words: str) -> str:
    return f"one of {', '.join(words)}"
