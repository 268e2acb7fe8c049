"""The blocking pump: carries out operations in the thread that called.

There is no hidden thread but the stop thread. Policy is in `turns`, waiting and waking in `relay`; here is only how
an operation is begun, and how it is left when its caller is interrupted.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, Self, TypeVar

from motorbus.bus.face import BusFace
from motorbus.bus.look import questions
from motorbus.bus.relay import Relay
from motorbus.bus.run import Notify, Run, taken
from motorbus.bus.ticket import Flight
from motorbus.core.operation import Exchange, Runnable

T = TypeVar("T")


class Bus(BusFace):
    """An open bus, blocking. Any number of threads may call `run`; use it in a `with`."""

    @cached_property
    def relay(self) -> Relay:
        return Relay(self.link, self.turns, self.changed)

    def run(self, operation: Runnable[T], report: Notify | None = None) -> T:
        """Carry out an operation and return its value; `report` gets its events instead of the bus's own listener.

        Raises whatever the operation raises; KeyboardInterrupt after the operation has cleaned up.
        """
        if isinstance(operation, Exchange) and not (operation.effect and questions(self.turns, operation)):
            return self._exchange(operation)
        relay = self.relay
        run = Run(self.turns, operation, now=self.link.now, report=self.listener(report), wake=relay.wake)
        caught: BaseException | None = None
        while True:
            try:
                if caught is not None:
                    relay.recover()
                    run.interrupt(caught)
                while not run.advance():
                    relay.turn()
                break
            except BaseException as interruption:  # dealt with above, where a second one is caught too
                caught = interruption
        return run.result()

    def _exchange(self, exchange: Exchange[T]) -> T:
        """The short path: one exchange needs no run."""
        flight, relay = Flight(exchange), self.relay
        try:
            relay.start(flight)
            while not flight.done:
                relay.turn()
        except BaseException:
            relay.recover()
            with self.turns.lock:
                self.turns.abandon(flight)
            raise
        answer: Any = flight.result()
        value: T = taken(self.turns, exchange, answer)
        return value

    def close(self) -> None:
        """Give the port back. Nothing is sent to the devices: they go on doing what they were told."""
        self._hang_up()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()
