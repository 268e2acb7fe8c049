"""What the commands for one servo share: its address, a verb carried out or only shown."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from cyclopts import Parameter

from motorbus.cli import dry
from motorbus.cli.consent import consent_to
from motorbus.cli.exits import Unforeseeable
from motorbus.cli.feetech.orders import NAME
from motorbus.cli.output import Output
from motorbus.cli.target import Target, device, face, opened
from motorbus.core import units
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from motorbus.families.feetech.driver import Servo

T = TypeVar("T")

Device = Annotated[str, Parameter(name="BUS#ID", help="feetech:PORT#ID, as feetech:/dev/ttyACM0#3")]
BusOption = Annotated[str, Parameter(help="Any option of the bus string, as a flag.")]


def one_of_ours(text: str) -> Target:
    """BUS#ID with exactly one servo of this family. Raises RequestError otherwise."""
    found = device(text)
    if found.family.name != NAME:
        raise RequestError(f"{found.bus} is no {NAME} bus", advice="nothing was sent")
    return found


def on_servo(
    text: str,
    options: Mapping[str, str],
    output: Output,
    do: Callable[[Servo], T],
    *,
    dry_run: bool = False,
    consent: Callable[[Servo], str] | None = None,
) -> tuple[int, T | None]:
    """Open the bus of BUS#ID and let `do` have the servo; its id, and what came of it.

    With `dry_run` what would change something is shown and not sent, as far as that can be foreseen, and what comes
    back is worth nothing. `consent` says what somebody must agree to before, "" for nothing, once a rehearsal has
    found nothing against it.
    """
    bus, _, (node,) = one_of_ours(text)
    with opened(bus, options, output) as opening:
        rehearsal = dry.DryBus(opening)
        if dry_run:
            return node, _rehearsed(rehearsal, do, node, output)
        one = face(opening, node)
        what = consent(one) if consent else ""
        consent_to(what, output, yes=not what, rehearse=partial(do, face(rehearsal, node)))
        return node, do(one)


def _rehearsed(rehearsal: dry.DryBus, do: Callable[[Servo], T], node: int, output: Output) -> T | None:
    result = None
    try:
        result = do(face(rehearsal, node))
    except Unforeseeable as error:
        output.note(f"note: {error.summary}; what is shown is as far as it can be foreseen")
    dry.show(rehearsal, output)
    return result


def reads_only(dry_run: bool) -> None:
    """Raises RequestError for a dry run of what only reads: there is nothing to withhold."""
    if dry_run:
        raise RequestError(
            "without a new value this only reads, so there is nothing that --dry-run could withhold",
            expected="a new value, or no --dry-run",
            advice="nothing was sent",
        )


def both_limits(low: str, high: str) -> tuple[float, float] | None:
    """Two limits as typed, in rad; None for none. Raises RequestError for one alone, and for what is no angle."""
    if bool(low) != bool(high):
        raise RequestError("one limit alone", expected="both --low and --high", advice="nothing was sent")
    return (units.parse(low, "position"), units.parse(high, "position")) if low else None


def facts(told: Any) -> dict[str, Any]:
    """What a verb returned, as plain data."""
    found: dict[str, Any] = told._asdict()
    return found
