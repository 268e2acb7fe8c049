"""Moves that are waited for: when the wait is interrupted, the devices stop and hold where they are.

Errors of the moves themselves (no reply, stalled, out of time) end the wait as they are and send nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple, Protocol, TypeVar

from motorbus.core import units
from motorbus.core.operation import (
    Alone,
    Closed,
    Operation,
    Pause,
    Runnable,
    Together,
    afterwards,
    outcome,
)
from motorbus.errors import MotorbusError, RequestError

T = TypeVar("T")

LOOK: Final = 0.02
"""s between two readings of a device that was stopped."""
STILL: Final = 0.006
"""rad within which it must stay; the coarsest position has counts of 0.005."""
SPAN: Final = 0.1
"""s for which it must stay there."""
LONGEST: Final = 1.0
"""s after which it is no longer looked at."""


class Device(Protocol):
    """A device that moves; `last_move` identifies the move that was ordered last."""

    @property
    def node(self) -> int: ...

    last_move: object


class Moving(NamedTuple):
    """A device of a move, how it stops (gives its promise, an Enum; None without torque), and where it is (rad)."""

    device: Device
    stop: Callable[[], Runnable[Any]]
    position: Callable[[], Runnable[float]]


def stopped_if_interrupted(move: Runnable[T], *devices: Moving) -> Operation[T]:
    """Order a move and wait for it; after an interruption stop its devices and add a note where each holds.

    A device that has got a newer move is left alone.
    """
    wait = _Wait(devices)
    try:
        return (yield from afterwards(wait.on(move), wait.stopped))
    except BaseException as error:
        for note in wait.notes:
            error.add_note(note)
        raise


class _Wait:
    def __init__(self, devices: tuple[Moving, ...]) -> None:
        self.notes: list[str] = []
        self._devices = devices
        self._move = object()
        self._open = False

    def on(self, move: Runnable[T]) -> Operation[T]:
        for one in self._devices:
            one.device.last_move = self._move
        self._open = True
        try:
            value = yield from move
        except (Exception, Closed, GeneratorExit) as error:
            self._open = isinstance(error, MemoryError)
            raise
        self._open = False
        return value

    def stopped(self) -> Operation[None]:
        if not self._open:
            return
        cut_off = MotorbusError("its stop was interrupted")
        self.notes = [_note(one, cut_off) for one in self._devices]
        told = yield from Together([outcome(iter(Alone(self._stop(one)))) for one in self._devices])
        self._open = False
        found = [(one, came) for one, came in zip(self._devices, told, strict=True) if came]
        self.notes = [_note(one, came) for one, came in found]
        places = yield from Together([_place(one, came) for one, came in found])
        self.notes = [note + place for note, place in zip(self.notes, places, strict=True)]

    def _stop(self, one: Moving) -> Operation[str]:
        """Nothing else goes onto the bus meanwhile, so a newer move comes before all of it or behind."""
        if one.device.last_move is not self._move:
            return ""
        promise = yield from one.stop()
        if promise is None:
            return "its torque is off"
        return "holds" if promise.name.startswith("HOLD") else f"{promise.value};"


def _note(one: Moving, came: str | MotorbusError) -> str:
    node = one.device.node
    if isinstance(came, str):
        return f"#{node}: {came}"
    how = came.advice if isinstance(came, RequestError) else f"`motorbus stop BUS#{node}` stops it"
    return f"#{node} may still be moving: {came.summary}; {how}"


def _place(one: Moving, came: str | MotorbusError) -> Operation[str]:
    """Where a device that was stopped came to rest, or was seen last."""
    if isinstance(came, MotorbusError):
        return ""
    begun = since = yield from Pause(0)
    mark: float | None = None
    while True:
        here = yield from outcome(one.position())
        if isinstance(here, MotorbusError):
            return f", and its position is not known: {here.summary}"
        now = yield from Pause(LOOK)
        if mark is None or abs(here - mark) > STILL:
            mark, since = here, now
        place = f" at {units.show(here, 'position')}"
        if now - since >= SPAN:
            return place
        if now - begun >= LONGEST:
            return f"{place}, not yet at rest"
