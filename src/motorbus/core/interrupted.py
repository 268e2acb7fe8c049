"""Wait for a move; if the wait is interrupted, stop the devices.

Errors of the move itself (no reply, stalled, timeout) end the wait without a stop.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple, Protocol, TypeVar

from motorbus.core import units
from motorbus.core.steps import Exclusive, Guard, Runnable, Sleep, catch, gather
from motorbus.errors import MotorbusError, RequestError

T = TypeVar("T")

PERIOD: Final = 0.02  # s between two position readings of a stopped device
TOLERANCE: Final = 0.006
"""rad within which a device at rest stays; the coarsest position has counts of 0.005 rad."""
REST_TIME: Final = 0.1  # s for which it must stay within the tolerance
TIMEOUT: Final = 1.0  # s after which the readings end, at rest or not


class Device(Protocol):
    """A device that moves; `last_move` identifies its latest move."""

    @property
    def node(self) -> int: ...

    last_move: object


class Moving(NamedTuple):
    """A device of a move, its stop (returns the promise, an Enum; None without torque), and its position (rad)."""

    device: Device
    stop: Callable[[], Runnable[Any]]
    position: Callable[[], Runnable[float]]


async def stopped_if_interrupted(move: Runnable[T], *devices: Moving) -> T:
    """Run a move; if it is interrupted, stop its devices and add a note to the error: where each holds.

    A device with a newer move is not stopped.
    """
    async with _Move(devices):
        return await move


class _Move(Guard):
    def __init__(self, devices: tuple[Moving, ...]) -> None:
        self._devices = devices
        self._id = object()

    async def enter(self) -> None:
        for moving in self._devices:
            moving.device.last_move = self._id

    async def leave(self, error: BaseException | None) -> None:
        if error is None or (isinstance(error, Exception) and not isinstance(error, MemoryError)):
            return  # the move ended by itself
        results = await gather(*[catch(Exclusive(self._stop(moving))) for moving in self._devices])
        stopped = [pair for pair in zip(self._devices, results, strict=True) if pair[1]]
        for note in await gather(*[_note(moving, result) for moving, result in stopped]):
            error.add_note(note)

    async def _stop(self, moving: Moving) -> str:
        """Run it inside `Exclusive`: a newer move is then ordered either before the check or after the stop."""
        if moving.device.last_move is not self._id:
            return ""
        promise = await moving.stop()
        if promise is None:
            return "its torque is off"
        return "holds" if promise.name.startswith("HOLD") else f"{promise.value};"


async def _note(moving: Moving, result: str | MotorbusError) -> str:
    node = moving.device.node
    if isinstance(result, MotorbusError):
        fix = result.advice if isinstance(result, RequestError) else f"`motorbus stop BUS#{node}` stops it"
        return f"#{node} may still be moving: {result.summary}; {fix}"
    place = await catch(_rest_place(moving))
    if isinstance(place, MotorbusError):
        return f"#{node}: {result}, and its position is not known: {place.summary}"
    return f"#{node}: {result}{place}"


async def _rest_place(moving: Moving) -> str:
    """Return the text of the position at which a stopped device came to rest, or of its last reading."""
    begin = since = await Sleep(0)
    rest: float | None = None
    while True:
        position = await moving.position()
        now = await Sleep(PERIOD)
        if rest is None or abs(position - rest) > TOLERANCE:
            rest, since = position, now
        place = f" at {units.show(position, 'position')}"
        if now - since >= REST_TIME:
            return place
        if now - begin >= TIMEOUT:
            return f"{place}, not yet at rest"
