"""One axis of an open machine, and programs that visit axes on all buses at the same time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from motorbus.bus.base import BaseBus
from motorbus.core.family import AxisDriver
from motorbus.core.steps import Runnable, catch, gather
from motorbus.errors import LinkError, MotorbusError, RequestError
from motorbus.motion.machine import AxisConfig
from motorbus.motion.program import OnBuses
from motorbus.motion.status import AxisStatus


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
