"""`motorbus feetech many-turns`: over how many turns a servo counts, goals and position alike."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from motorbus.cli.exits import Exit
from motorbus.cli.feetech.orders import app
from motorbus.cli.feetech.servo import (
    BusOption,
    Device,
    both_limits,
    facts,
    on_servo,
    one_of_ours,
    reads_only,
)
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.core import units
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from motorbus.cli.output import Output
    from motorbus.families.feetech.driver import ManyTurns, Recounted, Servo

_SCHEMA = "motorbus.feetech.many-turns/1"


@app.command(
    usage="Usage: motorbus feetech many-turns BUS#ID [on|off] [OPTIONS]",
    help_epilogue="""STS, newer SMS and HLS servos. With `on` both position limits become 0 and bit
4 of the servo's own phase register is set, after which goals and position
count 7.5 turns to either side; with `off` that bit is cleared, and --low and
--high hold again. All other bits of that register stay as they are. The servo
goes limp, and forgets its turns whenever its supply goes: home it after each
power-up. `clear-turns` forgets them at once.

Examples:

    motorbus feetech many-turns feetech:/dev/ttyACM0#3
    motorbus feetech many-turns feetech:/dev/ttyACM0#3 on --yes
    motorbus feetech many-turns feetech:COM7#3 off --low 0 --high 359deg --yes
    motorbus feetech many-turns feetech:/dev/ttyACM0#3 on --dry-run""",
)
def many_turns(
    device_: Device,
    turns: Annotated[Literal["on", "off"] | None, Parameter(name="on|off")] = None,
    /,
    *,
    low: str = "",
    high: str = "",
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Say over how many turns a servo counts, or change that.

    Parameters
    ----------
    turns
        on or off; left out, it is read.
    low
        With off, the lowest position it has from then on, as 20deg.
    high
        Its highest position.
    yes
        Do not ask before this is written for good and the servo goes limp.
    """
    one_of_ours(device_)
    limits = both_limits(low, high)
    if turns is None:
        reads_only(dry_run)
        if limits:
            raise RequestError("limits without off", expected="off", advice="nothing was sent")
        node, counts = on_servo(device_, options, output, lambda one: one.many_turns())
        assert counts is not None
        output.document(_SCHEMA, {"id": node, **facts(counts)})
        output.table(f"#{node}", ["", ""], _rows(counts))
        return Exit.OK

    def change(one: Servo) -> Recounted:
        return one.set_many_turns(turns == "on", limits)

    def consent(one: Servo) -> str:
        what = "over many turns" if turns == "on" else "within one turn"
        return "" if yes else f"let #{one.node} go limp and count {what}, for good"

    node, told = on_servo(device_, options, output, change, dry_run=dry_run, consent=consent)
    if told is not None and not dry_run:
        _tell(node, told, output)
    return Exit.OK


def _tell(node: int, told: Recounted, output: Output) -> None:
    before, after, note = told
    output.document(_SCHEMA, {"id": node, **facts(after), "before": facts(before), "note": note})
    output.table(
        f"#{node}",
        ["", "before", "now"],
        [(name, was, now) for (name, was), (_, now) in zip(_rows(before), _rows(after), strict=True)],
    )
    output.note(f"note: {note}")


def _rows(counts: ManyTurns) -> list[tuple[str, Any]]:
    limits = " to ".join(units.show(limit, "position") for limit in counts.limits or ())
    return [
        ("goals", "over many turns" if counts.goals else "within limits"),
        ("position", "over many turns" if counts.told else "within one turn"),
        ("limits", limits or "none"),
        ("stands at", units.show(counts.position, "position")),
        ("phase", f"{counts.raw_phase} (raw)"),
    ]
