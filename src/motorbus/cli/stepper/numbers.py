"""Numbers of the manual as people type them: the number itself, a quantity with its unit, or a choice by its name."""

from __future__ import annotations

from math import floor
from typing import TYPE_CHECKING, Final

from motorbus.core import units
from motorbus.errors import RequestError
from motorbus.families.stepper.table import PARAMETERS, allowed

if TYPE_CHECKING:
    from motorbus.core.register import Register

SWITCH: Final = {"on": 1, "off": 0}
_NEAR: Final = 1e-6
"""Of a raw count: as far as a quantity may be from a whole number of them, for pi is in the way of angles."""


def number(name: str, text: str) -> int:
    """The number that a request carries: 1000 or 1s for a delay in ms, 3 or "output 3 on" for an output.

    Raises RequestError, with what is allowed, for text that is none of these, and for a quantity that lies between two
    numbers: nothing is rounded in silence. Whether the number may be sent is for the command itself to say.
    """
    row = PARAMETERS[name]
    named = {word.casefold(): raw for raw, word in row.choices.items()}
    if row.high == 1:
        named |= SWITCH
    if text.casefold() in named:
        return named[text.casefold()]
    try:
        return units.whole(text)
    except ValueError:
        if row.unit in units.QUANTITIES and not text[-1:].isdigit():
            return _counted(row, text)
        raise RequestError(
            f"{name}: {text!r} is not a whole number", expected=expected(name), advice="nothing was sent"
        ) from None


def expected(name: str) -> str:
    """What may be typed for a number, in words."""
    words = [word for word in PARAMETERS[name].choices.values() if word not in allowed(name)]
    return allowed(name) + (f"; or {', '.join(words)}" if words else "")


def _counted(row: Register, text: str) -> int:
    exact = units.parse(text, units.QUANTITIES[row.unit]) / row.scale
    if abs(exact - round(exact)) > _NEAR:
        raise RequestError(
            f"{row.name}: {text} lies between two numbers",
            expected=f"{floor(exact)} or {floor(exact) + 1}; {allowed(row.name)}",
            advice="nothing was sent, and nothing is rounded",
        )
    return round(exact)
