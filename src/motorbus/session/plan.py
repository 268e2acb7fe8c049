"""What opening a machine takes, found out and checked before any port is touched: which buses, which axes on them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from os import PathLike
from typing import NamedTuple, Self

from motorbus import families
from motorbus.bus.aio import AsyncBus
from motorbus.bus.blocking import Bus
from motorbus.core.family import AxisDriver, Family
from motorbus.core.register import shown
from motorbus.errors import LinkError, MotorbusError, RequestError
from motorbus.motion.axis import AsyncAxis, Axis
from motorbus.motion.body import named as named_in
from motorbus.motion.machine import AxisSpec, Machine
from motorbus.motion.machine.agreement import check
from motorbus.motion.machine.refusal import no_axes, of_file, path, refused
from motorbus.motion.safety import Gate
from motorbus.motion.several import named
from motorbus.session.address import parse_address
from motorbus.session.opening import AnyBus, open, open_async, simulated_link
from motorbus.session.options import lock_name, prepare


class Plan(NamedTuple):
    """A machine, the names of the axes that are wanted of it, and of the buses that these need."""

    machine: Machine
    axes: tuple[str, ...]
    buses: tuple[str, ...]

    @classmethod
    def of(cls, machine: Machine, axes: str | Iterable[str] | None = None) -> Self:
        """What these axes, groups and buses of a machine need; None: all of its axes.

        Raises RequestError for a name that it does not have, a machine that does not fit together, an address that
        cannot be, two buses on one port, an id that no device has, and an emergency stop or an end that it cannot have.
        """
        if not isinstance(machine, Machine):
            raise RequestError(
                f"{shown(machine)} is not a machine",
                expected="a motorbus.Machine",
                advice="`load` opens the machine of a file; nothing was opened",
            )
        with of_file(machine.file):
            check(machine)
            names = tuple(machine.axes) if axes is None else _chosen(machine, axes)
            if not names:
                raise no_axes(() if axes is None else named_in(axes))
        buses = tuple(dict.fromkeys(machine.axes[name].bus for name in names))
        with of_file(machine.file):
            _check_ports(machine, buses)
            _check_devices(machine, buses)
        return cls(machine, names, buses)

    def open(self, name: str, report: Callable[[object], None] | None) -> Bus:
        """Open one of the buses. Raises as `motorbus.open`, naming the file and the bus in it."""
        with _of_bus(self.machine, name):
            address, options = self.machine.buses[name].address, estop_options(self.machine, name)
            return open(address, report=report, interlock=Gate(), **options)

    def open_async(self, name: str, report: Callable[[object], None] | None) -> AsyncBus:
        """The same for asyncio."""
        with _of_bus(self.machine, name):
            options = estop_options(self.machine, name)
            address = self.machine.buses[name].address
            return open_async(address, report=report, interlock=Gate(), **options)

    def blocking(self, buses: Mapping[str, Bus]) -> dict[str, Axis]:
        """The axes on these buses, of whose devices nothing is known yet."""
        return {
            name: Axis(bus, name, spec, bus.family.devices.blocking(bus, spec.node), AxisDriver())
            for name, spec, bus in self._placed(buses)
        }

    def awaiting(self, buses: Mapping[str, AsyncBus]) -> dict[str, AsyncAxis]:
        """The same for asyncio."""
        return {
            name: AsyncAxis(bus, name, spec, bus.family.devices.awaiting(bus, spec.node), AxisDriver())
            for name, spec, bus in self._placed(buses)
        }

    def _placed(self, buses: Mapping[str, AnyBus]) -> Iterator[tuple[str, AxisSpec, AnyBus]]:
        for name in self.axes:
            spec = self.machine.axes[name]
            yield name, spec, buses[spec.bus]


@contextmanager
def _of_bus(machine: Machine, bus: str) -> Iterator[None]:
    """Within it, what goes wrong with a bus of a machine begins with the path of its file, and the place in it."""
    with of_file(machine.file):
        try:
            yield
        except MotorbusError as error:
            raise named(f"bus.{bus}", error) from error


def loaded(file: str | PathLike[str]) -> Machine:
    """The machine of a file, with every address, port and id in it checked. Raises RequestError as `Machine.load`."""
    machine = Machine.load(file, check_address=_check_address)
    with of_file(machine.file):
        _check_ports(machine, [name for name, bus in machine.buses.items() if _can_be_judged(bus.address)])
        _check_devices(machine, machine.buses)
    return machine


def _check_address(address: str) -> None:
    """Raise RequestError for an address that cannot be, as far as that can be judged."""
    if _can_be_judged(address):
        _try(address)


@lru_cache(maxsize=64)  # of devices that could be made: a file is judged more than once on its way to a bus
def _try(address: str) -> None:
    """Make the simulated devices of an address, and throw them away. Raises RequestError where they cannot be."""
    opening = prepare(address, {})
    if opening.port == "sim":
        simulated_link(opening)


def _can_be_judged(address: str) -> bool:
    """False without python-can: opening that bus raises an error, other buses do not need it."""
    try:
        lock_name(address, {})
    except LinkError:
        return False
    return True


def estop_options(machine: Machine, bus: str) -> dict[str, object]:
    """The options of this bus of a machine by the `estop` of its axes.

    All axes of the file count, also those that are not opened, and the ids that the address names.
    """
    address = parse_address(machine.buses[bus].address)
    held = [str(axis.node) for axis in machine.axes.values() if (axis.bus, axis.estop) == (bus, "hold")]
    if not held or "hold" not in families.load(address.family).link.stops[1:]:
        return {}
    said = address.options.get("estop_hold")
    return {"estop_hold": "+".join([*([said] if said else []), *held])}


def _check_devices(machine: Machine, buses: Iterable[str]) -> None:
    """Raise RequestError for an axis on these buses whose device cannot be, or cannot stop or end as the file says."""
    for bus in buses:
        address = machine.buses[bus].address
        family = families.load(parse_address(address).family)
        for name, axis in machine.axes.items():
            if axis.bus == bus:
                device = _device(name, axis, address, family)
                if axis.estop is not None and axis.estop not in family.link.stops:
                    raise _no_such_stop(name, axis, family.name, family.link.stops)
                if axis.exit == "torque_off" and not hasattr(device, "disable_torque"):
                    raise _no_switch(name, axis, family.name)


def _device(name: str, axis: AxisSpec, address: str, family: Family) -> object:
    """The device of an axis, of which nothing is known yet; it needs no bus to check its id."""
    try:
        return family.devices.blocking(None, axis.node)
    except RequestError as error:
        advice = f"give the id of its device; `motorbus scan {address}` lists them"
        raise refused(path("axis", name, "device"), error.summary, error.expected, advice) from None


def _no_such_stop(name: str, axis: AxisSpec, family: str, stops: Iterable[str]) -> RequestError:
    return RequestError(
        f'axis.{name}.estop: an emergency stop of {axis.device} ({family}) cannot be "{axis.estop}"',
        expected=" or ".join(f'"{one}"' for one in stops) or "no such key: it has one kind of stop",
        cause="its protocol has no order for that",
        advice="take estop out of the file; nothing was opened",
        node=axis.node,
    )


def _no_switch(name: str, axis: AxisSpec, family: str) -> RequestError:
    return RequestError(
        f"axis.{name}.exit: {axis.device} ({family}) does not have a switch for its torque",
        expected='"hold", "park" or "leave"',
        cause="its protocol has no order for that",
        advice='write exit = "hold"; nothing was opened',
        node=axis.node,
    )


def _chosen(machine: Machine, names: str | Iterable[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(axis for name in named_in(names) for axis in machine.axes_of(name)))


def _check_ports(machine: Machine, buses: Iterable[str]) -> None:
    """Raise RequestError for an address that cannot be, and for a port that two buses share."""
    taken: dict[str, str] = {}
    for name in buses:
        try:
            port = lock_name(machine.buses[name].address, {})
            _try(machine.buses[name].address)
        except MotorbusError as error:
            raise named(f"bus.{name}", error) from error
        if port in taken and port not in ("", "sim"):
            raise RequestError(
                f"bus.{name}.address: {port} is the port of bus.{taken[port]} too",
                expected="a port for each bus",
                advice="give the axes of both to one bus, or change an address; nothing was opened",
            )
        taken[port] = name
