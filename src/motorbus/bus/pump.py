"""The blocking pump: carries out operations in the thread that called.

There is no hidden thread but the stop thread. Policy is in `turns`, waiting and waking in `relay`; here is only how
an operation is begun, and how it is left when its caller is interrupted.
"""

from __future__ import annotations

import os
from functools import cached_property
from typing import Any, Self, TypeVar

from motorbus.bus.face import BusFace
from motorbus.bus.look import questions
from motorbus.bus.relay import Relay
from motorbus.bus.run import Notify, Run
from motorbus.bus.straight import cast, fly, usual
from motorbus.bus.volley import volley
from motorbus.core.operation import UNLIKE, Exchange, Runnable

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
        if isinstance(operation, Exchange):
            value = fly(self, operation) if operation.whole is not None else cast(self, operation)
            if value is not UNLIKE:
                return value
            if not (operation.effect and questions(self.turns, operation)):
                return usual(self, operation)
        relay = self.relay
        run = Run(self.turns, operation, now=self.link.now, report=self.listener(report), wake=relay.wake)
        try:
            try:
                while not run.advance():
                    relay.turn()
            except BaseException as interruption:
                relay.clean_up(run, interruption)
        except BaseException as interruption:  # a second one fell between the first and what deals with it
            relay.clean_up(run, interruption)
        return run.result()

    def volley(self, *exchanges: Exchange[Any]) -> list[Any]:
        """Carry out several exchanges in their order, as a control loop does in every cycle; their values.

        What nobody answers leaves in one write with what follows it, where the bus is idle: goals out, positions in.
        Raises the first error as `run` does; what comes behind has not been sent then.
        """
        return volley(self, exchanges)

    def close(self) -> None:
        """Give the port back. Nothing is sent to the devices: they go on doing what they were told."""
        self._hang_up()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()


if os.environ.get("MOTORBUS_ENGINE") == "new":  # until every part runs on it
    from motorbus.bus import blocking

    Bus = blocking.Bus  # type: ignore[assignment, misc]
