"""Write a value and read it back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, TypeVar

from motorbus.core.steps import Runnable
from motorbus.errors import MotorbusError, NoReply, VerificationFailed, WireError, unread

T = TypeVar("T")

TRIES: Final = 3


async def write_verified(
    write: Callable[[], Runnable[object]],
    read: Callable[[], Runnable[T]],
    expected: T,
    *,
    node: int,
    what: str,
    differs: Callable[[T], MotorbusError] | None = None,
) -> None:
    """Write, read back, and repeat both while the value differs.

    Raises VerificationFailed, or the error that `differs` makes of the last value; OutcomeUnknown when the value cannot
    be read back.
    """
    for attempt in range(TRIES):
        await write()
        try:
            await check(read, expected, node=node, what=what, differs=differs)
        except VerificationFailed:
            if attempt == TRIES - 1:
                raise
        else:
            return


async def check(
    read: Callable[[], Runnable[T]],
    expected: T,
    *,
    node: int,
    what: str,
    differs: Callable[[T], MotorbusError] | None = None,
) -> None:
    """Read a value that was written. Raises as `write_verified`."""
    try:
        found = await read()
    except (NoReply, WireError) as error:
        raise unread(error, node=node, what=f"the write of {what}") from error
    if found == expected:
        return
    if differs is not None:
        raise differs(found)
    raise VerificationFailed(f"node {node}: {what} reads back {found}, not {expected}", node=node)
