"""Procedures run in the calling thread, on one bus or on several at the same time."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Mapping, Sequence
from math import inf
from typing import Any, Final, Generic, TypeVar

from motorbus.bus.base import IDLE, BaseBus, check_clocks
from motorbus.bus.interrupts import interrupts
from motorbus.bus.jobs import Since
from motorbus.bus.tasks import Notify, TaskTree
from motorbus.core.operation import Runnable
from motorbus.link.stream import wait_any

T = TypeVar("T")

LOOK: Final = 0.001
"""s between two looks at a link without descriptor, while several buses are waited for."""
SHORT: Final = 0.02
"""s of a wait for a notification, after which other threads may use the bus."""
BRIEF: Final = 0.002
"""s of a wait for the turn of a bus while this thread has that of another, so that threads never block each other."""


def run_here(
    bus: BaseBus, procedure: Runnable[T], report: Notify | None = None, *, since: Since | None = None
) -> T:
    """Run a procedure that was called at `since` (None: now) in this thread, also on a bus of an event loop."""
    with interrupts():
        part = _Part(bus, procedure, report, since)
        _run_parts([part])
        return part.tree.result()


def run_on(
    procedures: Mapping[Any, Runnable[Any]], since: Mapping[Any, Since] | None = None
) -> dict[BaseBus, Any]:
    """Run a procedure on each bus at the same time: what each returned, or the MotorbusError that it raised.

    Any other error of one of them, and a signal, cancels all; it is raised when all have cleaned up.
    """
    check_clocks(procedures)
    with interrupts():
        moments = since or {}
        parts = [_Part(bus, procedure, None, moments.get(bus)) for bus, procedure in procedures.items()]
        _run_parts(parts)
        return {part.bus: part.tree.outcome() for part in parts}


class _Part(Generic[T]):
    """A procedure on one bus. `news`: its tree can advance. `blocked`: another thread had the turn of the bus.

    `cancellations` are thrown into the tree when this thread has the turn.
    """

    def __init__(
        self, bus: BaseBus, procedure: Runnable[T], report: Notify | None, since: Since | None
    ) -> None:
        bus.check_thread()
        self.bus = bus
        self.news = True
        self.sleeps = self.holds_turn = self.blocked = False
        self.cancellations: list[BaseException] = []
        self.tree: TaskTree[T] = TaskTree(
            bus.engine,
            procedure,
            now=bus.link.now,
            report=bus.listener(report),
            settled=self._settled,
            since=since,
        )

    def _settled(self) -> None:
        self.news = True
        if self.sleeps:
            with self.bus.settled:
                self.bus.settled.notify_all()

    def cancel(self, error: BaseException) -> None:
        """Throw this into the tree when it advances."""
        self.cancellations.append(error)
        self.news = True

    def advance(self, timeout: float) -> bool:
        """Step the tree and send; True when it has ended. Does nothing if the turn is not free within `timeout` s."""
        if self.tree.root.finished:
            return True
        self.holds_turn = self.holds_turn or self.bus.turn.acquire(timeout=timeout)
        self.blocked = not self.holds_turn
        if self.blocked:
            return False
        while self.cancellations:
            self.tree.cancel(self.cancellations.pop(0))
        while self.news and not self.tree.root.finished:
            self.news = False
            if not self.tree.advance():
                self.bus.send()
        if self.tree.root.finished:
            self.release_turn()
        return self.tree.root.finished

    def release_turn(self) -> None:
        """Let other threads use the bus, unless a request is in flight or the bus is used exclusively."""
        engine = self.bus.engine
        free = engine.idle and engine.exclusive is None and (not engine.listeners or self.bus.turn.wanted)
        if self.holds_turn and (self.tree.root.finished or free or self.bus.waits_for_stop):
            self.holds_turn = False
            self.bus.turn.release()

    def wait(self) -> None:
        """Wait until something comes, a deadline, or a moment that the tree waits for."""
        bus, moment = self.bus, self.tree.next_moment()
        if self.holds_turn:
            listens = bus.engine.idle and bus.engine.listeners and not bus.link.virtual
            bus.receive(min(moment, bus.link.now() + SHORT) if listens else moment)
        elif not bus.waits_for_stop:
            self._sleep(min(moment - bus.link.now(), IDLE))
        self.news = True

    def _sleep(self, seconds: float) -> None:
        """Sleep, at most until a stop ends the sleeps of the tree."""
        with self.bus.settled:
            self.news, self.sleeps = False, True
            try:
                self.bus.settled.wait_for(lambda: self.news, max(0.0, seconds))
            finally:
                self.sleeps = False


def _run_parts(parts: Sequence[_Part[Any]]) -> None:
    """Run all trees to their end. An interrupt, or an error that is none of ours, cancels them; they clean up."""
    signals = interrupts()
    try:
        while True:
            try:
                if not (going := _advance(parts)):
                    return
                signals.waiting = all(part.bus.engine.idle for part in going)
                if signals.pending is not None:
                    signals.waiting = False
                    signals.raise_pending()
                _wait(going)
            except BaseException as error:
                for part in parts:
                    part.cancel(error)
            finally:
                signals.waiting = False
    finally:
        for part in parts:
            if not part.tree.root.finished:  # an error in the lines above
                with part.bus.turn:
                    part.tree.drop()
            part.release_turn()


def _advance(parts: Sequence[_Part[Any]]) -> list[_Part[Any]]:
    """Step all trees; those that have not ended. An error that is none of ours is raised."""
    going = []
    for part in parts:
        holds_another = any(other.holds_turn for other in parts if other is not part)
        if not part.advance(BRIEF if holds_another else -1.0):
            going.append(part)
    for part in parts:
        if (error := part.tree.foreign_error()) is not None:
            raise error
    for part in going:
        if part.bus.waits_for_stop or not part.bus.link.virtual:
            part.release_turn()
    return going


def _wait(parts: Sequence[_Part[Any]]) -> None:
    """Wait until one of these can advance."""
    if len(parts) == 1:
        parts[0].wait()
    elif all(part.bus.link.virtual for part in parts):
        events = {part: part.bus.next_event(part.tree.next_moment()) for part in parts}
        for part in sorted(parts, key=events.__getitem__):
            part.bus.receive(min(events.values()))
            part.news = True
    else:
        _poll(parts)


def _poll(parts: Sequence[_Part[Any]]) -> None:
    """One wait on the descriptors of all links, then take what has come."""
    descriptors, seconds = [], IDLE
    for part in parts:
        descriptor = part.bus.link.fileno()
        if part.blocked or (part.holds_turn and descriptor is None):
            seconds = min(seconds, LOOK)
        elif part.holds_turn and descriptor is not None:
            descriptors.append(descriptor)
        moment = min(part.tree.next_moment(), part.bus.engine.next_deadline())
        seconds = min(seconds, max(0.0, moment - part.bus.link.now()))
    if descriptors:
        with contextlib.suppress(OSError, ValueError):  # closed or lost: `receive` says so
            wait_any(descriptors, seconds)
    else:
        time.sleep(seconds)
    for part in parts:
        if part.holds_turn:
            part.bus.receive(-inf)
        part.news = True
