"""Procedures run in the calling thread, on one bus or on several at the same time. Its counterpart is in `aio.py`."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Mapping, Sequence
from math import inf
from typing import Any, Final, Generic, TypeVar

from motorbus.bus.base import IDLE, BaseBus, check_clocks
from motorbus.bus.interrupts import interrupts
from motorbus.bus.jobs import Since
from motorbus.bus.tasks import Notify, TaskTree, starting
from motorbus.core.steps import Runnable
from motorbus.link.stream import wait_any

T = TypeVar("T")

POLL_PERIOD: Final = 0.001
"""s between polls of a link without a descriptor, or of a bus that another thread uses, with several buses."""
LISTEN_TIME: Final = 0.02
"""Longest wait (s) for a notice while holding the turn; then waiting threads get it."""
TURN_TIMEOUT: Final = 0.002
"""Longest wait (s) for the turn of a bus while holding another's: two threads never block each other."""


def run_here(
    bus: BaseBus, procedure: Runnable[T], report: Notify | None = None, *, since: Since | None = None
) -> T:
    """Run a procedure in this thread; the bus may be an asyncio bus.

    `since`: what had happened on the bus when the caller decided; None: as of now.
    """
    with interrupts():
        with starting(procedure):
            part = _Part(bus, procedure, report, since)
        _run_parts([part])
        return part.tree.result()


def run_on(
    procedures: Mapping[Any, Runnable[Any]], since: Mapping[Any, Since] | None = None
) -> dict[BaseBus, Any]:
    """Run a procedure on each bus at the same time: what each returned, or the MotorbusError that it raised.

    An error that is not a MotorbusError, or a signal, cancels all; it is raised after all have cleaned up.
    """
    with interrupts():
        with starting(*procedures.values()):
            check_clocks(procedures)
            sinces = since or {}
            parts = [_Part(bus, procedure, None, sinces.get(bus)) for bus, procedure in procedures.items()]
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
        self.is_sleeping = self.holds_turn = self.blocked = False
        self.cancellations: list[BaseException] = []
        self.tree: TaskTree[T] = TaskTree(
            bus.engine,
            procedure,
            now=bus.link.now,
            report=bus.event_sink(report),
            settled=self._settled,
            since=since,
        )

    def _settled(self) -> None:
        self.news = True
        if self.is_sleeping:
            with self.bus.settled:
                self.bus.settled.notify_all()

    def cancel(self, error: BaseException) -> None:
        """Throw this into the tree when it advances."""
        self.cancellations.append(error)
        self.news = True

    def advance(self, timeout: float) -> bool:
        """Step the tree and send; True when it has ended.

        Does nothing if the turn is not free within `timeout` s (-1: no limit).
        """
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
        """Release the turn if the tree has ended, a stop waits for it, or the bus is idle and not exclusive.

        A tree that waits for a notice keeps it until another thread wants it.
        """
        engine = self.bus.engine
        free = (
            engine.idle
            and engine.exclusive is None
            and (not engine.notification_handlers or self.bus.turn.wanted)
        )
        if self.holds_turn and (self.tree.root.finished or free or self.bus.waits_for_stop):
            self.holds_turn = False
            self.bus.turn.release()

    def wait(self) -> None:
        """Wait for data, a deadline, or the next moment of the tree; without the turn sleep for at most `IDLE`."""
        bus, moment = self.bus, self.tree.next_moment()
        if self.holds_turn:
            listens = bus.engine.idle and bus.engine.notification_handlers and not bus.link.virtual
            bus.receive(min(moment, bus.link.now() + LISTEN_TIME) if listens else moment)
        elif not bus.waits_for_stop:
            self._sleep(min(moment - bus.link.now(), IDLE))
        self.news = True

    def _sleep(self, seconds: float) -> None:
        """Sleep this long, or until something that the tree waits for has ended."""
        with self.bus.settled:
            self.news, self.is_sleeping = False, True
            try:
                self.bus.settled.wait_for(lambda: self.news, max(0.0, seconds))
            finally:
                self.is_sleeping = False


def _run_parts(parts: Sequence[_Part[Any]]) -> None:
    """Run all trees to their end. A signal, or an error that is not a MotorbusError, cancels them; they clean up."""
    signals = interrupts()
    try:
        while True:
            try:
                if not (going := _advance(parts)):
                    return
                # While all buses are idle the handler raises a signal itself. Set it before `pending` is looked at.
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
            if not part.tree.root.finished:  # a signal was raised outside the inner `try`
                with part.bus.turn:
                    part.tree.drop()
            part.release_turn()


def _advance(parts: Sequence[_Part[Any]]) -> list[_Part[Any]]:
    """Step all trees and return the parts that have not ended. Raises an error that is not a MotorbusError."""
    going = []
    for part in parts:
        holds_another = any(other.holds_turn for other in parts if other is not part)
        if not part.advance(TURN_TIMEOUT if holds_another else -1.0):
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
        # one shared clock: read every bus up to the earliest event, first the bus that has it
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
            seconds = min(seconds, POLL_PERIOD)
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
