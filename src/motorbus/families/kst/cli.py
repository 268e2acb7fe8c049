"""The commands `motorbus kst ...`, and the functions that common commands use of this family (`motorbus.cli.faces`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Annotated, Any, Final, Literal

from cyclopts import App, Group, Parameter

from motorbus.cli import consent, dry, identity, quantity, several, target
from motorbus.cli.device_command import DeviceCommand, device_command
from motorbus.cli.exits import Exit
from motorbus.core import units
from motorbus.core.interrupted import Moving, stopped_if_interrupted
from motorbus.core.register import Register
from motorbus.core.scan import Skipped
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import Progress, gather
from motorbus.errors import RequestError
from motorbus.families.kst.driver import feedback, motion, provisioning
from motorbus.families.kst.driver.broadcast import broadcast_read
from motorbus.families.kst.driver.node import checked_id
from motorbus.families.kst.driver.scan import ScanWarning
from motorbus.families.kst.driver.servo import Servo, settings_of
from motorbus.families.kst.profiles import (
    PROFILES,
    VERSIONS,
    bit_rate_code,
    current,
    temperature,
    version_text,
)

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
"""Register a command: usage, note, examples. It is run with a `Run`: `write` asks for consent, or shows the frames of a
dry run; `show` prints facts (as JSON) or their text, in a dry run nothing. `consent` names what --yes consents to, by
default every write; with "" the command has no --yes."""


def label(node: int) -> str:
    """A servo in a sentence: #37 (0x25)."""
    return f"#{node} (0x{node:02X})"


def parse_bit_rate(text: str) -> int:
    """Parse 500000, 500k or 1M. Raises RequestError for a rate that these servos do not have."""
    rate = units.rate(text)
    bit_rate_code(rate)  # raises
    return rate


