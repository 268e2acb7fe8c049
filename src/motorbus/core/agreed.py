"""Read a value until two consecutive readings are equal.

For a wire with a weak check: an 8-bit sum accepts about one in some hundred packets with two damaged bytes. A second
reading that is also damaged, also accepted and equal is improbable. A value that keeps changing never agrees, so the
device must be at rest.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, TypeVar

from motorbus.core.steps import Runnable
from motorbus.errors import VerificationFailed

T = TypeVar("T")

READINGS: Final = 8
"""Maximum number of readings."""


async def agreed(reading: Callable[[], Runnable[T]], *, node: int, what: str, most: int = READINGS) -> T:
    """Return the value on which two consecutive readings agree; `reading` makes each, `what` names it in errors.

    Raises the errors of a reading, and VerificationFailed if no two of `most` consecutive readings are equal.
    """
    values: list[T] = []
    for _ in range(most):
        values.append(await reading())
        if len(values) > 1 and values[-2] == values[-1]:
            return values[-1]
    raise VerificationFailed(
        f"node {node}: {most} readings of the {what}, and no two in a row are the same: the last two are "
        f"{values[-2]} and {values[-1]}",
        expected="two readings in a row that agree",
        cause="the value changes all the time, as where a shaft moves or shakes, or the line is very bad",
        advice="wait until the shaft is at rest; read a moving value without `confirmed`",
        node=node,
    )
