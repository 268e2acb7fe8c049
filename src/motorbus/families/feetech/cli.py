"""The commands `motorbus feetech …`."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from cyclopts import App, Parameter
from msgspec import Meta, Struct

from motorbus.cli.common import Common, Target, Writing
from motorbus.cli.discover import in_shell
from motorbus.cli.dryrun import carry_out
from motorbus.cli.output import emit, note
from motorbus.cli.target import open_devices, parse_quantity
from motorbus.errors import RequestError
from motorbus.families.feetech.driver.servo import Servo

app = App(name="feetech", help="Commands of feetech devices only.", help_epilogue="")

ModeName = Literal["position", "velocity", "pwm", "step", "current"]


class ModeState(Struct, frozen=True, tag="mode"):
    """The operating mode of a servo, and what keeps it from moving."""

    device: str
    mode: str
    blocked: tuple[str, ...] = ()


class Overload(Struct, frozen=True, tag="overload"):
    """The alarms that were cleared, and those that remain."""

    device: str
    cleared: tuple[str, ...]
    remaining: tuple[str, ...]


class Reset(Struct, frozen=True, tag="reset"):
    """Where a servo answers after its reset."""

    device: str
    node: int
    rate: Annotated[int, Meta(extra={"unit": "bit/s"})]


def _servo(devices: list[Target]) -> Target:
    """The only device, a servo of this family. Raises RequestError."""
    if len(devices) != 1 or not isinstance(devices[0].device, Servo):
        names = ", ".join(f"{one.family.name} {one.name}" for one in devices)
        raise RequestError(
            f"{names}: one feetech servo is needed", expected="DEVICE, as feetech:/dev/ttyACM0#3"
        )
    return devices[0]


@app.command
def mode(
    device: str,
    mode: ModeName | None = None,
    /,
    *,
    turns: Annotated[
        bool | None, Parameter(help="More than one turn (position mode).", negative="--one-turn")
    ] = None,
    low: Annotated[
        str, Parameter(help="Lowest position, as 0deg; for --one-turn, and an SCS that leaves pwm.")
    ] = "",
    high: Annotated[str, Parameter(help="Its highest position.")] = "",
    writing: Writing = Writing(),
    common: Common = Common(),
) -> None:
    """Show or set the operating mode (EEPROM); the servo loses its torque.

    Examples:

        motorbus feetech mode feetech:/dev/ttyACM0#3
        motorbus feetech mode feetech:/dev/ttyACM0#3 velocity --yes
        motorbus feetech mode shoulder position --turns --dry-run
    """
    if bool(low) != bool(high):
        raise RequestError("one limit alone", expected="both --low and --high")
    limits = (parse_quantity(low, "position"), parse_quantity(high, "position")) if low else None
    if mode is None and limits is not None:
        raise RequestError("limits without a mode", expected="MODE, as position")
    with open_devices(common, (device,)) as devices:
        target = _servo(devices)
        if mode is not None:
            question = f"set {mode} mode in the EEPROM of {target.name}; it loses its torque"
            carry_out(writing, target, lambda servo: servo.set_mode(mode, limits=limits), question)
        if turns is not None:
            many = turns
            question = f"set {'more than one turn' if many else 'one turn'} in the EEPROM of {target.name}"
            carry_out(writing, target, lambda servo: servo.set_multi_turn(many, limits), question)
        if not writing.dry_run:
            servo: Any = target.device
            blocked = tuple(in_shell(text, target) for text in servo.why_not_moving())
            known = servo.known_mode
            emit(ModeState(target.name, known.value if known else "not documented", blocked), common)


@app.command
def recover_overload(device: str, /, *, writing: Writing = Writing(), common: Common = Common()) -> None:
    """Switch torque on again after an overload; an arm sags meanwhile.

    Examples:

        motorbus feetech recover-overload feetech:/dev/ttyACM0#3
        motorbus feetech recover-overload shoulder
        motorbus feetech recover-overload shoulder --dry-run

    Torque off, 1 s, goal to the present position, torque on. Exit code 7 if the alarm stays: then switch the supply.
    """
    with open_devices(common, (device,)) as devices:
        target = _servo(devices)
        found = carry_out(writing, target, lambda servo: servo.recover_overload())
        if found is not None:
            emit(Overload(target.name, tuple(found.tripped), tuple(found.remaining)), common)
            if not found.tripped:
                note("no alarm was set")


@app.command
def reset(device: str, /, *, writing: Writing = Writing(), common: Common = Common()) -> None:
    """Restore the factory settings (EEPROM); the servo loses its torque, and as a rule keeps its id.

    Examples:

        motorbus feetech reset feetech:/dev/ttyACM0#3 --dry-run
        motorbus feetech reset feetech:/dev/ttyACM0#3 --yes
        motorbus feetech reset shoulder
    """
    with open_devices(common, (device,)) as devices:
        target = _servo(devices)
        question = f"overwrite all settings of {target.name} with factory values"
        found = carry_out(writing, target, lambda servo: servo.factory_restore(), question)
        if found is not None:
            emit(Reset(target.name, found.node, found.rate), common)
