"""A volley in two halves: goals and question leave, and whoever let them go does something else until the answer is in.

A control loop that knows its next goals before the answer to the last question is in wastes no time on the wire: they
leave `Behind` that answer, before anything else is done. Only what goes straight can be halved so; whatever is
otherwise is over when it has been let loose.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import inf
from threading import get_ident
from typing import TYPE_CHECKING, Any

from motorbus.bus.run import taken
from motorbus.bus.straight import brought, fallen, found, is_sure, launched_now, noted, off
from motorbus.bus.volley import rides, volley
from motorbus.core.operation import UNLIKE, Exchange
from motorbus.errors import LinkError

if TYPE_CHECKING:
    from motorbus.bus.course import Course
    from motorbus.bus.pump import Bus

Forgiven = tuple[type[Exception], ...]


class Behind:
    """An order that may leave right behind an answer, with the same question again.

    Not before `begins` (s on the link's clock), and only if that answer `fits`, which is asked of what it means. It was
    judged when it was made, by what was known in that `era` of the lock. `at` is when it has left, None where it has
    not; its `course` is that of the question.
    """

    __slots__ = ("at", "begins", "course", "era", "fits", "order")

    def __init__(self, order: Exchange[Any], era: int, begins: float, fits: Callable[[Any], bool]) -> None:
        self.order = order
        self.era = era
        self.begins = begins
        self.fits = fits
        self.at: float | None = None
        self.course: Course | None = None


class Loosed:
    """What has left as a volley does, in one write; `land` gives what came of it.

    Between the two the bus is free for everybody. Making one raises what `volley` does.
    """

    __slots__ = ("_bus", "_course", "_forgiven", "_last", "_told")

    def __init__(self, bus: Bus, exchanges: Sequence[Exchange[Any]], forgiven: Forgiven = ()) -> None:
        self._bus = bus
        self._forgiven = forgiven
        self._told: list[Any] = [None] * (len(exchanges) - 1)  # nothing comes of an order that is sure
        self._course: Course | None = _gone(bus, exchanges)
        self._last: Course | None = None
        if self._course is None:
            self._told = volley(bus, exchanges, forgiven)

    def behind(
        self, orders: Sequence[Exchange[Any]], begins: float, fits: Callable[[Any], bool]
    ) -> Behind | None:
        """These, ready to leave right behind the answer; None where they cannot, or it is not sure that they may."""
        if self._course is None or len(orders) != 1 or not rides(orders[0]):
            return None
        era = self._bus.turns.lock.era
        return Behind(orders[0], era, begins, fits) if _foreseen(self._bus, orders[0]) else None

    def land(self, behind: Behind | None = None) -> list[Any]:
        """The value of each, or the error where it is forgiven. Waits for the answer. Raises the error that is not.

        Where something has left `behind` it, that is what lands here next.
        """
        course, told = self._course, self._told
        if course is None:
            return told
        self._course, self._last = None, course
        try:
            told = [*told, _land(self._bus, course, behind)]
        except LinkError:
            raise
        except self._forgiven as error:
            return [*told, error]
        if behind is not None and behind.course is not None:
            self._course, self._told = behind.course, [None]
        return told

    def leave(self, behind: Behind) -> bool:
        """This leaves now, after all, and lands here next; false where it cannot, or anything has happened since it was
        judged: then nothing has left. Raises LinkError."""
        if self._last is None or not _left(self._bus, self._last, behind):
            return False
        self._course, self._told = behind.course, [None]
        return True


def _gone(bus: Bus, exchanges: Sequence[Exchange[Any]]) -> Course | None:
    """The question of these, in the air, with the order ahead of it if there is one; None when nothing has left."""
    if not 1 <= len(exchanges) <= 2:
        return None
    *orders, question = exchanges
    if question.whole is None or not all(rides(order) for order in orders):
        return None
    return _loose(bus, question, orders[0] if orders else None)


def _loose(bus: Bus, exchange: Exchange[Any], ahead: Exchange[Any] | None = None) -> Course | None:
    """Send this as `fly` does, and come back at once; what has left must be given to `_land`. None as `UNLIKE` there.

    Meanwhile the bus is free: whoever else wants something of it makes a usual flight of this one.
    """
    course: Course | None = exchange.course
    if (course is None or course.turns is not bus.turns) and (course := found(bus, exchange)) is None:
        return None
    launched, mine, dealt_with = None, None, False
    try:
        try:
            launched = launched_now(bus, course, ahead)
            if launched is not None:
                launched.wake = bus.relay.wake
                bus.relay.pass_on()
            return launched
        except BaseException as error:
            mine = _in_the_air(bus, launched)
            fallen(bus, mine, error)
            dealt_with = True
            raise
    except BaseException as error:  # as in `fly`
        if not dealt_with:
            fallen(bus, mine or _in_the_air(bus, launched), error)
        raise


def _foreseen(bus: Bus, order: Exchange[Any]) -> bool:
    """Whether this may surely leave, by what is known while an answer is on its way; it is noted as given then."""
    lock = bus.turns.lock
    try:
        try:
            lock.acquire()
            found = is_sure(bus.turns, order)
            lock.release()
        except BaseException:
            bus.relay.recover()
            raise
    except BaseException:  # as in `fly`
        bus.relay.recover()
        raise
    return found


def _land(bus: Bus, course: Course, behind: Behind | None = None) -> Any:
    """Wait for the answer of what was let loose on this bus, and return its value. Raises what `Bus.run` does.

    Where it comes straight, what is to leave `behind` it does so before anything else is done.
    """
    turns, relay, lock = bus.turns, bus.relay, bus.turns.lock
    then = None if behind is None else partial(_follow, bus, course, behind)
    mine, dealt_with = None, False
    try:
        try:
            lock.acquire()
            if turns.aloft is course and relay.pumper is None:
                relay.pumper = get_ident()
            lock.release()
            if relay.pumper == get_ident():
                value = brought(bus, course, then, bus.link.read(-inf))
                if value is not UNLIKE:
                    return value
            while not course.done:  # others have made a usual flight of it
                relay.turn()
        except BaseException as error:
            mine = _in_the_air(bus, behind.course if behind else None, course)
            fallen(bus, mine, error)
            dealt_with = True
            raise
    except BaseException as error:  # as in `fly`
        if not dealt_with:
            fallen(bus, mine or _in_the_air(bus, behind.course if behind else None, course), error)
        raise
    return taken(turns, course.exchange, course.result())


def _in_the_air(bus: Bus, *courses: Course | None) -> Course | None:
    """Which of these nobody waits for any more: it flies still, or others have made a usual flight of it."""
    turns = bus.turns
    if bus.relay.pumper == get_ident() and turns.aloft is not None:
        return turns.aloft
    mine = [one for one in courses if one is not None and not one.done]
    return next((one for one in mine if one.is_detached or turns.flying.get(one.lane) is one), None)


def _follow(bus: Bus, last: Course, behind: Behind, value: Any) -> None:
    """This order and the same question leave right behind an answer that came just now, where nothing is against it."""
    if bus.link.now() >= behind.begins and behind.fits(value):
        _go(bus, last, behind)


def _left(bus: Bus, last: Course, behind: Behind) -> bool:
    """Has this left now, a while after the answer to the `last` question? Raises LinkError."""
    relay, lock = bus.relay, bus.turns.lock
    mine, dealt_with = None, False
    try:
        try:
            lock.acquire()
            if relay.pumper is None:
                _go(bus, last, behind)
                relay.pumper = None
            lock.release()
        except BaseException as error:
            mine = _in_the_air(bus, behind.course)
            fallen(bus, mine, error)
            dealt_with = True
            raise
    except BaseException as error:  # as in `fly`
        if not dealt_with:
            fallen(bus, mine or _in_the_air(bus, behind.course), error)
        raise
    return behind.at is not None


def _go(bus: Bus, last: Course, behind: Behind) -> None:
    """The same, whenever it is; the caller holds the lock, and passes on."""
    turns, link = last.turns, bus.link
    course: Course | None = last.holder.course
    if course is None or turns.flying or turns.chores or turns.trace.subscriptions:
        return
    if turns.lock.era != behind.era:
        return
    if turns.group is not course.group:  # others may have gone straight since
        turns.regroup(course)
    if course.first.length == course.length and course.first.run >= course.most:
        course = course.twin
    if course.era != turns.lock.era and not course.fits():
        return
    order = behind.order
    if turns.lets_move is not None and not turns.lets_move():
        return
    if order.refusal is not None and order.refusal(turns.known.stops) is not None:
        return
    now, start, takes_time = link.now(), turns.free_at, turns.takes_time
    if start > now and takes_time:
        return
    if arrived := link.read(-inf):  # as in `launched_now`
        with turns.lock:
            turns.feed(arrived, link.now())
        return
    noted(turns, order, now)
    course.wake = bus.relay.wake
    off(bus, course, order, now, max(now, start), takes_time)
    behind.at, behind.course = now, course
