"""An open machine: its axes, the last known state of each, and the faces that subscribe to it."""

from __future__ import annotations

from collections import deque
from math import isfinite
from threading import Condition
from typing import Any, Final

from msgspec import Struct

from motorbus.bus.base import BaseBus
from motorbus.core.family import State
from motorbus.errors import RequestError
from motorbus.motion.axis import Axis, on_axes, read_state
from motorbus.motion.gate import Lease, SafetyGate
from motorbus.motion.health import HealthMonitor
from motorbus.motion.machine import MachineConfig, Names, nearest
from motorbus.motion.program import raise_first


class AxisState(Struct, frozen=True):
    """One axis in rad (m), rad/s (m/s), fraction, A, V, °C; None for what its device does not report.

    `age` is that of the position (s). `estimated`: the device reports no position. `torque`: given from here.
    """

    position: float | None = None
    target: float | None = None
    velocity: float | None = None
    load: float | None = None
    current: float | None = None
    voltage: float | None = None
    temperature: float | None = None
    age: float | None = None
    torque: bool = False
    moving: bool = False
    estimated: bool = False
    suspect: bool = False
    alarm: tuple[str, ...] = ()
    fault: str = ""


class RobotState(Struct, frozen=True):
    """The last known state of all axes: its number, its time (s, link clock), the axes by name."""

    number: int
    at: float
    axes: dict[str, AxisState]


class Subscription:
    """States as they come, at most `rate` per s; the oldest of `depth` is dropped and counted. From any thread."""

    def __init__(self, rate: float | None, depth: int) -> None:
        self.dropped = 0
        self._period: Final = 1 / rate if rate else 0.0
        self._next = 0.0
        self._states: deque[RobotState] = deque(maxlen=depth)
        self._changed = Condition()

    def put(self, state: RobotState) -> None:
        """Add a state, unless it comes before its turn."""
        if state.at < self._next:
            return
        # A late state does not delay the next one.
        self._next = max(self._next + self._period, state.at + self._period / 2)
        with self._changed:
            self.dropped += len(self._states) == self._states.maxlen
            self._states.append(state)
            self._changed.notify_all()

    def get(self, timeout: float = 0.0) -> RobotState | None:
        """The oldest state; None if there is none within `timeout` s."""
        with self._changed:
            self._changed.wait_for(lambda: bool(self._states), timeout)
            return self._states.popleft() if self._states else None


class OpenMachine:
    """What programs and faces need of an open machine. `targets` are the last goals (rad, m), by name."""

    config: MachineConfig

    def __init__(self) -> None:
        self.buses: dict[str, Any] = {}
        self.axes: dict[str, Axis] = {}
        self.gates: dict[BaseBus, SafetyGate] = {}
        self.health = HealthMonitor()
        self.targets: dict[str, float] = {}
        self.warnings: list[str] = []
        self.loops = 0  # control loops that publish states at present
        self.subscriptions: list[Subscription] = []
        self._number = 0

    def now(self) -> float:
        """s on the link clock."""
        bus: BaseBus = next(iter(self.buses.values()))
        return bus.now()

    @property
    def lease(self) -> Lease | None:
        """The lease that motion needs, None if it needs none."""
        return next((gate.lease for gate in self.gates.values()), None)

    @lease.setter
    def lease(self, lease: Lease | None) -> None:
        for gate in self.gates.values():
            gate.lease = lease

    def chosen(self, names: Names = None) -> list[Axis]:
        """The axes of these names of axes, groups and buses; None means all. Raises RequestError."""
        if not self.buses:
            raise RequestError("the machine is not open", advice="use `with Robot.load(…)`")
        return [self.axes[name] for name in self.config.axes_of(names)]

    def axis(self, name: str) -> Axis:
        """The axis of this name. Raises RequestError."""
        if name not in self.axes:
            raise RequestError(f"no axis {name!r}", advice=nearest(name, self.axes))
        return self.axes[name]

    def publish(self) -> None:
        """Give the state of this moment to all subscribers."""
        if self.subscriptions:
            state = self.snapshot()
            for subscription in tuple(self.subscriptions):
                subscription.put(state)

    def snapshot(self) -> RobotState:
        """The last known state; sends nothing."""
        self._number += 1
        now = self.now()
        return RobotState(
            self._number, now, {name: self._state_of(axis, now) for name, axis in self.axes.items()}
        )

    def _state_of(self, axis: Axis, now: float) -> AxisState:
        status, config = axis.status, axis.config
        self.gates[axis.bus].update(status)
        sample = status.state or State(now)
        return AxisState(
            position=status.known_position,
            target=self.targets.get(axis.name),
            velocity=None if sample.velocity is None else sample.velocity / config.ratio,
            load=sample.load,
            current=sample.current,
            voltage=sample.voltage,
            temperature=sample.temperature,
            age=None if status.position is None else now - status.at,
            torque=status.engaged,
            moving=status.moving,
            estimated=status.position is None and status.estimate is not None,
            suspect=status.suspect is not None,
            alarm=sample.alarm,
            fault=status.fault,
        )

    def subscribe(self, *, rate: float | None = None, depth: int = 64) -> Subscription:
        """All states from now on, at most `rate` per s."""
        subscription = Subscription(rate, depth)
        self.subscriptions.append(subscription)
        return subscription

    def unsubscribe(self, subscription: Subscription) -> None:
        """End what `subscribe` began."""
        self.subscriptions.remove(subscription)


async def read_axes(machine: OpenMachine, names: Names = None) -> dict[str, AxisState]:
    """Read these axes; gives the `AxisState` of each by name.

    Every axis is visited; then the first error is raised, with a note for each other.
    """
    axes = machine.chosen(names)
    await on_axes([axis for axis in axes if machine.health.is_due(axis)], machine.health.note)
    raise_first(await on_axes(axes, read_state))
    machine.publish()
    state = machine.snapshot()
    return {axis.name: state.axes[axis.name] for axis in axes}


async def read_positions(machine: OpenMachine, names: Names = None) -> dict[str, Any]:
    """Read the positions (rad, m) of these axes, by name; None where a device reports none."""
    return {name: state.position for name, state in (await read_axes(machine, names)).items()}


async def poll(machine: OpenMachine) -> None:
    """Program: read all axes for the subscribers; errors show as age."""
    await on_axes(machine.chosen(), read_state)
    machine.publish()


# -- what it is ------------------------------------------------------------------------------------------------


class AxisDescription(Struct, frozen=True):
    """One axis. Positions in rad (m), velocities in rad/s (m/s); `low` and `high` None without a limit.

    `commands` are the functions of its device. `parent`, `frame` and `tip` are those of the machine file.
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
    parent: str | None = None
    frame: str | None = None
    tip: str | None = None


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
        parent=config.parent,
        frame=config.frame,
        tip=config.tip,
    )
