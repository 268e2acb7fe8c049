"""The blocking bus: procedures run in the thread that calls, on one bus or on several at the same time."""

from __future__ import annotations

import contextlib
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import inf
from threading import get_ident
from typing import Any, Final, Self, TypeVar

from motorbus.bus.attempt import Attempt
from motorbus.bus.base import IDLE, BaseBus, check_clocks
from motorbus.bus.engine import PENDING
from motorbus.bus.interrupts import ELSEWHERE, INTERRUPTS, MAIN, interrupts
from motorbus.bus.tasks import STEPPING, Notify, Starting, Tree, check_outside, decode
from motorbus.bus.turn import Wake
from motorbus.core.register import shown
from motorbus.core.request import Priority, Request, Response
from motorbus.core.steps import Runnable, discard, gather
from motorbus.errors import LinkError, LinkLost, MotorbusError, RequestError
from motorbus.link.stream import wait_any

T = TypeVar("T")

POLL_PERIOD: Final = 0.001
"""s between polls of a link without a descriptor, or of a bus that another thread uses, with several buses."""
LISTEN_TIME: Final = 0.02
"""Longest wait (s) for a notice while holding the turn; then waiting threads get it."""
TURN_TIMEOUT: Final = 0.002
"""Longest wait (s) for the turn of a bus while holding another's: two threads never block each other."""


