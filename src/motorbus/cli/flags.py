"""A flag that nobody has is most often a known one mistyped, so that is said and not a list of options."""

from __future__ import annotations

from difflib import get_close_matches
from inspect import Parameter, signature
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from motorbus.errors import RequestError


def explain(error: RequestError, command: Callable[..., object], options: dict[str, str]) -> None:
    """Where a bus refused an option for one of these flags, say which flag that is, and which one may be meant."""
    named = signature(command).parameters.values()
    flags = [one.name.strip("_").replace("_", "-") for one in named if one.kind is Parameter.KEYWORD_ONLY]
    for option in options:
        if f"unknown option {option.replace('-', '_')!r}" not in error.summary:
            continue
        meant = get_close_matches(option.replace("_", "-"), flags, n=1, cutoff=0.7)
        error.summary = f"--{option}: no such flag, and the bus has no such option"
        if meant:
            error.summary = f"--{option}: no such flag"
            error.expected = f"did you mean --{meant[0]}?"
        error.advice = error.advice or "`--help` lists the flags; nothing was sent"
        error.args = (error.summary,)
