"""The blocking bus: procedures run in the thread that calls."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Mapping, Sequence
from math import inf
from threading import get_ident
from typing import Any, Final, Generic, Self, TypeVar

from motorbus.bus.attempt import Attempt
from motorbus.bus.base import IDLE, BaseBus, check_clocks
from motorbus.bus.interrupts import ELSEWHERE, INTERRUPTS, MAIN, Interrupts, interrupts
from motorbus.bus.jobs import RequestJob, Since
from motorbus.bus.positions import GATED
from motorbus.bus.prepared import Prepared
from motorbus.bus.tasks import Notify, TaskTree
from motorbus.core.entry import shown
from motorbus.core.operation import UNLIKE, Exchange, Operation, Rank, Runnable, Together
from motorbus.errors import LinkError, MotorbusError, RequestError
from motorbus.link.wait import wait_any

T = TypeVar("T")

LOOK: Final = 0.001
"""s between two looks at a link without descriptor, while several buses are waited for."""
SHORT: Final = 0.02
"""s of a wait for a notification, after which other threads may use the bus."""
BRIEF: Final = 0.002
"""s of a wait for the turn of a bus while this thread has that of another."""


class Bus(BaseBus):
    """An open bus. Any number of threads may call `run`; the holder of `turn` alone has requests in flight."""

    _defers_signals = False

    def run(self, procedure: Runnable[T], report: Notify | None = None) -> T:
        """Run a procedure and return its value; `report` gets its events.

        Raises what the procedure raises; a signal is raised when the procedure has cleaned up.
        """
        if isinstance(procedure, Exchange) and not self._needs_reads(procedure):
            return self.transact(procedure)  # type: ignore[no-any-return]
        return run_here(self, procedure, report)

    def transact(self, request: Exchange[Any]) -> Any:
        """Carry out one request."""
        turn = self.turn
        if self.link.virtual:
            self.check_thread()
        signals = INTERRUPTS if get_ident() == MAIN else ELSEWHERE
        since = self.engine.since() if request.effect else None
        signals.depth += 1
        try:
            turn.acquire(request.rank)
            try:
                prepared = self.prepare(request)
                if prepared is not None:
                    return self._receive(prepared, self.write(prepared))
                job = RequestJob(request, since=since)
                self.engine.submit(job, self.link.now())
                return self._finish(job)
            except LinkError as error:
                self._lost(error)
                raise
            finally:
                turn.release()
        finally:
            signals.depth -= 1
            if signals.pending is not None and not signals.depth:
                signals.raise_pending()

    def _receive(self, prepared: Prepared, attempt: Attempt) -> Any:
        """The value of a prepared request that was written."""
        chunks = self.link.read(attempt.deadline)
        value = self.accept(prepared, chunks, attempt.deadline)
        if value is not UNLIKE:
            return value
        job = RequestJob(prepared.exchange)
        self.adopt(prepared, chunks, job)
        return self._finish(job)

    def _finish(self, job: RequestJob) -> Any:
        try:
            while not job.done:
                self.send()
                if job.done:
                    break
                if self.waits_for_stop:
                    self.turn.release()
                    self.turn.acquire(job.priority)
                else:
                    self.receive(inf)
        except BaseException:  # the caller does not wait any more
            self.engine.cancel(job)
            raise
        return job.result()

    def exchange(
        self, requests: Sequence[Exchange[Any]], tolerated: tuple[type[Exception], ...] = ()
    ) -> list[Any]:
        """Carry out a batch, as a control loop does in every cycle: the values of its requests.

        A request without reply leaves in one write with the next one, where the bus is idle: goals out, positions in.
        An error of a `tolerated` type becomes the value of its request; any other is raised, and requests behind it
        have not been sent.
        """
        return self.start(requests).result(tolerated)

    def start(self, requests: Sequence[Exchange[Any]], timeout: float = -1.0) -> Pending:
        """Send a batch, see `exchange`; `Pending.result` gives its values.

        A batch that cannot be sent at once, or for which the bus is not free within `timeout` s (-1: no limit), is sent
        by `result`. Until then the calling thread has the bus, signals are deferred, and the thread uses the bus for
        nothing else.
        """
        if self.link.virtual:
            self.check_thread()
        signals = INTERRUPTS if get_ident() == MAIN else ELSEWHERE
        pending = Pending(self, requests, signals)
        signals.depth += 1
        try:
            if self.turn.acquire(Rank.CONTROL, timeout):
                self._start(pending)
        except LinkError as error:
            self._lost(error)
            raise
        finally:
            if pending.prepared is None:
                pending.release()
        return pending

    def _start(self, pending: Pending) -> None:
        """Write a batch of a prepared request, and an order in front of it, if both may leave now."""
        requests = pending.requests
        _check_requests(requests)
        count = len(requests)
        if count != 1 and not (count == 2 and self._may_join(requests[0])):
            return
        prepared = self.prepare(requests[-1])
        if prepared is None:
            return
        try:
            self.write(prepared, None if count == 1 else requests[0], pending.since)
        except LinkError:
            raise
        except MotorbusError:  # the order is refused: `result` says so
            return
        pending.prepared = prepared

    def _may_join(self, order: Exchange[Any]) -> bool:
        """This order may leave in one write with the next request."""
        if order.replies != ():
            return False
        return order.effect not in GATED or self.interlock is None or not self.interlock.required_reads(order)

    def _needs_reads(self, request: Exchange[Any]) -> bool:
        return request.effect in GATED and bool(self.required_reads(request))

    def defer_signals(self) -> None:
        """Raise signals at the end of a request only, until this bus is closed; see `motorbus.bus.interrupts`."""
        if not self._defers_signals:
            self._defers_signals = INTERRUPTS.install()

    def close(self) -> None:
        """Give the port back. Nothing is sent: devices keep doing what they were ordered."""
        self._hang_up()
        if self._defers_signals:
            self._defers_signals = False
            INTERRUPTS.uninstall()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()


class Pending:
    """A batch that was started. `prepared` is the request whose reply is awaited, None where nothing was sent yet."""

    __slots__ = ("bus", "ended", "prepared", "requests", "signals", "since")

    def __init__(self, bus: Bus, requests: Sequence[Exchange[Any]], signals: Interrupts) -> None:
        self.bus = bus
        self.requests = requests
        self.signals = signals
        self.since = bus.engine.since()
        self.prepared: Prepared | None = None
        self.ended = False

    def release(self) -> None:
        """Give the bus back; raise a signal that came meanwhile."""
        self.bus.turn.release()
        signals = self.signals
        signals.depth -= 1
        if signals.pending is not None and not signals.depth:
            signals.raise_pending()

    def result(self, tolerated: tuple[type[Exception], ...] = ()) -> list[Any]:
        """The values of all requests; an error of a `tolerated` type is the value of its request. Raises others."""
        prepared, bus = self.prepared, self.bus
        if self.ended:
            raise RequestError("result() was called before", advice="start the batch again")
        self.ended = True
        if prepared is None:
            return run_here(bus, carry_out_batch(self.requests, tolerated), since=self.since)
        value: Any
        try:
            value = bus._receive(prepared, prepared.attempt)
        except LinkError as error:
            bus._lost(error)
            raise
        except tolerated as error:
            value = error
        finally:
            self.prepared = None
            self.release()
        return [value] if len(self.requests) == 1 else [None, value]


def carry_out_batch(
    requests: Sequence[Exchange[Any]], tolerated: tuple[type[Exception], ...]
) -> Operation[list[Any]]:
    """Carry out these requests: those on different lanes at the same time, others in order."""
    if len({request.lane for request in requests}) > 1:
        return (yield from Together([_tolerate(request, tolerated) for request in requests]))
    values = []
    for request in requests:
        value = yield from _tolerate(request, tolerated)
        values.append(value)
    return values


def _tolerate(request: Exchange[Any], tolerated: tuple[type[Exception], ...]) -> Operation[Any]:
    try:
        return (yield from request)
    except tolerated as error:
        return error


def exchange_on(
    batches: Mapping[Bus, Sequence[Exchange[Any]]], tolerated: tuple[type[Exception], ...] = ()
) -> dict[BaseBus, Any]:
    """Carry out a batch on each bus at the same time: the values of each, or its MotorbusError."""
    found: dict[BaseBus, Any] = {}
    pending: list[Pending] = []
    with interrupts():
        try:
            for bus, requests in batches.items():
                try:
                    pending.append(bus.start(requests, -1.0 if not pending else BRIEF))
                except MotorbusError as error:
                    found[bus] = error
        finally:
            sent = [one for one in pending if one.prepared is not None]
            for one in sent:
                try:
                    found[one.bus] = one.result(tolerated)
                except Exception as error:
                    found[one.bus] = error
        unsent = [one for one in pending if one not in sent]
        if unsent:
            work = {one.bus: carry_out_batch(one.requests, tolerated) for one in unsent}
            found |= run_on(work, {one.bus: one.since for one in unsent})
    for value in found.values():
        if isinstance(value, Exception) and not isinstance(value, MotorbusError):
            raise value
    return found


def _check_requests(requests: Sequence[Any]) -> None:
    for one in requests:
        if not isinstance(one, Exchange):
            raise RequestError(
                f"{shown(one)} is not a request",
                expected="as bus.exchange([write(goals), sync_read_positions(servos)]): single requests, made before",
                advice="use run() for a procedure; nothing was sent",
            )


def run_here(
    bus: BaseBus, procedure: Runnable[T], report: Notify | None = None, *, since: Since | None = None
) -> T:
    """Run a procedure that was called at `since` (None: now) in this thread, also on a bus of an event loop."""
    with interrupts():
        part = _Part(bus, procedure, report, since)
        _run_parts([part])
        return part.tree.result()


def run_on(
    procedures: Mapping[Bus, Runnable[Any]], since: Mapping[Bus, Since] | None = None
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
    """A procedure on one bus; `news` is set when its tree can go on."""

    def __init__(
        self, bus: BaseBus, procedure: Runnable[T], report: Notify | None, since: Since | None = None
    ) -> None:
        bus.check_thread()
        self.bus = bus
        self.news = True
        self.sleeps = False
        self.holds_turn = self.blocked = False
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

    def take_turn(self, timeout: float = -1.0) -> bool:
        """Take the turn of the bus; False when it was not free within `timeout` s (-1: no limit)."""
        self.holds_turn = self.holds_turn or self.bus.turn.acquire(timeout=timeout)
        return self.holds_turn

    def release_turn(self) -> None:
        """Let other threads use the bus, unless a request is in flight or the bus is used exclusively."""
        engine = self.bus.engine
        free = engine.idle and engine.exclusive is None and (not engine.listeners or self.bus.turn.wanted)
        if self.holds_turn and (self.tree.root.finished or free or self.bus.waits_for_stop):
            self.holds_turn = False
            self.bus.turn.release()

    def advance(self, timeout: float) -> bool:
        """Step the tree and send; True when it has ended. Does nothing if the turn is not free within `timeout` s."""
        if self.tree.root.finished:
            return True
        self.blocked = not self.take_turn(timeout)
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

    def wait(self) -> None:
        """Wait until something comes, a deadline, or a moment that the tree waits for."""
        bus, moment = self.bus, self.tree.next_moment()
        if not self.holds_turn and not bus.waits_for_stop:
            self._sleep(min(moment - bus.link.now(), IDLE))
        elif self.holds_turn:
            listens = bus.engine.idle and bus.engine.listeners and not bus.link.virtual
            bus.receive(min(moment, bus.link.now() + SHORT) if listens else moment)
        self.news = True

    def _sleep(self, seconds: float) -> None:
        """Sleep, at most until a stop ends the sleeps of the tree."""
        if seconds <= 0:
            return
        with self.bus.settled:
            self.news, self.sleeps = False, True
            try:
                self.bus.settled.wait_for(lambda: self.news, seconds)
            finally:
                self.sleeps = False


def _run_parts(parts: Sequence[_Part[Any]]) -> None:
    """Run all trees to their end. An interrupt, or an error that is none of ours, cancels them; they clean up."""
    signals = interrupts()
    try:
        while True:
            try:
                going = [part for part in parts if not part.advance(_turn_timeout(part, parts))]
                if not going:
                    return
                for part in parts:
                    if (error := part.tree.foreign_error()) is not None:
                        raise error
                for part in going:
                    if part.bus.waits_for_stop or not part.bus.link.virtual:
                        part.release_turn()
                signals.waiting = all(part.bus.engine.idle for part in going)
                if signals.pending is not None:
                    signals.waiting = False
                    signals.raise_pending()
                _wait(going)
            except BaseException as error:
                signals.waiting = False
                for part in parts:
                    part.cancellations.append(error)
                    part.news = True
            finally:
                signals.waiting = False
    finally:
        for part in parts:
            if not part.tree.root.finished:  # an error in the lines above
                with part.bus.turn:
                    part.tree.drop()
            if part.holds_turn:
                part.holds_turn = False
                part.bus.turn.release()


def _turn_timeout(part: _Part[Any], parts: Sequence[_Part[Any]]) -> float:
    """s to wait for the turn of a bus: without limit only while this thread has no other, so threads never block."""
    others = any(other.holds_turn for other in parts if other is not part)
    return BRIEF if others else -1.0


def _wait(parts: Sequence[_Part[Any]]) -> None:
    """Wait until one of these can go on."""
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
