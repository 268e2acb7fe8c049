"""The straight way of an exchange that is run again and again: a control loop does little else.

When the bus is as it was when it was found idle and clean, the request leaves, the whole answer comes at one look, or
piece by piece, and all there is to do is to check it and to say what it means: `fly`. What nobody answers just leaves:
`cast`. Who has something to do meanwhile halves it: `bus/loosed.py`. Whatever is otherwise goes the usual way; an
answer that is not exactly the one that is due finds a flight in the air like any other. A test proves that both ways
give the same.

Here microseconds count, so what elsewhere would be three functions is one.
"""

from __future__ import annotations

from math import inf
from threading import get_ident
from typing import TYPE_CHECKING, Any, TypeVar

from motorbus.bus.course import Course
from motorbus.bus.pieces import Then, gathered
from motorbus.bus.run import taken
from motorbus.bus.ticket import Flight
from motorbus.core.operation import UNLIKE, Answer, Data, Exchange, Rank, Unlike
from motorbus.errors import LinkError, MotorbusError

if TYPE_CHECKING:
    from motorbus.bus.pump import Bus
    from motorbus.bus.turns import Turns
    from motorbus.core.aimed import Aim

T = TypeVar("T")


def charted(turns: Turns, exchange: Exchange[Any]) -> Course | None:
    """What is known of this exchange on this bus, in both its forms; None where there is no straight way for it."""
    if exchange.whole is None or exchange.rank is Rank.STOP or exchange.effect or not exchange.replies:
        return None
    with turns.lock:
        course = Course(turns, exchange, exchange.whole)
        other = None if exchange.other is None else exchange.other()
        if other is not None and other.whole is None:  # it could not take turns with its other form
            return None
        if other is not None and other.whole is not None:
            course.twin = Course(turns, other, other.whole, course)
    exchange.course = course
    return course


def fly(bus: Bus, exchange: Exchange[T], ahead: Exchange[Any] | None = None) -> T | Unlike:
    """Carry this out and return its value; `UNLIKE` when nothing was sent, and it must go the usual way.

    `ahead` is what nobody answers and leaves in the same write, in front of it. Raises what `Bus.run` does.
    """
    turns = bus.turns
    course: Course | None = exchange.course
    if (course is None or course.turns is not turns) and (course := found(bus, exchange)) is None:
        return UNLIKE
    launched, mine, dealt_with = None, None, False
    try:
        try:
            launched = launched_now(bus, course, ahead)
            if launched is None:
                return UNLIKE
            course = launched
            value: T | Unlike = brought(bus, course)
            if value is not UNLIKE:
                return value
        except BaseException as error:
            mine = _mine(bus, launched)
            fallen(bus, mine, error)
            dealt_with = True
            raise
    except BaseException as error:  # a second interrupt may fall into what the first one has brought about
        if not dealt_with:  # else others may have it in the air again by now
            fallen(bus, mine or _mine(bus, launched), error)
        raise
    answer: Any = course.result()
    return taken(turns, course.exchange, answer)  # type: ignore[no-any-return]


def brought(bus: Bus, course: Course, then: Then | None = None, arrived: list[Data] | None = None) -> Any:
    """Wait for the answer of what is in the air, and return what it means; `UNLIKE` where it has ended otherwise.

    The caller pumps, and lets go of the lock. `then` is done as soon as it has landed. Of what has `arrived` nobody
    knows when, so it counts as no younger than the first moment at which all of it could be there.
    """
    turns, lock, link, latest = course.turns, course.lock, bus.link, course.deadline
    if arrived:
        latest -= course.thinks
    else:
        if bus.sleeps:
            link.doze(latest - course.thinks)  # type: ignore[attr-defined]
        arrived = link.read(latest)
    if len(arrived) == 1:
        lock.acquire()  # let go of it below, or where the flight falls
        at = link.now()
        if at > latest:  # a host that was held up takes it in late
            at = latest
        if turns.aloft is course and at - course.sent_at >= course.least:
            value = course.whole(arrived[0], at)
            if value is not UNLIKE:
                course.lands(arrived[0], at)
                if then is not None:
                    then(value)
                bus.relay.pumper = None
                lock.release()
                return value
        lock.release()
    if (value := gathered(bus, course, arrived, latest, then)) is UNLIKE:
        _astray(bus, course, arrived)
    return value


