"""What only FEETECH servos can do: writes that wait for a trigger, many servos in one packet, back as shipped.

Besides these commands it offers the common ones what `faces.py` names.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Final

from cyclopts import App, Parameter

from motorbus.cli import dry, quantity, registers
from motorbus.cli.consent import consent_to, consent_to_ways, goals_among
from motorbus.cli.exits import Exit, Partial
from motorbus.cli.output import Output
from motorbus.cli.parameters import DryRun, Flag
from motorbus.cli.target import Target, check_names, device, face, opened, table_of, target
from motorbus.core.steps import Sleep
from motorbus.errors import RequestError
from motorbus.families.feetech import driver

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from motorbus.bus.blocking import Bus

NAME: Final = "feetech"

app = App(name=NAME, help="What only feetech devices can do.", help_epilogue="")

Names = Annotated[str, Parameter(name="NAME=VALUE")]
Silent = Annotated[Output, Parameter(parse=False)]


def _ours(found: Target) -> Target:
    if found.family.name != NAME:
        raise RequestError(f"{found.bus} is no {NAME} bus", advice="nothing was sent")
    return found


def _values(one: Any, assignments: Sequence[str]) -> dict[str, Any]:
    pairs = [assignment.partition("=")[::2] for assignment in assignments]
    if not pairs or not all(name and text for name, text in pairs):
        raise RequestError("what shall be written?", expected="NAME=VALUE, as goal_position=90deg")
    check_names(one.bus.family, [name for name, _ in pairs])
    table = table_of(one)
    return {name: _value(one, table[name], text) for name, text in pairs}


def _value(one: Any, entry: Any, text: str) -> Any:
    typed = quantity.typed(entry, text)
    return quantity.to_value(one, entry, int(typed.number)) if typed.raw else typed.number


@app.command(
    usage="Usage: motorbus feetech reg-write BUS#ID NAME=VALUE... [OPTIONS]",
    help_epilogue="""Examples:

    motorbus feetech reg-write feetech:/dev/ttyACM0#1 goal_position=90deg
    motorbus feetech reg-write feetech:/dev/ttyACM0#2 goal_position=-0.5""",
)
def reg_write(
    device_: Annotated[str, Parameter(name="BUS#ID")],
    /,
    *assignments: Names,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: str,
) -> Exit:
    """Hand over a write that is carried out at the next `action`.

    Parameters
    ----------
    device_
        feetech:PORT#ID, as feetech:/dev/ttyACM0#3
    assignments
        Registers that follow each other, in RAM.
    yes
        Do not ask before a way of more than 180 degrees.
    options
        Any option of the bus string, as a flag.
    """
    bus, _, (node,) = _ours(device(device_))
    with opened(bus, options, output) as opening:
        rehearsal = dry.DryBus(opening)
        one = face(rehearsal if dry_run else opening, node)
        values = _values(one, assignments)
        entries = [table_of(one)[name] for name in values]
        ways, rehearsed = goals_among(one, entries, values), face(rehearsal, node)
        consent_to_ways(ways, output, yes=yes or dry_run, rehearse=lambda: rehearsed.reg_write(**values))
        one.reg_write(**values)
        if dry_run:
            dry.show(rehearsal, output)
            return Exit.OK
        rows = registers.facts(one, entries, values)
    output.document("motorbus.feetech.reg-write/1", {"id": node, "registers": rows})
    registers.show(f"Waiting in #{node} for an action", rows, output)
    return Exit.OK


@app.command(
    help_epilogue="""Without ids one broadcast starts all servos in the same instant, and none of
them answers. Where a machine file bounds axes on this bus it is refused: what
another program handed over nobody can judge.

Examples:

    motorbus feetech action feetech:/dev/ttyACM0
    motorbus feetech action feetech:/dev/ttyACM0#1"""
)
def action(
    bus: Annotated[str, Parameter(name="BUS[#ID]")],
    /,
    *,
    dry_run: DryRun = False,
    output: Silent,
    **options: str,
) -> Exit:
    """Carry out what `reg-write` left.

    Parameters
    ----------
    bus
        feetech:PORT for everyone, or feetech:PORT#ID.
    options
        Any option of the bus string, as a flag.
    """
    wanted = _ours(target(bus))
    with opened(wanted.bus, options, output) as opening:
        rehearsal = dry.DryBus(opening)
        for node in wanted.nodes:
            face(rehearsal.apart() if dry_run else opening, node).action()
        if not wanted.nodes:
            (rehearsal if dry_run else opening).run(_action_all(opening))
        if dry_run:
            dry.show(rehearsal, output)
            return Exit.OK
    output.document("motorbus.feetech.action/1", {"ids": list(wanted.nodes) or "all"})
    output.text(f"action sent to {', '.join(f'#{node}' for node in wanted.nodes) or 'everyone'}")
    return Exit.OK


async def _action_all(bus: Bus) -> None:
    everyone = driver.action_all()
    await everyone
    await Sleep(
        bus.driver.air_time(everyone, bus.rate)
    )  # nobody answers: let it leave before the port is closed


