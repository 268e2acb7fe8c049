"""The blocking bus: procedures run in the thread that calls."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from math import inf
from select import POLLIN, poll
from threading import get_ident
from typing import Any, Final, Generic, Self, TypeVar

from motorbus.bus.attempt import Attempt
from motorbus.bus.base import IDLE, BaseBus, check_clocks
from motorbus.bus.interrupts import ELSEWHERE, INTERRUPTS, MAIN, Interrupts, interrupts
from motorbus.bus.jobs import RequestJob
from motorbus.bus.positions import GATED
from motorbus.bus.prepared import Prepared
from motorbus.bus.tasks import Notify, TaskTree
from motorbus.core.entry import shown
from motorbus.core.operation import UNLIKE, Exchange, Operation, Rank, Runnable, Together
from motorbus.errors import LinkError, MotorbusError, RequestError

T = TypeVar("T")

LOOK: Final = 0.001
"""s between two looks at a link without descriptor, while several buses are waited for."""


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
        stops = self.engine.positions.stops_for(request) if request.effect in GATED else None
        signals.depth += 1
        try:
            turn.acquire(request.rank)
            try:
                prepared = self.prepare(request)
                if prepared is not None:
                    return self._receive(prepared, self.write(prepared))
                job = RequestJob(request, losses=self.engine.losses)
                job.stops = stops
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
        job = RequestJob(prepared.exchange, losses=self.engine.losses)
        self.adopt(prepared, chunks, job)
        return self._finish(job)

    def _finish(self, job: RequestJob) -> Any:
        while not job.done:
            self.send()
            if job.done:
                break
            if self.waits_for_stop:
                self.turn.release()
                self.turn.acquire(job.priority)
            else:
                self.receive(inf)
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

    def start(self, requests: Sequence[Exchange[Any]]) -> Pending:
        """Send a batch, see `exchange`; `Pending.result` gives its values.

        A batch that cannot be sent at once is sent by `result`. Until then the calling thread has the bus, signals are
        deferred, and the thread uses the bus for nothing else.
        """
        if self.link.virtual:
            self.check_thread()
        signals = INTERRUPTS if get_ident() == MAIN else ELSEWHERE
        pending = Pending(self, requests, signals)
        signals.depth += 1
        self.turn.acquire(Rank.CONTROL)
        try:
            count = len(requests)
            prepared = None
            if 1 <= count <= 2 and isinstance(requests[-1], Exchange):
                prepared = self.prepare(requests[-1])
            if prepared is None or (count == 2 and not self._may_join(requests[0])):
                _check_requests(requests)
            else:
                self.write(prepared, requests[0] if count == 2 else None)
                pending.prepared = prepared
        except LinkError as error:
            self._lost(error)
            raise
        finally:
            if pending.prepared is None:
                pending.release()
        return pending

    def _may_join(self, order: Exchange[Any]) -> bool:
        """This order may leave in one write with the next request."""
        if order.replies != ():
            return False
        return (
            order.effect not in GATED or self._interlock is None or not self._interlock.required_reads(order)
        )

    def _needs_reads(self, request: Exchange[Any]) -> bool:
        return request.effect in GATED and bool(self.required_reads(request))

    def defer_signals(self) -> None:
        """Raise signals at the end of a request only, until this bus is closed; see `motorbus.bus.interrupts`."""
        if not self._defers_signals:
            self._defers_signals = True
            INTERRUPTS.install()

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

    __slots__ = ("bus", "prepared", "requests", "signals")

    def __init__(self, bus: Bus, requests: Sequence[Exchange[Any]], signals: Interrupts) -> None:
        self.bus = bus
        self.requests = requests
        self.signals = signals
        self.prepared: Prepared | None = None

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
        if prepared is None:
            return bus.run(carry_out_batch(self.requests, tolerated))
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
                    pending.append(bus.start(requests))
                except MotorbusError as error:
                    found[bus] = error
            unsent = [one for one in pending if one.prepared is None]
            if unsent:
                found |= run_on({one.bus: carry_out_batch(one.requests, tolerated) for one in unsent})
        finally:
            for one in pending:
                if one.prepared is not None:
                    try:
                        found[one.bus] = one.result(tolerated)
                    except Exception as error:
                        found[one.bus] = error
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


def run_here(bus: BaseBus, procedure: Runnable[T], report: Notify | None = None) -> T:
    """Run a procedure in this thread, also on a bus of an event loop; see `Bus.run`."""
    with interrupts():
        part = _Part(bus, procedure, report)
        _run_parts([part])
        return part.tree.result()


def run_on(procedures: Mapping[Bus, Runnable[Any]]) -> dict[BaseBus, Any]:
    """Run a procedure on each bus at the same time: what each returned, or the MotorbusError that it raised.

    Any other error of one of them, and a signal, cancels all; it is raised when all have cleaned up.
    """
    check_clocks(procedures)
    with interrupts():
        parts = [_Part(bus, procedure, None) for bus, procedure in procedures.items()]
        _run_parts(parts)
        return {part.bus: part.tree.outcome() for part in parts}


class _Part(Generic[T]):
    """A procedure on one bus; `news` is set when its tree can go on."""

    def __init__(self, bus: BaseBus, procedure: Runnable[T], report: Notify | None) -> None:
        bus.check_thread()
        self.bus = bus
        self.news = True
        self.sleeps = False
        self.holds_turn = False
        self.tree: TaskTree[T] = TaskTree(
            bus.engine, procedure, now=bus.link.now, report=bus.listener(report), settled=self._settled
        )

    def _settled(self) -> None:
        self.news = True
        if self.sleeps:
            with self.bus.settled:
                self.bus.settled.notify_all()

    def take_turn(self) -> None:
        if not self.holds_turn:
            self.bus.turn.acquire()
            self.holds_turn = True

    def release_turn(self) -> None:
        """Let other threads use the bus, unless a request is in flight or the bus is used exclusively."""
        engine = self.bus.engine
        free = engine.idle and engine.exclusive is None and not engine.listeners
        if self.holds_turn and (free or self.bus.waits_for_stop):
            self.holds_turn = False
            self.bus.turn.release()

    def advance(self) -> bool:
        """Step the tree and send; True when it has ended."""
        if self.tree.root.finished:
            return True
        self.take_turn()
        while self.news and not self.tree.root.finished:
            self.news = False
            if not self.tree.advance():
                self.bus.send()
        return self.tree.root.finished

    @property
    def only_sleeps(self) -> bool:
        """It waits for nothing but a moment."""
        return self.bus.engine.idle and not self.bus.engine.listeners

    def wait(self) -> None:
        """Wait until something comes, a deadline, or a moment that the tree waits for."""
        bus, moment = self.bus, self.tree.next_moment()
        if bus.waits_for_stop:
            self.release_turn()
        elif self.only_sleeps and not bus.link.virtual:
            self.release_turn()
            self._sleep(min(moment - bus.link.now(), IDLE))
        else:
            bus.receive(moment)
        self.news = True

    def _sleep(self, seconds: float) -> None:
        """Sleep, at most until a stop ends the sleeps of the tree."""
        if self.holds_turn or seconds <= 0:
            time.sleep(max(0.0, seconds))
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
                going = [part for part in parts if not part.advance()]
                if not going:
                    return
                for part in parts:
                    if (error := part.tree.foreign_error()) is not None:
                        raise error
                signals.waiting = all(part.bus.engine.idle for part in going)
                signals.raise_pending()
                _wait(going)
            except BaseException as error:
                for part in parts:
                    if not part.tree.root.finished:
                        part.take_turn()
                        part.tree.cancel(error)
                        part.news = True
            finally:
                signals.waiting = False
    finally:
        for part in parts:
            if part.holds_turn:
                part.holds_turn = False
                part.bus.turn.release()


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
    waiter, seconds = poll(), IDLE
    for part in parts:
        part.release_turn()
        descriptor = part.bus.link.fileno()
        if descriptor is None:
            seconds = min(seconds, LOOK)
        else:
            waiter.register(descriptor, POLLIN)
        moment = min(part.tree.next_moment(), part.bus.engine.next_deadline())
        seconds = min(seconds, max(0.0, moment - part.bus.link.now()))
    waiter.poll(1000 * seconds)
    for part in parts:
        if part.holds_turn:
            part.bus.receive(-inf)
        part.news = True
