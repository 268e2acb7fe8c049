"""The engine of a bus: requests in, frames out, data in, replies out. No I/O and no clock.

At most one request is in flight per lane, on at most `window` lanes. A request with replies is in `in_flight` from
before it is written until its attempt ends or the link fails; which nodes may still owe a reply is in `sync`. A
deadline is fixed when the request leaves; requests on other lanes, which share the wire, extend it, and an emergency
stop may shorten it. The engine relies on a link that is first in, first out: data read before a request cannot answer
it.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import count
from math import inf
from typing import Any, Final, TypeVar

from motorbus.bus import failures
from motorbus.bus.echo import Echo
from motorbus.bus.interlock import Interlock
from motorbus.bus.jobs import Attempt, ExclusiveJob, Job, RateJob, RequestJob, Since, Wait
from motorbus.bus.policy import carry_out
from motorbus.bus.positions import GATED, LastPositions, addressed, moves
from motorbus.bus.prepared import Prepared, nodes_of
from motorbus.bus.statistics import Statistics
from motorbus.bus.sync import SyncTable
from motorbus.bus.trace import Feed, TraceRecord
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
from motorbus.errors import LinkError, LinkFull, LinkLost, MotorbusError

T = TypeVar("T")

MARGIN: Final = {TimeoutClass.SCAN: 0.002, TimeoutClass.REPLY: 0.02, TimeoutClass.STORE: 0.02}
"""s that the host may be late; short for a scan, where silence is the usual answer."""
DIRECT: Final = 0.001
"""s; a link of less latency has no adapter that holds data back."""
STOP_DELAY: Final = 0.003
"""s that a stop waits for the turn beyond the air time of what is in flight."""


class Engine:
    """The engine of one bus. `rate` (bit/s) and `latency` (s) describe the link; `paced`: the link takes air
    time, so nothing is sent before `free_at` (s). `queue`: frames that its adapter takes at once, 0 if unknown.

    `time` (s) is `now` of the last `submit`, `next_frame` or `feed`. `losses` and `latches` count lost ports and
    emergency stops. An emergency stop is announced (`stopping`), sent (`stop_sent`), and stays `latched` until `reset`.
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
        self.window = min(driver.window, queue or driver.window)
        self.paced = paced
        self.interlock = interlock
        self.before_motion: Callable[[], None] | None = None
        """Called when the interlock has passed a request; the bus sets it to None after the first."""
        self.always_listening = self.listening = listen_only
        self.diagnosis: Callable[[], str] = str
        self.trace: Feed[TraceRecord] = Feed()
        self.notices: Feed[Notification] = Feed()
        self.statistics = Statistics()
        self.sync = SyncTable(driver)
        self.echo = Echo()
        self.receiver = driver.receiver()
        self.positions = LastPositions(driver, rate)
        self.in_flight: dict[int, Attempt] = {}
        self.queue: list[Job] = []
        self.notification_handlers: list[Callable[[Notification], None]] = []
        self.end_sleeps: list[Callable[[BaseException], None]] = []
        """Called with the error when an emergency stop is latched or the port is lost: procedures that sleep end."""
        self.exclusive: object = None
        self.latched = self.stopping = False
        self.latched_by = ""
        self.losses = self.latches = 0
        self.gone: LinkLost | None = None
        """Why there is no port; None again when it is back."""
        self.free_at = self.time = 0.0
        self.full_until = 0.0
        """s; the link was full, and nothing is written before."""
        self.rate = rate
        """bit/s"""
        self.latency = latency
        """s that the adapter may hold data back; part of every deadline."""
        self.since = Since(self.positions.stops, self.latches, self.losses)
        """Present counts of stops, emergency stops and losses. A caller keeps them; `check` compares."""
        self._serial = count()
        self._leaving: Attempt | None = None
        """The attempt whose request is being written."""
        self.ready = False
        self.last: Prepared | None = None
        """The prepared request that was carried out last, if nothing else happened since."""

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

    @property
    def idle(self) -> bool:
        """Nothing is in flight or waits to be sent."""
        return not (self.in_flight or self.queue)

    def check_ready(self) -> bool:
        """Set and return `ready`: a prepared request may be sent at once.

        `ready` stays True until `submit`, `feed`, an emergency stop or a lost link clears it.
        """
        self.ready = not (self.in_flight or self.queue or self.stopping or self.listening or self.gone) and (
            self.exclusive is None and self.echo.is_out and not self.receiver.held
        )
        return self.ready

    # -- jobs --------------------------------------------------------------------------------------------------

    def submit(self, job: Job, now: float) -> None:
        """Queue a job: by priority, then in order of submission. A refused job is settled at once."""
        self.time, self.ready = now, False
        self.note_last()
        job.serial = next(self._serial)
        if isinstance(job, RequestJob):
            try:
                self._check_stops(job.request, job.since)
            except MotorbusError as error:
                job.settle(error=error)
                return
            if job.priority is Priority.STOP:
                self.note_stop(job.request)
            if (
                job.request.decode_exact is not None
                and getattr(job.request.prepared, "engine", None) is not self
            ):
                job.request.prepared = self.prepare(job.request)
            job.policy = carry_out(self, job.request)
            insort(self.queue, job)
        elif isinstance(job, ExclusiveJob) and self.exclusive is not None and self.exclusive is job.owner:
            job.settle()
        else:
            insort(self.queue, job)

    def cancel(self, job: Job, error: BaseException | None = None) -> None:
        """Its caller no longer waits. A request in flight keeps its lane until its reply or its deadline."""
        self._remove(job)
        for attempt in self.in_flight.values():
            if attempt.job is job:
                attempt.job = None
        job.settle(error=error or failures.abandoned())

    def release(self, owner: object) -> None:
        """This owner no longer has the bus alone."""
        if self.exclusive is owner:
            self.exclusive = None

    def _resume(self, job: RequestJob, attempt: Attempt | None = None) -> None:
        """Ask the policy of a job for its next step, and queue the job with it.

        `attempt` is the finished one; None to start, after a wait, or when the chosen attempt may not leave.
        """
        assert job.policy is not None
        self._remove(job)
        if job.done:  # its caller waits no more
            return
        try:
            step = job.policy.send(attempt)
            while isinstance(step, Wait) and step.until <= self.time:
                step = job.policy.send(None)
        except StopIteration as end:
            self._decode(job, end.value)
        except MotorbusError as error:
            job.settle(error=error)
        else:
            job.step = step
            insort(self.queue, job)

    def _decode(self, job: RequestJob, answer: Response) -> None:
        request = job.request
        try:
            value = answer if request.decode is None else request.decode(answer)
        except Exception as error:  # a refusal of the device, or an error of the driver
            job.settle(error=error)
            return
        if request.expected:
            self.positions.accept(request, answer)
        job.settle(value)

    def _remove(self, job: Job) -> None:
        if job in self.queue:
            self.queue.remove(job)

    # -- what is sent ------------------------------------------------------------------------------------------

    def next_frame(self, now: float) -> Data | RateJob | None:
        """What to do now: write this data, or change the rate; None: nothing until `next_deadline` or new data.

        After a write call `written` or `not_written`, after a change of rate `rate_changed`. Also grants exclusive use
        of the bus.
        """
        self.time = now
        for job in list(self.queue):
            if not self._may_use_bus(job):
                continue
            if isinstance(job, RequestJob):
                data = self._try_to_send(job, now)
                if data is not None:
                    return data
            elif self.in_flight:  # a rate change or exclusive use waits, and what is behind it waits, too
                return None
            else:
                self.queue.remove(job)
                if isinstance(job, RateJob):
                    return job
                self.exclusive = job.owner
                job.settle()
        return None

    def _may_use_bus(self, job: Job) -> bool:
        if job.priority is Priority.STOP:
            return True
        return not self.stopping and (self.exclusive is None or self.exclusive is job.owner)

    def _try_to_send(self, job: RequestJob, now: float) -> Data | None:
        """Begin the next attempt of this job: its lane and the wire are free, its nodes are in sync, `check` passes."""
        if job.request.lane in self.in_flight or len(self.in_flight) >= self.window:
            return None
        if now < self.full_until or (self.paced and now < self.free_at):
            return None
        if not isinstance(job.step, Attempt):
            if job.step is not None and now < job.step.until:
                return None
            self._resume(job)
        if job.done or not isinstance(job.step, Attempt):
            return None
        attempt, request = job.step, job.step.request
        # Another request to this node may have failed since the probe was chosen: its quiet time runs again.
        if now < self._earliest(attempt):
            return None
        unprobed = (
            attempt.is_probe or request.priority is Priority.STOP or request.reply_within is TimeoutClass.SCAN
        )
        doubtful = [] if unprobed else self.sync.doubtful(request)
        if any(node not in attempt.excluded for node in doubtful):
            self._resume(job)
            return None
        self._remove(job)
        try:
            self.check(request, job.since)
        except MotorbusError as error:
            job.settle(error=error)
            return None
        attempt.job = job
        attempt.echo_excluded = attempt.after_echo and self.echo.present is False
        self.begin(attempt, now)
        return request.wire

    def _earliest(self, step: Attempt | Wait) -> float:
        """The earliest moment (s) for this step; -inf if it may be carried out now."""
        if isinstance(step, Wait):
            return step.until
        return self.sync.of(step.dues[0].node).quiet_until if step.is_probe else -inf

    def check(self, request: Request[Any], since: Since | None) -> None:
        """Raise the error that forbids sending this request now. `since`: the counts when its caller decided."""
        if self.listening:
            raise failures.listen_only(request)
        if request.priority is Priority.STOP:
            return
        if self.latched or since is not self.since:
            self._check_stops(request, since)
        if request.effect in GATED or (request.deferred is not None and self.interlock is not None):
            if self.interlock is None:
                raise failures.no_interlock(request)
            if request.precondition is not None and (
                error := request.precondition(self.positions.stop_count)
            ):
                raise error
            self.interlock.check(request, self.time)
            if self.before_motion is not None:
                self.before_motion()

    def _check_stops(self, request: Request[Any], since: Since | None) -> None:
        """Raise the error for a motion or torque request that must not leave.

        A stop is latched; or the request moves something, and a stop of its nodes or a lost port came after `since`.
        """
        if request.effect not in GATED or request.priority is Priority.STOP:
            return
        if self.latched:
            raise failures.latched(self.latched_by)
        if since is None or not moves(request):
            return
        if since.latches != self.latches or self.positions.is_stopped(request, since.stops):
            raise failures.stopped()
        if since.losses != self.losses:
            raise failures.outlived(request)

    def note_stop(self, request: Request[Any]) -> None:
        """Count a stop request that will be sent, and inform the interlock; from any thread."""
        self.positions.sent(request)
        self._note_since()
        if self.interlock is not None and request.effect in GATED:
            with suppress(Exception):  # the stop must go out
                self.interlock.stopped(tuple(addressed(request)))

    def _note_since(self) -> None:
        self.since = Since(self.positions.stops, self.latches, self.losses)

    def begin(self, attempt: Attempt, now: float) -> None:
        """Record an attempt before its request is written; `written` or `not_written` follows."""
        request = attempt.request
        if self.receiver.held:  # bytes from before the request are no part of its reply
            self._take_all(self.receiver.flush(), now)
        attempt.sent_at, attempt.air = now, self.air_time(request)
        if request.expected != ():
            attempt.deadline = max(now, self.free_at) + attempt.air + self.reply_timeout(request)
            self.in_flight[request.lane] = attempt
        if (request.effect or request.setpoints) and request.priority is not Priority.STOP:
            self.positions.sent(request)
        self._leaving = attempt

    def adopt(self, attempt: Attempt) -> None:
        """Record of a written prepared request what `begin` records; it continues on the general path."""
        request = attempt.request
        self.note_last()
        self.sync.mark_sent(request, attempt.sent_at)
        self.statistics.asked(request.expected)
        if isinstance(request.wire, bytes):
            self.echo.sent(request.wire, testing=False)

    def written(self) -> None:
        """The data of `next_frame` was written. If its request expects no reply, settle the job."""
        attempt, self._leaving = self._leaving, None
        assert attempt is not None
        request = attempt.request
        if request.expected == ():
            self.free_at = max(attempt.sent_at, self.free_at) + attempt.air
        else:
            self.sync.mark_sent(request, attempt.sent_at)
            self._share_wire(attempt)
        if isinstance(request.wire, bytes):
            self.echo.sent(request.wire, attempt.is_probe or request is self.echo.test)
        self.statistics.asked(request.expected)
        if self.trace.subscriptions:
            self.trace.put(TraceRecord(attempt.sent_at, "tx", request.wire))
        if request.expected == () and attempt.job is not None:
            self._decode(attempt.job, attempt.answer(self.time))

    def not_written(self, error: LinkError) -> None:
        """The link did not take the data of `next_frame`; other requests lose nothing.

        If it is full, the request is written again after its air time, until the deadline of this attempt. Any other
        error ends the request, of which a part may have been sent.
        """
        attempt, self._leaving = self._leaving, None
        assert attempt is not None
        assert attempt.job is not None
        request, job = attempt.request, attempt.job
        if request.expected != ():
            del self.in_flight[request.lane]
        if not isinstance(error, LinkFull):
            self._mark_owed(attempt)
        elif not attempt.write_until or attempt.sent_at < attempt.write_until:
            attempt.write_until = attempt.write_until or (
                attempt.sent_at + attempt.air + self.reply_timeout(request)
            )
            alone: Request[Response] = Request(request.wire)
            self.full_until = attempt.sent_at + self.air_time(alone)
            insort(self.queue, job)
            return
        job.settle(error=error)

    def _mark_owed(self, attempt: Attempt) -> None:
        """The replies to this attempt may still come."""
        for due in attempt.dues:
            self.sync.mark_owed(attempt.request.lane, due, attempt.sent_at + self.quiet_time)

    def _share_wire(self, attempt: Attempt) -> None:
        """Extend this deadline by the air time of each other attempt in flight, and theirs by its own.

        Each attempt counts each competitor once, and at most window - 1 of them.
        """
        if self.window == 1:
            return
        others = [other for other in self.in_flight.values() if other is not attempt]
        attempt.competitors = len(others)
        for other in others:
            attempt.deadline += other.air
            if other.competitors < self.window - 1 and other.job is not None:
                other.deadline += attempt.air
                other.competitors += 1

    def rate_changed(self, job: RateJob, error: MotorbusError | None = None) -> None:
        """A rate job has ended: the rate was set, or only read (0), or the link refused it (`error`)."""
        before = self.rate
        if error is None and job.tune.rate:
            self.rate = job.tune.rate
            self.listening = job.tune.listen_only or self.always_listening
            self.receiver = self.driver.receiver()
        job.settle(before, error)

    def alternate(self, request: Request[Any]) -> Request[Any]:
        """The equivalent request with another reply length, if the last reply of the node had the length of this one.

        A copy of the last reply then cannot pass for the new one.
        """
        if request.alternate is None or request.expected is ANY or len(request.expected) != 1:
            return request
        due = request.expected[0]
        node = self.sync.nodes.get(due.node)
        return request.alternate() if node is not None and node.length == due.length else request

    # -- what comes in -----------------------------------------------------------------------------------------

    def feed(self, chunks: Sequence[Data], now: float, looked: float | None = None) -> None:
        """Take the data of the link, then end attempts overdue at `looked`, when the link was read."""
        self.time, self.ready = now, False
        self.note_last()
        for data in chunks:
            if self.trace.subscriptions:
                self.trace.put(TraceRecord(now, "rx", data))
            if isinstance(data, bytes):
                self._feed_bytes(data, now)
            else:
                self._take_all(self.receiver.feed(data), now)
        self._end_complete(now)
        self.expire(now if looked is None else looked)

    def _feed_bytes(self, data: bytes, now: float) -> None:
        rest = self.echo.strip(data)
        if self.echo.broken:
            self._echo_broke(now)
        if rest:
            self._take_all(self.receiver.feed(rest), now)
        if self.echo.returned and not any(
            attempt.echo_excluded or attempt.fault == "echo" for attempt in self.in_flight.values()
        ):
            self.echo.suspect()
            self._fail_all_by_echo()

    def _take_all(self, events: Sequence[Event], now: float) -> None:
        for event in events:
            self._take(event, now)

    def _take(self, event: Event, now: float) -> None:
        if isinstance(event, Reply):
            self._take_reply(event, now)
        elif isinstance(event, Notification):
            self.statistics.other["notices"] += 1
            notice = event._replace(at=now)
            self.notices.put(notice)
            for handle in tuple(self.notification_handlers):
                handle(notice)
        else:
            self._take_noise(event, now)

    def _take_reply(self, reply: Reply, now: float) -> None:
        attempt = self.in_flight.get(reply.lane)
        if attempt is None:
            self._take_unexpected(None, reply, now)
        elif reply.data in self.echo.recent and not attempt.echo_excluded:
            self.echo.suspect()
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
        if attempt is not None and not attempt.is_probe and any(due.key == reply.key for due in attempt.dues):
            attempt.exclude(reply)
            self.statistics.other["unexpected"] += 1
        else:
            self.statistics.other["foreign"] += 1
            self.sync.mark_recent(now, self.quiet_time, reply.lane)

    def _take_noise(self, noise: Noise, now: float) -> None:
        self.statistics.other[noise.fault] += 1
        if noise.fault == "foreign":
            return
        for lane, attempt in self.in_flight.items():
            if noise.lane in (None, lane):
                attempt.take_noise(noise.fault, noise.data)
        self.sync.mark_recent(now, self.quiet_time, noise.lane)

    def _echo_broke(self, now: float) -> None:
        self.echo.broken = False
        self._fail_all_by_echo()
        self.sync.mark_recent(now, self.quiet_time)

    def _fail_all_by_echo(self) -> None:
        self.statistics.other["echo"] += 1
        for attempt in self.in_flight.values():
            attempt.fault = "echo"

    # -- how an attempt ends -----------------------------------------------------------------------------------

    def _end_complete(self, now: float) -> None:
        for lane, attempt in list(self.in_flight.items()):
            if not attempt.complete:
                continue
            self._take_all(self.receiver.flush(), now)  # all replies are here, so what is held is surplus
            if not self._may_be_echo(attempt) or attempt.surplus or now >= attempt.deadline:
                self._end(lane, attempt, now)

    def _may_be_echo(self, attempt: Attempt) -> bool:
        """Whether echo is unknown and the reply is the beginning of the request: the rest of an echo may follow."""
        return self.echo.present is None and any(
            self.echo.may_be(reply.data) for reply in attempt.replies.values()
        )

    def expire(self, now: float) -> None:
        """End every attempt whose deadline has passed."""
        for lane, attempt in list(self.in_flight.items()):
            if now < attempt.deadline:
                continue
            held = self.echo.give_up()
            if self.echo.broken:
                self._echo_broke(now)
            self._take_all([*(self.receiver.feed(held) if held else ()), *self.receiver.flush()], now)
            if self.in_flight.get(lane) is attempt:  # what was held has not completed it
                self._end(lane, attempt, now)

    def _end(self, lane: int, attempt: Attempt, now: float) -> None:
        """End an attempt: accept its replies (of a group, those that came) or set its fault; resume its job."""
        request, dues = attempt.request, attempt.dues
        single = request.expected is not ANY and len(dues) == 1
        if (single and not attempt.complete) or (dues and (attempt.fault or attempt.surplus)):
            attempt.fault = attempt.failure()
        answer = attempt.answer(min(now, attempt.deadline))
        if (
            attempt.is_probe
            and not attempt.fault
            and not (request.decode is not None and request.decode(answer))
        ):
            attempt.fault = "unexpected"
        answered = [due for index, due in enumerate(dues) if self._judge_reply(attempt, index, due, now)]
        del self.in_flight[lane]
        if attempt.fault in ("", "silence") or not dues:
            self._end_echo_test(attempt)
        if not attempt.fault or not dues:
            attempt.accepted = answer
            self._accept(attempt, answer, answered, now)
        attempt.ended = True
        if attempt.job is not None:
            self._resume(attempt.job, attempt)

    def _judge_reply(self, attempt: Attempt, index: int, due: Expected, now: float) -> bool:
        """True if this reply counts. Else count the error, and note the quiet time or the owed reply of its node."""
        if not attempt.fault and index in attempt.replies and due.node not in attempt.excluded:
            return True
        quiet_until = now + self.quiet_time
        if index in attempt.replies or attempt.request.priority is Priority.STOP:
            self.sync.of(due.node).quiet_until = quiet_until
        else:
            self.sync.mark_owed(attempt.request.lane, due, quiet_until)
        self.statistics.of(due.node).errors[attempt.failure()] += 1
        return False

    def _accept(self, attempt: Attempt, answer: Response, answered: Sequence[Expected], now: float) -> None:
        request = attempt.request
        if request.expected is ANY:
            if (
                request.lane == EVERY_LANE
            ):  # on such a bus the lane is the node: a stop must reach all that answered
                self.positions.add([reply.lane for reply in answer.replies])
            return
        if (
            request.priority is not Priority.STOP
        ):  # an earlier reply may still come, so a stop puts no node in sync
            for due in answered:
                self.sync.confirm(due, probe=attempt.is_probe)
        self.statistics.answered(answered, now - attempt.sent_at)
        self.positions.answered([due.node for due in answered], request, answer, self.rate)

    def _end_echo_test(self, attempt: Attempt) -> None:
        """If this attempt shows that there is no echo, record that."""
        if self.echo.present is not None or attempt.noise:
            return
        if attempt.is_probe or attempt.request is self.echo.test or self.echo.disproved:
            self.echo.exclude()

    # -- prepared requests -------------------------------------------------------------------------------------

    def prepare(self, request: Request[Any]) -> Prepared | None:
        """Prepare a request that is repeated; None if it needs the general path (queue, policy, receiver)."""
        if (
            request.decode_exact is None
            or request.priority is Priority.STOP
            or request.effect
            or not request.expected
        ):
            return None
        prepared = self._prepare(request)
        if request.alternate is not None and prepared is not None:
            alternate = self._prepare(request.alternate())
            if alternate is None:
                return None
            prepared.alternate = alternate
            alternate.alternate = alternate.record = prepared
        request.prepared = prepared
        return prepared

    def _prepare(self, request: Request[Any]) -> Prepared | None:
        if request.decode_exact is None or request.expected is ANY:
            return None
        nodes = nodes_of(request)
        states, times = [self.sync.of(node) for node in nodes], self.statistics.group(nodes)
        return Prepared(self, request, request.decode_exact, nodes, states, times, Attempt(request))

    def measure(self, prepared: Prepared) -> None:
        """Compute the time budget of a prepared request for the present rate and latency."""
        request = prepared.request
        prepared.budget = self.air_time(request) + self.reply_timeout(request)
        prepared.rate, prepared.latency = self.rate, self.latency

    def note_last(self, record: Prepared | None = None) -> None:
        """Note what was put off for the last prepared request: when its nodes were asked, and the reply length.

        `record` is the last one from now on.
        """
        last, self.last = self.last, record
        if last is not None:
            for state in last.states:
                state.length, state.asked_at = last.source.length, last.source.attempt.sent_at
        if record is not None and record.request.reports_position:
            self.positions.latest.update(dict.fromkeys(record.nodes, record))

    # -- time, loss, stop --------------------------------------------------------------------------------------

    def next_deadline(self) -> float:
        """The next moment (s) at which `next_frame` or `expire` has something to do; inf when there is none."""
        moments = [attempt.deadline for attempt in self.in_flight.values()]
        steps = [job.step for job in self.queue if isinstance(job, RequestJob)]
        waits = [self._earliest(step) for step in steps if step is not None]
        moments += [moment for moment in waits if moment > self.time]
        if self.queue:
            free = (self.full_until, self.free_at if self.paced else -inf)
            moments += [moment for moment in free if moment > self.time]
        return min(moments, default=inf)

    def announce_stop(self, by: str) -> None:
        """Refuse motion and torque from now on; from any thread. `by` is kept from the first stop until `reset`."""
        self.latched_by = self.latched_by if self.latched else by
        self.latches += 1
        self.latched = self.stopping = True
        self._note_since()
        self.ready = False

    def stop_delay(self, now: float) -> float:
        """s that a stop waits for the turn: as long as a reply may be on the wire; from any thread."""
        flying = tuple(self.in_flight.values())
        return max((self._remaining(one, now) for one in flying), default=0.0) + STOP_DELAY

    def latch(self, now: float, by: str) -> None:
        """Emergency stop: end motion that waits and what is in flight, refuse motion until `reset`.

        Requests that wait and neither move nor switch torque stay queued. With several lanes repeatable reads in flight
        are sent again after the stop; anything else in flight fails.
        """
        self.announce_stop(by)
        error = failures.latched(self.latched_by)
        for job in list(self.queue):
            if isinstance(job, RequestJob) and job.request.effect in GATED:
                self.cancel(job, error)
        for end in tuple(self.end_sleeps):
            end(error)
        for attempt in self.in_flight.values():
            attempt.deadline = min(attempt.deadline, now + self._remaining(attempt, now) + self.latency)
            caller, attempt.job = attempt.job, None
            if caller is None:
                continue
            if self.window > 1 and caller.request.repeatable and caller.request.effect is Effect.NONE:
                caller.policy, caller.step = carry_out(self, caller.request), None
                insort(self.queue, caller)
            else:
                caller.settle(error=error)

    def _remaining(self, attempt: Attempt, now: float) -> float:
        """s that a stop waits at most: the whole air time on a half-duplex line, else the rest of the request."""
        if not self.driver.full_duplex:
            return self.air_time(attempt.request)
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
        self.ready = False
        leaving, self._leaving = self._leaving, None
        attempts = {*self.in_flight.values(), *([] if leaving is None else [leaving])}
        jobs = [*self.queue, *(attempt.job for attempt in attempts)]
        for attempt in self.in_flight.values():
            self._mark_owed(attempt)
            for due in attempt.dues:
                self.statistics.of(due.node).errors["lost"] += 1
        self.in_flight.clear()
        self.queue.clear()
        self.exclusive = None
        if isinstance(error, LinkLost):
            if self.gone is None:
                self.losses += 1
                self._note_since()
                for end in tuple(self.end_sleeps):
                    end(error)
            self.gone = error
            self.positions.forget()
        for job in jobs:
            if job is not None:
                job.settle(error=error)

    def reconnected(self, now: float, latency: float) -> None:
        """The port is open again: all nodes are out of sync and their positions unknown; the nodes stay known."""
        self.latency = latency
        self.receiver = self.driver.receiver()
        self.echo.reset()
        self.sync.mark_all(now + self.quiet_time)
        self.positions.forget()
        self.gone = None
