"""`motorbus feetech torque-limit|gains|protection`: how strong, how stiff and how careful a servo is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Final

from cyclopts import Parameter

from motorbus.cli import quantity
from motorbus.cli.exits import Exit
from motorbus.cli.feetech.orders import app
from motorbus.cli.feetech.servo import BusOption, Device, assigned, facts, on_servo, one_of_ours, reads_only
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.target import table_of
from motorbus.core import units
from motorbus.core.register import Storage
from motorbus.errors import RequestError
from motorbus.families.feetech.driver.tuning import GAINS, PROTECTION, limiting
from motorbus.families.feetech.table import STS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from motorbus.families.feetech.driver import Gains, Protection, Servo

Values = Annotated[str, Parameter(name="NAME=VALUE")]
_MASKS: Final = ("unload", "led")
_UNITS: Final[Mapping[str, str]] = {
    part: STS[name].unit for part, name in PROTECTION.items() if part not in _MASKS
}


@app.command(
    usage="Usage: motorbus feetech torque-limit BUS#ID [LIMIT] [OPTIONS]",
    help_epilogue="""A fraction of the stall torque, as 0.5 or 50%. It acts at once and until
power-off; with --keep it is written to max_torque in EEPROM too, which needs
--yes. SCS and old SMS servos have max_torque alone: there it is always kept. A
greater limit lets a servo go for its goal again: mind where that is.

