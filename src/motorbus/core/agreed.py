"""A value that matters, on a wire whose check is weak: read until two readings in a row say the same.

An 8-bit sum lets two damaged bytes in some hundred pass. That the next reading is damaged as well, passes as well and
says the same is another matter. A value that changes all the time is never agreed on: this is for what stands still.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, TypeVar

from motorbus.core.operation import Operation, Runnable
from motorbus.errors import VerificationFailed

T = TypeVar("T")

READINGS: Final = 8
"""How often it is read at most."""


def agreed(reading: Callable[[], Runnable[T]], *, node: int, what: str, most: int = READINGS) -> Operation[T]:
    """What two readings in a row agree on; `reading` makes each, `what` is its name for people.

    Raises what a reading raises, and VerificationFailed when of `most` readings no two in a row are the same.
    """
    told: list[T] = []
    for _ in range(most):
        told.append((yield from reading()))
        if len(told) > 1 and told[-2] == told[-1]:
            return told[-1]
    raise VerificationFailed(
        f"node {node}: {most} readings of the {what}, and no two in a row are the same: the last two are "
        f"{told[-2]} and {told[-1]}",
        expected="two readings in a row that agree",
        cause="it changes all the time, as where a shaft moves or shakes, or the line is very bad",
        advice="let it come to rest; what moves is read without `confirmed`",
        node=node,
    )
