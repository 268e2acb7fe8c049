"""The engine of a bus: attempts out, data in, replies out. No I/O and no clock.

At most one request is in flight per lane, on at most `window` lanes. A request with replies is in `in_flight` from
before it is written until its attempt ends or the link fails; which nodes may still owe a reply is in `sync`. A
deadline is fixed when the request leaves; requests on other lanes, which share the wire, extend it, and an emergency
stop may shorten it. The engine relies on a link that is first in, first out: data read before a request cannot answer
it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from math import inf
from typing import Any, Final

from motorbus.bus import failures
from motorbus.bus.attempt import Attempt
from motorbus.bus.echo import Echo
from motorbus.bus.interlock import Interlock
from motorbus.bus.nodes import GATED, Nodes, addressed, is_refusal, moves
from motorbus.bus.sync import SyncTable, is_read, must_sync
from motorbus.bus.trace import Feed, Statistics, TraceRecord
from motorbus.core.family import BusDriver
from motorbus.core.request import (
    ANY,
    EVERY_LANE,
    Data,
    Effect,
    Event,
    Expected,
    Noise,
    Notification,
    Priority,
    Reply,
    Request,
    Response,
    TimeoutClass,
)
from motorbus.errors import LinkError, LinkFull, LinkLost

MARGIN: Final = {TimeoutClass.SCAN: 0.002, TimeoutClass.REPLY: 0.02, TimeoutClass.STORE: 0.02}
"""s that the host may be late; short for a scan, where silence is the usual answer."""
DIRECT: Final = 0.001
"""s; a link of less latency has no adapter that holds data back."""
STOP_DELAY: Final = 0.003
"""s that a stop waits for the turn beyond the air time of what is in flight."""
RECENT: Final = 64
"""Attempts whose nodes are doubted when unexpected data comes within the quiet time."""
PENDING: Final = object()
"""The value of a request whose reply is not complete."""


class Engine:
    """The engine of one bus. `rate` (bit/s) and `latency` (s) describe the link; `paced`: the link takes air time,
    so nothing is sent before `free_at` (s). `queue`: frames that its adapter takes at once, 0 if unknown.

    An emergency stop is announced (`stopping`), sent (`stop_sent`), and stays `latched` until `reset`.
    """

    def __init__(
        self,
        driver: BusDriver,
        *,
        rate: int,
        latency: float = 0.0,
        paced: bool = False,
        queue: int = 0,
        listen_only: bool = False,
        interlock: Interlock | None = None,
    ) -> None:
        self.driver = driver
        self.rate = rate
        self.latency = latency
        self.paced = paced
        self.window = min(driver.window, queue or driver.window)
        self.interlock = interlock
        self.before_motion: Callable[[], None] | None = None
        """Called when the interlock has passed a request; the bus sets it to None after the first."""
        self.listening = listen_only
        self.read_only = False
        """Only reads may leave; an emergency stop may as well."""
        self.diagnosis: Callable[[], str] = str
        self.trace: Feed[TraceRecord] = Feed()
        self.notices: Feed[Notification] = Feed()
        self.statistics = Statistics()
        self.sync = SyncTable(driver)
        self.echo = Echo(possible=driver.family.link.kind == "bytes")
        self.nodes = Nodes(driver, rate)
        self.receiver = driver.receiver()
        self.holds_data = False  # the receiver holds a part of a frame
        self.in_flight: dict[int, Attempt] = {}
        self.done: deque[Attempt] = deque()
        """Attempts that have ended, in order, for the scheduler of their tasks."""
        self.notification_handlers: list[Callable[[Notification], None]] = []
        self.end_sleeps: list[Callable[[BaseException], None]] = []
        """Called with the error when an emergency stop is latched or the port is lost: procedures that sleep end."""
        self.exclusive: object = None  # the task that has the bus alone
        self.latched = self.stopping = False
        self.latched_by = ""
        self.latched_at = self.lost_at = 0
        """Epochs of the last emergency stop and the last loss; see `Nodes.epoch`."""
        self.losses = 0
        self.gone: LinkLost | None = None
        """Why there is no port; None again when it is back."""
        self.free_at = 0.0
        self.full_until = 0.0
        """s; the link was full, and nothing is written before."""
        self._recent: deque[Attempt] = deque(maxlen=RECENT)
        self._wires: deque[Data] = deque(maxlen=8)
        """What was sent last: an echo of it is no reply."""
        self._repeats: dict[int, tuple[tuple[Expected, ...], int]] = {}
        """By lane, the last replies expected, and how often in a row."""
        self._last: Attempt | None = None
        """The last accepted attempt that read positions, if all its nodes answered."""

    # -- time --------------------------------------------------------------------------------------------------

    @property
    def quiet_time(self) -> float:
        """s of silence before a node out of sync is probed."""
        return self.driver.quiet_time(self.rate)

    def air_time(self, request: Request[Any]) -> float:
        """s on the wire of this request and its replies."""
        return self.driver.air_time(request, self.rate)

    def reply_timeout(self, request: Request[Any]) -> float:
        """s from the end of the air time to the deadline.

        For a scan on a link that holds nothing back: the shorter of the normal and the scan turnaround, no margin.
        """
        if request.reply_within is TimeoutClass.SCAN and self.latency < DIRECT:
            plain: Request[Response] = Request(request.wire, request.expected)
            return min(self.driver.turnaround(plain), self.driver.turnaround(request)) + self.latency
        return self.driver.turnaround(request) + self.latency + MARGIN[request.reply_within]

    def next_deadline(self) -> float:
        """The next moment (s) at which an attempt in flight ends; inf when there is none."""
        return min([attempt.deadline for attempt in self.in_flight.values()], default=inf)

    # -- what may leave ----------------------------------------------------------------------------------------

    def is_free(self, now: float) -> bool:
        """A single request may be sent at once."""
        return not (
            self.in_flight
            or self.stopping
            or self.listening
            or self.gone
            or self.echo.present is not False
            or self.exclusive is not None
            or self.holds_data
            or now < (self.free_at if self.paced else self.full_until)
        )

    def blocked_until(self, attempt: Attempt, now: float) -> float:
        """The moment (s) from which this attempt may leave, inf if another one must end first; 0: at once."""
        if attempt.request.lane in self.in_flight:
            return inf
        free = max(self.full_until, self.free_at if self.paced else 0.0)
        if attempt.is_probe:
            free = max(free, self.sync.of(attempt.nodes[0]).quiet_until)
        return free if now < free else 0.0

    def needs_sync(self, attempt: Attempt) -> bool:
        """A node of this attempt, which is no probe, is out of sync: it must be probed first."""
        if not self.sync.out_of_sync or attempt.is_probe or not must_sync(attempt.request):
            return False
        return not set(self.sync.doubtful(attempt.request)) <= set(attempt.excluded)

    def put_off(self, request: Request[Any], now: float) -> tuple[int, ...] | None:
        """The nodes out of sync for which a group does not wait now; None if one must be probed first."""
        nodes = tuple(self.sync.doubtful(request)) if must_sync(request) else ()
        if not nodes:
            return ()
        others = request.expected is not ANY and len(nodes) < len(request.expected)
        return nodes if others and all(self.sync.is_put_off(node, now) for node in nodes) else None

    def check(self, request: Request[Any], since: int, stop_since: int, now: float) -> None:
        """Raise the error that forbids sending this request now.

        `since` is the epoch when its caller decided: of latches and lost ports; `stop_since` of stops of nodes.
        """
        if self.listening:
            raise failures.listen_only(request)
        if self.read_only and not (is_poll(request) or self.stopping or self.latched):
            raise failures.read_only(request)
        if request.priority is Priority.STOP:
            return
        self.check_stops(request, since, stop_since)
        if request.effect in GATED or (request.deferred is not None and self.interlock is not None):
            if self.interlock is None:
                raise failures.no_interlock(request)
            if request.precondition is not None and (error := request.precondition(self.nodes.last_stop)):
                raise error
            self.interlock.check(request, now)
            if self.before_motion is not None:
                self.before_motion()

    def check_stops(self, request: Request[Any], since: int, stop_since: int) -> None:
        """Raise the error for a motion or torque request that must not leave.

        A stop is latched; or the request moves something, and a stop of its nodes or a lost port came after `since`.
        """
        if request.priority is Priority.STOP or request.effect not in GATED:
            return
        if self.latched:
            raise failures.latched(self.latched_by)
        if since == self.nodes.epoch or not moves(request):
            return
        if self.latched_at > since or self.nodes.is_stopped(request, stop_since):
            raise failures.stopped()
        if self.lost_at > since:
            raise failures.outlived(request)

    def note_stop(self, request: Request[Any]) -> None:
        """Count a stop that will be sent, and inform the interlock; from any thread."""
        if request.effect in GATED:
            self.nodes.stopped(request)
            if self.interlock is not None:
                self.interlock.stopped(tuple(addressed(request)))

    # -- an attempt begins -------------------------------------------------------------------------------------

    def attempt(self, request: Request[Any]) -> Attempt:
        """An attempt of this request. One with `decode_exact` is kept, and so is its attempt."""
        if request.decode_exact is None:
            return Attempt(request)
        attempt: Attempt | None = request.attempt
        if attempt is None:
            attempt = request.attempt = Attempt(request)
        elif attempt.in_flight or attempt.task is not None:
            return Attempt(request)  # another caller has sent it, or waits to send it
        return attempt

    def begin(self, attempt: Attempt, now: float) -> None:
        """Record an attempt before its request is written; `written` or `not_written` follows."""
        request = attempt.request
        if self.holds_data:  # bytes from before the request are no part of its reply
            self._flush(now)
        if attempt.timing != (self.rate, self.latency):
            attempt.timing = self.rate, self.latency
            attempt.air = self.air_time(request)
            attempt.budget = attempt.air + self.reply_timeout(request)
            for node in attempt.nodes:
                self.sync.of(node)
        if attempt.is_used:
            attempt.reset()
        attempt.sent_at = now
        if request.expected != ():
            attempt.deadline = max(now, self.free_at) + attempt.budget
            attempt.in_flight = True
            self.in_flight[request.lane] = attempt
            if not self._recent or self._recent[-1] is not attempt:
                self._recent.append(attempt)
        if (request.effect or request.setpoints) and request.priority is not Priority.STOP:
            self.nodes.ordered(request)
        self._wires.append(request.wire)
        if self.echo.present is not False and isinstance(request.wire, bytes):
            self.echo.sent(request.wire)
        if self.trace.subscriptions:
            self.trace.put(TraceRecord(now, "tx", request.wire))

    def written(self, attempt: Attempt) -> None:
        """Its data was written. A request without replies has ended."""
        if attempt.request.expected == ():
            self.free_at = max(attempt.sent_at, self.free_at) + attempt.air
            self.statistics.other["sent"] += 1
            attempt.is_used, attempt.accepted = True, Response((), (), attempt.sent_at)
            self.done.append(attempt)
        elif self.window > 1:
            self._share_wire(attempt)

    def not_written(self, attempt: Attempt, error: LinkError) -> bool:
        """The link did not take its data; other requests lose nothing. True: write it again after its air time.

        A full link takes it later, until the deadline of this attempt. Any other error ends the request, of which a
        part may have been sent.
        """
        request = attempt.request
        if attempt.in_flight:
            attempt.in_flight = False
            del self.in_flight[request.lane]
        if not isinstance(error, LinkFull):
            self._mark_owed(attempt)
        elif not attempt.write_until or attempt.sent_at < attempt.write_until:
            attempt.write_until = attempt.write_until or attempt.sent_at + attempt.budget
            alone: Request[Response] = Request(request.wire)
            self.full_until = attempt.sent_at + self.air_time(alone)
            return True
        attempt.is_used, attempt.error = True, error
        self.done.append(attempt)
        return False

    def _mark_owed(self, attempt: Attempt) -> None:
        """The replies to this attempt may still come."""
        for due in attempt.expected:
            self.sync.mark_owed(attempt.request.lane, due, attempt.sent_at + self.quiet_time)

    def _share_wire(self, attempt: Attempt) -> None:
        """Extend this deadline by the air time of each other attempt in flight, and theirs by its own.

        Each attempt counts each other one once, and at most window - 1 of them.
        """
        others = [other for other in self.in_flight.values() if other is not attempt]
        attempt.shared = len(others)
        for other in others:
            attempt.deadline += other.air
            if other.shared < self.window - 1 and other.task is not None:
                other.deadline += attempt.air
                other.shared += 1

    # -- what comes in -----------------------------------------------------------------------------------------

    def accept(self, attempt: Attempt, data: Data, at: float) -> Any:
        """The value of an attempt that is alone in flight, if this is its whole reply, else `PENDING`.

        Only for a request with `decode_exact`. Data of a pending attempt was not taken: `feed` it.
        """
        at = min(at, attempt.deadline)  # the host was late
        value = attempt.request.decode_exact(data, at)  # type: ignore[misc]  # the caller has looked
        if value is None:
            return PENDING
        if self.trace.subscriptions:
            self.trace.put(TraceRecord(at, "rx", data))
        del self.in_flight[attempt.request.lane]
        attempt.in_flight = False
        attempt.data, attempt.answer = data, None
        self._note(attempt, at, attempt.nodes, True)
        return value

    def feed(self, chunks: Sequence[Data], now: float, looked: float | None = None) -> None:
        """Take the data of the link, then end attempts overdue at `looked`, when the link was read."""
        for data in chunks:
            if self.trace.subscriptions:
                self.trace.put(TraceRecord(now, "rx", data))
            rest = self.echo.strip(data) if type(data) is bytes else data
            if self.echo.broken:
                self._fail_by_echo()
            if rest:
                self._take_all(self.receiver.feed(rest), now)
                self.holds_data = bool(self.receiver.held)
        if chunks:
            self._end_complete(now)
        self.expire(now if looked is None else looked)

    def _flush(self, now: float) -> None:
        self.holds_data = False
        self._take_all(self.receiver.flush(), now)

    def _take_all(self, events: Sequence[Event], now: float) -> None:
        for event in events:
            if isinstance(event, Reply):
                self._take_reply(event, now)
            elif isinstance(event, Noise):
                self._take_noise(event, now)
            else:
                self.statistics.other["notices"] += 1
                notice = event._replace(at=now)
                self.notices.put(notice)
                for handle in tuple(self.notification_handlers):
                    handle(notice)

    def _take_reply(self, reply: Reply, now: float) -> None:
        attempt = self.in_flight.get(reply.lane)
        if attempt is None:
            self._take_unexpected(None, reply, now)
        elif reply.data in self._wires and not attempt.is_probed:
            attempt.fault = "echo"
            self.statistics.other["echo"] += 1
        elif attempt.complete:
            if attempt.is_excluded(reply):
                self._settle_late(reply)
            else:
                attempt.surplus |= not self._take_for_all(reply)
        elif not self._settle_older(attempt, reply) and not attempt.take(reply):
            self._take_unexpected(attempt, reply, now)

    def _settle_older(self, attempt: Attempt, reply: Reply) -> bool:
        """True for an owed reply of an earlier request, which is settled; only an unprobed request can meet one."""
        unprobed = attempt.request.priority is Priority.STOP or attempt.request.expected is ANY
        return unprobed and self._settle_late(reply)

    def _settle_late(self, reply: Reply) -> bool:
        late = self.sync.take_owed(reply.lane, reply.key, len(reply.data))
        self.statistics.other["late"] += late
        return late

    def _take_for_all(self, reply: Reply) -> bool:
        """A request to all nodes takes every reply that no other request expects."""
        attempt = self.in_flight.get(EVERY_LANE)
        return attempt is not None and attempt.take(reply)

    def _take_unexpected(self, attempt: Attempt | None, reply: Reply, now: float) -> None:
        if self._settle_late(reply) or self._take_for_all(reply):
            return
        keys = [] if attempt is None or attempt.is_probe else [due.key for due in attempt.expected]
        if attempt is not None and reply.key in keys:
            attempt.exclude(reply)
            self.statistics.other["unexpected"] += 1
        else:
            self.statistics.other["foreign"] += 1
            self._doubt_recent(now, reply.lane)

    def _take_noise(self, noise: Noise, now: float) -> None:
        self.statistics.other[noise.fault] += 1
        if noise.fault == "foreign":
            return
        for lane, attempt in self.in_flight.items():
            if noise.lane in (None, lane):
                attempt.take_noise(noise.fault, noise.data)
        self._doubt_recent(now, noise.lane)

    def _doubt_recent(self, now: float, lane: int | None) -> None:
        """Unexpected data came: every node asked within the quiet time, on this lane, may have sent it."""
        quiet = self.quiet_time
        for attempt in self._recent:
            if lane in (None, attempt.request.lane) and now - attempt.sent_at <= quiet:
                for node in attempt.nodes:
                    self.sync.mark_doubted(node, now + quiet)

    def _fail_by_echo(self) -> None:
        """The echo of what was sent did not come as a whole: no reply of now counts."""
        self.echo.broken = False
        self.statistics.other["echo"] += 1
        for attempt in self.in_flight.values():
            attempt.fault = "echo"

    # -- how an attempt ends -----------------------------------------------------------------------------------

    def _end_complete(self, now: float) -> None:
        for attempt in tuple(self.in_flight.values()):
            if attempt.complete or attempt.fault:
                if self.holds_data:  # all replies are here, so what is held is surplus
                    self._flush(now)
                if attempt.complete or now >= attempt.deadline:
                    self._end(attempt, now)

    def expire(self, now: float) -> None:
        """End every attempt whose deadline has passed."""
        for attempt in tuple(self.in_flight.values()):
            if now < attempt.deadline:
                continue
            held = self.echo.give_up()
            if self.echo.broken:
                self._fail_by_echo()
            if held:
                self._take_all(self.receiver.feed(held), now)
            self._flush(now)
            self._end(attempt, now)

    def _end(self, attempt: Attempt, now: float) -> None:
        """End an attempt: accept its replies (of a group, those that came) or set its fault."""
        request, expected = attempt.request, attempt.expected
        if (len(expected) == 1 and not attempt.complete) or (expected and (attempt.fault or attempt.surplus)):
            attempt.fault = attempt.failure()
        answer = attempt.response(min(now, attempt.deadline))
        if attempt.is_probe and not attempt.fault and not (request.decode and request.decode(answer)):
            attempt.fault = "unexpected"
        del self.in_flight[request.lane]
        attempt.in_flight, attempt.is_used = False, True
        for due in expected:
            if attempt.fault or due.node in answer.missing:
                self._miss(attempt, due, now)
        if not attempt.fault or not expected:
            attempt.accepted = answer
            self._accept_response(attempt, answer)
        self.done.append(attempt)

    def _miss(self, attempt: Attempt, due: Expected, now: float) -> None:
        """This reply does not count: note the quiet time, or that its node owes it."""
        came = any(attempt.expected[index] is due for index in attempt.replies)
        if came or attempt.request.priority is Priority.STOP:
            self.sync.mark_doubted(due.node, 0.0)
            self.sync.of(due.node).quiet_until = now + self.quiet_time
        else:
            self.sync.mark_owed(attempt.request.lane, due, now + self.quiet_time)
        self.statistics.of(due.node).errors[attempt.failure()] += 1

    def _accept_response(self, attempt: Attempt, answer: Response) -> None:
        request = attempt.request
        if request.expected is ANY:
            if request.lane == EVERY_LANE:  # the lane is the node: a stop must reach all that answered
                self.nodes.add([reply.lane for reply in answer.replies])
            return
        self.echo.conclude(is_test=attempt.is_probe or request is self.echo.test)
        nodes = attempt.nodes
        if answer.missing:
            nodes = tuple([node for node in nodes if node not in answer.missing])
            for node in answer.missing if request.reports_position else ():
                self.nodes.sources.pop(node, None)  # its source may be this attempt, which has no reply of it
        reads = bool(request.reports_position) and not is_refusal(request, answer)
        if reads:
            attempt.answer = answer
        self._note(attempt, answer.at, nodes, reads)

    def _note(self, attempt: Attempt, at: float, nodes: tuple[int, ...], reads: bool) -> None:
        """Note an accepted reply: who is in sync, the position, how often in a row an equal one was expected."""
        request, known = attempt.request, self.nodes
        attempt.at = at
        if self.sync.out_of_sync and request.priority is not Priority.STOP:
            for node in nodes:  # an earlier reply may follow that to a stop, which puts no node in sync
                self.sync.confirm(node, probe=attempt.is_probe)
        if reads and request.reports_position:
            attempt.orders = known.orders
            if self._last is not attempt or nodes is not attempt.nodes:
                known.sources.update(dict.fromkeys(nodes, attempt))
                self._last = attempt if nodes is attempt.nodes else None
        known.rate = self.rate
        if not known.known.issuperset(nodes):
            known.add(nodes)
        for node in nodes:
            (self.statistics.nodes.get(node) or self.statistics.of(node)).ok += 1
        expected, count = self._repeats.get(request.lane, ((), 0))
        if attempt.expected == expected and 0 < self.driver.probe_after <= count:
            count = 0
            for due in attempt.expected:  # a reply may have been copied: a probe of one node shows that
                if due.node not in self.sync.out_of_sync:
                    self.sync.mark_owed(request.lane, due, 0.0)
                    break
        self._repeats[request.lane] = attempt.expected, count + 1 if attempt.expected == expected else 1

    # -- loss, stop --------------------------------------------------------------------------------------------

    def announce_stop(self, by: str) -> None:
        """Refuse motion and torque from now on; from any thread. `by` is kept from the first stop until `reset`."""
        self.latched_by = self.latched_by if self.latched else by
        self.nodes.epoch += 1
        self.latched_at = self.nodes.epoch
        self.latched = self.stopping = True

    def stop_delay(self, now: float) -> float:
        """s that a stop waits for the turn: as long as a reply may be on the wire; from any thread."""
        attempts = tuple(self.in_flight.values())
        return max((self._remaining(one, now) for one in attempts), default=0.0) + STOP_DELAY

    def latch(self, now: float, by: str) -> None:
        """Emergency stop: end sleeps, shorten what is in flight, refuse motion until `reset`.

        A repeatable read in flight may be sent again after the stop; anything else in flight fails.
        """
        self.announce_stop(by)
        error = failures.latched(self.latched_by)
        for end in tuple(self.end_sleeps):
            end(error)
        for attempt in self.in_flight.values():
            attempt.deadline = min(attempt.deadline, now + self._remaining(attempt, now) + self.latency)
            if self.window == 1 or not is_read(attempt.request):
                attempt.error = error

    def _remaining(self, attempt: Attempt, now: float) -> float:
        """s that a stop waits at most: the whole air time on a half-duplex line, else the rest of the request."""
        if not self.driver.full_duplex:
            return attempt.air
        request: Request[Response] = Request(attempt.request.wire)
        return max(0.0, attempt.sent_at + self.air_time(request) - now)

    def stop_sent(self) -> None:
        """The stop frames were sent: other requests may leave again, motion and torque stay refused."""
        self.stopping = False

    def reset(self) -> None:
        """Take the latch off."""
        self.latched = self.stopping = False

    def lost(self, error: LinkError) -> None:
        """The link failed: everything that waits fails with this error."""
        for attempt in self.in_flight.values():
            self._mark_owed(attempt)
            for node in attempt.nodes:
                self.statistics.of(node).errors["lost"] += 1
            attempt.in_flight, attempt.is_used, attempt.error = False, True, error
            self.done.append(attempt)
        self.in_flight.clear()
        self.exclusive = None
        if isinstance(error, LinkLost):
            if self.gone is None:
                self.losses += 1
                self.nodes.epoch += 1
                self.lost_at = self.nodes.epoch
                for end in tuple(self.end_sleeps):
                    end(error)
            self.gone = error
            self._forget_positions()

    def _forget_positions(self) -> None:
        """The devices may have restarted."""
        self.nodes.sources.clear()
        self._last = None

    def reconnected(self, now: float, latency: float) -> None:
        """The port is open again: all nodes are out of sync and their positions unknown; the nodes stay known."""
        self.latency = latency
        self.receiver, self.holds_data = self.driver.receiver(), False
        self.echo.reset()
        self.sync.mark_all(now + self.quiet_time)
        self._forget_positions()
        self.gone = None

    def set_rate(self, rate: int) -> None:
        """The link has this rate (bit/s) now."""
        self.rate = rate
        self.receiver, self.holds_data = self.driver.receiver(), False


def is_poll(request: Request[Any]) -> bool:
    """It changes nothing: a poll or a scan without effect. A write without a listed effect has another priority."""
    polls = request.priority is Priority.POLL or request.reply_within is TimeoutClass.SCAN
    return polls and request.effect is Effect.NONE and request.deferred is None
