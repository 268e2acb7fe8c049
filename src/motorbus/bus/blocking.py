"""The blocking bus: procedures run in the thread that calls."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from math import inf
from select import POLLIN, poll
from threading import get_ident
from typing import Any, Final, Generic, Self, TypeVar

from motorbus.bus.attempt import Attempt
from motorbus.bus.base import IDLE, BaseBus
from motorbus.bus.interrupts import ELSEWHERE, INTERRUPTS, MAIN, interrupts
from motorbus.bus.jobs import RequestJob
from motorbus.bus.policy import carry_out
from motorbus.bus.positions import GATED
from motorbus.bus.prepared import Prepared
from motorbus.bus.tasks import Notify, TaskTree
from motorbus.bus.trace import TraceRecord
from motorbus.core.entry import shown
from motorbus.core.operation import UNLIKE, Data, Exchange, Runnable
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
        if isinstance(procedure, Exchange) and not (
            procedure.effect in GATED and self.required_reads(procedure)
        ):
            return self.transact(procedure)  # type: ignore[no-any-return]
        return run_here(self, procedure, report)

    def transact(self, request: Exchange[Any]) -> Any:
        """Carry out one request."""
        engine, link, turn = self.engine, self.link, self.turn
        if link.virtual:
            self.check_thread()
        signals = INTERRUPTS if get_ident() == MAIN else ELSEWHERE
        stops = engine.positions.stops_for(request) if request.effect in GATED else None
        signals.depth += 1
        try:
            turn.acquire(request.rank)
            try:
                prepared: Prepared | None = request.course
                if prepared is None or prepared.engine is not engine:
                    return self._carry_out(request, stops)
                if not engine.ready and not engine.check_ready():
                    return self._carry_out(request, stops)
                single = prepared.single
                if single is not None and single.length == prepared.length:
                    prepared = prepared.alternate
                if engine.sync.out_of_sync and not engine.sync.out_of_sync.isdisjoint(prepared.nodes):
                    return self._carry_out(request, stops)
                if prepared.timing != engine.timing:
                    engine.measure(prepared)
                if stale := link.read(-inf):
                    engine.feed(stale, link.now())
                    return self._carry_out(request, stops)
                now = link.now()
                if now < engine.free_at:
                    return self._carry_out(request, stops)
                attempt = prepared.attempt
                attempt.sent_at = now
                attempt.deadline = deadline = now + prepared.budget
                engine.in_flight[prepared.lane] = attempt
                if engine.trace.subscriptions:
                    engine.trace.put(TraceRecord(now, "tx", prepared.wire))
                link.write(prepared.wire)
                chunks = link.read(deadline)
                if len(chunks) == 1:
                    at = link.now()
                    if at > deadline:  # the host was late
                        at = deadline
                    value = prepared.decode(chunks[0], at)
                    if value is not UNLIKE:
                        if engine.trace.subscriptions:
                            engine.trace.put(TraceRecord(at, "rx", chunks[0]))
                        engine.accepted(prepared, chunks[0], at)
                        return value
                return self._continue(prepared, chunks)
            except LinkError as error:
                self._lost(error)
                raise
            finally:
                turn.release()
        finally:
            signals.depth -= 1
            if signals.pending is not None and not signals.depth:
                signals.raise_pending()

    def _carry_out(self, request: Exchange[Any], stops: int | None) -> Any:
        """One request by the general path. The caller holds the turn."""
        engine = self.engine
        if request.whole is not None and getattr(request.course, "engine", None) is not engine:
            request.course = engine.prepare(request)
        job = RequestJob(request, losses=engine.losses)
        job.stops = stops
        engine.submit(job, self.link.now())
        return self._finish(job)

    def _continue(self, prepared: Prepared, chunks: Sequence[Data]) -> Any:
        """The reply to a prepared request is in pieces, damaged or missing: go on by the general path."""
        engine, attempt, request = self.engine, prepared.attempt, prepared.exchange
        prepared.attempt = Attempt(request, None)
        job = RequestJob(request, losses=engine.losses)
        job.policy = carry_out(engine, request)
        job.policy.send(None)  # up to the attempt that is in flight
        attempt.job = job
        engine.adopt(attempt)
        engine.feed(chunks, self.link.now(), attempt.sent_at)
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

    def volley(self, *requests: Exchange[Any]) -> list[Any]:
        """Carry out several requests in order, as a control loop does in every cycle; their values.

        A request without reply leaves in one write with the next one, where the bus is idle: goals out, positions in.
        Raises the first error; requests behind it have not been sent then.
        """
        return self.exchange(requests)

    def exchange(
        self, requests: Sequence[Exchange[Any]], forgiven: tuple[type[Exception], ...] = ()
    ) -> list[Any]:
        """`volley`; an error of a `forgiven` type becomes the value of its request."""
        _check_requests(requests)
        if len(requests) == 2:
            try:
                value = self._burst(requests[0], requests[1])
            except LinkError:
                raise
            except forgiven as error:
                return [None, error]
            if value is not UNLIKE:
                return [None, value]
        values: list[Any] = []
        for request in requests:
            try:
                values.append(self.run(request))
            except forgiven as error:
                values.append(error)
        return values

    def _burst(self, order: Exchange[Any], question: Exchange[Any]) -> Any:
        """Send an order without reply and a prepared request in one write; UNLIKE when nothing was sent."""
        engine, link = self.engine, self.link
        prepared: Prepared | None = question.course
        if order.replies != () or prepared is None or prepared.engine is not engine:
            return UNLIKE
        if order.effect in GATED and self.required_reads(order):
            return UNLIKE
        with self.turn:
            if not engine.ready and not engine.check_ready():
                return UNLIKE
            single = prepared.single
            if single is not None and single.length == prepared.length:
                prepared = prepared.alternate
            now = link.now()
            if engine.sync.out_of_sync and not engine.sync.out_of_sync.isdisjoint(prepared.nodes):
                return UNLIKE
            if now < engine.free_at or link.read(-inf):
                return UNLIKE
            if prepared.timing != engine.timing:
                engine.measure(prepared)
            engine.time = now
            engine.check(RequestJob(order, losses=engine.losses))
            try:
                return self._send_burst(order, prepared, now)
            except LinkError as error:
                self._lost(error)
                raise

    def _send_burst(self, order: Exchange[Any], prepared: Prepared, now: float) -> Any:
        engine, link, attempt = self.engine, self.link, prepared.attempt
        engine.positions.sent(order)
        engine.statistics.asked(order.replies)
        start = now + engine.air_time(order)
        attempt.sent_at = start if engine.paced else now
        attempt.deadline = deadline = start + prepared.budget
        engine.free_at = start
        engine.in_flight[prepared.lane] = attempt
        wire: Any = order.request
        if engine.trace.subscriptions:
            engine.trace.put(TraceRecord(now, "tx", wire))
            engine.trace.put(TraceRecord(now, "tx", prepared.wire))
        link.write(wire + prepared.wire)
        chunks = link.read(deadline)
        if len(chunks) == 1:
            at = min(link.now(), deadline)
            value = prepared.decode(chunks[0], at)
            if value is not UNLIKE:
                if engine.trace.subscriptions:
                    engine.trace.put(TraceRecord(at, "rx", chunks[0]))
                engine.accepted(prepared, chunks[0], at)
                return value
        return self._continue(prepared, chunks)

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


def _check_requests(requests: Sequence[Any]) -> None:
    for one in requests:
        if not isinstance(one, Exchange):
            raise RequestError(
                f"{shown(one)} is not a request",
                expected="as bus.volley(write(goals), sync_read_positions(servos)): single requests, made before",
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
    with interrupts():
        parts = [_Part(bus, procedure, None) for bus, procedure in procedures.items()]
        _run_parts(parts)
        return {part.bus: part.outcome() for part in parts}


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

    def outcome(self) -> Any:
        """The value or the MotorbusError; raises any other error."""
        error = self.tree.error()
        if error is None or isinstance(error, MotorbusError):
            return self.tree.root.value if error is None else error
        raise error

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
                _raise_interrupt(parts)
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


def _raise_interrupt(parts: Sequence[_Part[Any]]) -> None:
    """Raise what ended one tree and is no MotorbusError, so that the others end, too."""
    for part in parts:
        error = part.tree.root.error
        if part.tree.cancellation is None and not isinstance(error, MotorbusError | None):
            part.tree.cancellation = error
            raise error


def _wait(parts: Sequence[_Part[Any]]) -> None:
    """Wait until one of these can go on."""
    if len(parts) == 1:
        parts[0].wait()
    elif all(part.bus.link.virtual for part in parts):
        moment = min(map(_next_event, parts))
        for part in sorted(parts, key=_next_event):
            part.bus.receive(moment)
            part.news = True
    else:
        _poll(parts)


def _next_event(part: _Part[Any]) -> float:
    """When something happens on this simulated bus, in s of its clock."""
    link = part.bus.link
    due = link.due() if hasattr(link, "due") else inf
    moment = min(part.tree.next_moment(), part.bus.engine.next_deadline(), due)
    return max(moment, link.now())


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