@app.command(
    usage="Usage: motorbus feetech sync-read BUS#IDS NAME... [OPTIONS]",
    help_epilogue="""One packet asks, all answer one after the other. Ends with exit code 6 when
some are silent.

Examples:

    motorbus feetech sync-read feetech:/dev/ttyACM0#1-6 present_position
    motorbus feetech sync-read feetech:COM7#1-6 present_voltage moving --json""",
)
def sync_read(
    devices: Annotated[str, Parameter(name="BUS#IDS")], /, *names: str, output: Silent, **options: str
) -> Exit:
    """Read registers of many servos at once.

    Parameters
    ----------
    devices
        feetech:PORT#IDS, as feetech:/dev/ttyACM0#1-6
    names
        Registers by name.
    options
        Any option of the bus string, as a flag.
    """
    wanted = _ours(target(devices))
    if not wanted.nodes or not names:
        raise RequestError(
            "which servos, and what?", expected="BUS#IDS NAME..., as feetech:/dev/ttyACM0#1-6 moving"
        )
    check_names(wanted.family, names)
    with opened(wanted.bus, options, output) as opening:
        servos = [driver.Servo(opening, node) for node in wanted.nodes]
        found = opening.run(driver.sync_read(names, servos, rate=opening.rate))
    rows = {
        servo.node: _facts(servo, found.values[servo.node]) for servo in servos if servo.node in found.values
    }
    silent = {str(node): error.summary for node, error in found.errors.items()}
    output.document("motorbus.feetech.sync-read/1", {"devices": rows, "errors": silent})
    shown = [
        [node, *(quantity.shown(row["value"], row["unit"]) for row in row_)] for node, row_ in rows.items()
    ]
    output.table("", [">id", *names], shown)
    if not rows:
        raise next(iter(found.errors.values()))
    if silent:
        raise Partial("; ".join(silent.values()))
    return Exit.OK


def _facts(servo: driver.Node, values: Mapping[str, Any]) -> list[dict[str, Any]]:
    assert servo.table is not None
    return registers.facts(servo, [servo.table[name] for name in values], values)


@app.command(
    usage="Usage: motorbus feetech sync-write BUS NAME ID=VALUE... [OPTIONS]",
    help_epilogue="""Nobody acknowledges a sync write; `sync-read` shows what came of it.

Examples:

    motorbus feetech sync-write feetech:COM7 goal_position 1=90deg 2=-0.5
    motorbus feetech sync-write feetech:COM7 torque_limit 1=50% 2=50% --dry-run""",
)
def sync_write(
    bus: str,
    name: str,
    /,
    *assignments: Annotated[str, Parameter(name="ID=VALUE")],
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: str,
) -> Exit:
    """Write one register of many servos in one packet.

    Parameters
    ----------
    bus
        feetech:PORT, as feetech:/dev/ttyACM0
    name
        A register in RAM, by name.
    assignments
        For each servo, what the register shall hold.
    yes
        Do not ask before a way of more than 180 degrees.
    options
        Any option of the bus string, as a flag.
    """
    wanted = _ours(target(bus))
    check_names(wanted.family, [name])
    texts = _by_id(wanted, assignments)
    with opened(wanted.bus, options, output) as opening:
        rehearsal = dry.DryBus(opening)
        carrier = rehearsal if dry_run else opening
        servos = {node: driver.Servo(carrier, node) for node in texts}
        values: dict[driver.Node, dict[str, Any]] = {
            servo: {name: _value(servo, table_of(servo)[name], texts[node])} for node, servo in servos.items()
        }
        ways = [way for one, held in values.items() for way in goals_among(one, [table_of(one)[name]], held)]
        order = partial(driver.sync_write, values, rate=opening.rate)
        consent_to_ways(ways, output, yes=yes or dry_run, rehearse=lambda: rehearsal.run(order()))
        carrier.run(order())
    if dry_run:
        dry.show(rehearsal, output)
        return Exit.OK
    rows = {servo.node: _facts(servo, written) for servo, written in values.items()}
    output.document("motorbus.feetech.sync-write/1", {"devices": rows})
    shown = [[node, quantity.shown(row["value"], row["unit"]), row["raw"]] for node, (row,) in rows.items()]
    output.table("Sent, and acknowledged by nobody", [">id", name, ">raw"], shown)
    return Exit.OK


def _by_id(wanted: Target, assignments: Sequence[str]) -> dict[int, str]:
    pairs = [assignment.partition("=")[::2] for assignment in assignments]
    if not pairs or not all(node.isdecimal() and text for node, text in pairs):
        raise RequestError("which servos, and what?", expected="ID=VALUE, as 1=90deg 2=-0.5")
    texts = {int(node): text for node, text in pairs}
    if len(texts) < len(pairs):
        raise RequestError("a servo is named twice", sent=" ".join(assignments), advice="nothing was sent")
    for node in texts:
        wanted.family.devices.blocking(None, node)  # raises when it is no id
    return texts


@app.command(
    usage="Usage: motorbus feetech factory-restore BUS#ID [OPTIONS]",
    help_epilogue="""Examples:

    motorbus feetech factory-restore feetech:/dev/ttyACM0#3 --dry-run
    motorbus feetech factory-restore feetech:/dev/ttyACM0#3 --yes""",
)
def factory_restore(
    device_: Annotated[str, Parameter(name="BUS#ID")],
    /,
    *,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: str,
) -> Exit:
    """Set a servo back as shipped; it goes limp, and keeps its id as a rule.

    Parameters
    ----------
    device_
        feetech:PORT#ID, as feetech:/dev/ttyACM0#3
    yes
        Do not ask before everything in EEPROM is overwritten.
    options
        Any option of the bus string, as a flag.
    """
    bus, _, (node,) = _ours(device(device_))
    with opened(bus, options, output) as opening:
        rehearsal = dry.DryBus(opening)
        what = f"overwrite all settings of #{node}, and let it go limp"
        consent_to(what, output, yes=yes or dry_run, rehearse=face(rehearsal, node).factory_restore)
        found = face(rehearsal if dry_run else opening, node).factory_restore()
    if dry_run:
        dry.show(rehearsal, output)
        return Exit.OK
    facts = {"id": node, "found": found.node, "baud": found.rate}
    output.document("motorbus.feetech.factory-restore/1", facts)
    output.text(f"#{node} is as shipped; it answers as #{found.node} at {found.rate} bit/s")
    return Exit.OK
