"""Procedures run in the calling thread, on one bus or on several at the same time."""

from __future__ import annotations

import contextlib
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import inf
from queue import Empty, SimpleQueue
from typing import Any, Final, TypeVar

from motorbus.bus.base import IDLE, BaseBus, check_clocks
from motorbus.bus.interrupts import interrupts
from motorbus.bus.tasks import Notify, Tree, starting
from motorbus.core.request import Request
from motorbus.core.steps import Runnable
from motorbus.link.stream import wait_any

T = TypeVar("T")

POLL_PERIOD: Final = 0.001
"""s between polls of a link without a descriptor, or of a bus that another thread uses, with several buses."""
LISTEN_TIME: Final = 0.02
"""Longest wait (s) for a notice while holding the turn; then waiting threads get it."""
TURN_TIMEOUT: Final = 0.002
"""Longest wait (s) for the turn of a bus while holding another's: two threads never block each other."""


def run_here(bus: BaseBus, procedure: Runnable[T], report: Notify | None = None, since: int = -1) -> T:
    """Run a procedure in this thread; it was called at epoch `since`, -1: now."""
    with interrupts():
        with starting(procedure):
            part = Part(bus)
            tree = part.add(procedure, report, since)
        run_parts([part], single=isinstance(procedure, Request))
        return tree.result()


def run_on(procedures: Mapping[Any, Runnable[Any]]) -> dict[BaseBus, Any]:
    """Run a procedure on each bus at the same time: what each returned, or the MotorbusError that it raised.

    An error that is not a MotorbusError, or a signal, cancels all; it is raised after all have cleaned up.
    """
    with interrupts():
        with starting(*procedures.values()):
            check_clocks(procedures)
            parts = [Part(bus) for bus in procedures]
            trees = [part.add(procedures[part.bus]) for part in parts]
        run_parts(parts)
        return {part.bus: tree.outcome() for part, tree in zip(parts, trees, strict=True)}


class Part:
    """The procedures of this thread on one bus. `blocked`: another thread had the turn of the bus.

    `sends_at` is when (s) more may be sent. `orders` are carried out when this thread has the turn. An entry of
    `wakes` ends a sleep.
    """

    def __init__(self, bus: BaseBus, wakes: SimpleQueue[None] | None = None) -> None:
        bus.check_thread()
        self.bus = bus
        self.wakes: SimpleQueue[None] = wakes or SimpleQueue()
        self.trees: list[Tree[Any]] = []
        self.finished = True
        """Every procedure had ended after the last `advance`."""
        self.holds_turn = self.blocked = False
        self.sends_at = inf
        self.orders: deque[Callable[[], None]] = deque()

    def add(self, procedure: Runnable[T], report: Notify | None = None, since: int = -1) -> Tree[T]:
        """Run this procedure, too."""
        bus = self.bus
        tree: Tree[T] = Tree(
            bus.engine,
            procedure,
            now=bus.link.now,
            report=bus.event_sink(report),
            wake=self.wake,
            since=since,
        )
        self.trees.append(tree)
        self.finished = False
        return tree

    def wake(self) -> None:
        """End `_sleep`; from any thread."""
        if self.wakes.empty():
            self.wakes.put(None)

    def advance(self, timeout: float) -> bool:
        """Step the trees and send; True when all have ended.

        Does nothing if the turn is not free within `timeout` s (-1: no limit).
        """
        self.holds_turn = self.holds_turn or self.bus.turn.acquire(timeout=timeout)
        self.blocked = not self.holds_turn
        if self.blocked:
            return False
        while self.orders:
            self.orders.popleft()()
        stepped = self._stepped
        while True:
            for tree in stepped:
                tree.advance()
            self.finished = all(tree.finished for tree in self.trees)
            if self.finished:
                self.release_turn()
                return True
            self.sends_at = self.bus.send(stepped)
            if not any(tree.ready for tree in stepped):
                return False

    @property
    def _stepped(self) -> list[Tree[Any]]:
        """Its procedures, and what watches the bus in virtual time."""
        return [*self.trees, *self.bus.watches] if self.bus.watches else self.trees

    def cancel(self, error: BaseException) -> None:
        """Throw this into every procedure; the caller has the turn."""
        for tree in self.trees:
            tree.cancel(error)

    @property
    def waits_for_stop(self) -> bool:
        """An emergency stop in another thread needs the turn, and nothing is in flight."""
        return self.bus.engine.stopping and not self.bus.engine.in_flight

    @property
    def is_idle(self) -> bool:
        """Nothing is in flight, and nothing of it may be sent: it sleeps, or another thread has exclusive use."""
        return not self.bus.engine.in_flight and self.sends_at == inf

    def release_turn(self) -> None:
        """Release the turn if all has ended, a stop waits for it, or the bus is idle.

        A tree that waits for a notice keeps it until another thread wants it.
        """
        if not self.holds_turn:
            return
        listens = self.bus.engine.notification_handlers and not self.bus.turn.wanted
        if self.finished or self.waits_for_stop or (not listens and self.is_idle):
            self.holds_turn = False
            self.bus.turn.release()

    def next_moment(self) -> float:
        """When (s) a tree can go on by itself, or more may be sent."""
        return min(self.sends_at, *[tree.next_moment() for tree in self._stepped])

    def wait(self) -> None:
        """Wait for data, a deadline, or the next moment of a tree; without the turn sleep."""
        bus, moment = self.bus, self.next_moment()
        if self.holds_turn:
            listens = self.is_idle and bus.engine.notification_handlers and not bus.link.virtual
            bus.receive(min(moment, bus.link.now() + LISTEN_TIME) if listens else moment, self._stepped)
        elif not self.waits_for_stop:
            self._sleep(min(moment - bus.link.now(), self.longest_sleep))

    @property
    def longest_sleep(self) -> float:
        """s after which it looks at the bus again; the end of exclusive use wakes no thread."""
        return IDLE if self.bus.engine.exclusive is None else LISTEN_TIME

    def _sleep(self, seconds: float) -> None:
        """Sleep this long, or until something that a tree waits for has ended."""
        if not self.orders and not any(tree.ready for tree in self.trees):
            with contextlib.suppress(Empty):
                self.wakes.get(timeout=max(0.0, seconds))


