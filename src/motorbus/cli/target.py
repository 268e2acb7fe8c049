"""Options that commands share, and the way from words to open buses, devices and robots."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from motorbus.cli.common import FILE, Common, Target
from motorbus.cli.output import note
from motorbus.errors import NoReply, RequestError

if TYPE_CHECKING:
    from motorbus.bus.blocking import Bus
    from motorbus.motion.machine import MachineConfig
    from motorbus.motion.robot import Robot

LOG: Final = logging.getLogger("motorbus.cli")


# -- machine file --------------------------------------------------------------------------------------------------


def load_machine(common: Common) -> MachineConfig | None:
    """The machine file; None if there is none and none was asked for. Raises RequestError."""
    if common.machine == FILE and not os.path.exists(FILE):
        return None
    from motorbus.motion.machine import MachineConfig

    return MachineConfig.load(common.machine)


def need_machine(common: Common) -> MachineConfig:
    """The machine file. Raises RequestError without one."""
    machine = load_machine(common)
    if machine is None:
        raise RequestError(f"no machine file {common.machine}", advice="`motorbus init NAME=BUS` writes one")
    return machine


def edit_machine(path: Path, change: Mapping[str, object]) -> None:
    """Change values of a machine file; its comments stay. A crash leaves the old file or the new one."""
    from motorbus.motion.machine_edit import edit

    new = path.with_name(f".{path.name}.new")
    new.write_text(edit(path.read_text("utf-8"), change), "utf-8", newline="")
    new.replace(path)


def is_address(word: str) -> bool:
    """`FAMILY:PORT`, not a name of the machine file."""
    return ":" in word


def _unknown(word: str, common: Common) -> RequestError:
    what = f"{word!r} is no address" if word else "no bus and no device are named"
    return RequestError(
        f"{what}, and there is no machine file {common.machine}",
        expected="FAMILY:PORT#ID, as feetech:/dev/ttyACM0#3",
        advice="`motorbus scan` lists the ports; `motorbus init NAME=BUS` writes a machine file",
    )


def key_values(common: Common) -> dict[str, str]:
    """The options of -o. Raises RequestError."""
    found = {}
    for text in common.option:
        name, equals, value = text.partition("=")
        if not (name and equals and value):
            raise RequestError(f"-o {text}: not an option", expected="-o KEY=VALUE, as -o baud=500000")
        found[name.replace("-", "_")] = value
    return found


def _with_options(address: str, common: Common) -> str:
    bus, hash_, ids = address.partition("#")
    return bus + "".join(f",{name}={value}" for name, value in key_values(common).items()) + hash_ + ids


def bus_address(word: str, common: Common) -> str:
    """The address of a bus by its name or address; "" is --bus, else the only bus of the machine file."""
    word = word or common.bus
    if is_address(word):
        return _with_options(word, common)
    machine = load_machine(common)
    if machine is None:
        raise _unknown(word, common)
    names = [word] if word else list(machine.buses)
    if len(names) != 1 or names[0] not in machine.buses:
        what = f"no bus {word!r}" if word else "several buses"
        raise RequestError(what, expected=f"one of {', '.join(machine.buses)}")
    return _with_options(machine.buses[names[0]].address, common)


# -- opening -------------------------------------------------------------------------------------------------------


@contextmanager
def open_bus(common: Common, word: str = "") -> Iterator[Bus]:
    """Open a bus by its name or address; "" is --bus, else the only bus of the machine file."""
    from motorbus import session

    _log(common)
    with session.open(bus_address(word, common), report=_report) as bus, _frames(bus):
        _notes(bus.simulated, [f"{bus.link.name}: {text}" for text in bus.warnings], common)
        yield bus


def _report(event: object) -> None:
    """An event of a procedure that has a text for the user."""
    if text := getattr(event, "text", "") or getattr(event, "why", ""):
        note(f"note: {text}")


def _notes(simulated: bool, warnings: Sequence[str], common: Common) -> None:
    if simulated and not common.json:
        note("simulated", once=True)
    for text in warnings:
        note(f"note: {text}")


@contextmanager
def open_devices(common: Common, words: Sequence[str] = ()) -> Iterator[list[Target]]:
    """Open the devices of these words: axes, groups, buses, addresses; () means the machine file, else --bus.

    A bus address without ids means all devices that answer. Raises NoReply if none answers.
    """
    from motorbus.session.address import parse_address

    wanted: dict[str, dict[int, str]] = {}
    for address, name in _addresses(common, words):
        spot = parse_address(address)
        nodes = wanted.setdefault(spot.bus, {})
        nodes |= {node: name or f"#{node}" for node in spot.nodes}
        if not spot.nodes:
            nodes[-1] = ""
    with ExitStack() as stack:
        found = []
        for address, nodes in wanted.items():
            bus = stack.enter_context(open_bus(common, address))
            if -1 in nodes:
                nodes = {node: f"#{node}" for node in _scan(bus)}
            devices = bus.family.devices.blocking
            found += [Target(name, bus, node, bus.family, devices(bus, node)) for node, name in nodes.items()]
        yield found


def _addresses(common: Common, words: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Address and name of each device, or the address of a bus."""
    words = words or ((common.bus,) if common.bus else ())
    machine = None if words and all(map(is_address, words)) else load_machine(common)
    if machine is None and not words:
        raise _unknown("", common)
    for word in words or (machine.buses if machine is not None else ()):
        if is_address(word):
            yield _with_options(word, common), ""
        elif machine is None:
            raise _unknown(word, common)
        else:
            for axis in machine.axes_of(word):
                config = machine.axes[axis]
                address = machine.buses[config.bus].address
                yield f"{_with_options(address, common)}#{config.node}", axis


