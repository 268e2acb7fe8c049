"""`motorbus feetech mode`: the operating mode of a servo, and what keeps it from moving."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from motorbus.cli.exits import Exit
from motorbus.cli.feetech.orders import app
from motorbus.cli.feetech.servo import (
    BusOption,
    Device,
    both_limits,
    on_servo,
    one_of_ours,
    reads_only,
)
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.wording import shell_words
from motorbus.errors import RequestError
from motorbus.families.feetech.driver import Servo

if TYPE_CHECKING:
    from motorbus.core.family import Family


@app.command(
    usage="Usage: motorbus feetech mode BUS#ID [MODE] [OPTIONS]",
    help_epilogue="""STS and newer SMS have position, velocity, pwm and step, old SMS all but step,
HLS position, velocity and current, SCS position and pwm. On SCS servos pwm is
both limits 0, and position needs --low and --high. Without MODE it says what
the servo heeds, and what would keep it from obeying an order: a torque limit
of 0, a goal torque of 0, limits without a way between them, an alarm that lets
its torque drop.

Examples:

    motorbus feetech mode feetech:/dev/ttyACM0#3
    motorbus feetech mode feetech:/dev/ttyACM0#3 velocity --yes
    motorbus feetech mode feetech:COM7#2 position --low 0.4 --high 5 --yes
    motorbus feetech mode feetech:/dev/ttyACM0#3 step --dry-run""",
)
def mode(
    device_: Device,
    mode_: Annotated[
        Literal["position", "velocity", "pwm", "step", "current"] | None, Parameter(name="MODE")
    ] = None,
    /,
    *,
    low: str = "",
    high: str = "",
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Say what a servo heeds and what blocks it, or put it into another mode.

    Parameters
    ----------
    mode_
        position, velocity, pwm, step or current; left out, it is read.
    low
        Lowest position of an SCS servo that becomes a servo again, as 20deg.
    high
        Its highest position.
    yes
        Do not ask before the mode is written for good and the servo goes limp.
    """
    one_of_ours(device_)
    limits = both_limits(low, high)
    if not mode_:
        _only_read(limits, dry_run)

    def change(one: Servo) -> dict[str, Any] | None:
        if mode_:
            one.set_mode(mode_, limits=limits)
        return None if dry_run else _heeds(one)

    def consent(one: Servo) -> str:
        return f"put #{one.node} into {mode_} mode, for good, and let it go limp" if mode_ and not yes else ""

    node, told = on_servo(device_, options, output, change, dry_run=dry_run, consent=consent)
    if told is not None:
        output.document("motorbus.feetech.mode/1", {"id": node, **told})
        heeded = told["mode"] or f"{told['code']}, which is not documented"
        rows = [("mode", heeded), ("lock", told["lock"])]
        output.table(f"#{node}", ["", ""], rows + [("blocked", words) for words in told["blockers"]])
    return Exit.OK


def _only_read(limits: tuple[float, float] | None, dry_run: bool) -> None:
    reads_only(dry_run)
    if limits:
        raise RequestError("limits without a mode", expected="MODE, as position", advice="nothing was sent")


def _heeds(one: Servo) -> dict[str, Any]:
    blockers = _blockers(one)
    locked = one.read_raw("lock")["lock"]
    assert one.table is not None
    assert one.settings is not None
    heeded = one.known_mode
    return {
        "mode": heeded.value if heeded else None,
        "code": one.settings.mode_code,
        "lock": one.table["lock"].choices.get(locked, str(locked)).partition(":")[0],
        "blockers": blockers,
    }


def _blockers(one: Servo) -> list[str]:
    family: Family = one.bus.family  # type: ignore[attr-defined]
    return [shell_words(words, family) for words in one.blockers()]
