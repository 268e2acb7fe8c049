"""What the commands of this family share: one servo, by its address, and a verb carried out or only shown."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Final, TypeVar

from cyclopts import App, Parameter

from motorbus.cli import dry
from motorbus.cli.consent import consent_to
from motorbus.cli.output import Output
from motorbus.cli.target import Target, device, face, opened, target
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from motorbus.families.kst import Servo

T = TypeVar("T")

NAME: Final = "kst"

app = App(name=NAME, help="What only kst devices can do.", help_epilogue="")

Device = Annotated[str, Parameter(name="BUS#ID", help="kst:PORT#ID, as kst:can://slcan/dev/ttyACM0#0x25")]
BusOption = Annotated[
    str, Parameter(help="Any option of the bus string, as a flag: --profile kst-ext, --bitrate 1000000.")
]


def ours(found: Target) -> Target:
    """The same target. Raises RequestError when it is on a bus of another family."""
    if found.family.name != NAME:
        raise RequestError(f"{found.bus} is no {NAME} bus", advice="nothing was sent")
    return found


def one_of_ours(text: str) -> Target:
    """BUS#ID with exactly one servo of this family. Raises RequestError otherwise, id 0 (everyone) included."""
    ours(target(text.partition("#")[0]))
    return ours(device(text))


def on_servo(
    text: str,
    options: Mapping[str, str],
    output: Output,
    do: Callable[[Servo], T],
    *,
    dry_run: bool = False,
    consent: str = "",
) -> tuple[int, T]:
    """Open the bus of BUS#ID and let `do` have the servo; its id, and what came of it.

    With `dry_run` what would change something is shown and not sent, and what comes back is worth nothing. `consent`
    is what somebody must agree to before, once a rehearsal has found nothing against it.
    """
    bus, _, (node,) = one_of_ours(text)
    with opened(bus, options, output) as opening:
        rehearsal = dry.DryBus(opening)
        rehearse = partial(do, face(rehearsal, node))
        consent_to(consent, output, yes=dry_run or not consent, rehearse=rehearse)
        result = do(face(rehearsal if dry_run else opening, node))
    if dry_run:
        dry.show(rehearsal, output)
    return node, result


def reads_only(dry_run: bool) -> None:
    """Raises RequestError for a dry run of what only reads: there is nothing to withhold."""
    if dry_run:
        raise RequestError(
            "without a new value this only reads, so there is nothing that --dry-run could withhold",
            expected="a new value, or no --dry-run",
            advice="nothing was sent",
        )


def named(node: int) -> str:
    """#37 (0x25), as it is spoken of in prose."""
    return f"#{node} (0x{node:02X})"
