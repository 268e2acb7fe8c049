"""`motorbus scan`, `info`, `init`."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, floor
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from cyclopts import Parameter
from msgspec import Meta, Struct

from motorbus.cli.common import Common, Target
from motorbus.cli.output import emit, note, progress
from motorbus.cli.registers import Value, raise_errors, read_values
from motorbus.cli.target import address_of, load_machine, open_bus, open_devices
from motorbus.core import units
from motorbus.core.family import AxisDriver, Found
from motorbus.core.steps import Progress
from motorbus.errors import DeviceError, LinkError, MotorbusError, NoReply, RequestError

if TYPE_CHECKING:
    from motorbus.motion.machine import AxisConfig

VELOCITY: Final = "90 deg/s"  # of an axis in a new machine file
ACCELERATION: Final = "180 deg/s2"
FIXES: Final = {  # commands that do what a device method does
    "enable_torque()": "torque on {}",
    "set_mode('position')": "feetech mode {} position",
    "recover_overload()": "feetech recover-overload {}",
    "set_velocity()": "write {} goal_velocity=1rad/s",
    "set_duty()": "write {} goal_time=10%",
    "set_current()": "write {} goal_torque=0.1A",
    "write(protection_current=…)": "write {} protection_current=0.5A",
    "cap_torque(1.0)": "write {} torque_limit=100%",
    "write(max_torque=1.0)": "write {} max_torque=100%",
}


class Port(Struct, frozen=True):
    """A serial port of this computer."""

    port: str
    description: str
    family: str
    stable: str


class Device(Struct, frozen=True):
    """A device that answered a scan."""

    id: int
    rate: Annotated[int, Meta(extra={"unit": "bit/s"})]
    model: str = ""
    firmware: str = ""


class ScanResult(Struct, frozen=True, tag="scan"):
    """The devices of a bus."""

    bus: str
    devices: list[Device]


def scan(
    bus: str = "",
    /,
    *,
    ids: Annotated[str, Parameter(help="Ask only these ids, as 1-6+9.")] = "",
    rates: Annotated[str, Parameter(help="Rates, as 1M+500k, or all.")] = "",
    all_ports: Annotated[bool, Parameter(help="Scan the bus of every serial port.")] = False,
    common: Common = Common(),
) -> None:
    """Find the devices on a bus; without a bus list the ports.

    Examples:

        motorbus scan
        motorbus scan feetech:/dev/ttyACM0
        motorbus scan feetech:/dev/ttyACM0 --rates all
    """
    if bus or common.bus:
        emit(_scan(bus or common.bus, ids, rates, common), common)
        return
    from motorbus.link.serial import ports

    found = [Port(one.device, one.description, one.guess, one.stable or "") for one in ports()]
    if not all_ports:
        emit(found, common)
        if not found:
            note("no serial port found; `motorbus demo` needs none")
        return
    results = []
    for port in found:
        known = port.family in ("feetech", "stepper")
        for family in (port.family,) if known else ("feetech", "stepper"):
            try:
                results.append(_scan(f"{family}:{port.port}", ids, rates, common))
            except (LinkError, NoReply) as error:
                note(f"{family}:{port.port}: {error.summary}")
    for result in results:
        emit(result, common)


def _scan(bus: str, ids: str, rates: str, common: Common) -> ScanResult:
    """The devices of a bus. Raises NoReply if none answers."""
    from motorbus.session.address import parse_ids

    nodes = parse_ids(ids) if ids else ()
    with open_bus(common, bus) as opened, progress("scan") as advance:
        asked = tuple(units.rate(rate) for rate in rates.split("+") if rate not in ("", "all"))
        if rates == "all":
            asked = opened.family.link.rates

        def report(event: object) -> None:
            if isinstance(event, Progress):
                advance(event.done, event.total, event.what)
            elif opened.report is not None:
                opened.report(event)

        found: list[Found] = opened.run(opened.driver.scan(nodes, asked), report)
        rate = opened.rate
    if not found:
        tried = ", ".join(map(str, asked)) or rate
        raise NoReply(
            f"{bus}: no device answers at {'any rate' if rates == 'all' else f'{tried} bit/s'}",
            cause="no power, a loose cable, or devices at another rate",
            advice="check the supply" if rates == "all" else f"`motorbus scan {bus} --rates all` tries all",
        )
    return ScanResult(bus, [_device(one) for one in found])


def _device(found: Found) -> Device:
    identity = found.identity
    if identity is None:
        return Device(found.node, found.rate, "not identified")
    return Device(found.node, found.rate, identity.model, identity.firmware)


# -- info ----------------------------------------------------------------------------------------------------------


class Info(Struct, frozen=True, tag="info"):
    """A device: angles in rad of the device. `blocked` says why it does not move; `exit`, `estop` are of its axis."""

    device: str
    id: int
    model: str
    firmware: str
    register_map: str
    rate: Annotated[int, Meta(extra={"unit": "bit/s"})]
    mode: str = ""
    low: Annotated[float | None, Meta(extra={"unit": "rad"})] = None
    high: Annotated[float | None, Meta(extra={"unit": "rad"})] = None
    blocked: tuple[str, ...] = ()
    axis_limits: str = ""
    exit: str = ""
    estop: str = ""
    details: dict[str, str] = {}
    registers: list[Value] = []


def info(
    target: str,
    /,
    *,
    registers: Annotated[bool, Parameter(help="Read every register.")] = False,
    common: Common = Common(),
) -> None:
    """Show what a device is, its limits and mode, and what blocks its motion; writes nothing.

    Examples:

        motorbus info feetech:/dev/ttyACM0#3
        motorbus info shoulder
        motorbus info feetech:/dev/ttyACM0#3 --registers --json
    """
    failures: dict[str, MotorbusError] = {}
    shown: list[Info] = []
    machine = load_machine(common)
    with open_devices(common, (target,)) as devices:
        for one in devices:
            try:
                config = machine.axes.get(one.name) if machine is not None else None
                shown.append(_info(one, config, registers=registers))
            except (NoReply, DeviceError) as error:
                failures[one.name] = error
    if common.json:
        emit(shown[0] if len(devices) == 1 and shown else shown, common)
    else:
        for number, result in enumerate(shown):
            print("\n" * (number > 0), end="")
            emit(result, common)
    raise_errors(failures, is_partial=bool(shown))


def _info(target: Target, config: AxisConfig | None, *, registers: bool) -> Info:
    device, bus = target.device, target.bus
    identity = device.identify()
    low, high = _limits(target, bus.driver.axis(identity)) or (None, None)
    has_mode = identity.table and hasattr(device, "mode")
    mode = device.mode() if has_mode else ""
    blocked = device.why_not_moving() if has_mode and hasattr(device, "why_not_moving") else ()
    return Info(
        target.name,
        target.node,
        identity.model,
        identity.firmware,
        identity.table or "unknown: the device is never written",
        bus.rate,
        str(getattr(mode, "value", mode)),
        low,
        high,
        tuple(in_shell(text, target) for text in blocked),
        _axis_limits(config),
        "" if config is None else config.exit_action,
        (config.estop if config is not None else "") or next(iter(target.family.link.stops), "stop"),
        {name: str(value) for name, value in identity.details.items() if name not in Info.__struct_fields__},
        read_values(target, (), all=True) if registers else [],
    )


def in_shell(text: str, target: Target) -> str:
    """A fix that names a device method, with the command in its place."""
    for method, command in FIXES.items():
        text = text.replace(method, f"`motorbus {command.format(address_of(target))}`")
    return text


def _limits(target: Target, driver: AxisDriver) -> tuple[float, float] | None:
    if "limits" not in driver:
        return None
    try:
        return target.bus.run(driver.limits(target.device))
    except (DeviceError, RequestError):  # none in this mode
        return None


def _axis_limits(config: AxisConfig | None) -> str:
    if config is None or config.low is None or config.high is None:
        return ""
    return f"{config.show(config.low)} to {config.show(config.high)}"


# -- init ----------------------------------------------------------------------------------------------------------


class InitResult(Struct, frozen=True, tag="init"):
    """The file that was written and its axes: device, model, limits."""

    file: str
    axes: dict[str, InitAxis]


class InitAxis(Struct, frozen=True):
    """An axis of a new machine file."""

    device: str
    model: str
    limits: str


def init(
    *buses: Annotated[str, Parameter(name="NAME=BUS")],
    to: Annotated[str, Parameter(help="The file to write.")] = "",
    names: Annotated[str, Parameter(help="Names of the axes in order of ids, as pan,lift.")] = "",
    force: Annotated[bool, Parameter(help="Replace the file.")] = False,
    common: Common = Common(),
) -> None:
    """Write a machine file from the devices that answer.

    Examples:

        motorbus init arm=feetech:/dev/ttyACM0
        motorbus init arm=feetech:/dev/ttyACM0 --names pan,lift,elbow,wrist,roll,gripper
        motorbus init left=feetech:/dev/ttyACM0 right=feetech:/dev/ttyACM1 --to arms.toml
    """
    from motorbus.motion import machine_edit
    from motorbus.motion.machine import MachineConfig

    path = Path(to or common.machine)
    given = buses or ((common.bus,) if common.bus else ())
    if not given:
        raise RequestError("no bus", expected="NAME=FAMILY:PORT", advice="`motorbus scan` lists the ports")
    if path.exists() and not force:
        raise RequestError(f"{path} exists", advice="--to another file, or --force replaces it")
    wanted = [name for name in names.split(",") if name]
    tables: dict[str, Any] = {"format": 1, "bus": {}, "axis": {}}
    models: dict[str, str] = {}
    for text in given:
        name, address = _split(text)
        if name in tables["bus"]:
            raise RequestError(f"two buses have the name {name}", expected="NAME=BUS, each name once")
        tables["bus"][name] = {"address": address.partition("#")[0]}
        for device, model, axis in _axes(name, address, common):
            title = wanted.pop(0) if wanted else f"{name}_{device.node}"
            tables["axis"][title] = axis
            models[title] = model
    if wanted:
        raise RequestError(f"--names: no device for {', '.join(wanted)}", expected=f"{len(models)} names")
    machine = MachineConfig.of(tables)
    with path.open("w" if force else "x", encoding="utf-8") as file:
        file.write(machine_edit.write(machine))
    axes = {
        name: InitAxis(axis.device, models[name], _axis_limits(axis)) for name, axis in machine.axes.items()
    }
    emit(InitResult(str(path), axes), common)
    note(f"check low and high in {path}; then `motorbus info {next(iter(axes))}`")


def _split(text: str) -> tuple[str, str]:
    """NAME=BUS or BUS; the name of a bus without one is that of its family."""
    head, colon, _ = text.partition(":")
    name, equals, _ = head.partition("=")
    if not colon:
        raise RequestError(f"{text!r} is not a bus", expected="NAME=FAMILY:PORT, as arm=feetech:/dev/ttyACM0")
    return (name, text[len(name) + 1 :]) if equals else (head, text)


def _axes(name: str, address: str, common: Common) -> Iterator[tuple[Target, str, dict[str, str]]]:
    """Each device of a bus that can be an axis, its model, and the keys of its axis."""
    is_empty = True
    with open_devices(common, (address,)) as devices:
        for one in devices:
            identity = one.device.identify()
            driver = one.bus.driver.axis(identity)
            if not identity.table or not driver.names:
                note(f"note: #{one.node} is left out: the functions of {identity.model} are not known")
                continue
            is_empty = False
            number = f"{one.node:#x}" if one.family.link.kind == "frames" else str(one.node)
            axis = {"device": f"{name}#{number}", "unit": "deg", "max_velocity": VELOCITY}
            axis["max_acceleration"] = ACCELERATION
            yield one, identity.model, axis | _range(_limits(one, driver))
    if is_empty:
        raise DeviceError(f"{address}: no device can be an axis")


def _range(limits: tuple[float, float] | None) -> dict[str, str]:
    """Zero in the middle of the range of the device; limits in 0.1 deg, rounded inwards."""
    if limits is None or limits[0] >= limits[1]:
        return {}
    low, high = (end / units.DEGREE for end in limits)
    zero = round((low + high) / 2, 1)
    first, last = ceil(round((low - zero) * 10, 6)) / 10, floor(round((high - zero) * 10, 6)) / 10
    return {"zero": f"{zero} deg", "low": f"{first} deg", "high": f"{last} deg"}
