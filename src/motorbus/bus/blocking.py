"""The blocking bus: procedures run in the thread that calls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from threading import get_ident
from typing import Any, Self, TypeVar

from motorbus.bus.attempt import Attempt
from motorbus.bus.base import BaseBus
from motorbus.bus.engine import PENDING
from motorbus.bus.interrupts import ELSEWHERE, INTERRUPTS, MAIN
from motorbus.bus.running import Part, run_here, run_on, run_parts
from motorbus.bus.tasks import STEPPING, Notify, check_outside, decode
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
        if self.watches or not engine.is_free(now):
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
            if request.effect:
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
            if not engine.not_written(attempt, error):
                self.hand_over()
                raise
            return None
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
        assert attempt.accepted is not None
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
