"""What can be known beforehand about an exchange that is run again and again, for the straight way to fly it.

How long its answer is, how long that may take, who is asked: as long as nothing has happened on the bus since it was
found idle and clean, all of that stays as it was. "Nothing has happened" is one number. Whoever takes the lock of the
turns in the usual way may change anything, so `TurnsLock` counts that, and first makes good what the straight way has
put off: the flight that is in the air taints its nodes, and what was read is known. So an interrupt at any line,
another thread, or an emergency stop finds what it would find if there were no straight way.
"""

from __future__ import annotations

from _thread import RLock
from collections.abc import Callable
from math import inf
from operator import attrgetter, itemgetter
from typing import TYPE_CHECKING, Any, Final

from motorbus.bus.pace import EARLY, SETTLE, byte_time, least_time, patience
from motorbus.bus.statistics import BUCKETS, bucket_of
from motorbus.bus.ticket import Flight
from motorbus.bus.trust import GROUP_RUN
from motorbus.core.aimed import Aim
from motorbus.core.operation import ANY, Answer, Data, Exchange, Reply, Whole

if TYPE_CHECKING:
    from motorbus.bus.turns import Turns

AIMS: Final = 16
"""Moulds that are kept in mind on one bus."""
STALE: Final = -1
"""The era of a course for which the bus was not found fit yet."""


class TurnsLock(RLock):  # type: ignore[misc]  # final for type checkers only
    """The lock of one set of turns.

    Taken by `with`, whoever has it may change anything: `era` is another then, and what was put off has been made good
    if `owing` says that there is something. The straight way takes it by `acquire`, and sees to both itself.
    """

    _take = property(RLock.acquire)

    def __init__(self, settle: Callable[[], None]) -> None:
        self.era = 0
        self.owing = False
        self._settle = settle

    def __enter__(self) -> bool:  # type: ignore[override]
        taken = False
        try:  # an interrupt at any line from here on, the last one too, gives it back
            # read, and not called: behind a call an interrupt may fall, and nobody would know
            taken = self._take
            self.era += 1
            if self.owing:
                self._settle()
            return True
        except BaseException:
            if taken:
                self.release()
            raise


