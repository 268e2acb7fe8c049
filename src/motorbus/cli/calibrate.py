"""`motorbus calibrate`: the present pose of a device gets another name, or its zero is shown as the device has it."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from motorbus.cli import dry
from motorbus.cli.consent import consent_to
from motorbus.cli.exits import Exit
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.target import able, device, face, offers, opened, takes
from motorbus.core import units
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from motorbus.cli.output import Output

app = App(
    name="calibrate",
    usage="Usage: motorbus calibrate BUS#ID [OPTIONS]",
    help_epilogue="""Bring the device into a pose by hand, then say what that pose shall read: the
middle of the turn, or --to. It goes limp while this is written to EEPROM, so
support what would fall; --yes agrees to that. Its limits stay as they are, and
mean other poses afterwards. --show changes nothing: it tells where the device
has its zero, to be held against what a machine's file says.

Examples:

    motorbus calibrate feetech:/dev/ttyACM0#3 --yes
    motorbus calibrate feetech:/dev/ttyACM0#3 --to 90deg --yes
    motorbus calibrate feetech:/dev/ttyACM0#3 --show
    motorbus calibrate feetech:/dev/ttyACM0#3 --dry-run""",
)


@app.default
def calibrate(
    device_: Annotated[str, Parameter(name="BUS#ID")],
    /,
    *,
    to: str = "",
    show: Flag = False,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: str,
) -> Exit:
    """Make the present pose of a device read another position, for good.

    Parameters
    ----------
    device_
        FAMILY:PORT#ID, as feetech:/dev/ttyACM0#3
    to
        What it shall read, in rad or as 90deg; the middle of its turn when left out.
    show
        Only tell where its zero is.
    yes
        Do not ask before the zero is moved for good and the device goes limp.
    options
        Any option of the bus string, as a flag.
    """
    bus, family, (node,) = device(device_)
    offers(family, "calibrate")
    if show and (to or dry_run):
        raise RequestError("--show only reads", expected="no --to or --dry-run beside it")
    wanted = {"to": units.parse(to, "position")} if to else {}
    with opened(bus, options, output) as opening:
        one = face(opening, node)
        if show:
            _tell(f"Zero of #{node}", "motorbus.calibrate.zero/1", node, able(one, "zero")(), output)
            return Exit.OK
        takes(one, "calibrate", wanted)
        told = _calibrated(one, wanted, output, yes=yes, dry_run=dry_run)
    if dry_run:
        return Exit.OK
    _tell(f"#{node} is calibrated", "motorbus.calibrate/1", node, told, output)
    return Exit.OK


def _calibrated(one: Any, wanted: Mapping[str, Any], output: Output, *, yes: bool, dry_run: bool) -> Any:
    """Carry it out once somebody has agreed, or only show it."""
    rehearsal = dry.DryBus(one.bus)
    rehearse = partial(face(rehearsal, one.node).calibrate, **wanted)
    if dry_run:
        dry.rehearse(rehearsal, rehearse, output)
        return None
    what = f"move the zero of #{one.node} for good, and let it go limp"
    consent_to(what, output, yes=yes, rehearse=rehearse)
    return one.calibrate(**wanted)


def _tell(title: str, schema: str, node: int, told: Any, output: Output) -> None:
    """Print what a verb returned: floats are angles, whole numbers are raw."""
    facts: dict[str, Any] = told._asdict()
    note = facts.pop("note", "")
    output.document(schema, {"id": node, **facts, **({"note": note} if note else {})})
    output.table(title, ["", ""], [(name.replace("_", " "), _shown(value)) for name, value in facts.items()])
    if note:
        output.note(f"note: {note}")


def _shown(value: Any) -> str:
    if isinstance(value, float):
        return units.show(value, "position")
    return " to ".join(map(_shown, value)) if isinstance(value, tuple) else str(value)
