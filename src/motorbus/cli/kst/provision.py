"""`motorbus kst provision`: id and bit rate from the first look to the proof after the restart, guided.

No command restarts these servos, so a person must; what has been reached is found out by asking, so the same words
said again go on from there, whatever happened in between.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from motorbus.cli import dry
from motorbus.cli.consent import consent_to
from motorbus.cli.exits import Exit
from motorbus.cli.kst.identity import bits_per_second, whole
from motorbus.cli.kst.offers import say
from motorbus.cli.kst.servo import BusOption, Device, app, named, one_of_ours
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.target import face, opened
from motorbus.core import units
from motorbus.core.steps import Progress
from motorbus.errors import RequestError
from motorbus.families import kst
from motorbus.families.kst import Node
from motorbus.families.kst.driver.provisioning import provision as provision_procedure

if TYPE_CHECKING:
    from motorbus.cli.output import Bar, Output
    from motorbus.families.kst import Servo

SCHEMA = "motorbus.kst.provision/1"


@app.command(
    usage="Usage: motorbus kst provision BUS#ID [--new-id ID] [--new-bitrate RATE] [OPTIONS]",
    help_epilogue="""Connect one servo at a time. Sees that it is alone and the new id free, writes,
saves, asks for a power cycle, waits for the servo to come back, and verifies.
When it was interrupted, say the same again: it goes on from where things are.
With --json every step is a line. Ends with exit code 9 when the servo comes
back as it was.

Examples:

    motorbus kst provision kst:can://slcan/dev/ttyACM0#0x25 --new-id 0x26
    motorbus kst provision kst:can://slcan/dev/ttyACM0#0x25 --new-bitrate 1M
    motorbus kst provision kst:sim,ids=0x25#0x25 --new-id 0x26 --dry-run""",
)
def provision(
    device_: Device,
    /,
    *,
    new_id: str = "",
    new_bitrate: str = "",
    timeout: str = "120s",
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Give a servo its id or its bit rate, or both, and see it come back with them.

    Parameters
    ----------
    new_id
        The id it shall have, 1 to 127.
    new_bitrate
        The bit rate it shall have, as 1000000 or 1M.
    timeout
        How long to wait for the power cycle.
    yes
        Do not ask before its memory is written.
    """
    bus, _, (node,) = one_of_ours(device_)
    wanted = _wanted(new_id, new_bitrate)
    seconds = units.parse(timeout, "time")
    become = " and ".join(_words(wanted))
    with opened(bus, options, output) as opening:
        if dry_run:
            return _shown(dry.DryBus(opening), node, wanted, output)
        rehearse = partial(_rehearse, dry.DryBus(opening), node, wanted)
        consent_to(f"let {named(node)} become {become}, for good", output, yes=yes, rehearse=rehearse)
        with output.progress("provisioning") as bar:
            procedure = provision_procedure(face(opening, node), timeout=seconds, **wanted)
            done = opening.run(procedure, report=lambda event: _tell(event, bar, output))
    facts = {"id": done.node, "bitrate": done.rate, "firmware": done.firmware, "resumed": done.resumed}
    output.document(SCHEMA, {"event": "provisioned", "from": node, **facts})
    before = "had all of it already" if done.resumed else "came back after the power cycle"
    output.text(f"{named(done.node)} {before}: it answers at {done.rate} bit/s, firmware {done.firmware}")
    return Exit.OK


def _wanted(new_id: str, new_bitrate: str) -> dict[str, int]:
    wanted = {}
    if new_id:
        wanted["new_id"] = Node(whole(new_id, "an id")).node
    if new_bitrate:
        wanted["new_rate"] = bits_per_second(new_bitrate)
    if not wanted:
        raise RequestError("what shall it become?", expected="--new-id, --new-bitrate, or both")
    return wanted


def _words(wanted: dict[str, int]) -> list[str]:
    id_ = [named(wanted["new_id"])] if "new_id" in wanted else []
    return id_ + ([f"one that speaks at {wanted['new_rate']} bit/s"] if "new_rate" in wanted else [])


def _tell(event: Any, bar: Bar, output: Output) -> None:
    """Say where it has come to; the power cycle is asked for on stderr, where a person reads it in any case."""
    if isinstance(event, Progress):
        bar.advance(event.done, event.total, event.what)
        output.document(SCHEMA, {"event": "progress", **event._asdict()})
    elif isinstance(event, kst.PowerCycleNeeded):
        output.document(SCHEMA, {"event": "power-cycle", **event._asdict()})
        bar.say("take the supply of this servo away now, and give it back")
        if not bar.shown:
            output.note("take the supply of this servo away now, and give it back")
    elif said := say(event):
        output.note(said)


def _rehearse(bus: dry.DryBus, node: int, wanted: dict[str, int]) -> None:
    """What would be written; the looking before and the verifying after it are left out."""
    servo: Servo = face(bus, node)
    if "new_id" in wanted:
        servo.set_node_id(wanted["new_id"])
    if "new_rate" in wanted:
        servo.set_bit_rate(wanted["new_rate"])
    servo.save()


def _shown(bus: dry.DryBus, node: int, wanted: dict[str, int], output: Output) -> Exit:
    _rehearse(bus, node, wanted)
    dry.show(bus, output)
    output.text("then a power cycle would be asked for, and the servo looked for")
    return Exit.OK