def found(bus: Bus, exchange: Exchange[Any]) -> Course | None:
    """`charted`; an interrupt in it leaves the bus usable."""
    try:
        return charted(bus.turns, exchange)
    except BaseException:
        bus.relay.recover()
        raise


def launched_now(bus: Bus, course: Course, ahead: Exchange[Any] | None) -> Course | None:
    """The course, or its twin, that has left just now; None when nothing has."""
    turns, link, lock = course.turns, bus.link, course.lock
    lock.acquire()
    try:
        if turns.flying or turns.chores or turns.trace.subscriptions or course.holder.course is not course:
            return None
        if turns.group is not course.group:
            turns.regroup(course)
        first = course.first
        if first.length == course.length and first.run >= course.most:
            course = course.twin
        if course.era != lock.era and not course.fits():
            return None
        relay, pace = bus.relay, turns.pace
        takes_time = pace is not None and pace.certain  # as `turns.takes_time`
        now, start = link.now(), turns.free_at
        if relay.pumper is not None or (start > now and takes_time):
            return None
        if arrived := link.read(-inf):  # it cannot answer a request that has not left: take it in first
            with lock:
                turns.feed(arrived, link.now())
            return None
        if start < now:
            start = now
        if ahead is not None and not _may_leave(turns, ahead, now):
            return None
        off(bus, course, ahead, now, start, takes_time)
        return course
    finally:
        lock.release()


def off(
    bus: Bus, course: Course, ahead: Exchange[Any] | None, now: float, start: float, takes_time: bool
) -> None:
    """This leaves, with what is ahead of it, and may; its bits pass from `start` on. The caller holds the lock."""
    turns, request = course.turns, course.request
    if ahead is not None:
        turns.free_at = start = start + _air_time(turns, ahead)
        request = ahead.request + request  # type: ignore[operator,assignment]  # bytes, as the bus is calm
    # an answer cannot come before its question has passed, which does so behind what is ahead of it
    course.sent_at = start if takes_time else now
    course.deadline = start + course.wait
    turns.lock.owing, bus.relay.pumper = True, get_ident()
    turns.aloft = turns.flying[course.lane] = course
    turns.echo.recent.append(course.request)  # type: ignore[arg-type]
    bus.link.write(request)


def cast(bus: Bus, exchange: Exchange[T]) -> T | Unlike:
    """Send what nobody answers; `UNLIKE` when nothing was sent, and it must go the usual way. Raises as `Bus.run`."""
    lock, mine, dealt_with = bus.turns.lock, None, False
    if exchange.replies != ():
        return UNLIKE
    try:
        try:
            lock.acquire()
            moment = _thrown(bus, exchange)
            lock.release()
        except BaseException as error:
            mine = _mine(bus, None)
            fallen(bus, mine, error)
            dealt_with = True
            raise
    except BaseException as error:  # as in `fly`
        if not dealt_with:
            fallen(bus, mine or _mine(bus, None), error)
        raise
    if moment is None:
        return UNLIKE
    answer: Any = Answer((), (), moment)
    value: T = answer if exchange.read is None else exchange.read(answer)
    return value


def _thrown(bus: Bus, exchange: Exchange[Any]) -> float | None:
    """When this has left, just now (s); None where it has not."""
    turns, link = bus.turns, bus.link
    if turns.calm_since != turns.lock.era and not turns.is_calm():
        return None
    if bus.relay.pumper is not None or turns.flying or turns.trace.subscriptions or turns.chores:
        return None
    now, free = link.now(), turns.free_at
    if (free > now and turns.takes_time) or not _may_leave(turns, exchange, now):
        return None
    turns.free_at = (free if free > now else now) + _air_time(turns, exchange)
    link.write(exchange.request)
    return now


