"""Opening a machine: options of its buses, its devices, what an unfinished change of one means. Only reads are sent."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from math import isfinite, tau
from typing import Any, Final

from msgspec import structs

from motorbus import families
from motorbus.bus.base import BaseBus
from motorbus.core.family import Identity
from motorbus.core.steps import READABLE, catch, gather
from motorbus.errors import MotorbusError, NoReply, RequestError
from motorbus.link.memory import MemoryLink, share_clock
from motorbus.motion.axis import Axis, AxisStatus
from motorbus.motion.gate import SafetyGate
from motorbus.motion.machine import AxisConfig, BusConfig, MachineConfig, Names, Velocity
from motorbus.motion.program import OnBuses, raise_first
from motorbus.motion.state import OpenMachine
from motorbus.session.address import parse_address
from motorbus.session.journals import unfinished

USUAL_VELOCITY: Final = tau / 4  # rad/s of an axis that an address gives
UNTRUSTED: Final = "unfinished change: "


def machine_at(address: str, max_velocity: float = USUAL_VELOCITY) -> MachineConfig:
    """A machine of the devices of an address, `FAMILY:PORT#1-6`: axes `#1` …, with the limits of the devices."""
    spot = parse_address(address)
    if not spot.nodes:
        raise RequestError(
            f"{address!r} names no device", expected="ids after #, as feetech:/dev/ttyACM0#1-6"
        )
    if not (isfinite(max_velocity) and max_velocity > 0):
        raise RequestError(f"velocity {max_velocity}", expected="a finite number above 0")
    velocity = Velocity(max_velocity, "velocity")
    axes = {f"#{node}": AxisConfig(device=f"bus#{node}", max_velocity=velocity) for node in spot.nodes}
    return MachineConfig(buses={"bus": BusConfig(spot.bus)}, axes=axes)


def select(config: MachineConfig, names: Names) -> MachineConfig:
    """The machine with these axes only, and what needs no other one; with () no axis and all buses.

    Raises RequestError for an unknown name.
    """
    wanted = config.axes_of(names)
    used = {config.axes[name].bus for name in wanted}
    if not wanted and names is None:
        raise RequestError(
            "the machine has no axis", advice="add [axis.NAME]; `motorbus init BUS` writes a file"
        )
    return structs.replace(
        config,
        axes={name: config.axes[name] for name in wanted},
        buses={name: bus for name, bus in config.buses.items() if name in used or not wanted},
        groups={name: axes for name, axes in config.groups.items() if set(axes) <= set(wanted)},
        poses={name: pose for name, pose in config.poses.items() if set(pose) <= set(wanted)},
    )


def bus_options(machine: MachineConfig, name: str) -> dict[str, Any]:
    """Options of a bus by the `estop` of its axes. Raises RequestError for a stop that the family lacks."""
    address = parse_address(machine.buses[name].address)
    stops = families.load(address.family).link.stops
    held = []
    for axis, config in machine.axes.items():
        if config.bus != name or config.estop is None:
            continue
        if config.estop not in stops:
            raise RequestError(
                f"axis.{axis}.estop: {address.family} has no {config.estop}", expected=" or ".join(stops)
            )
        if config.estop == "hold" and "hold" in stops[1:]:
            held.append(str(config.node))
    if not held:
        return {}
    return {"estop_hold": "+".join([*filter(None, [address.options.get("estop_hold")]), *held])}


async def identify(machine: OpenMachine, kind: str) -> None:
    """Program: ask each device what it is. Only reads are sent."""
    links = [bus.link for bus in machine.buses.values()]
    simulated = [link for link in links if isinstance(link, MemoryLink) and link.virtual]
    if len(simulated) == len(links):
        share_clock(simulated)
    groups: dict[BaseBus, list[tuple[str, AxisConfig]]] = {}
    for name, config in machine.config.axes.items():
        groups.setdefault(machine.buses[config.bus], []).append((name, config))

    async def ask(bus: BaseBus, members: Sequence[tuple[str, AxisConfig]]) -> tuple[Any, ...]:
        return await gather(*[catch(_identify_axis(bus, name, config, kind)) for name, config in members])

    values = await OnBuses({bus: ask(bus, members) for bus, members in groups.items()})
    raise_first(values)
    found = {
        name: value
        for bus, group in groups.items()
        for (name, _), value in zip(group, values[bus], strict=True)
    }
    for name, value in found.items():
        if isinstance(value, NoReply):
            config = machine.config.axes[name]
            value.summary = (
                f"{name}: {config.device} does not answer on {machine.config.buses[config.bus].address}"
            )
    raise_first(found)
    machine.axes = {name: found[name] for name in machine.config.axes}
    machine.config = structs.replace(
        machine.config, axes={name: axis.config for name, axis in machine.axes.items()}
    )
    for bus in machine.buses.values():
        machine.gates[bus] = SafetyGate(
            bus, [axis.status for axis in machine.axes.values() if axis.bus is bus]
        )
    for name, bus in machine.buses.items():
        machine.warnings += [f"{name}: {text}" for text in bus.warnings]
        _distrust(machine, bus)


def _distrust(machine: OpenMachine, bus: BaseBus) -> None:
    """A device whose guarded change is unfinished by the journal is at fault."""
    change = None
    with suppress(MotorbusError):  # a later version wrote the journal; the bus warns of that
        change = unfinished(bus)
    if change is None or change.facts.get(READABLE):
        return
    for axis in machine.axes.values():
        if axis.bus is bus and axis.config.node in (change.node, change.facts.get("new")):
            axis.status.set_fault(f"{UNTRUSTED}`motorbus recover {change.bus}` ends it")


async def _identify_axis(bus: BaseBus, name: str, config: AxisConfig, kind: str) -> Axis:
    """Procedure: the axis of a device, by what the device says of itself."""
    identity: Identity = await bus.driver.identify(config.node)
    driver = bus.driver.axis(identity)
    device = getattr(bus.family.devices, kind)(bus, config.node)
    if not driver.names:
        raise RequestError(f"{name}: {config.device} is {identity.model}, whose functions are not known")
    if name.startswith("#") and "stream" not in driver and "set_velocity" in driver:
        config = structs.replace(config, kind="wheel")
    axis = Axis(
        name,
        config,
        bus,
        device,
        driver,
        AxisStatus(name, config, measured="position" in driver),
        identity.model,
    )
    if config.is_wheel and not axis.follows_setpoints:
        axis.require("jog")
    elif not config.is_wheel and "position" in driver and "stream" not in driver:
        raise RequestError(
            f"{name}: {config.device} is not in position mode", advice='kind = "wheel", or change its mode'
        )
    if config.max_torque is not None:
        axis.require("cap_torque")
    if config.exit_action == "torque_off":
        axis.require("disable_torque")
    if "limits" in driver and not config.is_wheel:
        found = await catch(driver.limits(device))
        if isinstance(found, NoReply):
            raise found
        axis.limits = None if isinstance(found, MotorbusError) else found
    return axis