@command(
    "provision BUS#ID",
    "Connect one servo at a time. After an interrupt, give the same command again.",
    "provision kst:can://slcan/dev/ttyACM0#0x25 --new-bitrate 1M",
    "provision kst:sim,ids=0x25#0x25 --new-id 0x26 --dry-run",
)
def provision(
    run: Run,
    /,
    *,
    new_id: Annotated[str, Parameter(help="New id, 1 to 127.")] = "",
    new_bitrate: Annotated[str, Parameter(help="New bit rate, as 1000000 or 1M.")] = "",
    timeout: Annotated[str, Parameter(help="Time to wait for the power cycle.")] = "120s",
) -> Exit:
    """Write id and bit rate, save, wait for a power cycle, and verify."""
    wanted: dict[str, int] = {}
    values: list[str] = []
    if new_id:
        wanted["new_id"] = checked_id(identity.id_said(new_id))
        values.append(f"the id {label(wanted['new_id'])}")
    if new_bitrate:
        wanted["new_rate"] = parse_bit_rate(new_bitrate)
        values.append(f"the bit rate {wanted['new_rate']} bit/s")
    if not wanted:
        raise RequestError("no new id and no new bit rate", expected="--new-id, --new-bitrate, or both")
    seconds = units.parse(timeout, "time")

    def write(servo: Servo) -> None:
        """What `provision` writes, without its checks."""
        if "new_id" in wanted:
            servo.set_node_id(wanted["new_id"])
        if "new_rate" in wanted:
            servo.set_bit_rate(wanted["new_rate"])
        servo.save()

    if run.dry_run:
        run.write(write)
        run.output.text("then: power cycle, and a check of the new values")
        return Exit.OK

    def show_step(event: object) -> None:
        if isinstance(event, (Progress, provisioning.PowerCycleNeeded)):
            name = "progress" if isinstance(event, Progress) else "power-cycle"
            run.output.document(run.schema, {"event": name, **event._asdict()})

    with target.opened(run.bus, run.options, run.output) as bus:
        rehearse = partial(write, Servo(dry.DryBus(bus), run.node))
        question = f"{run.label}: write and save {' and '.join(values)}"
        consent.consent_to(question, run.output, yes=run.yes, rehearse=rehearse)
        done: provisioning.Provisioned = identity.carried_out(
            bus, run.node, "provision", output=run.output, report=show_step, timeout=seconds, **wanted
        )
    result = "had these values already" if done.resumed else "came back after the power cycle"
    text = f"{label(done.node)} {result}: it answers at {done.rate} bit/s, firmware {done.firmware}"
    facts = {"bitrate": done.rate, "firmware": done.firmware, "resumed": done.resumed}
    return run.show({"event": "provisioned", "from": run.node, "id": done.node, **facts}, text)


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
    "limits BUS#ID [LOW HIGH]",
    "Not in the manual; a profile without it refuses.",
    "limits kst:sim,profile=kst-ext#1",
    "limits kst:sim,profile=kst-ext#1 -45deg 45deg --yes",
)
def limits(
    run: Run,
    low: Annotated[str, Parameter(name="LOW", help="At most 0, in rad or as -45deg.")] = "",
    high: Annotated[str, Parameter(name="HIGH", help="At least 0.")] = "",
    /,
) -> Exit:
    """Read the travel limits of a servo, or write and save them."""
    if bool(low) != bool(high):
        raise RequestError("one limit alone", expected="both, as -45deg 45deg", advice="nothing was sent")
    if low:
        bounds = units.parse(low, "position"), units.parse(high, "position")
        run.write(lambda servo: servo.set_travel_limits(*bounds), "write and save its travel limits")
    else:
        bounds = run.read(lambda servo: servo.travel_limits())
    shown = {"low": units.show(bounds[0], "position"), "high": units.show(bounds[1], "position")}
    return run.show({"low": bounds[0], "high": bounds[1]}, **shown)


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
    "set_node_id()": "`motorbus set-id BUS#ID NEW`",
    "set_bit_rate()": "`motorbus set-baud BUS#ID RATE`",
    "provision()": "`motorbus kst provision`",
    "set_mid_point()": "`motorbus kst mid-point`",
    "set_reversed()": "`motorbus kst reverse BUS#ID on|off`",
    "set_reversed(False)": "`motorbus kst reverse BUS#ID off`",
    "reversed()": "`motorbus kst reverse BUS#ID`",
}
"""A call in an error text -> the command that does the same."""
CUT_OFF: Final = (
    "repeat `motorbus set-id`, `motorbus set-baud` or `motorbus kst provision`: it reads the state of the servo and "
    "continues; nothing was sent"
)
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
        if row is profile.status_row:
            amperes, celsius = current(profile, raw), temperature(raw)
            return f"{units.show(amperes, 'current')}, {units.show(celsius, 'temperature')}"
    return quantity.meaning(row, raw)


def ping_everyone(bus: Any) -> list[int]:
    """For `motorbus ping BUS`: the ids of the servos that answer one broadcast read."""
    return sorted(bus.run(broadcast_read("node_id", settings_of(bus))))


def move_together(bus: Any, goals: Mapping[int, float], *, wait: bool = True) -> None:
    """For `motorbus move` with several servos: move them to these targets (rad by id) after all are checked.

    With `wait`, an interrupt or a servo that does not answer stops all. Errors as `Servo.move` raises.
    """
    servos = [Servo(bus, node) for node in goals]

    async def send_and_wait(setpoints: Sequence[Setpoint]) -> None:
        for servo, setpoint in zip(servos, setpoints, strict=True):
            await several.or_all_stop(motion.send_target(servo, setpoint))
        arrivals = map(motion.wait_arrival, servos, [setpoint.value for setpoint in setpoints])
        await gather(*map(several.or_all_stop, arrivals))

    async def move() -> None:
        raws = [motion.target(servo, to) for servo, to in zip(servos, goals.values(), strict=True)]
        setpoints = [await motion.setpoint(servo, raw) for servo, raw in zip(servos, raws, strict=True)]
        if wait:
            moving = [
                Moving(one, partial(motion.stop, one), partial(feedback.position, one)) for one in servos
            ]
            await stopped_if_interrupted(send_and_wait(setpoints), *moving)
            return
        for servo, setpoint in zip(servos, setpoints, strict=True):
            await motion.send_target(servo, setpoint)

    several.carried_out(bus, move())
