"""Switches of simulated devices: named options for behaviour on which the sources conflict or are silent.

Every switch has a source. It is set in a bus string or by a flag. A family lists its switches as the fields of a frozen
dataclass; parsing, ranges, errors and help are the same for all families.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, fields
from difflib import get_close_matches
from math import inf, isfinite, nan
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
    """A dataclass field for a switch: default, help, choices (none: any value) and source.

    `span` is the range of a number without choices. The switch has the type of its default.
    """
    return field(default=default, metadata={"help": help, "choices": choices, "source": source, "span": span})


def options(kind: type[Any]) -> tuple[Option, ...]:
    """The switches of this dataclass as options of a bus string."""
    return tuple(Option(one.name, type(one.default), one.default, **one.metadata) for one in fields(kind))


def switched(kind: type[S], family: str, given: Mapping[str, object]) -> S:
    """Make this dataclass of switches with the given values, which may be text.

    Raises RequestError for an unknown name, with similar names, and for an invalid value.
    """
    known = {option.name: option for option in options(kind)}
    for name in given.keys() - known.keys():
        near = get_close_matches(name, known, n=3)
        raise RequestError(
            f"a simulated {family} bus has no option {name!r}",
            expected=f"perhaps {', '.join(near)}" if near else f"one of {', '.join(known)}",
        )
    return kind(**{name: _value(known[name], value) for name, value in given.items()})


def _value(option: Option, value: object) -> object:
    refusal = f"option {option.name}: {value!r} is not possible"
    found: object = ("no", "yes")[value] if isinstance(value, bool) else str(value)
    if isinstance(option.default, bool):
        word = str(value).lower()
        if word not in _YES | _NO:
            raise RequestError(f"option {option.name}: {value!r} is neither yes nor no", expected="yes or no")
        return word in _YES
    if isinstance(option.default, int | float):
        is_int = isinstance(option.default, int)
        low, high = option.span
        try:
            found = number = (units.whole if is_int else units.real)(str(value))
        except ValueError:
            number = nan
        if not (isfinite(number) and low <= number <= high):
            what = "a whole number" if is_int else "a number"
            bounds = f"{low:g} or more" if high == inf else f"{low:g} to {high:g}"
            raise RequestError(refusal, expected=f"{what}, {bounds}")
    if option.choices and found not in option.choices:
        raise RequestError(refusal, expected=f"one of {', '.join(map(str, option.choices))}")
    return found
