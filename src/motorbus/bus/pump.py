"""The blocking pump: moves bytes between a link and turns, in the thread that called.

One thread pumps at a time; the others wait and are woken, and whoever still waits takes over. There is no hidden
thread but the stop thread. Policy is in `turns`; here are only waiting, waking, and leaving cleanly.
"""

from __future__ import annotations

from math import inf
from threading import get_ident
from typing import Any, Self, TypeVar

from motorbus.bus.crank import crank, launch, push, take_in
from motorbus.bus.face import BusFace
from motorbus.bus.run import Notify, Run
from motorbus.bus.ticket import Flight
from motorbus.core.operation import Exchange, Runnable

T = TypeVar("T")

NAP = 0.05  # s; a waiting thread looks at its own ticket at least this often


class Bus(BusFace):
    """An open bus, blocking. Any number of threads may call `run`; use it in a `with`."""

    _pumper: int | None = None

    def run(self, operation: Runnable[T], report: Notify | None = None) -> T:
        """Carry out an operation and return its value; `report` gets its events instead of the bus's own listener.

        Raises whatever the operation raises; KeyboardInterrupt after the operation has cleaned up.
        """
        if isinstance(operation, Exchange):
            return self._exchange(operation)
        run = Run(self.turns, operation, now=self.link.now, report=report or self.report, wake=self._wake)
        while True:
            try:
                while not run.advance():
                    self._turn()
                break
            except BaseException as interruption:
                self._recover()
                run.interrupt(interruption)
        return run.result()

    def _exchange(self, exchange: Exchange[T]) -> T:
        """The short path: one exchange needs no run."""
        flight = Flight(exchange)
        try:
            if self._launched(flight):
                take_in(self.link, self.turns, flight.deadline)
                self._hand_over()
            flight.wake = self._wake
            while not flight.done:
                self._turn()
        except BaseException:
            self._recover()
            with self.turns.lock:
                self.turns.abandon(flight)
            raise
        answer: Any = flight.result()
        return answer if exchange.read is None else exchange.read(answer)

    def _launched(self, flight: Flight) -> bool:
        """Has it left at once, and is its answer to be waited for here?"""
        with self.changed:
            if self._pumper is None and launch(self.link, self.turns, flight):
                self._pumper = get_ident() if not flight.done else None
                return not flight.done
            if self._pumper is not None:
                self.turns.submit(flight, self.link.now())
            return False

    def _turn(self) -> None:
        """Let time pass: pump, or wait for the thread that does."""
        with self.changed:
            if self._pumper not in (None, get_ident()):
                push(self.link, self.turns)
                self.changed.wait(NAP)
                return
            self._pumper = get_ident()
        try:
            crank(self.link, self.turns, inf)
        finally:
            self._hand_over()

    def _hand_over(self) -> None:
        with self.changed:
            self._pumper = None
            self.changed.notify_all()

    def _wake(self) -> None:
        with self.changed:
            self.changed.notify_all()

    def _recover(self) -> None:
        """An interrupt may fall between taking a lock and leaving it; give back what this thread still holds."""
        if self._pumper == get_ident():
            self._pumper = None
        try:
            while True:
                self.changed.notify_all()
                self.turns.lock.release()
        except RuntimeError:  # not held (any more): the usual case
            pass

    def close(self) -> None:
        """Give the port back. Nothing is sent to the devices: they go on doing what they were told."""
        self.stopper.close()
        self.link.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()
