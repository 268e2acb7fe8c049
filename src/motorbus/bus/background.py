"""A procedure that runs beside those of the callers: the watch over a lease."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

from motorbus.bus.base import BaseBus
from motorbus.bus.running import run_here
from motorbus.bus.tasks import TaskTree
from motorbus.core.steps import Procedure

T = TypeVar("T")


class BackgroundTask(Generic[T]):
    """One procedure on one bus, for which either `along` or `carried` is called, once."""

    def __init__(self, bus: BaseBus, procedure: Callable[[], Procedure[T]]) -> None:
        self._bus = bus
        self._procedure = procedure
        self._tree: TaskTree[Any] | None = None

    def along(self) -> None:
        """Step it whenever the bus is used; for virtual time, which passes only then."""
        bus = self._bus
        with bus.turn:
            self._tree = TaskTree(bus.engine, self._procedure(), now=bus.now, report=bus.event_sink(None))
            bus.background.append(self._tree)

    def hurry(self) -> None:
        """End its sleep; from any thread."""
        if self._tree is not None:
            with self._bus.turn:
                self._tree.end_sleeps()

    def drop(self) -> None:
        """Step it no more."""
        tree = self._tree
        if tree is not None and tree in self._bus.background:
            with self._bus.turn:
                self._bus.background.remove(tree)
                tree.drop()

    def carried(self) -> T:
        """Run it in this thread, beside whatever uses the bus, and return its value. Raises what it raises."""
        return run_here(self._bus, self._procedure())
