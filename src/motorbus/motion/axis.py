"""One axis of an open machine: what is known of it, who may move it, and programs that visit several axes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf
from typing import Any, Final

from motorbus.bus.base import BaseBus
from motorbus.core.family import AxisDriver, State
from motorbus.core.steps import Runnable, catch, gather
from motorbus.errors import LinkError, MotorbusError, Refused, RequestError
from motorbus.motion.machine import AxisConfig
from motorbus.motion.program import OnBuses

FRESH: Final = 0.5  # s for which a position may be used to judge a goal
FASTEST: Final = 30.0  # rad/s; no motor of these families is faster # assumption
JITTER: Final = 0.01  # rad; readings of a device at rest differ by less


class AxisStatus:
    """Angles in rad of the device, times in s of the link clock.

    `owner` counts the stops, torque-offs and new sources of goals. A source keeps the number that `claim` gave it; its
    goals are refused when the number has changed. `estimate` is the position of an axis whose device reports none,
    None where it is unknown. `engaged`: torque was given from here. `moving`: a goal was sent and no stop since.
    `endless`: its motion has no end of its own. `measured`: its device reports its position; the last reading was
    `seen` at that time, `position` is the last sound one.
    """

    __slots__ = (
        "at", "config", "endless", "engaged", "estimate", "fault", "high", "low", "measured", "moving", "name", "node",
        "owner", "position", "seen", "state", "suspect",
    )  # fmt: skip

    def __init__(self, name: str, config: AxisConfig, *, measured: bool = True) -> None:
        self.name: Final = name
        self.config: Final = config
        self.node: Final = config.node
        self.low, self.high = config.device_limits
        self.position: float | None = None
        self.at = -inf
        self.suspect: float | None = None
        self.estimate: float | None = None
        self.seen = -inf
        self.measured = measured
        self.state: State | None = None  # its last sample, except for the position
        self.fault = ""
        self.owner = 0
        self.engaged = self.moving = self.endless = False

    def claim(self) -> int:
        """Make the caller the only source of goals from now on."""
        self.owner += 1
        return self.owner

    def take(self, angle: float, at: float) -> bool:
        """Take a reading; False while it is suspect.

        An implausible reading is suspect until a second one agrees with it.
        """
        self.seen = at
        before, age = self.position, at - self.at
        if before is None or abs(angle - before) <= JITTER + FASTEST * min(age, FRESH):
            is_sound = True
        else:
            is_sound = self.suspect is not None and abs(angle - self.suspect) <= JITTER + FASTEST * min(
                age, FRESH
            )
        if not is_sound:
            self.suspect = angle
            return False
        self.position, self.at, self.suspect = angle, at, None
        return True

    def forget(self) -> None:
        """The device may be anywhere."""
        self.position = self.suspect = self.estimate = None
        self.at = -inf

    def stopped(self) -> None:
        """A stop or torque-off will be sent: its source of goals loses it."""
        self.owner += 1
        self.moving = self.endless = False

    def set_fault(self, why: str) -> None:
        """It gets no motion and no torque until the fault is cleared."""
        self.fault = why
        self.owner += 1
        self.forget()
        self.engaged = self.moving = self.endless = False

    def check_fault(self) -> None:
        """Raise Refused if it is at fault."""
        if self.fault:
            raise Refused(
                f"{self.name} is at fault: {self.fault}",
                reason="fault",
                advice=f'find the cause, then robot.clear_fault("{self.name}")',
                node=self.node,
            )

    @property
    def known_position(self) -> float | None:
        """The last position of the axis (rad, m), measured or estimated."""
        angle = self.position if self.position is not None else self.estimate
        return None if angle is None else self.config.from_device(angle)


@dataclass(slots=True, eq=False)
class Axis:
    """One axis: its configuration, its device and what that can do, what is known of it.

    `limits` are those of the device (rad), None if unknown.
    """

    name: str
    config: AxisConfig
    bus: BaseBus
    device: Any
    driver: AxisDriver
    status: AxisStatus
    model: str = ""
    limits: tuple[float, float] | None = None

    def require(self, *capabilities: str) -> None:
        """Raise RequestError if its device lacks one of these functions."""
        for capability in capabilities:
            if capability not in self.driver:
                raise RequestError(
                    f"{self.name}: {self.config.device} has no {capability.replace('_', ' ')}",
                    node=self.config.node,
                )

    @property
    def follows_setpoints(self) -> bool:
        """A control loop can lead it."""
        return ("set_velocity" if self.config.is_wheel else "stream") in self.driver

    @property
    def range(self) -> tuple[float, float]:
        """Lowest and highest position (rad, m), by file and device."""
        low, high = self.status.low, self.status.high
        if self.limits is not None:
            low, high = max(low, self.limits[0]), min(high, self.limits[1])
        ends = self.config.from_device(low), self.config.from_device(high)
        return min(ends), max(ends)


def by_bus(axes: Sequence[Axis]) -> dict[BaseBus, list[Axis]]:
    """Axes by their bus."""
    found: dict[BaseBus, list[Axis]] = {}
    for axis in axes:
        found.setdefault(axis.bus, []).append(axis)
    return found


async def on_axes(axes: Sequence[Axis], visit: Callable[[Axis], Runnable[Any]]) -> dict[str, Any]:
    """Program: run `visit(axis)` for each axis, all at the same time; gives the value or error of each by name.

    The error of a device names its axis.
    """

    async def visit_all(members: list[Axis]) -> tuple[Any, ...]:
        results: tuple[Any, ...] = await gather(*[catch(visit(axis)) for axis in members])
        return results

    groups = by_bus(axes)
    values = await OnBuses({bus: visit_all(members) for bus, members in groups.items()}) if axes else {}
    found: dict[str, Any] = {}
    for bus, members in groups.items():
        if not isinstance(values[bus], tuple):  # one cause for the whole bus
            found |= {axis.name: values[bus] for axis in members}
            continue
        for axis, result in zip(members, values[bus], strict=True):
            if isinstance(result, MotorbusError) and result.node in (None, axis.config.node):
                name_axis(axis, result)
            found[axis.name] = result
    return found


def name_axis(axis: Axis, error: MotorbusError) -> None:
    """Let an error of the device of an axis name the axis."""
    if not isinstance(error, LinkError) and not error.summary.startswith(axis.name):
        error.summary = f"{axis.name}: {error.summary}"


async def read_state(axis: Axis) -> None:
    """Procedure: read all that the device reports into its status."""
    status = axis.status
    if "state" in axis.driver:
        state = await axis.driver.state(axis.device)
        status.state = state
        if state.position is None or status.take(state.position, state.at):
            return
    await read_position(axis)


async def read_position(axis: Axis) -> None:
    """Procedure: read its position, a suspect one again; nothing without one."""
    for _ in range(2 if axis.status.measured else 0):
        if axis.status.take(await axis.driver.position(axis.device), axis.bus.now()):
            return
