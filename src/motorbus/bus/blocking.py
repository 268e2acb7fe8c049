"""The blocking bus: procedures run in the thread that calls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from threading import get_ident
from typing import Any, Self, TypeVar

from motorbus.bus.attempt import Attempt
from motorbus.bus.base import BaseBus
from motorbus.bus.engine import PENDING
from motorbus.bus.interrupts import ELSEWHERE, INTERRUPTS, MAIN, interrupts
from motorbus.bus.nodes import GATED
from motorbus.bus.running import TURN_TIMEOUT, Part, run_here, run_parts
from motorbus.bus.tasks import STEPPING, Notify, Tree, check_outside, decode
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
        if isinstance(procedure, Request):
            return self._carry_out(procedure)  # type: ignore[no-any-return]
        return run_here(self, procedure, report)

    def exchange(
        self, requests: Sequence[Request[Any]], tolerated: tuple[type[Exception], ...] = ()
    ) -> list[Any]:
        """Carry out a batch, as a control loop does in every cycle: the values of its requests.

        A request without reply leaves in one write with the next one, where the bus is idle: goals out, positions in.
        An error of a `tolerated` type becomes the value of its request; any other is raised, and requests behind it
        have not been sent.
        """
        values = exchange_on({self: requests}, tolerated)[self]
        if isinstance(values, MotorbusError):
            raise values
        return values  # type: ignore[no-any-return]

    def _carry_out(self, request: Request[T]) -> T:
        """The value of a single request, which is sent at once where it can be."""
        if STEPPING.active:
            check_outside()
        if self.link.virtual:
            self.check_thread()
        signals = INTERRUPTS if get_ident() == MAIN else ELSEWHERE
        since = self.engine.nodes.epoch
        signals.depth += 1  # as `with interrupts()`, written out for speed
        try:
            self.turn.acquire(request.priority)
            try:
                attempt = self.start(request, None, since)
                if attempt is not None and (value := self.finish(attempt)) is not PENDING:
                    return value  # type: ignore[no-any-return]
                part, tree = self.continue_with(request, attempt, since)
            except LinkLost as error:
                self._lost(error)
                raise
            finally:
                self.turn.release()
            run_parts([part], single=True)
            return tree.result()
        finally:
            signals.depth -= 1
            if signals.pending is not None and not signals.depth:
                signals.raise_pending()

    # -- a single request, without a task; the caller holds the turn ---------------------------------------------

    def start(self, request: Request[Any], order: Request[Any] | None, since: int) -> Attempt | None:
        """Send this request at once, an order without replies in front of it; None where it must wait.

        Raises what forbids the request.
        """
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
        if request.effect or engine.read_only:
            if self._reads_first(request):
                return None
            engine.check(request, since, since, now)
        if order is not None:
            if self._reads_first(order):
                return None
            try:
                engine.check(order, since, since, now)
            except MotorbusError:  # the general path says so
                return None
            engine.begin_order(order, now)
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

    def finish(self, attempt: Attempt) -> Any:
        """Wait for the reply to what `start` sent: its value, or `PENDING` where it needs more than one look."""
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

    def continue_with(
        self, procedure: Runnable[T], attempt: Attempt | None, since: int
    ) -> tuple[Part, Tree[T]]:
        """A task for what was not sent at once, or for a request whose attempt has no whole reply yet."""
        part = Part(self)
        tree = part.add(procedure, since=since)
        if attempt is not None:
            tree.continue_from(attempt)
            self.hand_over()
        return part, tree

    def _reads_first(self, request: Request[Any]) -> bool:
        """Whether the gate must read positions first; the task makes these reads again."""
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
        self._close_port()
        if self._defers_signals:
            self._defers_signals = False
            INTERRUPTS.uninstall()

    _drop = close

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()


def _may_join(order: Request[Any]) -> bool:
    """This order may leave in one write with the next request; CAN frames are written one by one."""
    return order.expected == () and isinstance(order.wire, bytes)


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
    check_outside()
    found: dict[BaseBus, Any] = {}
    started: list[_Batch] = []
    with interrupts():
        waiting = [_Batch(bus, requests, tolerated) for bus, requests in batches.items()]
        try:
            for batch in waiting:
                if batch.send(TURN_TIMEOUT if started else -1.0):
                    started.append(batch)
            for batch in started:
                batch.receive()
        finally:
            for batch in waiting:
                batch.release()
        run_parts([batch.part for batch in waiting if batch.part is not None], single=True)
        for batch in waiting:
            found[batch.bus] = batch.outcome()
    return found


class _Batch:
    """A batch on one bus. `part` carries out what could not be sent at once or has no whole reply yet."""

    def __init__(
        self, bus: Bus, requests: Sequence[Request[Any]], tolerated: tuple[type[Exception], ...]
    ) -> None:
        _check_requests(requests)
        bus.check_thread()
        self.bus = bus
        self.requests = requests
        self.tolerated = tolerated
        self.since = bus.engine.nodes.epoch
        self.order = requests[0] if len(requests) == 2 and _may_join(requests[0]) else None
        self.attempt: Attempt | None = None
        self.part: Part | None = None
        self.tree: Tree[Any] | None = None
        self.value: Any = None
        self._holds_turn = False

    def send(self, timeout: float) -> bool:
        """Send it at once, and hold the turn; False where that is not possible."""
        bus, requests = self.bus, self.requests
        self._holds_turn = bus.turn.acquire(Priority.CONTROL, timeout)
        if self._holds_turn and (self.order is not None or len(requests) == 1):
            try:
                self.attempt = bus.start(requests[-1], self.order, self.since)
            except LinkError as error:  # a part of it may have been sent
                self.value = bus._lost(error) if isinstance(error, LinkLost) else error
                return False
            except MotorbusError:  # it is refused: the task says so
                pass
        if self.attempt is None:
            batch = carry_out_batch(requests, self.tolerated)
            self.part, self.tree = bus.continue_with(batch, None, self.since)
            self.release()
        return self.attempt is not None

    def receive(self) -> None:
        """Wait for the reply; what is more than one complete reply is left to a task."""
        bus, attempt = self.bus, self.attempt
        assert attempt is not None
        try:
            self.value = bus.finish(attempt)
        except LinkLost as error:
            self.value = bus._lost(error)
        except Exception as error:
            self.value = error
        if self.value is PENDING:
            self.part, self.tree = bus.continue_with(self.requests[-1], attempt, self.since)

    def release(self) -> None:
        """Give the turn back."""
        if self._holds_turn:
            self._holds_turn = False
            self.bus.turn.release()

    def outcome(self) -> Any:
        """The values of the requests, or the MotorbusError that is not tolerated. Raises any other error."""
        value = self.value if self.tree is None else self.tree.outcome()
        if self.attempt is None:
            return value
        if isinstance(value, Exception) and not isinstance(value, self.tolerated):
            if not isinstance(value, MotorbusError):
                raise value
            return value
        order = self.order
        if order is None:
            return [value]
        answer = Response((), (), self.attempt.sent_at)
        return [answer if order.decode is None else order.decode(answer), value]


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