def run_parts(parts: Sequence[Part], *, single: bool = False) -> None:
    """Run all trees to their end. A signal, or an error that is not a MotorbusError, cancels them; they clean up.

    With `single`, of a single request, signals wait for its end.
    """
    signals = interrupts()
    try:
        while True:
            try:
                if not (going := _advance(parts)):
                    return
                # While all buses are idle the handler raises a signal itself. Set it before `pending` is looked at.
                signals.waiting = not single and all(part.is_idle for part in going)
                if signals.pending is not None and not single:
                    signals.waiting = False
                    signals.raise_pending()
                wait_for(going)
            except BaseException as error:
                for part in parts:
                    part.orders.append(partial(part.cancel, error))
            finally:
                signals.waiting = False
    finally:
        for part in parts:
            for tree in part.trees:
                if not tree.finished:  # a signal was raised outside the inner `try`
                    with part.bus.turn:
                        tree.drop()
            part.release_turn()


def _advance(parts: Sequence[Part]) -> list[Part]:
    """Step all trees and return the parts that have not ended. Raises an error that is not a MotorbusError."""
    going = []
    for part in parts:
        if part.finished:
            continue
        holds_another = len(parts) > 1 and any(other.holds_turn for other in parts if other is not part)
        if not part.advance(TURN_TIMEOUT if holds_another else -1.0):
            going.append(part)
    for tree in [tree for part in parts for tree in part.trees] if going else ():
        if tree.finished and (error := tree.foreign_error()) is not None:
            raise error
    for part in going:
        if part.waits_for_stop or not part.bus.link.virtual:
            part.release_turn()
    return going


def wait_for(parts: Sequence[Part]) -> None:
    """Wait until one of these can advance."""
    if len(parts) == 1:
        parts[0].wait()
    elif all(part.bus.link.virtual for part in parts):
        # one shared clock: read every bus up to the earliest event, first the bus that has it
        events = {part: part.bus.next_event(part.next_moment()) for part in parts}
        for part in sorted(parts, key=events.__getitem__):
            part.bus.receive(min(events.values()), part._stepped)
    else:
        _poll(parts)


def _poll(parts: Sequence[Part]) -> None:
    """One wait on the descriptors of all links, then take what has come."""
    descriptors, seconds = [], min(part.longest_sleep for part in parts)
    for part in parts:
        descriptor = part.bus.link.fileno()
        if part.blocked or (part.holds_turn and descriptor is None):
            seconds = min(seconds, POLL_PERIOD)
        elif part.holds_turn and descriptor is not None:
            descriptors.append(descriptor)
        moment = min(part.next_moment(), part.bus.engine.next_deadline())
        seconds = min(seconds, max(0.0, moment - part.bus.link.now()))
    if descriptors:
        with contextlib.suppress(OSError, ValueError):  # closed or lost: `receive` says so
            wait_any(descriptors, seconds)
    else:
        time.sleep(seconds)
    for part in parts:
        if part.holds_turn:
            part.bus.receive(-inf, part.trees)
