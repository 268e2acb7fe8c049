"""The commands `motorbus feetech ...`, and the functions that common commands use (`motorbus.cli.faces`)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Annotated, Any, Final, Literal

from cyclopts import App, Group, Parameter

from motorbus.cli import several
from motorbus.cli.device_command import DeviceCommand, device_command
from motorbus.cli.exits import Exit
from motorbus.cli.wording import shell_words
from motorbus.core import units
from motorbus.core.scan import Skipped
from motorbus.errors import RequestError
from motorbus.families.feetech.driver.eeprom import TorqueAfterWrite
from motorbus.families.feetech.driver.group import ReadsAlone, disable_torque_everyone, prepare_all
from motorbus.families.feetech.driver.identity import ScanWarning
from motorbus.families.feetech.driver.motion import Motion, move_all
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.scan import broadcast_ping
from motorbus.families.feetech.driver.servo import Servo

__all__ = ["COMMANDS", "app", "disable_torque_everyone", "move_together", "ping_everyone", "say"]

Device = Annotated[str, Parameter(name="BUS#ID", help="As feetech:/dev/ttyACM0#3.")]
ModeName = Annotated[
    Literal["position", "velocity", "pwm", "step", "current"] | None,
    Parameter(name="MODE", help="The new mode."),
]
Run = DeviceCommand[Servo]

app = App(
    name="feetech",
    help="What only feetech devices can do.",
    help_epilogue="",
    group_arguments=Group.create_default_parameters(),
)
command = partial(device_command, app, Servo, Device)


@command(
    "mode BUS#ID [MODE]",
    "STS and SMBL have position, velocity, pwm and step, SMCL all but step, HLS\n"
    "position, velocity and current, SCS position and pwm. Without MODE it shows the\n"
    "mode, and the settings and alarms that keep the servo from moving.",
    "mode feetech:/dev/ttyACM0#3",
    "mode feetech:/dev/ttyACM0#3 velocity --yes",
    "mode feetech:COM7#2 position --low 20deg --high 280deg --yes",
)
def mode(
    run: Run,
    mode_: ModeName = None,
    /,
    *,
    low: Annotated[str, Parameter(help="Lowest position of an SCS that leaves pwm.")] = "",
    high: Annotated[str, Parameter(help="Its highest position.")] = "",
) -> Exit:
    """Show the mode of a servo and what keeps it from moving, or set another mode; it is limp then."""
    if bool(low) != bool(high):
        raise RequestError("one limit alone", expected="both --low and --high")
    limits = (units.parse(low, "position"), units.parse(high, "position")) if low else None
    if mode_ is None:
        if limits:
            raise RequestError("limits without a mode", expected="MODE, as position")
        return run.show(**run.read(partial(_mode_facts, run)))
    run.write(lambda servo: servo.set_mode(mode_, limits=limits), f"set {mode_} mode; it goes limp")
    return run.show({"mode": mode_}, f"{run.label} is in {mode_} mode, limp")


def _mode_facts(run: Run, servo: Servo) -> dict[str, Any]:
    """What `mode` shows, as arguments of `DeviceCommand.show`."""
    blocked = [shell_words(text, servo.bus.family) for text in servo.why_not_moving()]  # type: ignore[attr-defined]
    name = servo.known_mode.value if servo.known_mode else "not documented"
    text = "\n".join([f"{run.label} mode: {name}", *(f"blocked: {one}" for one in blocked)])
    return {"facts": {"mode": name, "blocked": blocked}, "text": text}


@command(
    "recover-overload BUS#ID",
    "Torque off, one second, the goal to where it stands, torque on: an arm sags\n"
    "meanwhile. Exit code 7 and a limp servo if the alarm stays: then only a power\n"
    "cycle helps.",
    "recover-overload feetech:/dev/ttyACM0#3",
    "recover-overload feetech:/dev/ttyACM0#3 --dry-run",
    consent="",
)
def recover_overload(run: Run, /) -> Exit:
    """Switch torque on again after an overload."""
    found = run.write(lambda servo: servo.recover_overload())
    if run.dry_run:
        return Exit.OK
    text = f"{run.label} has no overload to recover from"
    if found.tripped:
        text = f"{run.label} holds where it stands; the alarm {' and '.join(found.tripped)} is gone"
    return run.show(found._asdict(), "\n".join([text, *(f"warning: {one}" for one in found.remaining)]))


@command(
    "reset BUS#ID",
    "Instruction 0x06; as a rule the id is kept.",
    "reset feetech:/dev/ttyACM0#3 --dry-run",
    "reset feetech:/dev/ttyACM0#3 --yes",
)
def reset(run: Run, /) -> Exit:
    """Restore the factory values of a servo; it goes limp."""
    found = run.write(lambda servo: servo.factory_restore(), "overwrite all its settings; it goes limp")
    if run.dry_run:
        return Exit.OK
    text = f"{run.label} has its factory values; it answers as #{found.node} at {found.rate} bit/s"
    return run.show({"found": found.node, "baud": found.rate}, text)


# -- what the commands of all families (motorbus scan, read, move, ...) use of this family ---------------------

COMMANDS: Final = {
    "calibrate()": "`motorbus calibrate`",
    "factory_restore()": "`motorbus feetech reset`",
    "limits=(low, high)": "--low and --high",
    "move()": "`motorbus move`",
    "recover_overload()": "`motorbus feetech recover-overload`",
    **{
        f"set_mode('{name}')": f"`motorbus feetech mode BUS#ID {name}`"
        for name in ("position", "velocity", "pwm", "step", "current")
    },
}
"""A call in an error text -> the command that does the same."""


def say(event: object) -> str:
    """The text that a command prints for an event of a scan, a group or a write; "": none."""
    if isinstance(event, ScanWarning):
        return f"#{event.node} at {event.rate} bit/s: {event.what}"
    if isinstance(event, Skipped):
        return f"nothing was sent at {event.rate} bit/s: {event.why}"
    if isinstance(event, ReadsAlone):
        return f"#{event.node} answers READ and not SYNC READ: it is read by itself"
    if isinstance(event, TorqueAfterWrite):
        state = "has its torque back" if event.on else f"stays without torque: {event.why}"
        return f"#{event.node} was limp while its EEPROM was written, and {state}"
    return ""


def ping_everyone(bus: Any) -> list[int]:
    """For `motorbus ping BUS`: the ids that answer one broadcast PING; replies of several servos may collide."""
    return sorted(bus.run(broadcast_ping()))


def move_together(
    bus: Any,
    goals: Mapping[int, float],
    *,
    velocity: float | None = None,
    acceleration: float | None = None,
    wait: bool = True,
) -> None:
    """For `motorbus move` with several servos: move them to these goals (rad by id) after all are checked.

    If one does not answer, the others stop. Errors as `Servo.move` raises.
    """
    servos: dict[Node, float] = {Servo(bus, id): goal for id, goal in goals.items()}

    async def move() -> None:
        for error in (await prepare_all(servos)).values():
            raise error
        await move_all(Motion(velocity, acceleration), servos, wait=wait, around=several.or_all_stop)

    several.carried_out(bus, move())