Examples:

    motorbus feetech torque-limit feetech:/dev/ttyACM0#3
    motorbus feetech torque-limit feetech:/dev/ttyACM0#3 50%
    motorbus feetech torque-limit feetech:/dev/ttyACM0#3 80% --keep --yes
    motorbus feetech torque-limit feetech:/dev/ttyACM0#3 50% --dry-run""",
)
def torque_limit(
    device_: Device,
    limit: Annotated[str, Parameter(name="LIMIT")] = "",
    /,
    *,
    keep: Flag = False,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Read the torque limit of a servo, or set it.

    Parameters
    ----------
    limit
        A fraction, 0 to 1, or as 50%; left out, it is read.
    keep
        Write it to EEPROM too, where it survives power-off.
    yes
        Do not ask before writing to EEPROM; the servo goes limp then.
    """
    if not limit:
        reads_only(dry_run)
        node, held = on_servo(device_, options, output, lambda one: one.torque_limit())
        assert held is not None
        output.document("motorbus.feetech.torque-limit/1", {"id": node, "limit": held})
        output.text(units.show(held, "load"))
        return Exit.OK
    wanted = units.parse(limit, "load")

    def consent(one: Servo) -> str:
        kept = keep or limiting(table_of(one)).storage is Storage.EEPROM
        asked = kept and not yes
        return f"write max_torque to EEPROM, where it is kept, and let #{one.node} go limp" if asked else ""

    node, told = on_servo(
        device_, options, output, lambda one: one.set_torque_limit(wanted, persistent=keep),
        dry_run=dry_run, consent=consent,
    )  # fmt: skip
    if told is not None and not dry_run:
        where = {"registers": list(told.registers), "kept": told.kept}
        output.document("motorbus.feetech.torque-limit/1", {"id": node, "limit": told.value, **where})
        how_long = "for good" if told.kept else "until power-off"
        output.text(
            f"#{node}: {units.show(told.value, 'load')} in {' and '.join(told.registers)}, {how_long}"
        )
    return Exit.OK


@app.command(
    usage="Usage: motorbus feetech gains BUS#ID [NAME=VALUE...] [OPTIONS]",
    help_epilogue="""p, i, d are of the position loop; velocity_p and velocity_i of the velocity
loop; current_p and current_i of the current loop of HLS servos. Those are kept
in EEPROM, and the servo goes limp while they are written: --yes. live_p,
live_i and live_d of HLS servos act at once, until power-off. Which of them a
servo has is shown without a value.

Examples:

    motorbus feetech gains feetech:/dev/ttyACM0#3
    motorbus feetech gains feetech:/dev/ttyACM0#3 p=16 d=32 --yes
    motorbus feetech gains feetech:/dev/ttyACM0#7 live_p=20
    motorbus feetech gains feetech:/dev/ttyACM0#3 i=2 --dry-run""",
)
def gains(
    device_: Device,
    /,
    *values: Values,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Read the gains of a servo, or set some of them.

    Parameters
    ----------
    values
        Gains by name, 0 to 254; left out, all are read.
    yes
        Do not ask before writing to EEPROM; the servo goes limp then.
    """
    wanted: dict[str, Any] = {name: _whole(name, text) for name, text in assigned(values, GAINS).items()}

    def consent(one: Servo) -> str:
        kept = [name for name in wanted if not name.startswith("live_")]
        return f"write {', '.join(kept)} to EEPROM, and let #{one.node} go limp" if kept and not yes else ""

    def change(one: Servo) -> Gains | None:
        if wanted:
            one.set_gains(**wanted)
        return None if dry_run else one.gains()

    if not wanted:
        reads_only(dry_run)
    node, told = on_servo(device_, options, output, change, dry_run=dry_run, consent=consent)
    if told is None:
        return Exit.OK
    output.document("motorbus.feetech.gains/1", {"id": node, **facts(told)})
    rows = [(name, value) for name, value in facts(told).items() if value is not None]
    output.table(f"Gains of #{node}", ["gain", ">value"], rows)
    return Exit.OK


def _whole(name: str, text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise RequestError(
            f"{name}: {text!r} is not a whole number", expected="0 to 254", advice="nothing was sent"
        ) from None


@app.command(
    usage="Usage: motorbus feetech protection BUS#ID [NAME=VALUE...] [OPTIONS]",
    help_epilogue="""A duty above `threshold` for `time` is an overload, after which `torque` is
left of the torque; `current` for `current_time` is too much current. `unload`
names the alarms that let the torque drop and `led` those that blink, with
commas, or none. All of it is kept in EEPROM: --yes. Which parts a servo has is
shown without a value; HLS servos protect themselves by their current.

Examples:

    motorbus feetech protection feetech:/dev/ttyACM0#3
    motorbus feetech protection feetech:COM7#3 torque=30% time=1.5s --yes
    motorbus feetech protection feetech:COM7#3 unload=current,overload --yes
    motorbus feetech protection feetech:COM7#3 max_temperature=60 --dry-run""",
)
def protection(
    device_: Device,
    /,
    *values: Values,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Read what a servo protects itself from, or set parts of it.

    Parameters
    ----------
    values
        Parts by name, with a unit where they have one; left out, all are read.
    yes
        Do not ask before writing to EEPROM; the servo goes limp then.
    """
    one_of_ours(device_)
    wanted = {name: _part(name, text) for name, text in assigned(values, PROTECTION).items()}

    def change(one: Servo) -> Protection | None:
        if wanted:
            one.set_protection(**wanted)
        return None if dry_run else one.protection()

    if not wanted:
        reads_only(dry_run)

    def consent(one: Servo) -> str:
        return (
            f"write {', '.join(wanted)} to EEPROM, and let #{one.node} go limp" if wanted and not yes else ""
        )

    node, told = on_servo(device_, options, output, change, dry_run=dry_run, consent=consent)
    if told is None:
        return Exit.OK
    output.document("motorbus.feetech.protection/1", {"id": node, **facts(told)})
    rows = [(name, _shown(name, value)) for name, value in facts(told).items() if value is not None]
    output.table(f"Protection of #{node}", ["part", "value"], rows)
    return Exit.OK


def _part(name: str, text: str) -> Any:
    if name in _MASKS:
        return () if text == "none" else tuple(text.split(","))
    return units.parse(text, units.QUANTITIES[_UNITS[name]])


def _shown(name: str, value: Any) -> str:
    return (", ".join(value) or "none") if name in _MASKS else quantity.shown(value, _UNITS[name])
