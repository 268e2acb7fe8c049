"""Who talks when, on one bus: all policy in one state machine that never waits and never reads a clock.

Time and bytes come in, bytes and results go out. Tickets wait in four queues by rank; `send` picks the next that
may go, `feed` takes what arrived, `due` says when to look again. One exchange flies per lane, as many lanes as the
family's window allows. Every deadline is fixed when the request leaves; `air` says the one thing that extends it.

The pumps hold `lock` around every call. An interrupt at any line leaves the state usable: a node is tainted before
anything else happens to it, a flight keeps its deadline, and what is half done is done again or times out.
"""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Sequence
from math import inf
from typing import Any

from motorbus.bus import verdict
from motorbus.bus.absence import Absence
from motorbus.bus.air import Air
from motorbus.bus.claims import Claims
from motorbus.bus.course import Straight, TurnsLock
from motorbus.bus.known import rest_of, withdraws
from motorbus.bus.pace import Pace
from motorbus.bus.silence import Silence
from motorbus.bus.ticket import Claim, Flight, Listener, Retune, Ticket, Timer
from motorbus.core.family import Family, Stop
from motorbus.core.operation import ANY, Data, Effect, Exchange, Notice, Rank, Runnable, Timeout
from motorbus.errors import LinkError, MotorbusError

RETRIES = 2  # of a repeatable exchange, after the first try
GATED = (Effect.MOTION, Effect.TORQUE)
KEPT = (Effect.PERSISTENT, Effect.IDENTITY)  # a stop lets these follow it, so that locks get closed

Admit = Callable[[Exchange[Any]], None]
Look = Callable[[Exchange[Any]], "Sequence[Runnable[Any]]"]  # what must be asked before this may leave


