"""What blocking and asyncio buses have in common: their parts, their observers, the emergency stop."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Any, Final

from motorbus.bus import failures
from motorbus.bus.attempt import Attempt
from motorbus.bus.engine import DIRECT, Engine
from motorbus.bus.interlock import Interlock
from motorbus.bus.nodes import Reading
from motorbus.bus.stop import EmergencyStop
from motorbus.bus.stop_socket import StopOutcome, asked_by
from motorbus.bus.tasks import PRIORITY, Notify, Pause, Tree
from motorbus.bus.turn import Turn
from motorbus.core.family import BusDriver, Family, IdChanged
from motorbus.core.request import Priority, Request
from motorbus.core.steps import JournalEntry
from motorbus.errors import LinkError, LinkLost, MotorbusError, RequestError
from motorbus.link.base import Link, Renewable
from motorbus.link.memory import MemoryLink

IDLE = 0.25
"""s; the longest wait for data before the caller looks at its procedure again."""
DRAIN: Final = 32
"""Reads by which a late host takes what is there before it takes the rest for late."""


class BaseBus:
    """An open bus: one link, one driver, one engine.

    `interlock` judges requests that move a motor or switch torque; without it they are refused. `report` gets the
    events of procedures. `journal` gets the journal entries first. `stop_socket` is where another process can request
    an emergency stop. `warnings` are for the user. `on_id_change` is called before a device gets another id,
    `on_reconnect` when the lost port was opened again, before anything is sent.
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
        self.positions: Mapping[int, Reading] = self.engine.nodes
        """The last request that read a position and its reply, by node."""
        self.turn = Turn()
        """Held while a request is in flight, or the state of this bus is read or changed as a whole."""
        self.stopper = EmergencyStop(self, stop_socket)
        self.engine.interlock = interlock
        self.engine.before_motion = self._start_stopper
        self.reconnects = isinstance(link, Renewable)
        """A lost port is opened again by the next request. May be set to False only."""
        self.on_reconnect: Callable[[], None] | None = None
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
        self._close_port()

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

    @property
    def read_only(self) -> bool:
        """Only reads leave; all that changes a device is refused with RequestError, but for an emergency stop."""
        return self.engine.read_only

    @read_only.setter
    def read_only(self, on: bool) -> None:
        self.engine.read_only = on

    def _start_stopper(self) -> None:
        """A motion request is about to leave: from now on a thread can stop it."""
        self.stopper.start()
        self.engine.before_motion = None

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.link.name}, {self.family.name}, {self.rate} bit/s>"

    def now(self) -> float:
        """s on the clock of the link."""
        return self.link.now()

    def check_thread(self) -> None:
        """Raise RequestError for a second thread on a simulated bus in virtual time; an emergency stop may."""
        if isinstance(self.link, MemoryLink) and self.link.virtual:
            self.link.clock.check_thread()

    # -- the link ----------------------------------------------------------------------------------------------

    def send(self, trees: Sequence[Tree[Any]]) -> float:
        """Write all that these may send now; the moment (s) from which more may be sent, inf while none is known.

        The caller holds the turn; a lost link fails everything that waits.
        """
        engine, link = self.engine, self.link
        if engine.gone is not None and not self._reconnect():
            self._fail(engine.gone, trees)
            return inf
        moment = inf
        try:
            now = link.now()
            waiting = [one for tree in trees for one in tree.sending]
            if waiting and (stale := link.read(now)):
                engine.feed(stale, now)  # it cannot answer what has not left
            while waiting and (moment := self._send_next(waiting, now)) == 0.0:
                waiting = [one for tree in trees for one in tree.sending]
        except LinkError as error:
            self._fail(self.lost(error), trees)
        self.hand_over()
        return moment

    def _send_next(self, waiting: list[Attempt | Pause], now: float) -> float:
        """Send the first that may leave and return 0; else the moment (s) from which one may, inf if unknown."""
        engine, moment = self.engine, inf
        for one in sorted(waiting, key=PRIORITY):
            if not self._may_use_bus(one):
                continue
            if isinstance(one, Pause):
                if engine.in_flight:  # what is behind it waits, too
                    break
                one.task.tree.sending.remove(one)
                self._end_pause(one)
                return 0.0
            if len(engine.in_flight) >= engine.window:
                break
            if blocked := engine.blocked_until(one, now):
                moment = min(moment, blocked)
                continue
            one.task.tree.sending.remove(one)
            self._send(one, now)
            return 0.0
        return moment

    def _may_use_bus(self, one: Attempt | Pause) -> bool:
        if one.priority is Priority.STOP:
            return True
        owner = self.engine.exclusive
        return not self.engine.stopping and (owner is None or owner is one.task.owner)

    def _send(self, attempt: Attempt, now: float) -> None:
        engine, tree, request = self.engine, attempt.task.tree, attempt.request
        try:
            if engine.needs_sync(attempt):
                engine.check_stops(request, attempt.since, attempt.stop_since)
                tree.send_back(attempt)
                return
            engine.check(request, attempt.since, attempt.stop_since, now)
        except Exception as error:  # also of the gate or of the driver
            attempt.error = error
            tree.end(attempt)
            return
        engine.begin(attempt, now)
        try:
            self.link.write(request.wire)
        except LinkLost as error:
            if not attempt.in_flight:
                attempt.error = error
                engine.done.append(attempt)
            raise
        except LinkError as error:
            if engine.not_written(attempt, error):
                tree.put_back(attempt)
        else:
            engine.written(attempt)

    def _end_pause(self, pause: Pause) -> None:
        """Nothing is in flight: set the rate, or give the bus to the task of this pause."""
        engine, task, tune = self.engine, pause.task, pause.tune
        before, failure = engine.rate, None
        if tune is None:
            engine.exclusive = task
            task.tree.ready.append((task, None, None))
            return
        try:
            if tune.rate:
                self.link.tune(tune.rate)
                engine.set_rate(tune.rate)
        except MotorbusError as error:
            failure = error
        task.tree.ready.append((task, before, failure))
        if isinstance(failure, LinkLost):
            raise failure

    def hand_over(self) -> None:
        """Give every attempt that has ended to the task that waits for it."""
        done = self.engine.done
        while done:
            attempt = done.popleft()
            if attempt.task is not None:
                attempt.task.tree.end(attempt)

    def _fail(self, error: LinkError, trees: Sequence[Tree[Any]]) -> None:
        self.hand_over()
        for tree in trees:
            tree.fail(error)

    def receive(self, until: float, trees: Sequence[Tree[Any]] = ()) -> None:
        """Wait for data, at most until this moment or the next deadline, and feed the engine.

        Only what was due before this look is overdue after it: the reply may be in the buffer of a host that was late.
        """
        engine, link = self.engine, self.link
        if engine.gone is not None:
            if isinstance(link, Renewable) and self.reconnects:
                link.rest(min(until, link.now() + IDLE))
            return
        try:
            looked = link.now()
            deadline = engine.next_deadline()
            chunks = link.read(min(until, deadline, looked + IDLE))
            reads = DRAIN if engine.latency < DIRECT else 1  # an adapter gives all at once
            while reads and chunks and looked >= deadline and (more := link.read(-inf)):
                chunks = [*chunks, *more]
                reads -= 1
            engine.feed(chunks, link.now(), looked)
        except LinkError as error:
            self._fail(self.lost(error), trees)
        self.hand_over()

    def next_event(self, moment: float) -> float:
        """When something happens on a simulated bus in virtual time, at `moment` (s) at the latest."""
        due = self.link.due() if isinstance(self.link, MemoryLink) else inf
        return max(min(moment, self.engine.next_deadline(), due), self.now())

    def lost(self, error: LinkError) -> LinkError:
        """The link failed: all that waits fails with this error."""
        if isinstance(error, LinkLost):
            error = failures.lost(error, reconnects=self.reconnects)
        self.engine.lost(error)
        return error

    def _reconnect(self) -> bool:
        """Open the lost port again if it is there; False when it is not, and every request has failed."""
        link, engine = self.link, self.engine
        if not self.reconnects or not isinstance(link, Renewable):
            engine.lost(engine.gone or LinkLost("the port is gone"))
            return False
        try:
            link.renew(engine.losses)
        except LinkError as error:
            self.lost(error)
            return False
        engine.reconnected(link.now(), link.latency)
        if self.on_reconnect is not None:
            self.on_reconnect()
        if link.rate != engine.rate:
            with contextlib.suppress(MotorbusError):
                link.tune(engine.rate)
        return True

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
        """A number that a stop of this node changes; None: of any node, an emergency stop or a lost port as well."""
        return self.engine.nodes.epoch if node is None else self.engine.nodes.last_stop(node)

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
        if not self._open:
            raise LinkLost("the bus is closed: no stop was sent", advice="open it again, or cut the power")
        return self.stopper.stop()

    def trigger_estop(self) -> None:
        """Request an emergency stop and return at once; for signal handlers.

        Does nothing before the stop thread exists: on a simulated bus that is the first motion or torque request.
        """
        self.stopper.trigger()

    def latch(self) -> None:
        """Refuse motion and torque until `reset`, as after an emergency stop; sends nothing."""
        self.engine.announce_stop(asked_by())
        self.turn.acquire(Priority.STOP)
        try:
            self.engine.latch(self.link.now(), asked_by())
        finally:
            self.engine.stop_sent()
            self.turn.release()

    def reset(self) -> None:
        """Take the latch off. Nothing is sent and nothing moves."""
        self.engine.reset()

    def _close_port(self) -> None:
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
