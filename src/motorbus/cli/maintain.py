"""`motorbus set-id`, `set-baud`, `set-zero`, `recover`, `backup`, `restore`: guarded changes of what a device keeps."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Final

import msgspec
from cyclopts import Parameter
from msgspec import Struct

from motorbus.cli.common import Common, NeedsConsent, Partial, Target, Writing
from motorbus.cli.dryrun import carry_out
from motorbus.cli.output import confirm, emit, note
from motorbus.cli.registers import map_of, raise_errors
from motorbus.cli.target import (
    bus_address,
    bus_of,
    edit_machine,
    need_machine,
    open_bus,
    open_devices,
    parse_quantity,
)
from motorbus.core import units
from motorbus.core.register import Storage
from motorbus.core.request import Effect
from motorbus.errors import LinkError, MotorbusError, RequestError
from motorbus.journal import Change, everywhere
from motorbus.session.journals import journal_of, unfinished


class Changed(Struct, frozen=True, tag="changed"):
    """The devices that have this id or rate now, and the address that reaches them."""

    devices: tuple[int, ...]
    address: str


class Zeroed(Struct, frozen=True, tag="zeroed"):
    """What the present pose reads now."""

    device: str
    position: str


class Recovered(Struct, frozen=True, tag="recovered"):
    """An unfinished change and its end: finished, taken back, forgotten; "" if it is unfinished."""

    bus: str
    change: str
    outcome: str = ""


class Saved(Struct, frozen=True, tag="saved"):
    """A file with the settings of a device, or the settings that were written from it."""

    device: str
    file: str
    settings: tuple[str, ...]


class Settings(Struct, frozen=True):
    """A settings file: raw register values by name."""

    format: int
    family: str
    model: str
    firmware: str
    map: str
    values: dict[str, int]


def _one(devices: list[Target], method: str, what: str) -> Target:
    """The only device, which has this method. Raises RequestError."""
    if len(devices) != 1:
        names = ", ".join(one.name for one in devices)
        raise RequestError(f"{len(devices)} devices: {names}", expected="one device, as BUS#ID")
    if not hasattr(devices[0].device, method):
        raise RequestError(f"{devices[0].family.name} devices have no {what}")
    return devices[0]


def set_id(
    device: str,
    new: Annotated[str, Parameter(name="NEW")],
    /,
    *,
    writing: Writing = Writing(),
    common: Common = Common(),
) -> None:
    """Change the id of a device (EEPROM); it loses its torque.

    Examples:

        motorbus set-id feetech:/dev/ttyACM0#1 7
        motorbus set-id shoulder 7 --dry-run
        motorbus set-id kst:can://slcan/dev/ttyACM0#0x25 0x26 --yes

    Connect one new device at a time: two devices with one id may look like one.
    `motorbus recover` ends an interrupted change. A KST servo asks for a power cycle.
    """
    try:
        number = int(new, 0)
    except ValueError:
        raise RequestError(f"{new!r} is not an id", expected="a whole number, as 7 or 0x26") from None
    with open_devices(common, (device,)) as devices:
        target = _one(devices, "set_id", "id that can be changed")
        question = f"write id {number} to the EEPROM of {target.name}"
        found = carry_out(writing, target, lambda one: one.set_id(number), question)
        if found is None:
            return
    if not target.name.startswith("#"):
        _move_axis(common, target.name, found.node)
    emit(Changed((found.node,), f"{bus_of(target)}#{found.node}"), common)


def _move_axis(common: Common, axis: str, node: int) -> None:
    """Change the entry of an axis of the machine file whose device has another id now."""
    device = f"{need_machine(common).axes[axis].bus}#{node}"
    edit_machine(Path(common.machine), {f"axis.{axis}.device": device})
    note(f"note: {common.machine}: {axis} is {device}")


def set_baud(
    target: Annotated[str, Parameter(name="BUS")],
    rate: str,
    /,
    *,
    writing: Writing = Writing(),
    common: Common = Common(),
) -> None:
    """Change the rate of the devices on a bus, or of one device (EEPROM).

    Examples:

        motorbus set-baud feetech:/dev/ttyACM0 500000
        motorbus set-baud feetech:/dev/ttyACM0#3 1M --dry-run
        motorbus set-baud kst:can://slcan/dev/ttyACM0#0x25 500k --yes

    The devices answer at the new rate only: a bus is opened at it with `-o baud=RATE` (CAN: `-o bitrate=RATE`).
    """
    wanted = units.rate(rate)
    done: list[int] = []
    errors: dict[str, MotorbusError] = {}
    with open_devices(common, (target,)) as devices:
        first = _one(devices[:1], "set_baud", "rate that can be changed")
        question = f"write rate {wanted} bit/s to the EEPROM of {', '.join(one.name for one in devices)}"
        how = writing
        for one in devices:
            try:
                if carry_out(how, one, lambda device: device.set_baud(wanted), question) is not None:
                    done.append(one.node)
            except (LinkError, NeedsConsent) as error:
                if done:
                    error.add_note(f"at {wanted} bit/s already: {_ids(done)}")
                raise
            except MotorbusError as error:
                errors[one.name] = error
            how = Writing(yes=True, dry_run=writing.dry_run)
    if done:
        option = "baud" if first.family.link.kind == "bytes" else "bitrate"
        emit(Changed(tuple(done), f"{bus_of(first)},{option}={wanted}#{_ids(done)}"), common)
    raise_errors(errors, is_partial=bool(done))


def _ids(nodes: list[int]) -> str:
    return "+".join(map(str, nodes))


def set_zero(
    device: str,
    /,
    *,
    to: Annotated[str, Parameter(help="What the present pose reads then, as 180deg.")] = "",
    writing: Writing = Writing(),
    common: Common = Common(),
) -> None:
    """Set the zero position of a device (EEPROM): the present pose reads the middle of the turn, or --to.

    Examples:

        motorbus set-zero feetech:/dev/ttyACM0#3
        motorbus set-zero shoulder --to 180deg --dry-run
        motorbus set-zero kst:can://slcan/dev/ttyACM0#0x25 --yes

    The device loses its torque and may move to its old target afterwards: keep clear. A KST servo reads 0 and needs a
    profile that has the object.
    """
    with open_devices(common, (device,)) as devices:
        has_offset = hasattr(devices[0].device, "calibrate")
        target = _one(devices, "calibrate" if has_offset else "set_mid_point", "zero that can be set")
        if to and not has_offset:
            raise RequestError(f"{target.family.name} devices read 0 at their zero", advice="leave --to out")
        goal = parse_quantity(to, "position") if to else None

        def change(one: Any) -> float:
            if not has_offset:
                return float(one.set_mid_point())
            one.calibrate(goal)
            return float(one.position())

        place = carry_out(writing, target, change, f"write the zero position to the EEPROM of {target.name}")
        if place is not None:
            emit(Zeroed(target.name, units.show(place, "position")), common)


# -- recover -------------------------------------------------------------------------------------------------------

OUTCOMES: Final = {"new": "finished", "old": "taken back"}


def recover(
    bus: str = "",
    /,
    *,
    forget: Annotated[bool, Parameter(help="Forget the change; send nothing.")] = False,
    writing: Writing = Writing(),
    common: Common = Common(),
) -> None:
    """Finish an interrupted change of a bus, or take it back; without BUS list the unfinished changes.

    Examples:

        motorbus recover
        motorbus recover feetech:/dev/ttyACM0
        motorbus recover feetech:/dev/ttyACM0 --forget --yes

    set-id, set-baud, and motion of a stepper controller keep a journal. A servo is locked again; a controller stops and
    gets its project 1 back. --forget is for a device that is gone.
    """
    if not (bus or common.bus):
        _list_changes(common)
        return
    address = bus_address(bus, common)
    ended: Recovered | None = Recovered(address, "nothing is unfinished")
    if forget:
        journal = journal_of(address)
        if journal is not None and (change := journal.unfinished()):
            confirm(f"forget {_text(change)}", writing)
            journal.forget()
            ended = Recovered(address, _text(change), "forgotten")
    else:
        with open_bus(common, address) as opened:
            if change := unfinished(opened):
                device = opened.family.devices.blocking(opened, change.node)
                target = Target(f"#{change.node}", opened, change.node, opened.family, device)
                verb, facts = change.verb, change.facts
                question = f"end {_text(change)}"
                outcome = carry_out(writing, target, lambda one: one.recover(verb, facts), question)
                ended = outcome and Recovered(change.bus, _text(change), OUTCOMES.get(outcome, outcome))
    if ended is not None:
        emit(ended, common)


def _list_changes(common: Common) -> None:
    found = everywhere()
    errors = [one for one in found if isinstance(one, MotorbusError)]
    changes = [Recovered(one.bus, _text(one)) for one in found if isinstance(one, Change)]
    if changes or common.json:
        emit(changes, common)
    elif not errors:
        print("nothing is unfinished")
    if errors:
        raise errors[0]


def _text(change: Change) -> str:
    return change.describe().rstrip(",")


# -- backup, restore -----------------------------------------------------------------------------------------------


def backup(device: str, file: Path, /, *, common: Common = Common()) -> None:
    """Save the settings of a device to a new file; writes nothing to the device.

    Examples:

        motorbus backup feetech:/dev/ttyACM0#3 shoulder.json
        motorbus backup shoulder shoulder.json
        motorbus backup stepper:/dev/ttyUSB0 projects.toml

    The file has each EEPROM register that `write` can write, not id and rate; of a stepper controller all projects.
    """
    with open_devices(common, (device,)) as devices:
        target = _one(devices, "read", "settings")
        if hasattr(target.device, "backup"):
            text = target.device.backup().text()
            names: tuple[str, ...] = ("all projects",)
        else:
            values = _read_settings(target)
            names = tuple(values)
            identity = target.device.identify()
            kept = Settings(
                1, target.family.name, identity.model, identity.firmware, map_of(target).name, values
            )
            text = msgspec.json.format(msgspec.json.encode(kept)).decode() + "\n"
    with file.open("x", encoding="utf-8") as stream:
        stream.write(text)
    emit(Saved(target.name, str(file), names), common)


def _read_settings(target: Target) -> dict[str, int]:
    """The raw values of the EEPROM registers that `write` can write, by name."""
    rows = [
        row.name
        for row in map_of(target).values()
        if row.storage is Storage.EEPROM
        and row.writable
        and row.readable
        and not row.protected
        and row.effect is not Effect.IDENTITY
    ]
    if not rows:
        raise RequestError(f"{target.name}: map {map_of(target).name} has no settings that can be saved")
    return dict(target.device.read_raw(*rows))


def restore(file: Path, device: str, /, *, writing: Writing = Writing(), common: Common = Common()) -> None:
    """Write the settings of a file that differ from those of the device, and read them back (EEPROM).

    Examples:

        motorbus restore shoulder.json feetech:/dev/ttyACM0#3 --dry-run
        motorbus restore shoulder.json shoulder
        motorbus restore projects.toml stepper:/dev/ttyUSB0 --yes
    """
    text = file.read_text("utf-8")
    with open_devices(common, (device,)) as devices:
        target = _one(devices, "write", "settings")
        if hasattr(target.device, "restore"):
            kind = type(target.device.backup())
            wanted = kind.parse(text)
            question = f"write all projects to {target.name}"
            if carry_out(writing, target, lambda one: one.restore(wanted) or True, question):
                emit(Saved(target.name, str(file), ("all projects",)), common)
            return
        values = _parse_settings(text, file, target)
        now = _read_settings(target)
        unknown = [name for name in values if name not in now]
        if unknown:
            raise RequestError(f"{file}: {unknown[0]!r} is not a setting of {target.name}")
        table = map_of(target)
        changed = {name: raw for name, raw in values.items() if now[name] != raw}
        orders = {name: table[name].to_value(raw) for name, raw in changed.items()}
        question = f"write {', '.join(changed)} to the EEPROM of {target.name}"
        if changed and not carry_out(writing, target, lambda one: one.write(**orders) or True, question):
            return
        after = _read_settings(target) if changed else now
        wrong = [name for name, raw in changed.items() if after[name] != raw]
        if wrong:
            raise Partial(f"{target.name}: {', '.join(wrong)} read back another value")
        emit(Saved(target.name, str(file), tuple(changed)), common)
        if not changed:
            note(f"{target.name} has these settings already: nothing was written")


def _parse_settings(text: str, file: Path, target: Target) -> dict[str, int]:
    """The values of a settings file for this device. Raises RequestError."""
    try:
        saved = msgspec.json.decode(text, type=Settings)
    except msgspec.MsgspecError as error:
        raise RequestError(f"{file} is not a file of `motorbus backup`: {error}") from None
    table = map_of(target).name
    if (saved.family, saved.map) != (target.family.name, table):
        raise RequestError(
            f"{file} is of a {saved.family} device with map {saved.map}",
            expected=f"{target.family.name}, map {table}",
        )
    return saved.values
