"""`motorbus read`, `write`, `monitor`."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from math import inf
from typing import Annotated, Any, Final

from cyclopts import Parameter
from msgspec import Struct
from msgspec.structs import astuple

from motorbus.cli.common import Common, Partial, Target, Writing
from motorbus.cli.dryrun import carry_out
from motorbus.cli.output import emit, escape, redraw, table_lines
from motorbus.cli.target import bus_address, load_machine, open_bus, open_devices, parse_quantity, parse_time
from motorbus.core import units
from motorbus.core.family import AxisDriver, Identity
from motorbus.core.register import Register, RegisterMap, Storage
from motorbus.core.request import Effect
from motorbus.core.steps import Sleep
from motorbus.errors import DeviceError, LinkLost, MotorbusError, NoReply, RequestError


class Value(Struct, frozen=True):
    """A register: its value in `unit`, the meaning of a code."""

    device: str
    register: str
    value: float | int
    unit: str = ""
    meaning: str = ""


def map_of(target: Target) -> RegisterMap:
    """The register map of a device, by its firmware. Raises DeviceError if it is unknown."""
    table: RegisterMap | None = getattr(target.device, "table", None)
    if table is not None:
        return table
    identity: Identity = target.device.identify()
    table = getattr(target.device, "table", None) or target.family.registers.get(identity.table)
    if table is None:
        raise DeviceError(
            f"{target.name}: {identity.model}, firmware {identity.firmware}: its registers are not known",
            node=target.node,
        )
    return table


def read(
    target: str,
    /,
    *registers: str,
    all: Annotated[bool, Parameter(help="Read every register.")] = False,
    raw: Annotated[bool, Parameter(help="Show raw values.")] = False,
    common: Common = Common(),
) -> None:
    """Read registers of devices; without names the present values.

    Examples:

        motorbus read feetech:/dev/ttyACM0#3
        motorbus read shoulder min_position_limit max_position_limit
        motorbus read feetech:/dev/ttyACM0#1-6 present_position --json
    """
    with open_devices(common, (target,)) as devices:
        together = devices[0].family.sync_read
        errors: dict[str, MotorbusError] = {}
        values: list[Value] = []
        if together is not None and registers and not raw and _is_one_bus(devices):
            found = devices[0].bus.run(together(registers, [one.device for one in devices]))
            for one in devices:
                if one.node in found.errors:
                    errors[one.name] = found.errors[one.node]
                else:
                    values += _values(one, found.values[one.node], raw=False)
        else:
            for one in devices:
                try:
                    values += read_values(one, registers, all=all, raw=raw)
                except (NoReply, DeviceError) as error:
                    errors[one.name] = error
    if values:
        emit(values, common)
    raise_errors(errors, is_partial=bool(values))


def _is_one_bus(devices: Sequence[Target]) -> bool:
    return len(devices) > 1 and len({id(one.bus) for one in devices}) == 1


def raise_errors(errors: Mapping[str, MotorbusError], *, is_partial: bool) -> None:
    """Raise the errors of devices, by name: Partial if others answered."""
    if errors and is_partial:
        raise Partial("; ".join(f"{name}: {error.summary}" for name, error in errors.items()))
    if errors:
        raise next(iter(errors.values()))


def read_values(target: Target, names: Sequence[str], *, all: bool = False, raw: bool = False) -> list[Value]:
    """The values of these registers of a device; () means its present values."""
    if not names:
        rows = [row.name for row in map_of(target).values() if row.readable]
        present = [name for name in rows if name.startswith("present_")]
        names = rows if all or not present else present
    return _values(target, (target.device.read_raw if raw else target.device.read)(*names), raw=raw)


def _values(target: Target, found: Mapping[str, Any], *, raw: bool) -> list[Value]:
    table = map_of(target)
    return [
        Value(
            target.name,
            name,
            value,
            "raw" if raw else table[name].unit,
            "" if table[name].unit else table[name].choices.get(int(value), ""),
        )
        for name, value in found.items()
    ]


# -- write ---------------------------------------------------------------------------------------------------------


def write(
    target: str,
    /,
    *values: Annotated[str, Parameter(name="REGISTER=VALUE")],
    writing: Writing = Writing(),
    common: Common = Common(),
) -> None:
    """Write registers of devices; a value has a unit, or is raw as 2048raw.

    Examples:

        motorbus write feetech:/dev/ttyACM0#3 max_temperature=65°C
        motorbus write shoulder goal_position=2048raw --dry-run
        motorbus write feetech:/dev/ttyACM0#1-6 torque_limit=50% --yes
    """
    if not values:
        raise RequestError("no register to write", expected="REGISTER=VALUE, as torque_limit=50%")
    pairs = assignments(values)
    with open_devices(common, (target,)) as devices:
        orders = [(one, {name: parse_value(one, name, text) for name, text in pairs}) for one in devices]
        rows = [map_of(devices[0])[name] for name, _ in pairs]
        question = _question(devices, rows)
        together = devices[0].family.sync_write
        is_goal = all(row.name.startswith("goal_") for row in rows)  # goals start together
        if together is not None and is_goal and _is_one_bus(devices):
            by_node = {one.node: wanted for one, wanted in orders}
            carry_out(writing, devices[0].bus, lambda bus: bus.run(together(by_node)), question)
        else:
            how = writing
            for one, wanted in orders:
                carry_out(how, one, lambda device: device.write(**wanted), question)  # noqa: B023
                how = Writing(yes=True, dry_run=writing.dry_run)
        if not writing.dry_run:
            readable = [name for name, row in zip(dict(pairs), rows, strict=True) if row.readable]
            emit(
                [value for one in devices for value in (read_values(one, readable) if readable else [])],
                common,
            )


def assignments(texts: Sequence[str]) -> list[tuple[str, str]]:
    """REGISTER=VALUE texts, parsed. Raises RequestError."""
    found = []
    for text in texts:
        name, equals, value = text.partition("=")
        if not (name and equals and value.strip()):
            raise RequestError(
                f"{text!r} is not an assignment", expected="REGISTER=VALUE, as torque_limit=50%"
            )
        found.append((name, value.strip()))
    return found


def parse_value(target: Target, register: str, text: str) -> float | int:
    """`65°C`, `2048raw`, `1` of a row without unit -> the value in the unit of the row."""
    row = map_of(target)[register]
    number = text.removesuffix("raw").strip()
    if number == text and row.unit in units.QUANTITIES:
        return parse_quantity(text, units.QUANTITIES[row.unit])
    try:
        raw = units.whole(number) if number != text or not row.unit else units.real(number)
    except ValueError:
        form = f"a number of {row.unit}" if row.unit else "a whole number"
        raise RequestError(
            f"{row.name}: {text!r} is not a value", expected=f"{form}, or as 2048raw"
        ) from None
    if number == text:
        return raw
    of_device = getattr(target.device, "value", None)
    return of_device(row, raw) if of_device is not None else row.to_value(int(raw))


def _question(devices: Sequence[Target], rows: Sequence[Register]) -> str:
    """What needs consent: EEPROM, motion."""
    names = ", ".join(one.name for one in devices)
    kept = [row.name for row in rows if row.storage is Storage.EEPROM]
    moving = [row.name for row in rows if row.effect is Effect.MOTION]
    if kept:
        return f"write {', '.join(kept)} to the EEPROM of {names}"
    return f"write {', '.join(moving)}, which may move {names}" if moving else ""


# -- monitor -------------------------------------------------------------------------------------------------------


class Sample(Struct, frozen=True):
    """One device: rad, rad/s, fraction, A, V, °C in its own angles; `axis_position` in rad or m of its axis."""

    device: str
    position: float | None = None
    axis_position: float | None = None
    velocity: float | None = None
    load: float | None = None
    current: float | None = None
    voltage: float | None = None
    temperature: float | None = None
    alarm: tuple[str, ...] = ()
    note: str = ""
    error: str = ""


class Samples(Struct, frozen=True, tag="samples"):
    """All devices at one time (s since the start)."""

    time: float
    samples: list[Sample]


COLUMNS: Final = (
    ("velocity", "rad/s", 1.0, 2),
    ("load", "load %", 100.0, 0),
    ("current", "A", 1.0, 3),
    ("voltage", "V", 1.0, 1),
    ("temperature", "°C", 1.0, 0),
)


def monitor(
    *targets: str,
    rate: Annotated[float, Parameter(help="Samples per s.")] = 5.0,
    count: Annotated[int, Parameter(help="End after so many samples.")] = 0,
    for_: Annotated[str, Parameter(name="--for", help="End after this time.")] = "",
    file: Annotated[str, Parameter(name="--csv", help="Write the samples to this file.")] = "",
    listen: Annotated[bool, Parameter(help="Send nothing; show each frame of a bus.")] = False,
    common: Common = Common(),
) -> None:
    """Watch axes or devices until Ctrl-C; without targets all axes.

    Examples:

        motorbus monitor
        motorbus monitor shoulder elbow --rate 20 --csv run.csv
        motorbus monitor feetech:/dev/ttyACM0 --for 10s
    """
    if not (units.MIN_RATE <= rate <= units.MAX_RATE) or count < 0:
        raise RequestError("--rate must be above 0 and --count not below 0")
    seconds = parse_time(for_) or inf
    if listen:
        _listen(targets[0] if targets else "", seconds, common)
        return
    answered: set[str] = set()
    machine = load_machine(common)
    axes = machine.axes if machine is not None else {}
    with ExitStack() as stack:
        devices = stack.enter_context(open_devices(common, targets))
        writer = (
            csv.writer(stack.enter_context(open(file, "w", encoding="utf-8", newline=""))) if file else None
        )
        if writer is not None:
            writer.writerow(["time", *Sample.__struct_fields__])
        bus = devices[0].bus
        drivers: dict[int, AxisDriver] = {}
        start, number = bus.now(), 0
        with suppress(KeyboardInterrupt):
            while True:
                samples = [_sample(one, axes, drivers) for one in devices]
                answered |= {one.device for one in samples if not one.error}
                at = bus.now() - start
                if common.json:
                    emit(Samples(at, samples), common)
                else:
                    redraw(table_lines(_rows(samples, axes)))
                if writer is not None:
                    values = [
                        (*astuple(one)[:-3], " ".join(one.alarm), one.note, one.error) for one in samples
                    ]
                    writer.writerows((f"{at:.4f}", *row) for row in values)
                number += 1
                if number == count or number / rate > seconds:
                    break
                bus.run(_sleep(start + number / rate - bus.now()))
    silent = ", ".join(one.name for one in devices if one.name not in answered)
    if silent:
        raise (Partial if answered else NoReply)(f"no answer from {silent}")


async def _sleep(seconds: float) -> None:
    await Sleep(max(0.0, seconds))


def _sample(target: Target, axes: Any, drivers: dict[int, AxisDriver]) -> Sample:
    """The state of a device, or its error."""
    key = id(target.device)
    try:
        if key not in drivers:
            drivers[key] = target.bus.driver.axis(target.device.identify())
        if "state" not in drivers[key]:
            return Sample(target.name, note="reports no state")
        state = target.bus.run(drivers[key].state(target.device))
    except LinkLost as error:
        if not target.bus.reconnects:
            raise
        return Sample(target.name, error=error.summary)
    except MotorbusError as error:
        return Sample(target.name, error=error.summary)
    config, position = axes.get(target.name), state.position
    is_known = config is not None and position is not None
    return Sample(
        target.name,
        position,
        config.from_device(position) if is_known else None,
        state.velocity,
        state.load,
        state.current,
        state.voltage,
        state.temperature,
        (*state.alarm, *state.refused),
    )


def _rows(samples: Sequence[Sample], axes: Any) -> list[list[str]]:
    """A head and a row for each device; a column without a value is left out."""
    used = [one for one in COLUMNS if any(getattr(row, one[0]) is not None for row in samples)]
    rows = [["device", "position", *(head for _, head, _, _ in used), "alarm"]]
    for one in samples:
        place = "" if one.position is None else f"{one.position / units.DEGREE:.1f} deg"
        if one.axis_position is not None:
            place = axes[one.device].show(one.axis_position)
        cells = [
            "" if (value := getattr(one, name)) is None else f"{value * scale:.{places}f}"
            for name, _, scale, places in used
        ]
        rows.append([one.device, place, *cells, ", ".join(one.alarm) or escape(one.error or one.note)])
    return rows


class Frame(Struct, frozen=True, tag="frame"):
    """A received frame; time in s on the link clock."""

    time: float
    frame: str
    meaning: str


def _listen(word: str, seconds: float, common: Common) -> None:
    """Show what is received on a bus, and send nothing."""
    address = bus_address(word, common)
    if ":can://" in address and "listen_only=" not in address:
        address += ",listen_only=yes"
    with open_bus(common, address) as bus:
        records = bus.trace.subscribe(10_000)
        end = bus.now() + seconds
        with suppress(KeyboardInterrupt):
            while bus.now() < end:
                bus.run(_sleep(min(0.05, end - bus.now())))
                for record in records:
                    data = record.data if isinstance(record.data, bytes) else record.data.flat()
                    for one in bus.driver.decode(data):
                        frame = Frame(record.at, one.data.hex(" ").upper(), one.fault or one.title)
                        if common.json:
                            emit(frame, common)
                        else:
                            print(f"{frame.time:10.3f}  {frame.frame}  {frame.meaning}", flush=True)
