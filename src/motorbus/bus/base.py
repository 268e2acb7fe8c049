"""What blocking and asyncio buses have in common: their parts, their observers, the emergency stop."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import inf
from pathlib import Path
from threading import Condition
from typing import Any

from motorbus.bus import failures
from motorbus.bus.engine import Engine
from motorbus.bus.interlock import Interlock
from motorbus.bus.jobs import Attempt, RateJob, RequestJob, Since
from motorbus.bus.policy import carry_out
from motorbus.bus.positions import Reading
from motorbus.bus.prepared import Prepared
from motorbus.bus.stop import EmergencyStop
from motorbus.bus.stop_socket import StopOutcome, asked_by
from motorbus.bus.tasks import Notify, TaskTree
from motorbus.bus.trace import TraceRecord
from motorbus.bus.turn import Turn
from motorbus.core.family import BusDriver, Family, IdChanged
from motorbus.core.request import Data, Priority, Request
from motorbus.core.steps import JournalEntry, Runnable
from motorbus.errors import LinkError, LinkFull, LinkLost, MotorbusError, RequestError
from motorbus.link.base import Link, Renewable
from motorbus.link.memory import MemoryLink

IDLE = 0.25
"""s; the longest wait for data before the caller looks at its procedure again."""


class BaseBus:
    """An open bus: one link, one driver, one engine.

    `interlock` judges requests that move a motor or switch torque; without it they are refused. `report` gets the
    events of procedures. `journal` gets the journal entries first. `stop_socket` is where another process can request
    an emergency stop. `warnings` are for the user. `on_id_change` is called before a device gets another id.
    """

    _open = False

    def __init__(
        self,
        link: Link,
        driver: BusDriver,
        *,
        interlock: Interlock | None = None,
        report: Notify | None = None,
        journal: Notify | None = None,
        stop_socket: Path | None = None,
    ) -> None:
        self.link = link
        self.driver = driver
        self.report = report
        self.journal = journal
        self.on_id_change: Callable[[IdChanged], None] | None = None
        self.warnings: tuple[str, ...] = tuple(link.warnings)
        self.engine = Engine(
            driver,
            rate=link.rate,
            latency=link.latency,
            paced=link.paced,
            queue=getattr(link, "queue", 0),
            listen_only=bool(getattr(link, "listen_only", False)),
        )
        self.engine.diagnosis = getattr(link, "trouble", str)
        self.statistics = self.engine.statistics
        self.trace = self.engine.trace
        """Subscribe to every request and delivery."""
        self.notices = self.engine.notices
        """Subscribe to what devices send without a request."""
        self.positions: Mapping[int, Reading] = self.engine.positions
        """The last request that read a position and its reply, by node."""
        self.lock = self.turn = Turn()
        """Held while a request is in flight, or the state of this bus is read or changed as a whole."""
        self.settled = Condition()
        """Notified when something ends that a sleeping thread waits for."""
        self.stopper = EmergencyStop(self, stop_socket)
        self.engine.interlock = interlock
        self.engine.before_motion = self._start_stopper
        self.reconnects = isinstance(link, Renewable)
        """A lost port is opened again by the next request. May be set to False only."""
        self._on_reconnect: list[Callable[[], None]] = []
        self.background: list[TaskTree[Any]] = []
        """Procedures that are stepped whenever the bus is used; see `BackgroundTask`."""
        self._open = True
        if stop_socket is not None:
            self.stopper.start()

    def __del__(self) -> None:
        """Give back what a bus holds that was dropped without `close`."""
        if not self._open:
            return
        self._drop()
        if not self.link.simulated:
            warnings.warn(f"{self!r} was not closed", ResourceWarning, source=self, stacklevel=2)

    def _drop(self) -> None:
        self._hang_up()

    @property
    def family(self) -> Family:
        """The family of the devices."""
        return self.driver.family

    @property
    def interlock(self) -> Interlock | None:
        """What judges motion requests."""
        return self.engine.interlock

    @interlock.setter
    def interlock(self, interlock: Interlock | None) -> None:
        self.engine.interlock = interlock

    def _start_stopper(self) -> None:
        """A motion request is about to leave: from now on a thread can stop it."""
        self.stopper.start()
        self.engine.before_motion = None

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.link.name}, {self.family.name}, {self.rate} bit/s>"

    def now(self) -> float:
        """s on the clock of the link."""
        return self.link.now()

    @property
    def waits_for_stop(self) -> bool:
        """An emergency stop in another thread needs the turn, and nothing is in flight."""
        return self.engine.stopping and not self.engine.in_flight

    def check_thread(self) -> None:
        """Raise RequestError for a second thread on a simulated bus in virtual time; an emergency stop may."""
        if isinstance(self.link, MemoryLink) and self.link.virtual:
            self.link.clock.check_thread()

    # -- the link ----------------------------------------------------------------------------------------------

    def send(self) -> None:
        """Write all that may be sent now. The caller holds the turn; a lost link fails all requests."""
        engine, link = self.engine, self.link
        for tree in tuple(self.background):
            if tree.advance() and tree in self.background:
                self.background.remove(tree)
        if engine.gone is not None and not self._reconnect():
            return
        try:
            now = link.now()
            if engine.queue and (stale := link.read(now)):  # it cannot answer what has not left
                engine.feed(stale, now)
            while (out := engine.next_frame(now)) is not None:
                if isinstance(out, RateJob):
                    self._set_rate(out)
                else:
                    try:
                        link.write(out)
                    except LinkLost:
                        raise
                    except LinkError as error:
                        engine.not_written(error)
                    else:
                        engine.written()
        except LinkError as error:
            self._lost(error)

    def receive(self, until: float) -> None:
        """Wait for data, at most until this moment or the next deadline, and feed the engine.

        Only what was due before this look is overdue after it: the reply may be in the buffer of a host that was late.
        """
        engine, link = self.engine, self.link
        until = min([until, *(tree.next_moment() for tree in self.background)])
        if engine.gone is not None:
            self._wait_without_link(until)
            return
        try:
            looked = link.now()
            chunks = link.read(min(until, engine.next_deadline(), looked + IDLE))
            engine.feed(chunks, link.now(), looked)
        except LinkError as error:
            self._lost(error)

    def next_event(self, moment: float) -> float:
        """When something happens on a simulated bus in virtual time, at `moment` (s) at the latest."""
        due = self.link.due() if isinstance(self.link, MemoryLink) else inf
        return max(min(moment, self.engine.next_deadline(), due), self.now())

    def _lost(self, error: LinkError) -> None:
        if isinstance(error, LinkLost):
            error = failures.reconnecting(error) if self.reconnects else failures.final(error)
        self.engine.lost(error)

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

    def _reconnect(self) -> bool:
        """Open the lost port again if it is there; False when it is not, and every request has failed."""
        link, engine = self.link, self.engine
        if not self.reconnects or not isinstance(link, Renewable):
            engine.lost(engine.gone or LinkLost("the port is gone"))
            return False
        try:
            link.renew(engine.losses)
        except LinkError as error:
            self._lost(error)
            return False
        engine.reconnected(link.now(), link.latency)
        for function in self._on_reconnect:
            function()
        if link.rate != engine.rate:
            with contextlib.suppress(MotorbusError):
                link.tune(engine.rate, engine.listening)
        return True

    def _wait_without_link(self, until: float) -> None:
        if isinstance(self.link, Renewable) and self.reconnects:
            self.link.rest(min(until, self.link.now() + IDLE))

    # -- prepared requests -------------------------------------------------------------------------------------

    def find_prepared(self, request: Request[Any]) -> Prepared | None:
        """The prepared form of this request if it may be sent at once, else None. The caller holds the turn.

        `Engine.submit` makes the prepared form when the request is sent for the first time.
        """
        engine, link = self.engine, self.link
        prepared: Prepared | None = request.prepared
        if prepared is None or prepared.engine is not engine:
            return None
        if engine.in_flight or (not engine.ready and not engine.check_ready()):
            return None
        single = prepared.single
        if single is not None and single.length == prepared.length:
            prepared = prepared.alternate
        if engine.sync.out_of_sync and not engine.sync.out_of_sync.isdisjoint(prepared.nodes):
            return None
        if prepared.rate != engine.rate or prepared.latency != engine.latency:
            engine.measure(prepared)
        if stale := link.read(-inf):  # it cannot answer what has not left
            engine.feed(stale, link.now())
            return None
        return None if engine.paced and link.now() < engine.free_at else prepared

    def write(
        self, prepared: Prepared, order: Request[Any] | None = None, since: Since | None = None
    ) -> Attempt | None:
        """Write a prepared request; an order without reply goes in front of it. None: the link is full.

        Raises what forbids the order.
        """
        engine, now = self.engine, self.link.now()
        attempt = prepared.attempt
        if attempt.ended:
            attempt = prepared.attempt = Attempt(prepared.request)
        wire: Any = prepared.wire
        attempt.sent_at = now
        if order is not None:
            assert since is not None
            wire, attempt.sent_at = self._write_order(order, since, now) + wire, engine.free_at
        attempt.deadline = attempt.sent_at + prepared.budget
        engine.in_flight[prepared.lane] = attempt
        try:
            self.link.write(wire)
        except LinkFull:
            del engine.in_flight[prepared.lane]
            return None
        if order is not None:
            engine.statistics.other["sent"] += 1
        if engine.trace.subscriptions:
            for request in (prepared.request,) if order is None else (order, prepared.request):
                engine.trace.put(TraceRecord(now, "tx", request.wire))
        return attempt

    def _write_order(self, order: Request[Any], since: Since, now: float) -> Any:
        """Check and count an order that leaves with the next request; its data."""
        engine = self.engine
        engine.time = now
        engine.check(order, since)
        if order.priority is Priority.STOP:
            engine.note_stop(order)
        else:
            engine.positions.sent(order)
        engine.free_at = now + engine.air_time(order)
        return order.wire

    def accept(self, prepared: Prepared, chunks: Sequence[Data], deadline: float) -> Any:
        """The value if this is the complete reply to a prepared request, else None."""
        if len(chunks) != 1:
            return None
        at = self.link.now()
        if at > deadline:  # the host was late
            at = deadline
        value = prepared.decode(chunks[0], at)
        if value is None:
            return value
        engine, record, single = self.engine, prepared.record, prepared.single
        if engine.trace.subscriptions:
            engine.trace.put(TraceRecord(at, "rx", chunks[0]))
        if engine.last is not record:
            engine.note_last(record)
        sent_at = prepared.attempt.sent_at
        if single is not None:
            single.length, single.asked_at = prepared.length, sent_at
        prepared.times[int(1e6 * (at - sent_at)).bit_length()] += 1
        record.data, record.at, record.source, record.kept = chunks[0], at, prepared, None
        record.orders = engine.positions.orders
        engine.positions.rate = engine.rate
        del engine.in_flight[prepared.lane]
        return value

    def adopt(self, prepared: Prepared, chunks: Sequence[Data], job: RequestJob) -> None:
        """The reply to a prepared request is in pieces, damaged or missing: its job goes the general path."""
        engine, attempt = self.engine, prepared.attempt
        prepared.attempt = Attempt(prepared.request)
        job.policy = carry_out(engine, job.request)
        job.policy.send(None)  # up to the attempt that is in flight
        attempt.job = job
        engine.adopt(attempt)
        engine.feed(chunks, self.link.now(), attempt.sent_at)

    # -- observers ---------------------------------------------------------------------------------------------

    def event_sink(self, report: Notify | None) -> Notify | None:
        """The function that takes the events of a procedure: it passes them to the journal, then to `report`."""
        observer, journal, on_id_change = report or self.report, self.journal, self.on_id_change
        if journal is None and on_id_change is None:
            return observer

        def deliver(event: object) -> None:
            if on_id_change is not None and isinstance(event, IdChanged):
                on_id_change(event)
            if journal is not None and isinstance(event, JournalEntry):
                journal(event)
            if observer is not None:
                observer(event)

        return deliver

    @property
    def simulated(self) -> bool:
        """There is no real device behind this bus."""
        return self.link.simulated

    @property
    def rate(self) -> int:
        """Bit rate (bit/s)."""
        return self.engine.rate

    @property
    def latency(self) -> float:
        """s that the adapter may hold data back; part of every deadline."""
        return self.engine.latency

    @latency.setter
    def latency(self, seconds: float) -> None:
        self.engine.latency = seconds

    def stop_count(self, node: int | None = None) -> int:
        """Number of stops sent to this node, those for all nodes included; None: of all stops sent on this bus."""
        positions = self.engine.positions
        return positions.stop_total if node is None else positions.stop_count(node)

    @property
    def loss_count(self) -> int:
        """Number of times the port was lost."""
        return self.engine.losses

    def on_reconnect(self, function: Callable[[], None]) -> None:
        """Call this function each time the lost port was opened again, before anything is sent."""
        self._on_reconnect.append(function)

    def required_reads(self, request: Request[Any]) -> Sequence[Runnable[Any]]:
        """The reads that the interlock needs before it can check this request."""
        return () if self.interlock is None else self.interlock.required_reads(request)

    def attach(self, gate: Any) -> None:
        """Let the gate see positions and stops of this bus, and ask it which reads a request requires first."""
        positions = self.engine.positions
        gate.watch(positions, self.link.now, positions.stop_count, positions.accepted_count)
        self.interlock = gate
        self.on_reconnect(gate.forget)

    def expect_echo(self, test: Request[Any]) -> None:
        """Let the next reply to this request show whether the adapter echoes."""
        self.engine.echo.test = test

    @property
    def echoes(self) -> bool:
        """The adapter echoes what is sent."""
        return bool(self.engine.echo.present)

    # -- emergency stop ----------------------------------------------------------------------------------------

    @property
    def latched(self) -> bool:
        """An emergency stop is latched: motion and torque are refused until `reset`."""
        return self.engine.latched

    def move_stop_socket(self, path: Path | None) -> None:
        """Accept emergency stops of other processes at this socket from now on."""
        self.stopper.move(path)

    def estop(self) -> StopOutcome:
        """Emergency stop: drop what waits, send the stop frames until acknowledged or five times, and latch.

        Motion and torque are refused with Interrupted until `reset()`. May be called from any thread, but not from a
        signal handler (see `trigger_estop`). Raises LinkLost when the bus is closed.
        """
        return self.stopper.estop()

    def trigger_estop(self) -> None:
        """Request an emergency stop and return at once; for signal handlers.

        Does nothing before the stop thread exists: on a simulated bus that is the first motion or torque request.
        """
        self.stopper.trigger()

    def latch(self) -> None:
        """Refuse motion and torque until `reset`, as after an emergency stop; sends nothing."""
        with self.turn:
            self.engine.latch(self.link.now(), asked_by())
            self.engine.stop_sent()

    def reset(self) -> None:
        """Take the latch off. Nothing is sent and nothing moves."""
        self.engine.reset()

    def _hang_up(self) -> None:
        """End the stop thread, then give the port back."""
        self._open = False
        self.stopper.close()
        self.reconnects = False
        self.link.close()


def check_clocks(buses: Iterable[BaseBus]) -> None:
    """Raise RequestError if some of these buses use virtual time and some real time."""
    virtual = {bus.link.virtual for bus in buses}
    if len(virtual) > 1:
        raise RequestError(
            "buses in virtual time and buses in real time cannot work together",
            cause="virtual time passes only while a program waits on simulated buses",
            advice='simulate with clock="real"; nothing was sent',
        )