def bus_of(target: Target) -> str:
    """The address of the bus of a device, without options."""
    name, family = target.bus.link.name, target.family.name
    return name if name.startswith(f"{family}:") else f"{family}:{name}"


def address_of(target: Target) -> str:
    """The axis, or the address of a device, as the user types it."""
    return f"{bus_of(target)}{target.name}" if target.name.startswith("#") else target.name


def _scan(bus: Bus) -> tuple[int, ...]:
    if bus.family.link.only is not None:
        return (bus.family.link.only,)
    found = tuple(one.node for one in bus.run(bus.driver.scan()))
    if not found:
        raise NoReply(
            f"{bus.link.name}: no device answers at {bus.rate} bit/s",
            cause="no power, a loose cable, or devices at another rate",
            advice="`motorbus scan BUS --rates all` tries every rate",
        )
    return found


@contextmanager
def open_robot(common: Common, words: Sequence[str] = (), velocity: str = "") -> Iterator[Robot]:
    """Open the axes of these words: names of the machine file, or addresses; () means all axes, else those of --bus.

    `velocity` is the highest of the axes of an address; "": that of `Robot.at`.

    After success each axis stays as the command left it; after an error it ends as its `exit` says.
    """
    from motorbus.motion.robot import Robot

    _log(common)
    words = tuple(words) or ((common.bus,) if common.bus and load_machine(common) is None else ())
    addresses = [word for word in words if is_address(word)]
    if len(addresses) == 1 == len(words):
        limit = {"max_velocity": abs(parse_quantity(velocity, "velocity"))} if velocity else {}
        robot = Robot.at(_with_ids(_with_options(addresses[0], common), common), **limit)
    elif addresses:
        raise RequestError("several addresses in one command", expected="one, as feetech:/dev/ttyACM0#1-3")
    else:
        machine = load_machine(common)
        if machine is None:
            raise _unknown(words[0] if words else "", common)
        robot = Robot(machine, words or None)
    with robot, ExitStack() as stack:
        for bus in robot.buses.values():
            stack.enter_context(_frames(bus))
        _notes(any(bus.simulated for bus in robot.buses.values()), robot.warnings, common)
        yield robot
        for axis in robot.axes.values():  # nothing is left to do at the end
            axis.status.engaged = axis.status.moving = axis.status.endless = False


def _with_ids(address: str, common: Common) -> str:
    if "#" in address:
        return address
    with open_bus(Common(json=True), address) as bus:
        return f"{address}#{'+'.join(map(str, _scan(bus)))}"


# -- quantities ----------------------------------------------------------------------------------------------------


def parse_quantity(text: str, kind: str, unit: str = "") -> float:
    """`30deg` -> number in the API unit of `kind` (a key of `units.SCALES`); a bare number is in `unit`.

    Raises RequestError for another unit, and for a bare number without `unit`.
    """
    from motorbus.core import units

    text = text.strip()
    if text[-1:].isdigit() or text[-1:] == ".":
        if not unit:
            usual = next(iter(units.SCALES[kind]))
            raise RequestError(f"{kind} {text!r} has no unit", expected=f"a unit, as {text}{usual}")
        text += unit
    return units.parse(text, kind)


def parse_time(text: str) -> float | None:
    """A time (s); None for "". Raises RequestError."""
    seconds = parse_quantity(text, "time", "s") if text else None
    if seconds is not None and seconds <= 0:
        raise RequestError(f"{text} is not a time", expected="a time above 0, as 2s")
    return seconds


# -- log -----------------------------------------------------------------------------------------------------------


def _log(common: Common) -> None:
    """-v logs on stderr, -vv every frame; a thread writes, so that a terminal that is held delays no stop."""
    logger = logging.getLogger("motorbus")
    if not common.verbose or logger.level:
        return
    import atexit
    from logging.handlers import QueueHandler, QueueListener
    from queue import SimpleQueue

    records: SimpleQueue[Any] = SimpleQueue()
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(relativeCreated)7.0f ms  %(name)s  %(message)s"))
    listener = QueueListener(records, handler)
    listener.start()
    atexit.register(listener.stop)
    logger.addHandler(QueueHandler(records))
    logger.setLevel(logging.INFO if common.verbose == 1 else logging.DEBUG)


@contextmanager
def _frames(bus: Any) -> Iterator[None]:
    """With -vv log what is sent and received on a bus."""
    if not LOG.isEnabledFor(logging.DEBUG):
        yield
        return
    from motorbus.bus.trace import Subscription, TraceRecord

    class Log(Subscription[TraceRecord]):
        def put(self, record: TraceRecord) -> None:
            shown = record.data.hex(" ").upper() if isinstance(record.data, bytes) else record.data
            LOG.debug("%s %s", record.direction, shown)

    log = Log(0)
    bus.trace.add(log)
    try:
        yield
    finally:
        bus.trace.unsubscribe(log)
