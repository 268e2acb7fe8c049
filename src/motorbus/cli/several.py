"""Moves of several devices at once: when one of the devices is lost, the others stop."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from motorbus.errors import MotionError, MotorbusError

if TYPE_CHECKING:
    from motorbus.bus.blocking import Bus
    from motorbus.cli.dry import DryBus
    from motorbus.core.steps import Runnable

T = TypeVar("T")


class _Lost(BaseException):
    """Ends the moves beside the one that failed, as an interruption does."""

    def __init__(self, error: MotorbusError) -> None:
        super().__init__(error.summary)
        self.error = error


async def or_all_stop(move: Runnable[T]) -> T:
    """A move among several; an error of anything but its motion, as no reply, interrupts the others."""
    try:
        return await move
    except MotionError:
        raise
    except MotorbusError as error:
        raise _Lost(error) from None


def carried_out(bus: Bus | DryBus, operation: Runnable[T]) -> T:
    """Carry out an operation with such moves. Raises the error of the device that was lost, with all notes."""
    try:
        return bus.run(operation)
    except _Lost as lost:
        for note in getattr(lost, "__notes__", ()):
            lost.error.add_note(note)
        raise lost.error from None
