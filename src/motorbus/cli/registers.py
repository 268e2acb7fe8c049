"""`motorbus read`, `write`, `monitor`."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from math import inf
from typing import Annotated, Any, Final

from cyclopts import Parameter
from msgspec import Struct

from motorbus.cli.common import Common, Partial, Target, Writing
from motorbus.cli.dryrun import carry_out
from motorbus.cli.output import emit, escape, redraw, table_lines
from motorbus.cli.target import bus_address, load_machine, open_bus, open_devices, parse_quantity
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
        emit([value for one in devices for value in read_values(one, registers, all=all, raw=raw)], common)


def read_values(target: Target, names: Sequence[str], *, all: bool = False, raw: bool = False) -> list[Value]:
    """The values of these registers of a device; () means its present values."""
    table = map_of(target)
    if not names:
        rows = [row for row in table.values() if row.readable]
        present = [row for row in rows if row.name.startswith("present_")]
        names = [row.name for row in (rows if all or not present else present)]
    device = target.device
    found = device.read_raw(*names) if raw else device.read(*names)
    return [_value(target, table, name, value, raw=raw) for name, value in found.items()]


def _value(target: Target, table: RegisterMap, name: str, value: Any, *, raw: bool) -> Value:
    row = table[name]
    meaning = "" if row.unit else row.choices.get(int(value), "")
    return Value(target.name, name, value, "raw" if raw else row.unit, meaning)


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
        orders = [(one, _parse_values(one, pairs)) for one in devices]
        rows = [map_of(devices[0])[name] for name, _ in pairs]
        question = _question(devices, rows)
        together = devices[0].family.sync_write
        if together is not None and _may_sync(devices, rows):
            by_node = {one.node: wanted for one, wanted in orders}
            carry_out(writing, devices[0].bus, lambda bus: bus.run(together(by_node)), question)
        else:
            for number, (one, wanted) in enumerate(orders):
                how = writing if number == 0 else Writing(yes=True, dry_run=writing.dry_run)
                carry_out(how, one, partial(_write_one, wanted), question)
        if not writing.dry_run:
            emit([value for one, wanted in orders for value in _read_back(one, wanted)], common)


def _write_one(values: dict[str, float | int], device: Any) -> None:
    device.write(**values)


def _may_sync(devices: Sequence[Target], rows: Sequence[Register]) -> bool:
    """One request may write these rows of all devices."""
    is_one_bus = len({id(one.bus) for one in devices}) == 1
    return len(devices) > 1 and is_one_bus and all(row.storage is Storage.RAM for row in rows)


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


def _parse_values(target: Target, pairs: Sequence[tuple[str, str]]) -> dict[str, float | int]:
    table = map_of(target)
    return {name: parse_value(target, table[name], text) for name, text in pairs}


def parse_value(target: Target, row: Register, text: str) -> float | int:
    """`65°C`, `2048raw`, `1` of a row without unit -> the value in the unit of the row."""
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


def _read_back(target: Target, wanted: dict[str, float | int]) -> list[Value]:
    table = map_of(target)
    names = [name for name in wanted if table[name].readable]
    return read_values(target, names) if names else []


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
    seconds = parse_quantity(for_, "time", "s") if for_ else inf
    if not seconds > 0:
        raise RequestError(f"--for {for_}: not above 0")
    if listen:
        _listen(targets[0] if targets else "", seconds, common)
        return
    answered: set[str] = set()
    with ExitStack() as stack:
        devices = stack.enter_context(open_devices(common, targets))
        machine = load_machine(common)
        axes = machine.axes if machine is not None else {}
        table = stack.enter_context(open(file, "w", encoding="utf-8", newline="")) if file else None
        bus = devices[0].bus
        start, number = bus.now(), 0
        drivers: dict[str, AxisDriver] = {}
        try:
            while True:
                samples = [_sample(one, axes, drivers) for one in devices]
                answered |= {one.device for one in samples if not one.error}
                at = bus.now() - start
                _show_samples(Samples(at, samples), axes, common)
                if table is not None:
                    _write_rows(table, at, samples, head=number == 0)
                number += 1
                if number == count or number / rate > seconds:
                    break
                bus.run(_sleep(start + number / rate - bus.now()))
        except KeyboardInterrupt:
            pass
    silent = ", ".join(one.name for one in devices if one.name not in answered)
    if silent:
        raise (Partial if answered else NoReply)(f"no answer from {silent}")


async def _sleep(seconds: float) -> None:
    await Sleep(max(0.0, seconds))


def _sample(target: Target, axes: Any, drivers: dict[str, AxisDriver]) -> Sample:
    """The state of a device, or its error."""
    key = f"{id(target.bus)} {target.node}"
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
    of_axis = None if config is None or position is None else config.from_device(position)
    return Sample(
        target.name,
        position,
        of_axis,
        state.velocity,
        state.load,
        state.current,
        state.voltage,
        state.temperature,
        (*state.alarm, *state.refused),
    )


def _show_samples(result: Samples, axes: Any, common: Common) -> None:
    if common.json:
        emit(result, common)
        return
    used = [one for one in COLUMNS if any(getattr(row, one[0]) is not None for row in result.samples)]
    rows = [["device", "position", *(head for _, head, _, _ in used), "alarm"]]
    for one in result.samples:
        values = [getattr(one, name) for name, _, _, _ in used]
        cells = [
            "" if value is None else f"{value * scale:.{places}f}"
            for value, (_, _, scale, places) in zip(values, used, strict=True)
        ]
        alarm = ", ".join(one.alarm) or escape(one.error or one.note)
        rows.append([one.device, _place(one, axes), *cells, alarm])
    redraw(table_lines(rows))


def _place(one: Sample, axes: Any) -> str:
    if one.axis_position is not None:
        return str(axes[one.device].show(one.axis_position))
    return "" if one.position is None else f"{one.position / units.DEGREE:.1f} deg"


def _write_rows(file: Any, at: float, samples: Sequence[Sample], *, head: bool) -> None:
    writer = csv.writer(file)
    if head:
        writer.writerow(["time", *Sample.__struct_fields__])
    for one in samples:
        values = [getattr(one, name) for name in Sample.__struct_fields__]
        writer.writerow(
            [f"{at:.4f}", *(" ".join(value) if isinstance(value, tuple) else value for value in values)]
        )


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
        try:
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
        except KeyboardInterrupt:
            pass
