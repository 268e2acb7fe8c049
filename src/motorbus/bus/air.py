"""What is in the air: exchanges under way, what comes in for them, and when each is settled.

Every deadline is fixed when the request leaves and no arriving byte extends it; only behind a whole reply, what may
trail it is waited for once, for three byte times and the latency of the adapter at most. It allows for what flies on
other lanes, which share the wire: those that flew before, and as many after it as the window lets fly. A reply counts
only if its key and its exact length are due, nothing trails it, and its node may be believed. Turns builds on this.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from motorbus.bus import verdict
from motorbus.bus.echo import Echo
from motorbus.bus.known import Known
from motorbus.bus.pace import SETTLE, Pace, byte_time, least_time, patience
from motorbus.bus.statistics import Statistics
from motorbus.bus.ticket import Flight, Ticket, all_taken
from motorbus.bus.trace import Feed, TraceRecord
from motorbus.bus.trust import Trust
from motorbus.core.family import Family
from motorbus.core.operation import (
    ANY,
    EVERY_LANE,
    Answer,
    CanFrame,
    Data,
    Due,
    Exchange,
    Noise,
    Notice,
    Rank,
    Reply,
)

ECHO_SETTLE = 3.0  # byte times after a reply that may be the beginning of an echo, for the rest of it


class Air:
    """The exchanges in flight on one bus, one per lane. `rate` in bit/s, `latency` in seconds, of the link."""

    def __init__(self, family: Family, *, rate: int, latency: float, pace: Pace | None) -> None:
        self.family = family
        self.window = family.link.window
        self.rate = rate
        self.latency = latency
        self.pace = pace
        self.trace: Feed[TraceRecord] = Feed()
        self.notices: Feed[Notice] = Feed()
        self.statistics = Statistics(self.made_good)
        self.trust = Trust(family)
        self.echo = Echo()
        self.receiver = family.receiver()
        self.known = Known(family, rate)
        self.settled = 0
        self.flying: dict[int, Flight] = {}
        self.leaving: list[
            Flight
        ] = []  # handed out and not known to be written, of those that nobody answers
        self.free_at = 0.0

    def made_good(self) -> None:
        """Whatever was put off is done now."""
        raise AssertionError("turns knows what was put off")

    def _failed(self, flight: Flight, kind: str, now: float) -> None:
        raise AssertionError("turns decides whether there is another try")

    def _heard(self, notice: Notice) -> None:
        """Tell whoever listens."""
        raise AssertionError("turns knows the listeners")

    def _landed(self) -> None:
        """A lane has become free."""
        raise AssertionError("turns hands it on")

    def _settle(self, ticket: Ticket, value: object = None, error: BaseException | None = None) -> None:
        """Finish a ticket, and let the pump see that somebody can go on."""
        self.settled += 1
        ticket.finish(value, error)

    # -- what leaves ----------------------------------------------------------------------------------------

    def _launch(self, flight: Flight, now: float) -> Data:
        exchange = flight.exchange
        if exchange.other is not None and self.trust.alike(exchange):
            exchange = flight.exchange = exchange.other()
        if flight.left:
            flight.echo_checked = (
                flight.spoiled == "echo" or flight.echo_checked
            ) and self.echo.present is False
            flight.reset()
        start, air = max(now, self.free_at), self.family.air_time(exchange, self.rate)
        flight.sent_at, flight.left = now, True
        awaited = exchange.replies != ()
        if awaited:
            self.trust.ask(exchange, now)
            flight.deadline = start + air + patience(exchange, self.family, self.latency)
        if self.window > 1:
            self._share_wire(flight, air)
        if awaited:
            self.flying[exchange.lane] = flight
        else:
            self.free_at = start + air
        if exchange.effect or exchange.goals:
            self.known.order(exchange, self.rate)
        if isinstance(exchange.request, bytes):
            self.echo.sent(exchange.request, flight.parent is not None or exchange is self.echo.test)
        self.statistics.asked(exchange.replies)
        if self.trace.subscriptions:
            self.trace.put(TraceRecord(now, "tx", exchange.request))
        if not awaited:
            self.leaving.append(flight)
        return exchange.request

    def left(self, now: float) -> None:
        """What was handed out last has been written: only now does what nobody answers count as sent."""
        while self.leaving:
            self._settle(self.leaving[0], self.leaving[0].answer(now))
            del self.leaving[0]

    def _share_wire(self, flight: Flight, air: float) -> None:
        """Lanes share one wire: whichever goes first, each may have to wait for all the others, once."""
        flight.air = air
        for other in self.flying.values():
            flight.deadline += other.air
            if other.beside < self.window - 1 and not other.abandoned:
                other.deadline += air
                other.beside += 1
        flight.beside = len(self.flying)

    def expect_echo(self, exchange: Exchange[Any]) -> None:
        """This exchange, sent when the bus is opened, shows whether the adapter echoes."""
        self.echo.test = exchange

    # -- what comes in --------------------------------------------------------------------------------------

    def feed(self, arrived: list[Data], now: float, looked: float | None = None) -> None:
        """Take what the link delivered, settle what it answers, then what was overdue when the link was looked at.

        `looked` is when that look began (`now` when left out): what fell due during it gets another look.
        """
        for data in arrived:
            if self.trace.subscriptions:
                self.trace.put(TraceRecord(now, "rx", data))
            if isinstance(data, bytes):
                data = self.echo.strip(data)
                if self.echo.broken:
                    self._echo_broke(now)
            if data:
                events = self.receiver.feed(data)
                if not all_taken(self.flying, events, self.echo.recent):
                    for event in events:
                        self._take(event, now)
            if isinstance(data, bytes):
                if self.echo.returned:
                    self._echo_returned()
                self._let_settle(len(data), now)
        self._land(now)
        self.expire(now if looked is None else looked)

    def _let_settle(self, size: int, now: float) -> None:
        """A reply that came in pieces gets the time of one more byte: behind a shifted one, one byte is left over.

        One that came whole needs none, unless it may be the beginning of an echo, of which the rest may follow. It has
        that time even where the reply came at its very deadline; nobody waits for that whose call is over.
        """
        for flight in self.flying.values():
            last = flight.last
            if flight.settling or not flight.complete or last is None:
                continue
            if (echo := self.echo.may_be(last.data)) or size < len(last.data):
                flight.settling = True
                byte = byte_time(flight.exchange, self.family, self.rate)
                pause = (ECHO_SETTLE if echo else SETTLE) * byte + echo * self.latency
                flight.deadline = min(flight.deadline, now + pause) if flight.abandoned else now + pause

    def _take(self, event: Reply | Notice | Noise, now: float) -> None:
        if isinstance(event, Reply):
            self._take_reply(event, now)
        elif isinstance(event, Notice):
            self.statistics.other["notices"] += 1
            arrived = event._replace(at=now)
            self.notices.put(arrived)
            self._heard(arrived)
        else:
            self._take_noise(event, now)

    def _take_reply(self, reply: Reply, now: float) -> None:
        flight = self.flying.get(reply.lane)
        if flight is None:
            if not self._late(reply) and not self._everyones(reply):
                self._nobodys(reply, now)
        elif reply.data in self.echo.recent and not flight.echo_checked:
            self.echo.doubted()
            flight.spoiled = "echo"
            self.statistics.other["echo"] += 1
        elif flight.complete:
            if flight.passes_over(reply):
                self._late(reply)
            else:
                flight.surplus |= not self._everyones(reply)
        elif not self._is_stale(flight, reply) and not flight.take(reply):
            self._mismatch(flight, reply, now)

    def _is_stale(self, flight: Flight, reply: Reply) -> bool:
        """Only flights that go to doubtful nodes without a probe can meet an older reply of their own kind."""
        unasked = flight.rank is Rank.STOP or flight.exchange.replies is ANY
        return unasked and self._late(reply)

    def _late(self, reply: Reply) -> bool:
        if self.trust.late(reply.lane, reply.key, len(reply.data)):
            self.statistics.other["late"] += 1
            return True
        return False

    def _mismatch(self, flight: Flight, reply: Reply, now: float) -> None:
        dues = flight.exchange.replies
        mine = dues is not ANY and any(due.key == reply.key for due in dues)
        if self._late(reply) or self._everyones(reply):
            return
        if mine and not flight.parent:
            flight.disbelieve(reply)
            self.statistics.other["unexpected"] += 1
        else:
            self._nobodys(reply, now)

    def _everyones(self, reply: Reply) -> bool:
        """Everybody was asked, and this is what one of them says."""
        flight = self.flying.get(EVERY_LANE)
        return flight is not None and flight.take(reply)

    def _nobodys(self, reply: Reply, now: float) -> None:
        self.statistics.other["foreign"] += 1
        self.trust.doubt(now, self._quiet, reply.lane)

    def _take_noise(self, noise: Noise, now: float) -> None:
        self.statistics.other[noise.fault] += 1
        if noise.fault == "foreign":
            return
        for lane, flight in self.flying.items():
            if noise.lane in (None, lane):
                flight.hear_noise(noise.fault, noise.data)
        self.trust.doubt(now, self._quiet, noise.lane)

    def _echo_broke(self, now: float) -> None:
        self.echo.broken = False
        self.statistics.other["echo"] += 1
        for flight in self.flying.values():
            flight.spoiled = "echo"
        self.trust.doubt(now, self._quiet)

    def _echo_returned(self) -> None:
        """What was sent is back where no echo was known: who waits has heard himself, unless that was just tested."""
        if any(flight.echo_checked or flight.spoiled == "echo" for flight in self.flying.values()):
            return
        self.echo.doubted()
        self.statistics.other["echo"] += 1
        for flight in self.flying.values():
            flight.spoiled = "echo"

    @property
    def _quiet(self) -> float:
        return self.family.quiet_time(self.rate)

    # -- what is settled ------------------------------------------------------------------------------------

    def _land(self, now: float) -> None:
        for lane, flight in list(self.flying.items()):
            if not flight.complete or flight.exchange.replies is ANY:
                continue
            if flight.settling and not flight.surplus and now < flight.deadline:
                continue
            for event in self.receiver.flush():  # all replies are in, so what is held is surplus
                self._take(event, now)
            if (
                self.pace is not None
                and flight.last is not flight.put_aside
                and self._is_early(flight, self.pace, now)
            ):
                continue
            if flight.spoiled or flight.surplus:
                self._lost_try(lane, flight, now)
            else:
                self._accepted(lane, flight, now)

    def _is_early(self, flight: Flight, pace: Pace, now: float) -> bool:
        """Put this reply aside: it came sooner than it can travel, so the true one is still to come.

        On a byte line both would be the same bytes in one stream, so there the try is lost at once.
        """
        due = least_time(flight.exchange, self.family, self.rate, flight.unbelieved)
        if not pace.suspects(now - flight.sent_at, due):
            return False
        if not isinstance(flight.exchange.request, CanFrame) or len(flight.got) != 1:
            flight.spoiled = "early"
            return False
        self.statistics.other["early"] += 1
        flight.put_reply_aside()
        return True

    def _take_back(self, flight: Flight, pace: Pace) -> None:
        """Nothing came behind an early reply: ask again, unless there is no bit time and it was the true one."""
        if pace.nothing_behind() or not (pace.certain or flight.exchange.repeatable):
            flight.take_back()
        else:
            flight.spoiled = flight.spoiled or "early"

    def expire(self, now: float) -> None:
        """Settle everything whose moment has passed."""
        for lane, flight in list(self.flying.items()):
            if now >= flight.deadline:
                self._overdue(lane, flight, now)

    def _overdue(self, lane: int, flight: Flight, now: float) -> None:
        held = self.echo.give_up()
        if self.echo.broken:
            self._echo_broke(now)
        for event in (self.receiver.feed(held) if held else []) + self.receiver.flush():
            self._take(event, now)
        if self.flying.get(lane) is not flight:
            return
        if flight.put_aside is not None and not flight.complete and self.pace is not None:
            self._take_back(flight, self.pace)
        if flight.done and not flight.abandoned:  # an interrupt fell between settling it and forgetting it
            del self.flying[lane]
        elif flight.exchange.replies is ANY:
            self._accepted(lane, flight, now)
        elif flight.complete:
            self._land(now)
        elif len(flight.exchange.replies) > 1 and not flight.spoiled:
            self._accepted(lane, flight, now)
        else:
            self._lost_try(lane, flight, now)

    def _accepted(self, lane: int, flight: Flight, now: float) -> None:
        answer = flight.answer(min(now, flight.deadline))  # a host that was held up takes it in late
        exchange = flight.exchange
        if flight.parent is not None and not (exchange.read is not None and exchange.read(answer)):
            flight.spoiled = "unexpected"
            self._lost_try(lane, flight, now)
            return
        if flight.parent is None and not flight.abandoned:
            self._settle(flight, answer)
        self._believe(flight, answer, now)
        self._echo_settled(flight)
        if self.flying.get(lane) is flight:
            del self.flying[lane]
        self._landed()

    def _echo_settled(self, flight: Flight) -> None:
        """A test of the echo has ended: nothing but its answer came, or nothing at all. Or an answer came first."""
        if self.echo.present is not None or flight.noise:
            return
        if flight.parent is not None or flight.exchange is self.echo.test or self.echo.disproved:
            self.echo.excluded()

    def _believe(self, flight: Flight, answer: Answer, now: float) -> None:
        dues = flight.exchange.replies
        if dues is ANY:
            if flight.exchange.lane == EVERY_LANE:  # who obeyed everyone's order must be stopped, too
                self.known.hear_all([reply.lane for reply in answer.replies], None, self.rate)
            return
        heard: Sequence[Due] = self._heard_of(flight, now) if answer.missing else dues
        if flight.exchange.rank is not Rank.STOP:  # what a stop cut short may still answer
            self.trust.believe(*heard, barrier=flight.parent is not None)
        self.statistics.answered(heard, now - flight.sent_at)
        self.known.heard([due.node for due in heard], flight.exchange, answer, self.rate)

    def _heard_of(self, flight: Flight, now: float) -> list[Due]:
        """Whose replies count; the others are noted as missing, or as not to be believed."""
        heard = []
        for index, due in enumerate(flight.exchange.replies):  # type: ignore[arg-type]  # never ANY here
            if index in flight.got and due.node not in flight.unbelieved:
                heard.append(due)
                continue
            if index not in flight.got:
                self.trust.missed(flight.exchange.lane, due, now, self._quiet)
            elif not self.trust.of(due.node).silent:
                self.trust.of(due.node).quiet_until = now + self._quiet
            self.statistics.of(due.node).errors[verdict.fault(flight)] += 1
        return heard

    def _lost_try(self, lane: int, flight: Flight, now: float) -> None:
        kind = verdict.fault(flight)
        dues = flight.exchange.replies
        assert dues is not ANY
        for index, due in enumerate(dues):
            if index not in flight.got and flight.rank is not Rank.STOP:
                self.trust.missed(lane, due, now, self._quiet)
            else:
                self.trust.of(due.node).quiet_until = now + self._quiet
            self.statistics.of(due.node).errors[kind] += 1
        if kind == "silence":
            self._echo_settled(flight)
        self._failed(flight, kind, now)
        if self.flying.get(lane) is flight:
            del self.flying[lane]
        self._landed()
