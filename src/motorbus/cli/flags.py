"""A flag that nobody has is most often a known one mistyped, so that is said and not a list of options."""

from __future__ import annotations

from difflib import get_close_matches
from inspect import Parameter, signature
from typing import TYPE_CHECKING, Final

from motorbus.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Callable

    from cyclopts import CycloptsError

MINUS: Final = "\N{MINUS SIGN}"
"""Stands for the hyphen of a negative number while the parser looks at it, for it begins no flag."""


def surplus(error: CycloptsError) -> RequestError | None:
    """The error for words that a command has no place for; None for any other error of the parser."""
    from cyclopts import UnusedCliTokensError

    if not isinstance(error, UnusedCliTokensError) or not error.unused_tokens:
        return None
    words = " ".join(word.replace(MINUS, "-") for word in error.unused_tokens)
    chain = " ".join(["motorbus", *(error.command_chain or ())])
    usage = str(error.app.usage or "") if error.app is not None else ""
    return RequestError(
        f"`{chain}` has no place for {words!r}",
        expected=usage.removeprefix("Usage: ").strip(),
        advice=f"leave it out; `{chain} --help` shows how to say it; nothing was sent",
    )


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
        error.advice = "`--help` lists the flags; nothing was sent"
