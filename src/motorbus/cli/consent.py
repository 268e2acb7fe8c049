"""What needs somebody's agreement before it is done: one rule for every command, by whatever name.

Nobody is asked to agree to what is refused anyway, so a rehearsal comes before the question.
"""

from __future__ import annotations

import math
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final

from motorbus.cli.exits import Unforeseeable
from motorbus.cli.target import able
from motorbus.core.request import Effect

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from motorbus.cli.output import Output
    from motorbus.core.register import Register, Value

FAR: Final = math.pi
"""rad; a way that is longer needs consent."""


def consent_to_ways(
    goals: Sequence[tuple[Any, float]],
    output: Output,
    *,
    yes: bool,
    rehearse: Callable[[], object] | None = None,
) -> None:
    """Ask before a device goes far from where it stands; goals in rad. Raises NeedsConsent when nobody agrees.

    Before anybody is asked, `rehearse` raises what the move itself would be refused for.
    """
    if yes:
        return
    ways = [(one.node, abs(goal - able(one, "position")())) for one, goal in goals]
    far = [f"#{node} by {math.degrees(way):.0f} degrees" for node, way in ways if way > FAR]
    if far:
        consent_to(f"move {', '.join(far)}", output, yes=False, rehearse=rehearse)


def consent_to(what: str, output: Output, *, yes: bool, rehearse: Callable[[], object] | None = None) -> None:
    """Ask before `what` is done, unless `yes`. Raises NeedsConsent when nobody agrees.

    Before anybody is asked, `rehearse` raises what the work itself would be refused for.
    """
    if yes:
        return
    if rehearse is not None:
        refused_anyway(rehearse)
    output.consent(what, yes=False)


def refused_anyway(rehearse: Callable[[], object]) -> None:
    """Raise what the work itself would be refused for, as far as a rehearsal finds out."""
    with suppress(Unforeseeable):  # so far it would not have been refused
        rehearse()


def goals_among(
    one: Any, entries: Iterable[Register], values: Mapping[str, Value]
) -> list[tuple[Any, float]]:
    """What of these values, by register, are angles to which writing them sends the device, in rad."""
    return [
        (one, float(values[entry.name]))
        for entry in entries
        if entry.effect is Effect.MOTION and entry.unit == "rad"
    ]