class Bus(BaseBus):
    """An open bus. Any number of threads may call `run`; the holder of `turn` alone has requests in flight."""

    is_async = False
    _defers_signals = False

    def run(self, procedure: Runnable[T], report: Notify | None = None) -> T:
        """Run a procedure and return its value; `report` gets its events.

        Raises what the procedure raises; a signal is raised when the procedure has cleaned up.
        """
        since = self.engine.nodes.epoch
        if isinstance(procedure, Request):
            value = self._carry_out(procedure, None, since)
            if value is not PENDING:
                return value  # type: ignore[no-any-return]
        return run_here(self, procedure, report, since)

    def exchange(
        self, requests: Sequence[Request[Any]], tolerated: tuple[type[Exception], ...] = ()
    ) -> list[Any]:
        """Carry out a batch, as a control loop does in every cycle: the values of its requests.

        A request without reply leaves in one write with the next one, where the bus is idle: goals out, positions in.
        An error of a `tolerated` type becomes the value of its request; any other is raised, and requests behind it
        have not been sent.
        """
        _check_requests(requests)
        since = self.engine.nodes.epoch
        order = requests[0] if len(requests) == 2 else None
        if len(requests) == 1 or (order and order.expected == () and type(order.wire) is bytes):
            value: Any
            try:
                value = self._carry_out(requests[-1], order, since)
            except tolerated as error:
                value = error
            if value is not PENDING:
                sent = [decode(order, Response((), (), self.now()))] if order else []
                return [*sent, value]
        return run_here(self, carry_out_batch(requests, tolerated), None, since)

    # -- a single request, without a task ------------------------------------------------------------------------

    def _carry_out(self, request: Request[Any], order: Request[Any] | None, since: int) -> Any:
        """The value of a request that is sent at once, an order without replies in front of it.

        `PENDING` where it cannot be sent at once; nothing was sent then.
        """
        if STEPPING.active:
            check_outside()
        if self.link.virtual:
            self.check_thread()
        signals = INTERRUPTS if get_ident() == MAIN else ELSEWHERE
        signals.depth += 1  # as `with interrupts()`, written out for speed
        try:
            self.turn.acquire(request.priority if order is None else order.priority)
            try:
                attempt = self._start(request, order, since)
                if attempt is None:
                    return PENDING
                value = self._finish(attempt)
                if value is not PENDING:
                    return value
                part = Part(self)
                tree = part.add(request, since=since)
                tree.continue_from(attempt)
                self.hand_over()
            except LinkLost as error:
                self.lost(error)
                raise
            finally:
                self.turn.release()
            run_parts([part], single=True)
            return tree.result()
        finally:
            signals.depth -= 1
            if signals.pending is not None and not signals.depth:
                signals.raise_pending()

    def _start(self, request: Request[Any], order: Request[Any] | None, since: int) -> Attempt | None:
        """Send these at once, or None; the caller holds the turn. Raises what forbids a request without an order."""
        engine, link = self.engine, self.link
        now = link.now()
        if not engine.is_free(now):
            return None
        excluded = engine.put_off(request, now) if engine.sync.out_of_sync else ()
        if excluded is None:
            return None
        if stale := link.read(-inf):  # it cannot answer what has not left
            engine.feed(stale, now)
            self.hand_over()
            return None
        wire: Any = request.wire
        try:
            if request.effect or engine.read_only:
                engine.check(request, since, since, now)
            if order is not None:
                engine.check(order, since, since, now)
        except MotorbusError:
            if order is None:
                raise
            return None  # the task says which one is refused
        if order is not None:
            if order.priority is Priority.STOP:
                engine.note_stop(order)
            first = Attempt(order)
            engine.begin(first, now)
            engine.written(first)
            wire = order.wire + wire
        if request.priority is Priority.STOP:
            engine.note_stop(request)
        attempt = engine.attempt(request)
        attempt.excluded, attempt.task, attempt.direct = excluded, None, True
        attempt.since = attempt.stop_since = since
        attempt.write_until = 0.0
        engine.begin(attempt, now)
        try:
            link.write(wire)
        except LinkLost:
            raise
        except LinkError as error:
            return None if engine.not_written(attempt, error) else attempt
        if engine.window > 1 or not attempt.in_flight:
            engine.written(attempt)
        return attempt

    def _finish(self, attempt: Attempt) -> Any:
        """Wait for the reply to what `_start` sent: its value, or `PENDING` where it needs more than one look."""
        engine, link, request = self.engine, self.link, attempt.request
        if attempt.in_flight:
            chunks = link.read(attempt.deadline)
            if chunks and request.decode_exact is not None and not request.effect and not attempt.excluded:
                if type(chunks[0]) is bytes and (len(chunks) > 1 or len(chunks[0]) != attempt.size):
                    chunks = [self._rest_of(attempt, chunks)]
                if len(chunks) == 1:
                    value = engine.accept(attempt, chunks[0], link.now())
                    if value is not PENDING:
                        return value
            engine.feed(chunks, link.now(), attempt.sent_at)
        if attempt.accepted is None:
            return PENDING
        self.hand_over()
        return decode(request, attempt.accepted)

    def _rest_of(self, attempt: Attempt, chunks: list[Any]) -> bytes:
        """The whole reply, which comes in pieces."""
        data = b"".join(chunks)
        while len(data) < attempt.size and (more := self.link.read(attempt.deadline)):
            data += b"".join(more)  # type: ignore[arg-type]  # a link gives bytes or frames
        return data

    def defer_signals(self) -> None:
        """Raise signals at the end of a request only, until this bus is closed; see `motorbus.bus.interrupts`."""
        if not self._defers_signals:
            self._defers_signals = INTERRUPTS.install()

    def close(self) -> None:
        """Give the port back. Nothing is sent: devices keep doing what they were ordered."""
        self._close_port()
        if self._defers_signals:
            self._defers_signals = False
            INTERRUPTS.uninstall()

    _drop = close

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()


async def carry_out_batch(
    requests: Sequence[Request[Any]], tolerated: tuple[type[Exception], ...]
) -> list[Any]:
    """Carry out these requests: those on different lanes at the same time, others in order."""
    if len({request.lane for request in requests}) > 1:
        return list(await gather(*[_tolerate(request, tolerated) for request in requests]))
    values = []
    for request in requests:
        value = await _tolerate(request, tolerated)
        values.append(value)
    return values


async def _tolerate(request: Request[Any], tolerated: tuple[type[Exception], ...]) -> Any:
    try:
        return await request
    except tolerated as error:
        return error


