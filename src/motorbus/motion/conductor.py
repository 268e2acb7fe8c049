"""Who carries out work on several buses at once: from one thread, or on an event loop.

Work on one bus goes straight to it, for a control loop does so thousands of times a second.
"""

from __future__ import annotations

from collections.abc import Coroutine, Mapping
from typing import Any, TypeVar

from motorbus.bus import aio, running
from motorbus.bus.aio import AsyncBus
from motorbus.bus.blocking import Bus
from motorbus.errors import MotorbusError
from motorbus.motion.parallel import Parallel
from motorbus.motion.safety.blame import raise_blamed

T = TypeVar("T")


class Conductor:
    """Blocking."""

    def __init__(self, buses: Mapping[str, Bus]) -> None:
        self._buses = buses

    def run(self, work: Parallel[T]) -> T:
        """Carry out everything, then combine.

        Raises what `combine` raises, and Refused for what was ended because the lease was lost. Whatever is no
        MotorbusError, KeyboardInterrupt included, interrupts the work on every bus and is raised when all of it has
        cleaned up.
        """
        try:
            return self._run(work)
        except MotorbusError as error:
            raise_blamed(error, self._buses.values())
            raise

    def _run(self, work: Parallel[T]) -> T:
        procedures = work.operations
        if len(procedures) != 1:
            values = running.run_on({self._buses[name]: wanted for name, wanted in procedures.items()})
            return work.combine({name: values[self._buses[name]] for name in procedures})
        ((name, wanted),) = procedures.items()
        try:
            told = self._buses[name].run(wanted)
        except MotorbusError as error:
            told = error
        return work.combine({name: told})


class LoopConductor:
    """On an event loop."""

    def __init__(self, buses: Mapping[str, AsyncBus]) -> None:
        self._buses = buses

    def run(self, work: Parallel[T]) -> Coroutine[Any, Any, T]:
        """As `Conductor.run`. A cancelled task first cleans up on every bus, then raises CancelledError."""
        return self._run_owned(work, aio.Owned(tuple(work.operations.values())))

    async def _run_owned(self, work: Parallel[T], owned: aio.Owned) -> T:
        try:
            return await self._run(work)
        except MotorbusError as error:
            raise_blamed(error, self._buses.values())
            raise

    async def _run(self, work: Parallel[T]) -> T:
        procedures = work.operations
        if len(procedures) != 1:
            values = await aio.run_on({self._buses[name]: wanted for name, wanted in procedures.items()})
            return work.combine({name: values[self._buses[name]] for name in procedures})
        ((name, wanted),) = procedures.items()
        try:
            told = await self._buses[name].run(wanted)
        except MotorbusError as error:
            told = error
        return work.combine({name: told})