class Turns(Absence, Straight, Silence, Air):
    """The turn-taking of one bus. `rate` in bit/s and `latency` in seconds describe the link.

    `paced` says whether it takes bit time; None: it will show. While the link is `listening` every exchange is
    refused; one that was opened `listen_only` never speaks.
    """

    def __init__(
        self,
        family: Family,
        *,
        rate: int,
        latency: float = 0.0,
        paced: bool | None = False,
        listen_only: bool = False,
        admit: Admit | None = None,
    ) -> None:
        pace = None if paced is False else Pace(certain=bool(paced))
        super().__init__(family, rate=rate, latency=latency, pace=pace)
        self.listen_only = self.listening = listen_only
        self.admit = admit
        self.trouble: Callable[[], str] = str  # what the link has to say of failures since it was last asked
        self.lock = TurnsLock(self.settle)
        self.pending, self.counting, self.groups, self.aims = [], [], [], {}
        self.look: Look | None = None
        self.chores: list[Callable[[], None]] = []  # what else whoever pumps does; see `background`
        self.latched = self.stopping = False
        self.latched_by = ""
        self._queues: tuple[deque[Flight | Retune], ...] = tuple(deque() for _ in Rank)
        self._timers: list[Timer | Listener] = []
        self._claims = Claims()
        self._courtesy = 0  # who waited for one alone goes before the next claim
        self._look_at = inf

    # -- what is wanted -------------------------------------------------------------------------------------

    def submit(self, ticket: Ticket, now: float) -> None:
        """Take a ticket into the queues. `ticket.deadline` of a timer or listener is set by its owner."""
        if isinstance(ticket, Flight):
            if ticket.done:
                return
            exchange, rank = ticket.exchange, ticket.exchange.rank
            if self.latched and exchange.effect in GATED and rank is not Rank.STOP:
                self._settle(ticket, error=verdict.latched(self.latched_by))
                return
            if rank is Rank.STOP:
                self._withdraw(exchange)
            self._queues[rank].append(ticket)
        elif isinstance(ticket, Retune):
            self._queues[Rank.CONFIGURATION].append(ticket)
        elif isinstance(ticket, Timer | Listener):
            self._timers.append(ticket)
        elif isinstance(ticket, Claim):
            self._claims.waiting.append(ticket)
            self._grant_claim()

    def abandon(self, ticket: Ticket) -> None:
        """Its owner no longer waits. What is in the air stays there until it lands or its deadline passes."""
        for queue in self._queues:
            if ticket in queue:
                queue.remove(ticket)  # type: ignore[arg-type]
        if isinstance(ticket, Timer | Listener) and ticket in self._timers:
            self._timers.remove(ticket)
        if isinstance(ticket, Claim):
            self._forget(ticket)
        if isinstance(ticket, Flight):
            ticket.abandoned = True
        self._settle(ticket, error=verdict.cancelled())

    def _withdraw(self, stop: Exchange[Any]) -> None:
        """Whatever would move whom this stop is for ends here: nothing of it may be sent, or sent again, after it."""
        for ticket in [*self.flying.values(), *(one for queue in self._queues for one in queue)]:
            if isinstance(ticket, Flight) and withdraws(stop, ticket.exchange):
                self._settle(ticket, error=verdict.withdrawn())
                self.abandon(ticket)

    def release(self, claim: Claim) -> None:
        """What was to be done alone has ended. However often this is said, and whether it was granted or not."""
        self._forget(claim)
        self._grant_claim()

    def _forget(self, claim: Claim) -> None:
        if self._claims.forget(claim):
            self._courtesy = sum(map(len, self._queues))

    def _grant_claim(self) -> None:
        self._claims.grant(not (self.flying or (self._courtesy and self.waiting)), self._settle)

    @property
    def waiting(self) -> bool:
        """Something is queued."""
        return any(self._queues)

    @property
    def idle(self) -> bool:
        """Nothing waits, nothing flies, nobody holds the bus."""
        return not (self.flying or self._claims or self.latched or any(self._queues))

    # -- what goes out --------------------------------------------------------------------------------------

    def send(self, now: float) -> Data | Retune | None:
        """What the pump must do next: write this data, change the rate, or (None) wait."""
        self._look_at = inf
        while self.leaving:  # an interrupt fell between handing it out and writing it
            self._settle(self.leaving.pop(), error=verdict.cancelled())
        if self._claims.waiting and not self.flying:  # who was to hand it on may have been interrupted
            self._grant_claim()
        if len(self.flying) >= self.window:
            return None
        if now < self.free_at and self.takes_time:
            self._look_at = self.free_at
            return None
        for queue in self._queues:
            for ticket in list(queue):
                out = self._try(ticket, queue, now)
                if out is not None:
                    return out
                if self._awaits_silence(ticket):
                    return None
        return None

    def short(self, flight: Flight, now: float) -> Data | None:
        """The short path: launch at once when the bus is idle and the node is clean; None means queue it."""
        exchange = flight.exchange
        if not self.idle or self.listening or (now < self.free_at and self.takes_time):
            return None
        if exchange.replies is not ANY:
            nodes = self.trust.nodes
            for due in exchange.replies:
                trust = nodes.get(due.node)
                if trust is not None and trust.tainted:
                    return None
        try:
            self.admitted(exchange)
        except MotorbusError as refusal:
            self._settle(flight, error=refusal)
            return None
        return self._launch(flight, now)

    def _try(
        self, ticket: Flight | Retune, queue: deque[Flight | Retune], now: float
    ) -> Data | Retune | None:
        if ticket.done:
            queue.remove(ticket)
            return None
        if not self._may_go(ticket):
            return None
        if isinstance(ticket, Retune):
            return self._retune(ticket, queue)
        if self.listening:
            queue.remove(ticket)
            self._settle(ticket, error=verdict.listening(ticket.exchange))
            return None
        probe = self._probe(ticket, now)
        if probe is not None:
            return self._launch(probe, now)
        if self._must_wait(ticket, now):
            return None
        try:
            self.admitted(ticket.exchange)
        except MotorbusError as refusal:
            queue.remove(ticket)
            self._settle(ticket, error=refusal)
            return None
        request = self._launch(ticket, now)
        queue.remove(ticket)
        self._courtesy = max(0, self._courtesy - 1)
        return request

    def _may_go(self, ticket: Flight | Retune) -> bool:
        busy = bool(self.flying) if isinstance(ticket, Retune) else ticket.exchange.lane in self.flying
        return self._has_turn(ticket) and not busy

    def _awaits_silence(self, ticket: Flight | Retune) -> bool:
        """A change of rate waits until nothing flies, so nothing behind it in its queue may take off before it."""
        return isinstance(ticket, Retune) and not ticket.done and self._has_turn(ticket)

    def _has_turn(self, ticket: Flight | Retune) -> bool:
        """Nobody else has the bus alone or is about to have it."""
        urgent = isinstance(ticket, Flight) and ticket.rank is Rank.STOP
        if self.stopping and not urgent:
            return False
        if self._claims.held:
            return urgent or self._claims.ours(ticket.owner)
        return urgent or not self._claims.waiting or bool(self._courtesy)

    def _retune(self, ticket: Retune, queue: deque[Flight | Retune]) -> Retune | None:
        queue.remove(ticket)
        tune, there = ticket.tune, (self.rate, self.listening)
        if not tune.rate or (tune.rate, tune.listen_only or self.listen_only) == there:
            self._settle(ticket, self.rate)
            return None
        return ticket

    def retuned(self, ticket: Retune, error: MotorbusError | None = None) -> None:
        """The pump has changed the rate of the link, or the link has refused."""
        before = self.rate
        if error is None:
            self.rate = ticket.tune.rate
            self.listening = ticket.tune.listen_only or self.listen_only
            self.receiver = self.family.receiver()
        self._settle(ticket, before, error)

    def admitted(self, exchange: Exchange[Any]) -> None:
        plain = exchange.effect not in GATED and (exchange.later is None or self.admit is None)
        if plain or exchange.rank is Rank.STOP:  # a gate must know what waits from now on
            return
        if self.admit is None:
            raise verdict.ungated(exchange)
        if exchange.refusal is not None and (error := exchange.refusal(self.known.stops)):
            raise error
        self.admit(exchange)

    def _doubtful(self, flight: Flight) -> list[int]:
        exchange = flight.exchange
        if exchange.replies is ANY or exchange.rank is Rank.STOP:
            return []
        if exchange.timeout is Timeout.SCAN and flight.spoiled != "echo":
            return []
        nodes = self.trust.nodes
        return [due.node for due in exchange.replies if due.node in nodes and nodes[due.node].tainted]

    def _probe(self, flight: Flight, now: float) -> Flight | None:
        """A probe that must be answered before this flight may leave, if one may be sent now."""
        unbelieved: tuple[int, ...] = ()
        group = flight.exchange.replies is not ANY and len(flight.exchange.replies) > 1
        for node in self._doubtful(flight):
            trust = self.trust.of(node)
            if group and trust.silent and now < trust.probe_at:
                unbelieved += (node,)
            elif now >= trust.quiet_until:
                probe = Flight(self.trust.probe(node, now), flight.owner, parent=flight)
                if probe.exchange.lane not in self.flying:
                    return probe
        flight.unbelieved = unbelieved
        return None

    def _must_wait(self, flight: Flight, now: float) -> bool:
        waiting = [node for node in self._doubtful(flight) if node not in flight.unbelieved]
        for node in waiting:
            self._look_at = min(self._look_at, self.trust.of(node).quiet_until)
        return bool(waiting)

    # -- what comes of it -----------------------------------------------------------------------------------

    def expire(self, now: float) -> None:
        """Settle everything whose moment has passed."""
        if self.flying:
            super().expire(now)
        for timer in list(self._timers) if self._timers else ():
            if now >= timer.deadline:
                self._timers.remove(timer)
                self._settle(timer, now if isinstance(timer, Timer) else None)

    _landed = _grant_claim

    def _heard(self, notice: Notice) -> None:
        for ticket in list(self._timers):
            if isinstance(ticket, Listener) and not ticket.done:
                self._tell(ticket, notice)

    def _tell(self, listener: Listener, notice: Notice) -> None:
        try:
            if not listener.listen.match(notice):
                return
        except Exception as error:  # the listener's own, and nobody else's
            self._timers.remove(listener)
            self._settle(listener, error=error)
        else:
            self._timers.remove(listener)
            self._settle(listener, notice)

    def _failed(self, flight: Flight, kind: str, now: float) -> None:
        if flight.parent is not None:
            self._probe_failed(flight, flight.parent, kind, now)
        elif not flight.abandoned:
            self._again_or_fail(flight, kind)

    def _again_or_fail(self, flight: Flight, kind: str) -> None:
        exchange = flight.exchange
        flight.tries += 1
        patient = exchange.rank is not Rank.STOP and (exchange.timeout is not Timeout.SCAN or kind == "echo")
        if exchange.repeatable and patient and flight.tries <= RETRIES and not self.latched:
            for due in exchange.replies:  # type: ignore[union-attr]  # never ANY here
                self.statistics.of(due.node).retries += 1
            self._queues[flight.rank].appendleft(flight)
        else:
            self._settle(flight, error=verdict.error(flight, kind, flight.tries, self.trouble()))

    def _probe_failed(self, probe: Flight, parent: Flight, kind: str, now: float) -> None:
        parent.tries += 1
        ((node, _, _),) = probe.exchange.replies  # type: ignore[misc]  # a probe has exactly one reply
        if kind != "silence" and parent.tries <= RETRIES:
            return
        self.trust.stayed_silent(node, now, self._quiet)
        if len(parent.exchange.replies) == 1:  # type: ignore[arg-type]  # never ANY here
            queue = self._queues[parent.exchange.rank]
            if parent in queue:
                queue.remove(parent)
            parent.noise = probe.noise
            self._settle(parent, error=verdict.error(parent, kind, parent.tries, self.trouble()))

    # -- when to look again, and stopping -------------------------------------------------------------------

    def due(self) -> float:
        """The next moment something must be settled or may be sent; inf when nothing is awaited."""
        moment = self._look_at
        for ticket in (*self.flying.values(), *self._timers):
            if ticket.deadline < moment:
                moment = ticket.deadline
        return moment

    def latch(self, now: float, by: str = "in this process") -> Stop:
        """Emergency stop: drop what waits, let the rest of a reply pass, refuse motion until `reset`.

        `by` says in errors which process asked for the stop, and when. The first one counts until `reset`.
        """
        self.latched_by = self.latched_by if self.latched else by
        self.latched = self.stopping = True
        with contextlib.suppress(Exception):  # if it fails, the frames made before, without positions, do
            self.known.frames = self.family.stop(self.known.fresh(now))
        for queue in self._queues:
            for ticket in list(queue):
                if isinstance(ticket, Flight) and ticket.exchange.effect not in KEPT:
                    queue.remove(ticket)
                    self._settle(ticket, error=verdict.latched(self.latched_by))
        for flight in self.flying.values():
            rest = rest_of(flight, self.family, self.rate, now)
            flight.deadline = min(flight.deadline, now + rest + self.latency)
            flight.abandoned = True
            self._settle(flight, error=verdict.latched(self.latched_by))
        for idle in (*self._timers, *self._claims.outside()):
            self._settle(idle, error=verdict.latched(self.latched_by))
            self.abandon(idle)
        return self.known.frames

    def stopped(self) -> None:
        """The stop frames are out: clean-ups and reading may go on, motion and torque stay refused."""
        self.stopping = False

    def reset(self) -> None:
        """Take the latch off."""
        self.latched = self.stopping = False

    def lost(self, error: LinkError) -> None:
        """The link is gone: everything awaited fails with this error; moments awaited since then do not."""
        was_gone = self._was_gone(error)
        for lane, flight in self.flying.items():
            for due in () if flight.exchange.replies is ANY else flight.exchange.replies:
                self.statistics.of(due.node).errors["lost"] += 1
                self.trust.missed(lane, due, flight.sent_at, self._quiet)
        waiting: list[Ticket] = [*self.flying.values(), *self._claims.waiting]
        if not was_gone:
            waiting += self._timers
            self._timers.clear()
        for queue in self._queues:
            waiting += queue
            queue.clear()
        waiting += self.leaving
        self.leaving.clear()
        self.flying.clear()
        self._claims.waiting.clear()
        for ticket in waiting:
            self._settle(ticket, *self._fate(ticket, was_gone, error))