def exchange_on(
    batches: Mapping[Bus, Sequence[Request[Any]]], tolerated: tuple[type[Exception], ...] = ()
) -> dict[BaseBus, Any]:
    """Carry out a batch on each bus at the same time: the values of each, or its MotorbusError."""
    for requests in batches.values():
        _check_requests(requests)
    if len(batches) > 1:
        return run_on({bus: carry_out_batch(batch, tolerated) for bus, batch in batches.items()})
    found: dict[BaseBus, Any] = {}
    for bus, batch in batches.items():
        try:
            found[bus] = bus.exchange(batch, tolerated)
        except MotorbusError as error:
            found[bus] = error
    return found


def _check_requests(requests: Sequence[Any]) -> None:
    wrong = [one for one in requests if not isinstance(one, Request)]
    if not wrong:
        return
    discard(list(requests))
    raise RequestError(
        f"{shown(wrong[0])} is not a request",
        expected="as bus.exchange([write(goals), sync_read_positions(servos)]): single requests, made before",
        advice="use run() for a procedure; nothing was sent",
    )


def run_here(bus: BaseBus, procedure: Runnable[T], report: Notify | None = None, since: int = -1) -> T:
    """Run a procedure in this thread; it was called at epoch `since`, -1: now."""
    with interrupts():
        with Starting(procedure):
            part = Part(bus)
            tree = part.add(procedure, report, since)
        run_parts([part], single=isinstance(procedure, Request))
        return tree.result()


def run_on(procedures: Mapping[Any, Runnable[Any]]) -> dict[BaseBus, Any]:
    """Run a procedure on each bus at the same time: what each returned, or the MotorbusError that it raised.

    An error that is not a MotorbusError, or a signal, cancels all; it is raised after all have cleaned up.
    """
    with interrupts():
        with Starting(*procedures.values()):
            check_clocks(procedures)
            parts = [Part(bus) for bus in procedures]
            trees = [part.add(procedures[part.bus]) for part in parts]
        run_parts(parts)
        return {part.bus: tree.outcome() for part, tree in zip(parts, trees, strict=True)}


class Part:
    """The procedures of this thread on one bus. `blocked`: another thread had the turn of the bus.

    `sends_at` is when (s) more may be sent. `orders` are carried out when this thread has the turn.
    """

    def __init__(self, bus: BaseBus, wakes: Wake | None = None) -> None:
        bus.check_thread()
        self.bus = bus
        self.wakes = wakes or Wake()
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
        self.wakes.set()

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
        while True:
            going = [tree for tree in self.trees if not tree.advance()]
            self.finished = not going
            if self.finished:
                self.release_turn()
                return True
            self.sends_at = self.bus.send(going)
            if not [tree for tree in going if tree.ready]:
                return False

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
        return min(self.sends_at, *[tree.next_moment() for tree in self.trees])

    def wait(self) -> None:
        """Wait for data, a deadline, or the next moment of a tree; without the turn sleep."""
        bus, moment = self.bus, self.next_moment()
        if self.holds_turn:
            listens = self.is_idle and bus.engine.notification_handlers and not bus.link.virtual
            bus.receive(min(moment, bus.link.now() + LISTEN_TIME) if listens else moment, self.trees)
        elif not self.waits_for_stop:
            self._sleep(min(moment - bus.link.now(), self.longest_sleep))

    @property
    def longest_sleep(self) -> float:
        """s after which it looks at the bus again; the end of exclusive use wakes no thread."""
        return IDLE if self.bus.engine.exclusive is None else LISTEN_TIME

    def _sleep(self, seconds: float) -> None:
        """Sleep this long, or until something that a tree waits for has ended."""
        if not self.orders and not any(tree.ready for tree in self.trees):
            self.wakes.wait(max(0.0, seconds))


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
            part.bus.receive(min(events.values()), part.trees)
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