class Course(Flight):
    """One exchange on one bus, ready to be flown again and again; `twin` is the same in its other form.

    `era` is when the bus was found fit for it, `wait` (s) what its answer may take, `least` what it must take.
    `data` and `at` are the last answer; `pending` says that not all know it whom it concerns. `times` are the answers
    since they were counted last, by their buckets, of which the last one reached from `low` to `high` (s).

    An answer has `size` bytes, and before `thinks` (s) are left of its time nothing of it need be looked at. Of one
    that comes in pieces, `held` has what each look has brought, and when that was; a byte that is one too many would be
    there `settle` (s) later.
    """

    __slots__ = (
        "at",
        "bucket",
        "counting",
        "data",
        "era",
        "first",
        "group",
        "held",
        "high",
        "holder",
        "ids",
        "lane",
        "least",
        "length",
        "lock",
        "low",
        "most",
        "nodes",
        "own",
        "pending",
        "request",
        "settle",
        "size",
        "thinks",
        "times",
        "trusts",
        "turns",
        "twin",
        "wait",
        "whole",
    )

    def __init__(
        self, turns: Turns, exchange: Exchange[Any], whole: Whole[Any], twin: Course | None = None
    ) -> None:
        super().__init__(exchange)
        dues = exchange.replies
        assert dues is not ANY
        self.turns: Final = turns
        self.lock: Final = turns.lock
        self.own: Final = exchange
        self.holder: Final[Exchange[Any]] = twin.own if twin is not None else exchange
        self.request: Final = exchange.request
        self.lane: Final = exchange.lane
        self.whole: Final = whole
        self.twin: Course = twin or self
        self.ids: Final = tuple(due.node for due in dues)
        self.nodes: Final = frozenset(self.ids)
        self.trusts: Final = tuple(turns.trust.of(id) for id in self.ids)
        self.first: Final = self.trusts[0]
        self.length: Final = dues[0].length
        self.size: Final = sum(due.length for due in dues)
        self.most: Final[float] = inf if exchange.other is None else 1 if len(dues) == 1 else GROUP_RUN
        self.group: Final[Course | None] = None if len(dues) == 1 else twin or self
        self.era = STALE
        self.wait = self.least = self.thinks = self.settle = 0.0
        self.data: Data = b""
        self.at = -inf
        self.held: list[tuple[float, list[Data]]] = []
        self.pending = self.counting = False
        self.times = [0] * BUCKETS
        self.low = self.high = 0.0
        self.bucket = 0

    def fits(self) -> bool:
        """Is the bus idle and clean, so that this may go straight? The caller holds the lock."""
        turns, pace = self.turns, self.turns.pace
        if not turns.is_calm() or not (pace is None or pace.certain):
            return False
        if (
            turns.known.rate != turns.rate
        ):  # a stop goes at the rate at which somebody was heard, which is told soon
            return False
        if any(trust.tainted for trust in self.trusts) or not all(id in turns.known for id in self.ids):
            return False
        self.exchange, self.value, self.error, self.wake = self.own, None, None, None
        self.abandoned, self.left, self.tries = False, True, 0
        self.unbelieved, self.echo_checked = (), False
        self.reset()
        self.thinks = patience(self.own, turns.family, turns.latency)
        self.wait = turns.family.air_time(self.own, turns.rate) + self.thinks
        self.settle = SETTLE * byte_time(self.own, turns.family, turns.rate)
        self.least = -inf if pace is None else EARLY * least_time(self.own, turns.family, turns.rate)
        self.era = turns.lock.era
        return True

    def joined(self, *last: Data) -> bytes:
        """What is held, and this behind it."""
        pieces = [data for _, came in self.held for data in came]
        return b"".join([*pieces, *last])  # type: ignore[list-item]  # bytes, as the bus is calm

    @property
    def is_detached(self) -> bool:
        """It has become a flight like any other, and its exchange gets another course."""
        return self.holder.course not in (self, self.twin)

    def lands(self, data: Data, at: float) -> None:
        """This is its answer. The caller holds the lock."""
        took, turns, first = at - self.sent_at, self.turns, self.first
        if not self.low <= took < self.high:
            self.bucket, self.low, self.high = bucket_of(took)
        self.times[self.bucket] += 1
        if first.length == self.length:
            first.run += 1
        else:
            first.length, first.run = self.length, 1
        self.data, self.at = data, at
        if not self.pending:
            turns.pending.append(self)  # there twice after an interrupt does no harm, not at all would
            self.pending = True
            if not self.counting:
                turns.counting.append(self)
                self.counting = True
        del turns.flying[self.lane]
        turns.aloft = None
        turns.settled += 1


class Answered(Answer):
    """The answer that a course brought last, taken apart when somebody looks; nobody does, in most cycles of a loop."""

    __slots__ = ()

    @property
    def replies(self) -> tuple[Reply, ...]:
        """The replies in the order they were due."""
        kept: Any = tuple.__getitem__(self, 0)
        dues, lane, data = kept
        found, start = [], 0
        for _, key, length in dues:
            found.append(Reply(lane, key, data[start : start + length]))
            start += length
        return tuple(found)


