"""An operation on a bus that nobody waits for: it goes on while others have the bus pumped, or in a thread of its own.

A machine whose lease runs out is stopped, whatever its program does then. Where time is virtual nothing happens unless
somebody pumps, so whoever pumps carries this along, between two of his own steps. Where time is real a program may
sleep, or its event loop hang, so a thread pumps for it; it needs this process and its interpreter lock, and nothing
else, as the thread of the emergency stop does.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from motorbus.bus.crank import crank
from motorbus.bus.face import BusFace
from motorbus.bus.interruption import interrupts
from motorbus.bus.run import Run
from motorbus.bus.ticket import Timer
from motorbus.core.operation import Operation, Pause

T = TypeVar("T")

LOOK = 0.02
"""s; a thread that waits for an answer looks at least so often whether another one has brought it. What begins anew
does so behind as long a pause."""


class Background(Generic[T]):
    """One operation on one bus, for which either `along` or `carried` is called, once. `run` tells how it stands."""

    def __init__(self, bus: BusFace, operation: Callable[[], Operation[T]]) -> None:
        self.link = bus.link
        self.turns = bus.turns
        self._bus = bus
        self._operation = operation
        self._dropped = False
        self.run = self._begun(operation())

    def _begun(self, operation: Operation[T]) -> Run[T]:
        return Run(self.turns, operation, now=self.link.now, report=self._bus.listener(None))

    def _again(self) -> Operation[T]:
        """Behind a pause: what is struck each time would leave nobody else a moment."""
        yield from Pause(LOOK)
        return (yield from self._operation())

    def along(self) -> None:
        """From now on whoever pumps the bus carries it along.

        An interruption that falls into it is his, so it is raised there; this one cleans up, and begins anew.
        """
        with self.turns.lock:
            self.turns.chores.append(self._chore)

    def hurry(self) -> None:
        """Where it pauses it goes on as soon as somebody pumps. From any thread."""
        ticket = self.run.root.ticket
        if isinstance(ticket, Timer):
            ticket.deadline = self.link.now()

    def drop(self) -> None:
        """Where it pauses or has not begun nobody carries it along any more; at work it ends by itself."""
        with self.turns.lock:
            self._dropped = True
            ticket = self.run.root.ticket
            rests = isinstance(ticket, Timer) or not self.run.root.started
            if rests and self._chore in self.turns.chores:
                self.turns.chores.remove(self._chore)
            if isinstance(ticket, Timer):
                self.turns.abandon(ticket)

    def carried(self) -> T:
        """Carry it out in this thread, whoever else pumps the bus, and return its value. Raises what it raises.

        Only where time is real. Whatever else falls into it, want of memory say, has all of it clean up.
        """
        caught: BaseException | None = None
        while True:
            try:
                if caught is not None:
                    self.run.interrupt(caught)
                while not self.run.advance():
                    crank(self.link, self.turns, self.link.now() + LOOK)
                break
            except BaseException as interruption:
                caught = interruption
        return self.run.result()

    def _chore(self) -> None:
        """One step further; the caller holds the lock of the turns."""
        if self._chore not in self.turns.chores or not self._advance():
            return
        told, ended = self.run.interruption, self.run.root.error
        if self._dropped or not (told is not None or interrupts(ended)):
            self.turns.chores.remove(self._chore)
        else:
            self.run = self._begun(self._again())
        if ended is not None and ended is not told and interrupts(ended):
            raise ended

    def _advance(self) -> bool:
        """One step further; an interruption that falls into it has all of it clean up, and is raised."""
        first: BaseException | None = None
        while True:
            try:
                if first is None:
                    return self.run.advance()
                self.run.interrupt(first)
                break
            except BaseException as interruption:
                first = first or interruption  # one more fell into what deals with the first
        raise first
