"""Wait for a move; if the wait is interrupted, stop the devices.

Errors of the move itself (no reply, stalled, timeout) end the wait without a stop.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple, Protocol, TypeVar

from motorbus.core import units
from motorbus.core.steps import Exclusive, Runnable, Sleep, catch, gather, with_cleanup
from motorbus.errors import MotorbusError, RequestError

T = TypeVar("T")

PERIOD: Final = 0.02
"""s between two position readings of a stopped device."""
TOLERANCE: Final = 0.006
"""rad within which a device at rest stays; the coarsest position has counts of 0.005 rad."""
REST_TIME: Final = 0.1
"""s for which it must stay within the tolerance."""
TIMEOUT: Final = 1.0
"""s after which the readings end, at rest or not."""


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
    wait = _Wait(devices)
    try:
        return await with_cleanup(wait.run(move), wait.stop)
    except BaseException as error:
        for note in wait.notes:
            error.add_note(note)
        raise


class _Wait:
    """The wait for one move; `notes` say what each device does after `stop`."""

    def __init__(self, devices: tuple[Moving, ...]) -> None:
        self.notes: list[str] = []
        self._devices = devices
        self._move = object()
        self._open = False

    async def run(self, move: Runnable[T]) -> T:
        for moving in self._devices:
            moving.device.last_move = self._move
        self._open = True
        try:
            value = await move
        except (Exception, GeneratorExit) as error:
            self._open = isinstance(error, MemoryError)  # an interruption: it says nothing of the move
            raise
        self._open = False
        return value

    async def stop(self) -> None:
        if not self._open:
            return
        interrupted = MotorbusError("its stop was interrupted")
        self.notes = [_note(moving, interrupted) for moving in self._devices]
        results = await gather(*[catch(Exclusive(self._stop(moving))) for moving in self._devices])
        self._open = False
        stopped = [pair for pair in zip(self._devices, results, strict=True) if pair[1]]
        self.notes = [_note(moving, result) for moving, result in stopped]
        places = await gather(*[_place(moving, result) for moving, result in stopped])
        self.notes = [note + place for note, place in zip(self.notes, places, strict=True)]

    async def _stop(self, moving: Moving) -> str:
        """Run it inside `Exclusive`: a newer move is then ordered either before the check or after the stop."""
        if moving.device.last_move is not self._move:
            return ""
        promise = await moving.stop()
        if promise is None:
            return "its torque is off"
        return "holds" if promise.name.startswith("HOLD") else f"{promise.value};"


def _note(moving: Moving, result: str | MotorbusError) -> str:
    node = moving.device.node
    if isinstance(result, str):
        return f"#{node}: {result}"
    fix = result.advice if isinstance(result, RequestError) else f"`motorbus stop BUS#{node}` stops it"
    return f"#{node} may still be moving: {result.summary}; {fix}"


async def _place(moving: Moving, result: str | MotorbusError) -> str:
    """Return the text of the position at which a stopped device came to rest, or of its last reading."""
    if isinstance(result, MotorbusError):
        return ""
    begin = since = await Sleep(0)
    rest: float | None = None
    while True:
        position = await catch(moving.position())
        if isinstance(position, MotorbusError):
            return f", and its position is not known: {position.summary}"
        now = await Sleep(PERIOD)
        if rest is None or abs(position - rest) > TOLERANCE:
            rest, since = position, now
        place = f" at {units.show(position, 'position')}"
        if now - since >= REST_TIME:
            return place
        if now - begin >= TIMEOUT:
            return f"{place}, not yet at rest"
