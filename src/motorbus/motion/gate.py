"""The safety gate: a list of checks that each motion request passes before it is sent; the lease."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf, isfinite
from typing import Any, Final

from motorbus.bus.base import BaseBus
from motorbus.bus.interlock import check_limits
from motorbus.core.family import IdChanged
from motorbus.core.request import EVERY_LANE, Effect, Priority, Request
from motorbus.core.setpoint import Setpoint, Stays
from motorbus.errors import Interrupted, LimitExceeded, MotorbusError, NotHomed, Refused
from motorbus.motion.axis import FRESH, AxisStatus

LEAD_TIME: Final = 0.8  # s at the maximum velocity that a goal without a speed may be away
NEAR: Final = 0.1  # rad that any goal may be away
COUNT: Final = 0.0027  # rad; a device rounds a goal to its counts, the coarsest are 0.0051 rad apart
SPEED_SLACK: Final = 0.01
SPEED_UNIT: Final = 0.08
"""rad/s; a device rounds a speed up to its unit, so a legal speed never becomes illegal (50 counts/s of an STS)."""
ENDLESS: Final = ("velocity", "load", "current")


class Lease:
    """The right to move a machine, for `seconds` after each `beat`; without `seconds` until it ends.

    A lease that was not renewed in time is lost; it stays lost until `reset`.
    """

    def __init__(self, now: Callable[[], float], seconds: float = inf) -> None:
        self.seconds: Final = seconds
        self._now = now
        self._until = now() + seconds

    @property
    def lost(self) -> bool:
        """It was not renewed in time."""
        return self._now() > self._until

    def beat(self) -> None:
        """Renew it. Raises Refused if it is lost."""
        if self.lost:
            raise lease_lost("the machine")
        self._until = self._now() + self.seconds

    def reset(self) -> None:
        """Take it again after a loss. Nothing is sent."""
        self._until = self._now() + self.seconds


def lease_lost(name: str) -> Refused:
    """The error for an axis that must not move because the lease is lost."""
    return Refused(
        f"{name}: the motion lease was not renewed in time", reason="lease", advice="lease.reset()"
    )


Check = Callable[["SafetyGate", AxisStatus, Setpoint, float], "MotorbusError | None"]


def not_faulted(gate: SafetyGate, axis: AxisStatus, setpoint: Setpoint, now: float) -> MotorbusError | None:
    """An axis at fault gets no motion and no torque."""
    axis.check_fault()
    return None


def lease_held(gate: SafetyGate, axis: AxisStatus, setpoint: Setpoint, now: float) -> MotorbusError | None:
    """A lease was renewed in time."""
    return lease_lost(axis.name) if gate.lease is not None and gate.lease.lost else None


def finite(gate: SafetyGate, axis: AxisStatus, setpoint: Setpoint, now: float) -> MotorbusError | None:
    """The value is a finite number."""
    return None if isfinite(setpoint.value) else LimitExceeded(f"{axis.name}: {setpoint.value} is not finite")


def position_fresh(
    gate: SafetyGate, axis: AxisStatus, setpoint: Setpoint, now: float
) -> MotorbusError | None:
    """A goal is judged by a believable position of the last 0.5 s."""
    if not axis.measured or setpoint.quantity not in ("position", "relative"):
        return None
    if axis.suspect is not None:
        return Refused(
            f"{axis.name}: its last position is implausible", reason="suspect", advice="read it again"
        )
    if now - axis.at > FRESH:
        age = "not known" if axis.position is None else f"{now - axis.at:.1f} s old"
        return Refused(
            f"{axis.name}: its position is {age}",
            reason="stale",
            expected=f"at most {FRESH} s old",
            advice="read it before the goal is sent: robot.positions()",
        )
    return None


def within_limits(gate: SafetyGate, axis: AxisStatus, setpoint: Setpoint, now: float) -> MotorbusError | None:
    """A goal is inside the limits of axis and device, or leads back towards them."""
    here = axis.position if axis.position is not None else axis.estimate
    goal = setpoint.value
    if setpoint.quantity == "relative":
        if here is None and axis.low == -inf and axis.high == inf:
            return None
        if here is None:
            return NotHomed(f"{axis.name}: its position is not known", advice=f'robot.home("{axis.name}")')
        goal += here
    elif setpoint.quantity != "position":
        return None
    low, high = axis.low, axis.high
    if setpoint.low is not None and setpoint.high is not None:
        low, high = max(low, setpoint.low), min(high, setpoint.high)
    if low - COUNT <= goal <= high + COUNT:
        return None
    if here is not None and (here <= goal <= low or high <= goal <= here):
        return None
    config = axis.config
    ends = sorted((config.from_device(low), config.from_device(high)))
    where = f"{config.show(ends[0])} to {config.show(ends[1])}"
    return LimitExceeded(f"{axis.name}: goal {config.show(config.from_device(goal))} is outside {where}")


def within_step(gate: SafetyGate, axis: AxisStatus, setpoint: Setpoint, now: float) -> MotorbusError | None:
    """A goal without a speed is at most 0.8 s of travel away; no goal is farther away than max_step."""
    if setpoint.quantity != "position" or axis.position is None or setpoint.stays is not None:
        return None
    config, distance = axis.config, abs(setpoint.value - axis.position)
    most = inf if config.max_step is None else abs(config.max_step * config.ratio)
    if axis.node not in gate.paced:
        most = min(most, LEAD_TIME * abs(config.max_velocity * config.ratio) + NEAR)
    if distance <= most + COUNT:
        return None
    far, allowed = (config.show(value / abs(config.ratio)) for value in (distance, most))
    return LimitExceeded(
        f"{axis.name}: the goal is {far} away, at most {allowed} is allowed",
        reason="step",
        advice="give a velocity, or use robot.move()",
    )


def within_velocity(
    gate: SafetyGate, axis: AxisStatus, setpoint: Setpoint, now: float
) -> MotorbusError | None:
    """A velocity, or the speed of a move, is at most max_velocity."""
    if setpoint.quantity not in ("velocity", "speed"):
        return None
    most = abs(axis.config.max_velocity * axis.config.ratio)
    if abs(setpoint.value) <= most * (1 + SPEED_SLACK) + SPEED_UNIT:
        return None
    return LimitExceeded(
        f"{axis.name}: {abs(setpoint.value):.4g} rad/s of the device is above {most:.4g} rad/s",
        reason="velocity",
        advice="give velocity=…; the default of a device is its own maximum",
    )


def attended(gate: SafetyGate, axis: AxisStatus, setpoint: Setpoint, now: float) -> MotorbusError | None:
    """Motion without an end of its own needs a lease."""
    if setpoint.quantity not in ENDLESS or not setpoint.value or gate.lease is not None:
        return None
    return Refused(
        f"{axis.name}: this motion ends only by a stop, and the machine is not attended",
        reason="unattended",
        advice="use it inside `with robot.attended():`",
    )


CHECKS: Final[tuple[Check, ...]] = (
    not_faulted,
    lease_held,
    finite,
    position_fresh,
    within_limits,
    within_step,
    within_velocity,
    attended,
)


class SafetyGate:
    """The interlock of one bus: judges each request that moves an axis or switches its torque.

    It raises the error of the first check that fails; then nothing of the request is sent. A stop never gets here.
    """

    def __init__(self, bus: BaseBus, axes: Sequence[AxisStatus]) -> None:
        self.axes: Final = {axis.node: axis for axis in axes}
        self.lease: Lease | None = None
        self.paced: frozenset[int] = frozenset()
        """Nodes for which the request that is judged also gives a speed."""
        self._bus = bus
        self._deferred: dict[int, int] = {}  # node: number of its stops when its deferred write was sent
        bus.interlock = self
        bus.on_id_change = self.rename
        bus.on_reconnect = self.forget

    def check(self, request: Request[Any], now: float) -> None:
        """Raise MotorbusError if this request must not leave at `now` (s)."""
        deferred = request.deferred
        if request.priority is Priority.STOP or (request.effect < Effect.TORQUE and deferred is None):
            return
        setpoints = request.setpoints
        moving = [setpoint for setpoint in setpoints if setpoint.stays is not Stays.STILL]
        if deferred is not None and deferred.begins:
            self._check_deferred()
        elif request.effect is Effect.MOTION and not setpoints:
            raise LimitExceeded("this write moves a motor and does not say where to")
        if self.axes and request.lane == EVERY_LANE and moving:
            raise Refused(
                "a broadcast that moves cannot be judged", reason="limits", advice="address each device"
            )
        self.paced = frozenset(one.node for one in setpoints if one.quantity in ("speed", "time"))
        for setpoint in moving:
            axis = self.axes.get(setpoint.node)
            if axis is None:
                check_limits(setpoint)
                continue
            self.update(axis)
            for check in CHECKS:
                error = check(self, axis, setpoint, now)
                if error is not None:
                    error.node = axis.node
                    raise error
        for setpoint in setpoints:
            self._commit(setpoint, waits=deferred is not None and not deferred.begins)

    def _commit(self, setpoint: Setpoint, *, waits: bool) -> None:
        if waits:
            self._deferred[setpoint.node] = self._stops(setpoint.node)
        axis = self.axes.get(setpoint.node)
        if axis is None:
            return
        if setpoint.stays is Stays.STILL:
            axis.stopped()
            axis.engaged = axis.engaged and setpoint.quantity != "torque"  # torque off
            return
        axis.engaged = True
        if setpoint.stays is Stays.ON or setpoint.quantity in ("speed", "cap", "time", "torque"):
            return
        axis.moving = True
        axis.endless = setpoint.quantity in ENDLESS and bool(setpoint.value)
        if not axis.measured:
            axis.estimate = None

    def _stops(self, node: int) -> int:
        axis = self.axes.get(node)
        return self._bus.stop_count(node) if axis is None else axis.owner

    def _check_deferred(self) -> None:
        """Deferred writes begin once, and only if no stop has followed them."""
        pending, self._deferred = self._deferred, {}
        if not pending or any(self._stops(node) != stops for node, stops in pending.items()):
            raise Refused(
                "no deferred write may begin: none was sent, or a stop followed it",
                reason="stale",
                advice="write the goals again",
            )

    def update(self, axis: AxisStatus) -> None:
        """Take the last position that the bus has read, once."""
        reading = self._bus.positions.get(axis.node)
        if reading is None or reading[1].at <= axis.seen:
            return
        request, response = reading
        if callable(request.reports_position):
            angle = request.reports_position(response).get(axis.node)
            if angle is not None:
                axis.take(angle, response.at)

    def stopped(self, nodes: Sequence[int]) -> None:
        """A stop of these nodes (none: all) will be sent: each source of goals loses them. From any thread."""
        for node, axis in tuple(self.axes.items()):
            if not nodes or node in nodes:
                axis.stopped()

    def rename(self, change: IdChanged) -> None:
        """A device gets another id: its limits hold under both."""
        if change.node in self.axes:
            self.axes[change.new] = self.axes[change.node]

    def forget(self) -> None:
        """The port was lost and is back: devices may be anywhere."""
        self._deferred.clear()
        for axis in self.axes.values():
            axis.owner += 1
            axis.forget()


def check_owned(
    axes: Sequence[tuple[AxisStatus, int]], lease: Lease | None, *, latched: bool
) -> MotorbusError | None:
    """The error if the owner of one of these axes has changed since the caller claimed it."""
    lost = [axis for axis, owner in axes if axis.owner != owner]
    if not lost:
        return None
    names = ", ".join(axis.name for axis in lost)
    if lease is not None and lease.lost:
        return lease_lost(names)
    cause = "an emergency stop" if latched else "a stop or another command"
    return Interrupted(f"{names}: {cause} took over the axis", node=lost[0].node)
