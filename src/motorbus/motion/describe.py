"""What a machine is, for faces: axes with device, limits and ways to stop, as plain data."""

from __future__ import annotations

from math import isfinite

from msgspec import Struct

from motorbus.motion.axis import Axis
from motorbus.motion.state import OpenMachine


class AxisDescription(Struct, frozen=True):
    """One axis. Positions in rad (m), velocities in rad/s (m/s); `low` and `high` None without a limit.

    `commands` are the functions of its device.
    """

    device: str
    model: str
    kind: str
    unit: str
    low: float | None
    high: float | None
    max_velocity: float
    max_acceleration: float
    exit: str
    estop: str
    commands: tuple[str, ...]


class BusDescription(Struct, frozen=True):
    """One bus: its address, family, rate (bit/s), and whether its devices are simulated."""

    address: str
    family: str
    rate: int
    simulated: bool


class MachineDescription(Struct, frozen=True):
    """A machine: its tables by name."""

    name: str
    buses: dict[str, BusDescription]
    axes: dict[str, AxisDescription]
    groups: dict[str, tuple[str, ...]]
    poses: dict[str, dict[str, float]]


def describe(machine: OpenMachine) -> MachineDescription:
    """Describe an open machine; sends nothing."""
    config = machine.config
    buses = {
        name: BusDescription(config.buses[name].address, bus.family.name, bus.rate, bus.simulated)
        for name, bus in machine.buses.items()
    }
    axes = {name: _describe_axis(axis) for name, axis in machine.axes.items()}
    poses = {
        name: {axis: float(place) for axis, place in pose.items()} for name, pose in config.poses.items()
    }
    return MachineDescription(config.name, buses, axes, dict(config.groups), poses)


def _describe_axis(axis: Axis) -> AxisDescription:
    config = axis.config
    low, high = axis.range
    stops = axis.bus.family.link.stops
    return AxisDescription(
        device=config.device,
        model=axis.model,
        kind=config.kind,
        unit=config.display_unit,
        low=low if isfinite(low) else None,
        high=high if isfinite(high) else None,
        max_velocity=float(config.max_velocity),
        max_acceleration=float(config.acceleration),
        exit=config.exit_action,
        estop=config.estop or (stops[0] if stops else "stop"),
        commands=tuple(sorted(axis.driver.names)),
    )
