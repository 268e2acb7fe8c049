"""The blocking bus: procedures run in the thread that calls."""

from __future__ import annotations

import time
from collections.abc import Sequence
from math import inf
from threading import get_ident
from typing import Any, Generic, TypeVar

from motorbus.bus.attempt import Attempt
from motorbus.bus.engine import Engine
from motorbus.bus.interrupts import ELSEWHERE, INTERRUPTS, MAIN
from motorbus.bus.jobs import RateJob, RequestJob
from motorbus.bus.policy import carry_out
from motorbus.bus.positions import GATED
from motorbus.bus.prepared import Prepared
from motorbus.bus.stop_rounds import StopOutcome, run_rounds
from motorbus.bus.tasks import Notify, TaskTree
from motorbus.bus.trace import TraceRecord
from motorbus.bus.turn import Turn
from motorbus.core.operation import UNLIKE, Data, Exchange, Runnable
from motorbus.errors import LinkError, LinkLost, MotorbusError
from motorbus.link.base import Link

T = TypeVar("T")

IDLE = 0.25
"""s; the longest wait for a notification before the procedure is looked at again."""
SLICE = 0.002
"""s for which a thread that only waits for a notification keeps the turn while others want it."""


class Bus:
    """An open bus. Any number of threads may call `run`; the holder of `turn` alone has requests in flight."""

    def __init__(self, link: Link, engine: Engine) -> None:
        self.link = link
        self.engine = engine
        self.turn = Turn()
        self.now = link.now

    def run(self, procedure: Runnable[T], report: Notify | None = None) -> T:
        """Run a procedure and return its value; `report` gets its events.

        Raises what the procedure raises; a signal is raised when the procedure has cleaned up.
        """
        if isinstance(procedure, Exchange) and not (procedure.effect and self._required_reads(procedure)):
            return self.transact(procedure)  # type: ignore[no-any-return]
        signals = INTERRUPTS if get_ident() == MAIN else ELSEWHERE
        signals.depth += 1
        try:
            part = _Part(self, procedure, report)
            _run_tree(part)
            return part.tree.result()
        finally:
            signals.depth -= 1
            if signals.pending is not None and not signals.depth:
                raise signals.take()  # type: ignore[misc]

    def _required_reads(self, request: Exchange[Any]) -> Sequence[Runnable[Any]]:
        interlock = self.engine.interlock
        return interlock.required_reads(request) if interlock is not None and request.effect in GATED else ()

    def transact(self, request: Exchange[Any]) -> Any:
        """Carry out one request."""
        engine, link, turn = self.engine, self.link, self.turn
        signals = INTERRUPTS if get_ident() == MAIN else ELSEWHERE
        signals.depth += 1
        try:
            turn.acquire(request.rank)
            try:
                prepared: Prepared | None = request.course
                if prepared is None or prepared.engine is not engine:
                    return self._carry_out(request)
                if not engine.ready and not engine.check_ready():
                    return self._carry_out(request)
                single = prepared.single
                if single is not None and single.length == prepared.length:
                    prepared = prepared.alternate
                if engine.sync.out_of_sync and not engine.sync.out_of_sync.isdisjoint(prepared.nodes):
                    return self._carry_out(request)
                if prepared.timing != engine.timing:
                    engine.measure(prepared)
                if stale := link.read(-inf):
                    engine.feed(stale, link.now())
                    return self._carry_out(request)
                now = link.now()
                if now < engine.free_at:
                    return self._carry_out(request)
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
                engine.lost(error)
                raise
            finally:
                turn.release()
        finally:
            signals.depth -= 1
            if signals.pending is not None and not signals.depth:
                raise signals.take()  # type: ignore[misc]

    def estop(self) -> StopOutcome:
        """Emergency stop, in the calling thread."""
        with self.turn:
            self.engine.latch(self.now(), "in this process")
            return run_rounds(self)

    def _carry_out(self, request: Exchange[Any]) -> Any:
        """One request by the general path. The caller holds the turn."""
        engine = self.engine
        if request.course is None:
            request.course = engine.prepare(request)
        job = RequestJob(request, losses=engine.losses)
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
            if not job.done:
                self.receive(inf)
        return job.result()

    def send(self) -> None:
        """Write all that may be sent now."""
        engine, link = self.engine, self.link
        try:
            now = link.now()
            if engine.queue and (stale := link.read(now)):  # it cannot answer what has not left
                engine.feed(stale, now)
            while (out := engine.next_frame(now)) is not None:
                if isinstance(out, RateJob):
                    self._set_rate(out)
                else:
                    link.write(out)
                    engine.written()
        except LinkError as error:
            engine.lost(error)

    def _set_rate(self, job: RateJob) -> None:
        try:
            if job.tune.rate:
                self.link.tune(job.tune.rate, job.tune.listen_only or self.engine.always_listening)
        except MotorbusError as error:
            self.engine.rate_changed(job, error)
            if isinstance(error, LinkLost):
                raise
        else:
            self.engine.rate_changed(job)

    def receive(self, until: float) -> None:
        """Wait for data, at most until this moment or the next deadline, and feed the engine.

        Only what was due before this look is overdue after it: the reply may be in the buffer of a host that was late.
        """
        engine, link = self.engine, self.link
        try:
            looked = link.now()
            chunks = link.read(min(until, engine.next_deadline(), looked + IDLE))
            engine.feed(chunks, link.now(), looked)
        except LinkError as error:
            engine.lost(error)


class _Part(Generic[T]):
    """The tree on one bus; `news` is set when it can go on."""

    def __init__(self, bus: Bus, procedure: Runnable[T], report: Notify | None) -> None:
        self.bus = bus
        self.news = True
        self.holds_turn = False
        self.tree: TaskTree[T] = TaskTree(
            bus.engine, procedure, now=bus.link.now, report=report, settled=self._settled
        )

    def _settled(self) -> None:
        self.news = True

    def take_turn(self) -> None:
        if not self.holds_turn:
            self.bus.turn.acquire()
            self.holds_turn = True

    def release_turn(self) -> None:
        """Let other threads use the bus, unless a request is in flight or the bus is used exclusively."""
        engine = self.bus.engine
        if self.holds_turn and engine.idle and engine.exclusive is None:
            self.holds_turn = False
            self.bus.turn.release()

    def advance(self) -> bool:
        """Step the tree and send; True when it has ended."""
        self.take_turn()
        while self.news and not self.tree.root.finished:
            self.news = False
            if self.tree.advance():
                break
            self.bus.send()
        return self.tree.root.finished

    def wait(self) -> None:
        """Wait until something comes, a deadline, or a moment that the tree waits for."""
        bus, moment = self.bus, self.tree.next_moment()
        if bus.engine.idle and not bus.engine.listeners and not bus.link.virtual:
            self.release_turn()
            time.sleep(max(0.0, min(moment - bus.link.now(), IDLE)))
        else:
            bus.receive(moment)
        self.news = True


def _run_tree(part: _Part[Any]) -> None:
    """Run a tree to its end. An interrupt cancels it; it cleans up and is finished then."""
    signals = INTERRUPTS if get_ident() == MAIN else ELSEWHERE
    try:
        while True:
            try:
                if part.advance():
                    return
                signals.waiting = part.bus.engine.idle
                if signals.pending is not None and (error := signals.take()) is not None:
                    raise error
                part.wait()
            except BaseException as error:
                part.take_turn()
                part.tree.cancel(error)
                part.news = True
            finally:
                signals.waiting = False
    finally:
        if part.holds_turn:
            part.bus.turn.release()
