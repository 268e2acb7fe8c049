"""How a simulated device behaves where nobody has settled how a real one does: named switches with a source each.

A simulator that guesses in silence teaches its users the guess. So where sources conflict or say nothing, the
behaviour is chosen by name, as an option of a bus string or a flag. A family lists its switches as the fields of a
frozen dataclass; texts, ranges and help are the same for all families.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import Field, field, fields
from difflib import get_close_matches
from math import inf, isfinite
from typing import Any, TypeVar

from motorbus.core import units
from motorbus.core.family import Option
from motorbus.errors import RequestError

S = TypeVar("S")

_YES = frozenset({"yes", "true", "on", "1"})
_NO = frozenset({"no", "false", "off", "0"})


def switch(
    default: object, help: str, *choices: object, source: str, span: tuple[float, float] = (0.0, inf)
) -> Any:
    """A field of a dataclass of switches: its default, what it does, its choices (none: any), and who says so.

    `span` bounds a number that has no choices. The type of the default is the type of the switch.
    """
    return field(default=default, metadata={"help": help, "choices": choices, "source": source, "span": span})


def options(kind: type[Any]) -> tuple[Option, ...]:
    """Every switch of this dataclass as an option that a bus string may carry."""
    return tuple(_option(one) for one in fields(kind))


def _option(one: Field[Any]) -> Option:
    told = one.metadata
    return Option(one.name, type(one.default), one.default, told["help"], told["choices"], told["source"])


def switched(kind: type[S], family: str, given: Mapping[str, object]) -> S:
    """The switches of this dataclass, some set by name; values may be text.

    Raises RequestError, with suggestions, for an unknown name or an impossible value.
    """
    known = {one.name: one for one in fields(kind)}  # type: ignore[arg-type]  # S is a dataclass
    for name in given.keys() - known.keys():
        near = get_close_matches(name, known, n=3)
        raise RequestError(
            f"a simulated {family} bus has no option {name!r}",
            expected=f"perhaps {', '.join(near)}" if near else "",
            advice=f"`motorbus simulate {family} --switches` lists them",
        )
    return kind(**{name: _value(known[name], value) for name, value in given.items()})


def _value(one: Field[Any], value: object) -> object:
    choices, span = one.metadata["choices"], one.metadata["span"]
    found: object = ("no", "yes")[value] if isinstance(value, bool) else str(value)
    if isinstance(one.default, bool):
        return _truth(one.name, value)
    if isinstance(one.default, int | float):
        found = _number(one.name, value, type(one.default), span)
    if choices and found not in choices:
        raise RequestError(
            f"option {one.name}: {value!r} is not possible", expected=f"one of {', '.join(map(str, choices))}"
        )
    return found


def _truth(name: str, value: object) -> bool:
    word = str(value).lower()
    if word not in _YES | _NO:
        raise RequestError(f"option {name}: {value!r} is neither yes nor no", expected="yes or no")
    return word in _YES


def _number(name: str, value: object, kind: type, span: tuple[float, float]) -> float:
    try:
        number = (units.whole if kind is int else units.real)(str(value))
    except ValueError:
        number = float("nan")
    if not (isfinite(number) and span[0] <= number <= span[1]):
        what = "whole number" if kind is int else "number"
        bounds = f"{span[0]:g} or more" if span[1] == inf else f"{span[0]:g} to {span[1]:g}"
        raise RequestError(f"option {name}: {value!r} is not possible", expected=f"a {what}, {bounds}")
    return number
