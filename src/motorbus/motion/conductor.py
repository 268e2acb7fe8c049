"""Who carries out work on several buses at once: from one thread, or on an event loop.

Work on one bus goes straight to it, for a control loop does so thousands of times a second.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from motorbus.bus import asynchronous, blocking
from motorbus.bus.aio import AsyncBus
from motorbus.bus.concert import Concert
from motorbus.bus.concert_loop import LoopConcert
from motorbus.bus.pump import Bus
from motorbus.core.operation import Runnable
from motorbus.errors import MotorbusError
from motorbus.motion.abreast import Abreast
from motorbus.motion.safety.blame import raise_blamed

T = TypeVar("T")


class Conductor:
    """Blocking. `origins` are what the clock of each bus showed when the robot's was at 0 (s)."""

    def __init__(self, buses: Mapping[str, Bus], origins: Mapping[str, float]) -> None:
        self._buses = buses
        self._concert = Concert(buses, origins)

    def run(self, work: Abreast[T]) -> T:
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

    def _run(self, work: Abreast[T]) -> T:
        operations = work.operations
        if len(operations) != 1:
            return work.combine(self._run_on(operations))
        ((name, wanted),) = operations.items()
        try:
            told = self._buses[name].run(wanted)
        except MotorbusError as error:
            told = error
        return work.combine({name: told})

    def _run_on(self, operations: Mapping[str, Runnable[Any]]) -> dict[str, Any]:
        if not all(isinstance(bus, blocking.Bus) for bus in self._buses.values()):
            return self._concert.run(operations)
        buses: dict[str, Any] = {name: self._buses[name] for name in operations}
        values = blocking.run_on({buses[name]: wanted for name, wanted in operations.items()})
        return {name: values[bus] for name, bus in buses.items()}


class LoopConductor:
    """On an event loop."""

    def __init__(self, buses: Mapping[str, AsyncBus], origins: Mapping[str, float]) -> None:
        self._buses = buses
        self._concert = LoopConcert(buses, origins)

    async def run(self, work: Abreast[T]) -> T:
        """As `Conductor.run`. A cancelled task first cleans up on every bus, then raises CancelledError."""
        try:
            return await self._run(work)
        except MotorbusError as error:
            raise_blamed(error, self._buses.values())
            raise

    async def _run(self, work: Abreast[T]) -> T:
        operations = work.operations
        if len(operations) != 1:
            return work.combine(await self._run_on(operations))
        ((name, wanted),) = operations.items()
        try:
            told = await self._buses[name].run(wanted)
        except MotorbusError as error:
            told = error
        return work.combine({name: told})

    async def _run_on(self, operations: Mapping[str, Runnable[Any]]) -> dict[str, Any]:
        if not all(isinstance(bus, asynchronous.AsyncBus) for bus in self._buses.values()):
            return await self._concert.run(operations)
        buses: dict[str, Any] = {name: self._buses[name] for name in operations}
        values = await asynchronous.run_on({buses[name]: wanted for name, wanted in operations.items()})
        return {name: values[bus] for name, bus in buses.items()}
