"""The commands `motorbus kst ...`, and the functions that common commands use of this family (`motorbus.cli.faces`)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Annotated, Any, Final, Literal

from cyclopts import App, Group, Parameter

from motorbus.cli import quantity, several
from motorbus.cli.device_command import DeviceCommand, device_command
from motorbus.cli.exits import Exit
from motorbus.core import units
from motorbus.core.move import move
from motorbus.core.register import Register
from motorbus.core.scan import Skipped
from motorbus.families.kst.driver import provisioning
from motorbus.families.kst.driver.broadcast import broadcast_ping
from motorbus.families.kst.driver.motion import MOVE
from motorbus.families.kst.driver.node import Node
from motorbus.families.kst.driver.scan import ScanWarning
from motorbus.families.kst.driver.servo import Servo, settings_of
from motorbus.families.kst.profiles import PROFILES, VERSIONS, current, temperature, version_text

Device = Annotated[str, Parameter(name="BUS#ID", help="As kst:can://slcan/dev/ttyACM0#0x25.")]
Switch = Literal["on", "off"]
Run = DeviceCommand[Servo]

app = App(
    name="kst",
    help="What only kst devices can do.",
    help_epilogue="",
    group_arguments=Group.create_default_parameters(),
)
command = partial(device_command, app, Servo, Device)
"""Register a command: usage, note, examples; see `cli.device_command`."""


@command(
    "mid-point BUS#ID",
    "Keep clear: the servo may move to its old target. Not in the manual; a profile\nwithout it refuses.",
    "mid-point kst:sim,profile=kst-ext#1 --yes",
    "mid-point kst:sim,profile=kst-ext#1 --dry-run",
)
def mid_point(run: Run, /) -> Exit:
    """Make the present position of a servo its zero, and save it."""
    here = run.write(lambda servo: servo.set_mid_point(), "make its present position its zero, and save it")
    if run.dry_run:
        return Exit.OK  # it has no position to show
    text = f"{run.label} reads {units.show(here, 'position')} at its new zero; the save has no reply"
    return run.show({"position": here}, text)


@command(
    "reverse BUS#ID [on|off]",
    "It reverses the rotation. Some firmware undoes it at a restart. Not in the\n"
    "manual; a profile without it refuses.",
    "reverse kst:sim,profile=kst-ext#1",
    "reverse kst:sim,profile=kst-ext#1 on --yes",
)
def reverse(run: Run, switch: Switch | None = None, /) -> Exit:
    """Read the reverse bit of a servo, or write and save it."""
    if switch is None:
        on = run.read(lambda servo: servo.reversed())
    else:
        on = switch == "on"
        run.write(lambda servo: servo.set_reversed(on), f"switch its reverse bit {switch}, and save it")
    return run.show({"reversed": on}, f"{run.label} turns {'in reverse' if on else 'as shipped'}")


# -- what the commands of all families (motorbus scan, read, move, ...) use of this family ---------------------
# `motorbus.cli.faces` finds it by name.

COMMANDS: Final = {
    "set_mid_point()": "`motorbus kst mid-point`",
    "set_reversed()": "`motorbus kst reverse BUS#ID on|off`",
    "set_reversed(False)": "`motorbus kst reverse BUS#ID off`",
}
"""A call in an error text -> the command that does the same."""
CUT_OFF: Final = "repeat `motorbus set-id` or `motorbus set-baud`: it continues from the state of the servo"
"""Advice of `motorbus recover`, which sends nothing to these servos."""


def say(event: object) -> str:
    """The text that a command prints for an event of a scan or of `provision`; "": none."""
    if isinstance(event, ScanWarning):
        place = f"#{event.node} " if event.node else ""
        return f"{place}at {event.rate} bit/s: {event.what}"
    if isinstance(event, Skipped):
        return f"nothing was sent at {event.rate} bit/s: {event.why}"
    if isinstance(event, provisioning.PowerCycleNeeded):
        return "switch the supply of this servo off and on again now"
    return ""


def meaning(row: Register, raw: int) -> str:
    """For `motorbus read`: the raw value of an object in words."""
    if row.name in VERSIONS:
        return version_text(raw.to_bytes(row.size, "little"))
    for profile in PROFILES.values():
        if row == profile.table.at(0x6005, 0):
            amperes, celsius = current(profile, raw), temperature(raw)
            return f"{units.show(amperes, 'current')}, {units.show(celsius, 'temperature')}"
    return quantity.meaning(row, raw)


def ping_everyone(bus: Any) -> list[int]:
    """For `motorbus ping BUS`: the ids of the servos that answer one broadcast read."""
    return sorted(bus.run(broadcast_ping(settings_of(bus))))


def move_together(bus: Any, goals: Mapping[int, float], *, wait: bool = True) -> None:
    """For `motorbus move` with several servos: targets in rad by id; one that does not answer stops all."""
    servos: dict[Node, float] = {Servo(bus, node): to for node, to in goals.items()}
    several.carried_out(bus, move(MOVE, servos, wait=wait, around=several.or_all_stop))
