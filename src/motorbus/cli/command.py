"""`motorbus command`: the commands of the manual of a device, by name."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from enum import Enum
from typing import Any, Final

from msgspec import Struct

from motorbus.cli.common import Common, Target, Writing
from motorbus.cli.dryrun import carry_out
from motorbus.cli.output import emit
from motorbus.cli.registers import assignments, parse_value
from motorbus.cli.target import bus_address, open_devices
from motorbus.core import units
from motorbus.errors import RequestError

QUANTITIES: Final = {  # of the arguments of driver functions; any unit of it is taken
    "to": "position",
    "tolerance": "position",
    "velocity": "velocity",
    "seconds": "time",
    "timeout": "time",
    "deadline": "time",
}


class Command(Struct, frozen=True):
    """A command of the manual: its arguments, one line."""

    name: str
    arguments: str
    line: str


class CommandResult(Struct, frozen=True, tag="command"):
    """What a command of a device gave."""

    device: str
    command: str
    result: Any = "done"


def command(
    target: str = "",
    name: str = "",
    /,
    *arguments: str,
    writing: Writing = Writing(),
    common: Common = Common(),
) -> None:
    """List the commands of the manual of a device with their units, or run one.

    Examples:

        motorbus command stepper:/dev/ttyUSB0
        motorbus command stepper:/dev/ttyUSB0 set_step_delay 1 500 --yes
        motorbus command feetech:/dev/ttyACM0#3 reg_write goal_position=90deg --yes
    """
    if not name:
        from motorbus import families

        family = families.load(bus_address(target.partition("#")[0], common).partition(":")[0])
        emit([_describe(name, function) for name, function in family.commands.items()], common)
        return
    name = name.replace("-", "_")
    results = []
    with open_devices(common, (target,) if target else ()) as devices:
        for one in devices:
            function = _find(one, name)
            given, named = _parse(one, name, function, arguments)
            result = carry_out(
                writing,
                one,
                lambda device: device.bus.run(function(device, *given, **named)),  # noqa: B023
                f"run {name} on {one.name}",
            )
            if not writing.dry_run:
                results.append(CommandResult(one.name, name, "done" if result is None else _plain(result)))
    for result in results:
        emit(result, common)


def _find(target: Target, name: str) -> Any:
    known = target.family.commands
    if name not in known:
        from motorbus.motion.machine import nearest

        raise RequestError(f"{target.family.name} has no command {name!r}", advice=nearest(name, known))
    return known[name]


def _describe(name: str, function: Any) -> Command:
    words = []
    for one in list(inspect.signature(function).parameters.values())[1:]:
        unit = next(iter(units.SCALES[QUANTITIES[one.name]])) if one.name in QUANTITIES else ""
        text = one.name.upper() + (f"({unit})" if unit else "")
        if one.kind is one.VAR_POSITIONAL:
            text = f"{text}…"
        elif one.kind is one.VAR_KEYWORD:
            text = "REGISTER=VALUE…"
        elif one.kind is one.KEYWORD_ONLY:
            text = f"{one.name}={unit or '…'}"
        words.append(text if one.default is one.empty and one.kind is not one.VAR_POSITIONAL else f"[{text}]")
    return Command(name, " ".join(words), (inspect.getdoc(function) or "").partition("\n")[0])


def _parse(
    target: Target, name: str, function: Any, words: tuple[str, ...]
) -> tuple[list[Any], dict[str, Any]]:
    """The arguments of a driver function. Raises RequestError with its usage."""
    parameters = list(inspect.signature(function).parameters.values())[1:]
    known = {one.name: one for one in parameters if one.kind not in (one.VAR_KEYWORD, one.VAR_POSITIONAL)}
    takes_registers = any(one.kind is one.VAR_KEYWORD for one in parameters)
    plain = [one for one in parameters if one.kind in (one.POSITIONAL_ONLY, one.POSITIONAL_OR_KEYWORD)]
    rest = next((one for one in parameters if one.kind is one.VAR_POSITIONAL), None)
    given: list[Any] = []
    named: dict[str, Any] = {}
    for word in words:
        key, equals, text = word.partition("=")
        if equals and key in known:
            named[key] = _value(known[key], text)
        elif equals and takes_registers:
            [(register, text)] = assignments([word])
            named[register] = parse_value(target, register, text)
        elif len(given) < len(plain) or rest is not None:
            given.append(_value(plain[len(given)] if len(given) < len(plain) else rest, word))
        else:
            raise _usage(name, function, f"{word!r} is one argument too many")
    try:
        inspect.signature(function).bind(None, *given, **named)
    except TypeError:
        raise _usage(name, function, "its arguments do not fit") from None
    return given, named


def _usage(name: str, function: Any, what: str) -> RequestError:
    shown = _describe(name, function)
    return RequestError(f"{name}: {what}", expected=f"{name} {shown.arguments}".strip(), advice=shown.line)


def _value(parameter: Any, text: str) -> Any:
    """A word as the type of this parameter. A bare number is in the API unit."""
    text, kind = text.strip(), str(parameter.annotation)
    if kind.startswith("float") and parameter.name in QUANTITIES:
        return units.parse(text, QUANTITIES[parameter.name])
    try:
        if "bool" in kind:
            return {"yes": True, "no": False, "on": True, "off": False, "1": True, "0": False}[text]
        if kind.startswith("int"):
            return units.whole(text)
        if kind.startswith("float"):
            return units.real(text)
    except (ValueError, KeyError):
        form = "yes or no" if "bool" in kind else "a whole number" if kind.startswith("int") else "a number"
        raise RequestError(f"{parameter.name}: {text!r} is not possible", expected=form) from None
    return text


def _plain(value: Any) -> Any:
    """A result as plain data."""
    if hasattr(value, "_asdict"):
        return {name: _plain(one) for name, one in value._asdict().items()}
    if isinstance(value, Enum):
        return value.name.lower()
    if is_dataclass(value) and not isinstance(value, type):
        return _plain(asdict(value))
    if isinstance(value, Mapping):
        return {str(name): _plain(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, bytes):
        return value.hex(" ").upper()
    return value if isinstance(value, int | float | str) or value is None else str(value)
