"""How a file is refused: one message that names the place in the file, what may stand there, and what to do."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from os import PathLike
from typing import Any

from motorbus.core.register import shown
from motorbus.errors import LinkError, RequestError

_BARE = re.compile(r"[A-Za-z0-9_-]{1,40}")
_NOTHING = ("nothing was sent", "nothing was opened")
_KINDS = {dict: "a table", list: "a list", bool: "true or false", str: "text"}


def path(*keys: str) -> str:
    """`axis.shoulder.low`, and `axis."a b"` where a key needs quotes; no longer than a line."""
    return ".".join(key if _BARE.fullmatch(key) else shown(key).replace("'", '"') for key in keys)


def refused(where: str, what: str, expected: str, advice: str) -> RequestError:
    """The error for what stands at `where`; `advice` is what to do about it."""
    summary = f"{where}: {what}" if where else what
    return RequestError(summary, expected=expected, advice=f"{to_do(advice)}; nothing was opened")


def to_do(advice: str, otherwise: str = "change it") -> str:
    """What an advice says is to be done, without what was not done; `otherwise` where that is all it says."""
    return "; ".join(part for part in advice.split("; ") if part not in ("", *_NOTHING)) or otherwise


def no_axes(names: Iterable[str] = ()) -> RequestError:
    """The error for a machine that has no axis, or for these names of it, which stand for none."""
    those = ", ".join(names)
    return refused(
        those,
        "no axis is on it" if those else "the machine has no axis",
        "a file with [axis.NAME]",
        "add a table [axis.NAME] for each device; `motorbus init BUS` writes a file with those that answer",
    )


@contextmanager
def of_file(file: str | PathLike[str]) -> Iterator[None]:
    """Within it, what a machine or its ports are refused for begins with the path of its file, if it has one."""
    try:
        yield
    except (RequestError, LinkError) as error:
        if str(file) and not error.summary.startswith(f"{file}: "):
            error.summary = f"{file}: {error.summary}"
        raise


def said(value: Any) -> str:
    """What somebody wrote, for reading eyes: text in quotes, a table or a list only by that word."""
    if isinstance(value, dict | list):
        return _KINDS[type(value)]
    if isinstance(value, bool):
        return str(value).lower()
    return shown(value) if isinstance(value, str | int | float) else shown(str(value))


def nearest(word: str, known: Iterable[str], otherwise: str = "") -> str:
    """`did you mean shoulder?`, or `otherwise` when nothing is near."""
    near = get_close_matches(word.lower()[:80], sorted(known), n=1)
    return f"did you mean {near[0]}?" if near else otherwise


def listed(words: Iterable[str], otherwise: str = "none") -> str:
    """`one of a, b, c`; the first twelve where there are many."""
    found = list(words)
    if not found:
        return otherwise
    more = f" and {len(found) - 12} more" if len(found) > 12 else ""
    return f"{'one of ' if len(found) > 1 else ''}{', '.join(found[:12])}{more}"