class Straight:
    """What the turns of a bus know of the straight way: the course in the air, and those whose answers are not told.

    `group` is the course with several nodes that was flown last, `groups` are those flown since all was made good,
    `aims` when orders of which aim left last, so far as that is not told yet. `passes` says that an order may surely
    leave: then nobody else is asked. Of one that has been judged before, `lets_move` says whether it still may.
    """

    aloft: Course | None = None
    group: Course | None = None
    groups: list[Course]
    pending: list[Course]
    counting: list[Course]
    aims: dict[Aim, float]
    passes: Callable[[Exchange[Any]], bool] | None = None
    lets_move: Callable[[], bool] | None = None
    calm_since = STALE

    @property
    def takes_time(self: Any) -> bool:
        """What is sent surely needs the time of its bits on the wire."""
        return self.pace is not None and bool(self.pace.certain)

    def is_calm(self: Any) -> bool:
        """Nothing is under way or held back, and what was sent does not come back: an exchange may go straight."""
        turns: Turns = self
        if self.calm_since == turns.lock.era:
            return True
        if not turns.idle or turns.gone is not None or turns.leaving or turns.listening or turns.stopping:
            return False
        if not turns.echo.is_out or turns.family.link.kind != "bytes" or turns.receiver.held:
            return False
        self.calm_since = turns.lock.era
        return True

    def settle(self: Any) -> None:
        """Make good what was put off. The caller holds the lock; an interrupt in between leaves it to be done again."""
        turns: Turns = self
        self.tell()
        for course in sorted(turns.counting, key=attrgetter("at")):
            _count(turns, course)
        turns.counting.clear()
        turns.aims.clear()
        turns.group = None
        turns.groups.clear()
        course_aloft = turns.aloft
        if course_aloft is not None:
            course_aloft.done = False
            turns.echo.left()
            course_aloft.holder.course = None  # from now on it belongs to whoever waits for it
            turns.trust.ask(course_aloft.exchange, course_aloft.sent_at)
            turns.statistics.asked(course_aloft.exchange.replies)
            turns.aloft = None
        turns.lock.owing = False
        if course_aloft is not None and course_aloft.held:
            held, course_aloft.held = course_aloft.held, []
            for at, data in held:
                turns.feed(data, at)

    def regroup(self: Any, course: Course) -> None:
        """Another course is flown than the last one. How long the last answers of its nodes were must be known, to
        choose between it and its twin; of courses that have no node in common with it, it need not."""
        turns: Turns = self
        group = course.group
        if not all(one is group or one.nodes.isdisjoint(course.nodes) for one in turns.groups):
            turns.settle()
        if group is not None and group not in turns.groups:
            turns.groups.append(group)
        turns.group = (
            group if group is not None or not turns.groups else course
        )  # a single one is asked again

    def tell(self: Any) -> None:
        """Where those are who said so is known to whoever looks. The caller holds the lock."""
        turns: Turns = self
        if not turns.pending and not turns.aims:
            return
        if len(turns.pending) == 1 == len(turns.aims) and self._told_at_once(turns):
            return
        events: list[tuple[float, Aim | Course]] = [(course.at, course) for course in turns.pending]
        events += [(at, aim) for aim, at in turns.aims.items() if at > -inf]  # behind an answer as old
        for _, event in sorted(events, key=itemgetter(0)):
            if isinstance(event, Aim):
                turns.known.moves(event.ordered)
                turns.aims[event] = -inf
                continue
            if event.own.tells_position:
                answer = Answered((event.own.replies, event.lane, event.data), (), event.at)  # type: ignore[arg-type]
                turns.known.saw(event.ids, event.own, answer)
            event.pending = False
        turns.pending.clear()

    @staticmethod
    def _told_at_once(turns: Turns) -> bool:
        """The same in the usual case: one order left, and after it all told where they are whom it was for; else false.

        That they were not known for a while is told nobody.
        """
        (course,), ((aim, left),) = turns.pending, turns.aims.items()
        exchange, at, known = course.own, course.at, turns.known
        if not left < at or not exchange.tells_position or not course.nodes.issuperset(aim.ordered):
            return False
        if left > -inf:
            known.follow(aim.ordered)
            turns.aims[aim] = -inf
        answer = Answered((exchange.replies, course.lane, course.data), (), at)  # type: ignore[arg-type]
        known.saw(course.ids, exchange, answer)
        course.pending = False
        turns.pending.clear()
        return True

    def orders(self: Any, exchange: Exchange[Any], now: float) -> None:
        """This leaves, and sets something moving. The caller holds the lock."""
        turns: Turns = self
        turns.tell()
        turns.known.order(exchange, turns.rate)
        if len(turns.aims) >= AIMS:  # all told by now; who makes a new one for each order is asked anew
            turns.aims.clear()
        if exchange.aim is not None:
            turns.lock.owing = True
            turns.aims[exchange.aim] = -inf

    def made_good(self: Any) -> None:
        """`settle`, if there is anything, for somebody who has not the lock."""
        with self.lock:
            pass


def _count(turns: Turns, course: Course) -> None:
    """How many answers there were, and of what length, is known to those who count and to those who doubt."""
    first, count = course.first, sum(course.times)
    for trust in course.trusts:
        trust.asked_at, trust.lane = course.sent_at, course.own.lane
        if trust is first:  # that is up to date
            continue
        if trust.length != course.length:
            trust.length, trust.run = course.length, 0
        trust.run += min(count, first.run)
    turns.statistics.add(course.ids, course.times)
    course.times = [0] * BUCKETS
    course.counting = False
