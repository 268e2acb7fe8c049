"""The end of a program: each axis does what the machine file says, hold, stop, torque off, park, or leave.

What moves is stopped first; what shall be limp is released when it rests or after 0.5 s; parking is last. Every axis
is visited, whatever fails. An interrupt skips waiting and parking.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from motorbus.core.steps import catch
from motorbus.errors import MotorbusError
from motorbus.motion.axis import Axis, on_axes
from motorbus.motion.moves import move, release_torque, stop_axes, watch_rest
from motorbus.motion.program import Program
from motorbus.motion.state import OpenMachine

REST_WAIT: Final = 0.5  # s
PARK_SPEED: Final = 0.5  # share of the velocity of each axis


class Shutdown:
    """What is done before a machine is closed. `errors` by name of the axis; `notes` are for the user.

    With `graceful` each axis with torque goes to the pose `park`, if there is one, and is released.
    """

    def __init__(self, machine: OpenMachine, *, graceful: bool = False) -> None:
        self.errors: dict[str, MotorbusError] = {}
        self.notes: list[str] = []
        self._machine = machine
        self._park = machine.config.poses.get("park", {})
        self._actions = {
            name: self._graceful_action(axis) if graceful else axis.config.exit_action
            for name, axis in machine.axes.items()
            if axis.status.engaged or axis.status.moving or axis.status.endless
        }
        self._steps: list[Callable[[], Program[Any]]] = [self._stop, self._park_axes, self._release]
        self._hurried = False

    def _graceful_action(self, axis: Axis) -> str:
        if axis.name in self._park:
            return "park, torque_off"
        return "torque_off" if "disable_torque" in axis.driver else "hold"

    async def run(self) -> None:
        """Program: all of it. A signal or cancellation shortens it, and is raised at the end."""
        interrupt: BaseException | None = None
        while self._steps:
            try:
                await self._steps.pop(0)()
            except (Exception, GeneratorExit):
                raise
            except BaseException as signal:
                if interrupt is None:
                    self._steps = [self._stop, self._release]
                interrupt = interrupt or signal
                self._hurried = True
        if interrupt is not None:
            raise interrupt

    def _with(self, action: str) -> list[Axis]:
        axes = self._machine.axes
        return [axes[name] for name, actions in self._actions.items() if action in actions]

    async def _stop(self) -> None:
        moving = [
            axis
            for axis in (
                self._machine.axes[name] for name, action in self._actions.items() if action != "leave"
            )
            if (axis.status.moving or axis.status.endless) and not axis.status.fault
        ]
        self._note("stop", await stop_axes(moving))
        if not self._hurried and moving:
            await on_axes(moving, lambda axis: watch_rest(axis, REST_WAIT))

    async def _park_axes(self) -> None:
        parked = []
        lease = self._machine.lease
        for axis in self._with("park"):
            if axis.bus.latched:
                self.notes.append(f"{axis.name}: not parked, the emergency stop is in force")
            elif lease is not None and lease.lost:
                self.notes.append(f"{axis.name}: not parked, the lease is lost")
            elif axis.status.fault or axis.name in self.errors:
                self.notes.append(f"{axis.name}: not parked, it is at fault")
            else:
                parked.append(axis)
        if not parked:
            return
        goals = {axis.name: self._park[axis.name] for axis in parked}
        try:
            await move(self._machine, goals, speed=PARK_SPEED)
        except MotorbusError as error:
            self._note("park", dict.fromkeys(goals, error))

    async def _release(self) -> None:
        axes = [axis for axis in self._with("torque_off") if "disable_torque" in axis.driver]
        self._note("torque off", await release_torque(axes))

    def _note(self, what: str, results: dict[str, Any]) -> None:
        for name, result in results.items():
            if isinstance(result, MotorbusError):
                self.errors[name] = result
                self.notes.append(f"{name}: {what} failed: {result.summary}")


async def stop_bus(axes: list[Axis]) -> bool:
    """Procedure: the lease is lost: stop what moves, release what is released at the exit; True if all accepted."""
    accepted = True
    for axis in axes:
        moves, releases = axis.status.moving or axis.status.endless, axis.config.exit_action == "torque_off"
        axis.status.claim()
        if axis.bus.latched or not (moves or (releases and axis.status.engaged)):
            continue
        function = axis.driver.disable_torque if releases else axis.driver.stop
        result = await catch(function(axis.device))
        if isinstance(result, MotorbusError):
            accepted = False
        else:
            axis.status.stopped()
            axis.status.engaged = axis.status.engaged and not releases
    return accepted
