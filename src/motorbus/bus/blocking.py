"""The blocking bus: procedures run in the thread that calls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from math import inf
from threading import get_ident
from typing import Any, Self, TypeVar

from motorbus.bus.base import BaseBus
from motorbus.bus.interrupts import ELSEWHERE, INTERRUPTS, MAIN, Interrupts, interrupts
from motorbus.bus.jobs import Attempt, RequestJob, Since
from motorbus.bus.positions import GATED
from motorbus.bus.prepared import Prepared
from motorbus.bus.running import TURN_TIMEOUT, run_here, run_on
from motorbus.bus.tasks import Notify, check_outside
from motorbus.core.register import shown
from motorbus.core.request import Priority, Request, Response
from motorbus.core.steps import Runnable, discard, gather
from motorbus.errors import LinkError, LinkLost, MotorbusError, RequestError

T = TypeVar("T")


class Bus(BaseBus):
    """An open bus. Any number of threads may call `run`; the holder of `turn` alone has requests in flight."""

    is_async = False
    _defers_signals = False

    def run(self, procedure: Runnable[T], report: Notify | None = None) -> T:
        """Run a procedure and return its value; `report` gets its events.

        Raises what the procedure raises; a signal is raised when the procedure has cleaned up.
        """
        if isinstance(procedure, Request) and not self._needs_reads(procedure):  # without a TaskTree
            return self.transact(procedure)  # type: ignore[no-any-return]
        return run_here(self, procedure, report)

    def transact(self, request: Request[Any]) -> Any:
        """Carry out one request."""
        check_outside()
        turn = self.turn
        if self.link.virtual:
            self.check_thread()
        signals = INTERRUPTS if get_ident() == MAIN else ELSEWHERE
        since = self.engine.since if request.effect else None
        signals.depth += 1  # as `with interrupts()`, written out for speed
        try:
            turn.acquire(request.priority)
            try:
                prepared = self.find_prepared(request)
                attempt = None if prepared is None else self.write(prepared)
                if prepared is not None and attempt is not None:
                    return self._receive(prepared, attempt)
                job = RequestJob(request, since=since)
                self.engine.submit(job, self.link.now())
                return self._finish(job)
            except LinkLost as error:
                self._lost(error)
                raise
            finally:
                turn.release()
        finally:
            signals.depth -= 1
            if signals.pending is not None and not signals.depth:
                signals.raise_pending()

    def _receive(self, prepared: Prepared, attempt: Attempt) -> Any:
        """The value of a prepared request that was written; its reply may come in pieces."""
        link, deadline = self.link, attempt.deadline
        chunks: list[Any] = link.read(deadline)
        if chunks and type(chunks[0]) is bytes and len(chunks[0]) != prepared.size:
            data: Any = b"".join(chunks)
            while len(data) < prepared.size and (more := link.read(deadline)):
                data += b"".join(more)  # type: ignore[arg-type]  # a link gives bytes or frames
            chunks = [data]
        value = self.accept(prepared, chunks, deadline)
        if value is not None:
            return value
        job = RequestJob(prepared.request)
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
        self, requests: Sequence[Request[Any]], tolerated: tuple[type[Exception], ...] = ()
    ) -> list[Any]:
        """Carry out a batch, as a control loop does in every cycle: the values of its requests.

        A request without reply leaves in one write with the next one, where the bus is idle: goals out, positions in.
        An error of a `tolerated` type becomes the value of its request; any other is raised, and requests behind it
        have not been sent.
        """
        with self._start(requests) as batch:
            return batch.result(tolerated)

    def _start(self, requests: Sequence[Request[Any]], timeout: float = -1.0) -> _Batch:
        """Send a batch, see `exchange`; `result` gives its values.

        A batch that cannot be sent at once, or for which the bus is not free within `timeout` s (-1: no limit), is sent
        by `result`. Until then the calling thread has the bus, and signals are deferred.
        """
        _check_requests(requests)
        check_outside()
        if self.link.virtual:
            self.check_thread()
        signals = INTERRUPTS if get_ident() == MAIN else ELSEWHERE
        pending = _Batch(self, requests, signals)
        signals.depth += 1
        try:
            if self.turn.acquire(Priority.CONTROL, timeout):
                pending.prepared = self._write_batch(requests, pending.since)
        except LinkLost as error:
            self._lost(error)
            raise
        finally:
            if pending.prepared is None:
                pending.release()
        return pending

    def _write_batch(self, requests: Sequence[Request[Any]], since: Since) -> Prepared | None:
        """Write a prepared request, and an order in front of it; None where they cannot leave now."""
        order = requests[0] if len(requests) == 2 else None
        if len(requests) > 2 or not requests or (order is not None and not self._may_join(order)):
            return None
        prepared = self.find_prepared(requests[-1])
        try:
            if prepared is None or self.write(prepared, order, since) is None:
                return None
        except LinkError:
            raise
        except MotorbusError:  # the order is refused: `result` says so
            return None
        return prepared

    def _may_join(self, order: Request[Any]) -> bool:
        """This order may leave in one write with the next request; CAN frames are written one by one."""
        return order.expected == () and isinstance(order.wire, bytes) and not self._needs_reads(order)

    def _needs_reads(self, request: Request[Any]) -> bool:
        """Whether the gate must read positions first; `run_here` makes these reads again."""
        reads = self.required_reads(request) if request.effect in GATED else ()
        for read in reads:
            discard(read)
        return bool(reads)

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

    _drop = close

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()


class _Batch:
    """A batch that was started. `prepared` is the request whose reply is awaited, None where nothing was sent yet.

    At the end of its block the bus is free, also where an error was raised before `result`.
    """

    __slots__ = ("bus", "prepared", "requests", "signals", "since")

    def __init__(self, bus: Bus, requests: Sequence[Request[Any]], signals: Interrupts) -> None:
        self.bus = bus
        self.requests = requests
        self.signals = signals
        self.since = bus.engine.since
        self.prepared: Prepared | None = None

    def __enter__(self) -> _Batch:
        return self

    def __exit__(self, *exc: object) -> None:
        if (
            self.prepared is not None
        ):  # its reply is not awaited, and the node is out of sync from its deadline on
            self.prepared = None
            self.release()

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
            return run_here(bus, carry_out_batch(self.requests, tolerated), since=self.since)
        answer, value = Response((), (), bus.engine.time), None
        try:
            value = bus._receive(prepared, prepared.attempt)
        except LinkLost as error:
            bus._lost(error)
            raise
        except tolerated as error:
            value = error
        finally:
            self.prepared = None
            self.release()
        if len(self.requests) == 1:
            return [value]
        decode = self.requests[0].decode
        return [answer if decode is None else decode(answer), value]


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
    found: dict[BaseBus, Any] = {}
    pending: list[_Batch] = []
    with interrupts(), ExitStack() as stack:
        for bus, requests in batches.items():
            try:
                pending.append(stack.enter_context(bus._start(requests, TURN_TIMEOUT if pending else -1.0)))
            except MotorbusError as error:
                found[bus] = error
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
        if not isinstance(one, Request):
            for other in requests:
                discard(other)
            raise RequestError(
                f"{shown(one)} is not a request",
                expected="as bus.exchange([write(goals), sync_read_positions(servos)]): single requests, made before",
                advice="use run() for a procedure; nothing was sent",
            )
