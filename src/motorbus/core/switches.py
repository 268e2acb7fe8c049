"""Switches of simulated devices: named options for behaviour on which the sources conflict or are silent.

Every switch has a source. It is set in a bus string or by a flag. A family lists its switches as the fields of a frozen
dataclass; parsing, ranges, errors and help are the same for all families.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import Field, field, fields
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
    keys = ("help", "choices", "source")
    return tuple(
        Option(one.name, type(one.default), one.default, *(one.metadata[key] for key in keys))
        for one in fields(kind)
    )


def switched(kind: type[S], family: str, given: Mapping[str, object]) -> S:
    """Make this dataclass of switches with the given values, which may be text.

    Raises RequestError for an unknown name, with similar names, and for an invalid value.
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
        word = str(value).lower()
        if word not in _YES | _NO:
            raise RequestError(f"option {one.name}: {value!r} is neither yes nor no", expected="yes or no")
        return word in _YES
    if isinstance(one.default, int | float):
        is_int = isinstance(one.default, int)
        try:
            found = number = (units.whole if is_int else units.real)(str(value))
        except ValueError:
            number = nan
        if not (isfinite(number) and span[0] <= number <= span[1]):
            what = "a whole number" if is_int else "a number"
            bounds = f"{span[0]:g} or more" if span[1] == inf else f"{span[0]:g} to {span[1]:g}"
            raise RequestError(f"option {one.name}: {value!r} is not possible", expected=f"{what}, {bounds}")
    if choices and found not in choices:
        raise RequestError(
            f"option {one.name}: {value!r} is not possible", expected=f"one of {', '.join(map(str, choices))}"
        )
    return found