def usual(bus: Bus, exchange: Exchange[T]) -> T:
    """The usual way of one exchange, which needs no run."""
    flight, relay = Flight(exchange), bus.relay
    try:
        try:
            relay.start(flight)
            while not flight.done:
                relay.turn()
        except BaseException:
            given_up(bus, flight)
            raise
    except BaseException:  # as in `fly`
        given_up(bus, flight)
        raise
    value: T = taken(bus.turns, exchange, flight.result())
    return value


def _may_leave(turns: Turns, exchange: Exchange[Any], now: float) -> bool:
    """Note that this leaves, which nobody answers; False where it must not, or something has to be asked before."""
    if _matters(exchange) and not is_sure(turns, exchange) and not _admitted(turns, exchange):
        return False
    noted(turns, exchange, now)
    return True


def _matters(exchange: Exchange[Any]) -> bool:
    return bool(exchange.effect or exchange.goals or exchange.later is not None)


def noted(turns: Turns, exchange: Exchange[Any], now: float) -> None:
    """This leaves, which nobody answers, and may."""
    if _matters(exchange):
        aim = exchange.aim
        if aim in turns.aims:
            turns.aims[aim] = now
        else:
            turns.orders(exchange, now)
    turns.statistics.other["sent"] += 1
    turns.echo.recent.append(exchange.request)  # type: ignore[arg-type]  # bytes, as the bus is calm


def _air_time(turns: Turns, exchange: Exchange[Any]) -> float:
    """s on the wire for what nobody answers; all orders of one aim are as long, so of those it is known."""
    aim: Aim | None = exchange.aim
    if aim is None:
        return turns.family.air_time(exchange, turns.rate)
    rate, seconds = aim.air
    if rate != turns.rate:
        rate = turns.rate
        seconds = turns.family.air_time(exchange, rate)
        aim.air = rate, seconds
    return seconds


def is_sure(turns: Turns, exchange: Exchange[Any]) -> bool:
    """Whether this may surely leave, by what is known now; it is noted as given then. The caller holds the lock."""
    passes = turns.passes
    if passes is None or not exchange.sure:
        return False
    refusal = exchange.refusal
    if refusal is not None and refusal(turns.known.stops) is not None:
        return False
    try:
        return passes(exchange)
    except MotorbusError:  # who goes the usual way is told why
        return False


def _admitted(turns: Turns, exchange: Exchange[Any]) -> bool:
    if turns.look is not None and turns.look(exchange):
        return False
    try:
        turns.admitted(exchange)
    except MotorbusError:  # who goes the usual way is told why
        return False
    return True


def _astray(bus: Bus, course: Course, arrived: list[Data]) -> None:
    """The answer is not yet here, or is not as it usually is: it is taken in as that of any other flight."""
    relay, turns = bus.relay, course.turns
    with turns.lock:  # whatever came is taken in: where others have settled this by now, it is theirs
        turns.feed(arrived, bus.link.now(), course.sent_at)
    relay.hand_over()
    course.wake = relay.wake
    while not course.done:
        relay.turn()


def fallen(bus: Bus, course: Course | None, error: BaseException) -> None:
    """The flight has ended by this: where the link is lost all learn it, and whatever happens the bus is let go."""
    mine = [] if course is None else [course]
    try:
        if isinstance(error, LinkError):
            with bus.turns.lock:
                bus.turns.lost(error)
            if bus.relay.pumper == get_ident():
                bus.relay.hand_over()
            mine = []  # settled like all the others
    finally:
        given_up(bus, *mine)


def given_up(bus: Bus, *flights: Flight) -> None:
    """Nobody waits for these any more: they must not leave, and what is in the air lands, or its time is over."""
    bus.relay.recover()
    if flights:
        with bus.turns.lock:
            for flight in flights:
                bus.turns.abandon(flight)


def _mine(bus: Bus, launched: Course | None) -> Course | None:
    """What this thread has in the air; where others have made a usual flight of it, it is not flown again."""
    if bus.relay.pumper == get_ident():
        return bus.turns.aloft or launched
    return launched if launched is not None and launched.is_detached else None
