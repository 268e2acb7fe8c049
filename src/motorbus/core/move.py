"""Move devices to a position, and wait until they are there by their own samples and the clock of the link.

A wait that is interrupted stops the devices. Errors of the move itself (no reply, stalled, timeout) end it without a
stop.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, Final, Generic, Protocol, TypeVar

from motorbus.core import units
from motorbus.core.family import State
from motorbus.core.register import is_number, shown
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import Exclusive, Guard, Runnable, Sleep, catch, gather
from motorbus.errors import MotionError, MotorbusError, RequestError, Stalled

PERIOD: Final = 0.02  # s between two samples; one axis that is waited for takes a tenth of a bus at most
STALL_TIME: Final = 0.5  # s without progress after which a device counts as stalled
PROGRESS: Final = 0.003  # rad; a smaller change counts as noise
AT_REST: Final = 0.006
"""rad within which a stopped device stays; the coarsest position has counts of 0.005 rad."""
REST_TIME: Final = 0.1  # s for which it must stay there
REST_TIMEOUT: Final = 1.0  # s after which its readings end, at rest or not


class Device(Protocol):
    """A device that moves; `last_move` identifies its latest move."""

    @property
    def node(self) -> int: ...

    last_move: object


D = TypeVar("D", bound=Device)


class MoveLogic(Generic[D]):
    """How devices of one family move; a subclass gives what differs."""

    tolerance: float = 0.01  # rad
    slowest: float = 1.0  # rad/s that each device reaches
    stall_time: float = STALL_TIME  # s

    @abstractmethod
    async def check(self, device: D, to: float) -> Setpoint:
        """The goal (rad) as a setpoint, with the limits of the device. Raises LimitExceeded for an impossible one."""

    @abstractmethod
    def send(self, device: D, goal: Setpoint) -> Runnable[Any]:
        """Send the goal."""

    @abstractmethod
    def sample(self, device: D) -> Runnable[State]:
        """A sample with its position, and whether it moves where the device reports that."""

    @abstractmethod
    def stop(self, device: D) -> Runnable[Any]:
        """Stop it; gives the promise, an Enum, None without torque."""

    async def position(self, device: D) -> float:
        """Its position (rad)."""
        return _position(await self.sample(device))

    def tolerance_of(self, device: D) -> float:
        """rad within which this device is in position."""
        return self.tolerance

    def stall_time_of(self, device: D) -> float:
        """s without progress after which this device counts as stalled."""
        return self.stall_time

    def timeout(self, distance: float) -> float:
        """s after which a move over this distance (rad) is late."""
        return 1.0 + 2.0 * distance / self.slowest

    def stalled(self, device: D, state: State, goal: float) -> MotorbusError:
        """The error for a device that stands elsewhere than at its goal."""
        return Stalled(
            f"node {device.node} stands at {state.position:.4g} rad, not at {goal:.4g} rad",
            cause="its torque is off, or something holds it",
            node=device.node,
        )


async def move(
    logic: MoveLogic[D],
    goals: Mapping[D, float],
    *,
    wait: bool = True,
    tolerance: float | None = None,
    timeout: float | None = None,
) -> None:
    """Move devices to these goals (rad); return when all are in position, or at once with `wait=False`.

    All goals are checked before the first is sent. In position: within `tolerance` rad and not moving; a device that
    does not report whether it moves is in position after two such samples in a row. An interrupt of the wait stops
    all.

    Raises LimitExceeded; Stalled when a position has not changed for 0.5 s; MotionError after `timeout` s (None: from
    the distance).
    """
    for name, value, unit in (("tolerance", tolerance, "rad"), ("timeout", timeout, "s")):
        if value is not None and not (is_number(value) and value > 0):
            raise RequestError(
                f"{name} {shown(value)} is not a finite number above 0", expected=f"a number in {unit}"
            )
    checked = [(device, await logic.check(device, to)) for device, to in goals.items()]

    async def send() -> None:
        for device, goal in checked:
            await logic.send(device, goal)

    if not wait:
        for device in goals:
            device.last_move = None  # an earlier move that is interrupted does not stop this one
        await send()
        return
    async with _StopIfInterrupted(logic, tuple(goals)):
        await send()
        await gather(*[_arrive(logic, device, goal.value, tolerance, timeout) for device, goal in checked])


async def _arrive(
    logic: MoveLogic[D], device: D, goal: float, tolerance: float | None, timeout: float | None
) -> None:
    """Return when the device is in position; see `move`."""
    state = await logic.sample(device)
    here = mark = _position(state)
    within = tolerance or logic.tolerance_of(device)
    begun = progressed = state.at
    longest = logic.timeout(abs(here - goal)) if timeout is None else timeout
    looks = 0
    while True:
        near = abs(here - goal) <= within
        looks = looks + 1 if near else 0
        if near and (not state.moving if state.moving is not None else looks >= 2):
            return
        if abs(here - mark) >= PROGRESS:
            mark, progressed = here, state.at
        elif state.at - progressed > logic.stall_time_of(device) and not looks:
            raise logic.stalled(device, state, goal)
        if state.at - begun > longest:
            raise MotionError(
                f"node {device.node} is not in position after {longest:.3g} s: it is at {here:.4g} rad on its way to "
                f"{goal:.4g} rad",
                expected=f"within {within:.4g} rad",
                cause="the velocity is low for this distance, or the device oscillates about its goal",
                advice="give a longer timeout; it is still moving: stop() ends that",
                node=device.node,
            )
        await Sleep(PERIOD)
        state = await logic.sample(device)
        here = _position(state)


def _position(state: State) -> float:
    assert state.position is not None
    return state.position


class _StopIfInterrupted(Guard, Generic[D]):
    """Stops the devices of an interrupted move, and adds a note to the error: where each holds.

    A device with a newer move is not stopped.
    """

    def __init__(self, logic: MoveLogic[D], devices: tuple[D, ...]) -> None:
        self._logic = logic
        self._devices = devices
        self._id = object()

    async def enter(self) -> None:
        for device in self._devices:
            device.last_move = self._id

    async def leave(self, error: BaseException | None) -> None:
        if error is None or (isinstance(error, Exception) and not isinstance(error, MemoryError)):
            return  # the move ended by itself
        results = await gather(*[catch(Exclusive(self._stop(device))) for device in self._devices])
        stopped = [pair for pair in zip(self._devices, results, strict=True) if pair[1]]
        for note in await gather(*[self._note(device, result) for device, result in stopped]):
            error.add_note(note)

    async def _stop(self, device: D) -> str:
        """Run it inside `Exclusive`: a newer move is then ordered either before the check or after the stop."""
        if device.last_move is not self._id:
            return ""
        promise = await self._logic.stop(device)
        if promise is None:
            return "its torque is off"
        return "holds" if promise.name.startswith("HOLD") else f"{promise.value};"

    async def _note(self, device: D, result: str | MotorbusError) -> str:
        if isinstance(result, MotorbusError):
            stop = f"`motorbus stop BUS#{device.node}` stops it"
            fix = result.advice if isinstance(result, RequestError) else stop
            return f"#{device.node} may still be moving: {result.summary}; {fix}"
        place = await catch(self._rest_place(device))
        if isinstance(place, MotorbusError):
            return f"#{device.node}: {result}, and its position is not known: {place.summary}"
        return f"#{device.node}: {result}{place}"

    async def _rest_place(self, device: D) -> str:
        """Text of the position at which a stopped device came to rest, or of its last reading."""
        begin = since = await Sleep(0)
        rest: float | None = None
        while True:
            position = await self._logic.position(device)
            now = await Sleep(PERIOD)
            if rest is None or abs(position - rest) > AT_REST:
                rest, since = position, now
            place = f" at {units.show(position, 'position')}"
            if now - since >= REST_TIME:
                return place
            if now - begin >= REST_TIMEOUT:
                return f"{place}, not yet at rest"
