"""Who carries out work on several buses at once: from one thread, or on an event loop."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Any, TypeVar

from motorbus.bus.aio import AsyncBus
from motorbus.bus.pump import Bus
from motorbus.core.operation import Runnable
from motorbus.errors import MotorbusError
from motorbus.motion.abreast import Abreast

T = TypeVar("T")


class Conductor:
    """Blocking."""

    def __init__(self, buses: Mapping[str, Bus], origins: Mapping[str, float]) -> None:
        self._buses = buses
        self._origins = origins

    def run(self, work: Abreast[T]) -> T:
        """Carry out everything, then combine."""
        return work.combine({name: self._one(name, wanted) for name, wanted in work.operations.items()})

    def _one(self, name: str, wanted: Runnable[Any]) -> Any:
        try:
            return self._buses[name].run(wanted)
        except MotorbusError as error:
            return error


class LoopConductor:
    """On an event loop."""

    def __init__(self, buses: Mapping[str, AsyncBus], origins: Mapping[str, float]) -> None:
        self._buses = buses
        self._origins = origins

    async def run(self, work: Abreast[T]) -> T:
        """Carry out everything, then combine."""
        told = await asyncio.gather(*(self._one(name, wanted) for name, wanted in work.operations.items()))
        return work.combine(dict(zip(work.operations, told, strict=True)))

    async def _one(self, name: str, wanted: Runnable[Any]) -> Any:
        try:
            return await self._buses[name].run(wanted)
        except MotorbusError as error:
            return error
