"""The straight way on an event loop: the request leaves at once, and when the line says that something has come, the
whole answer is checked at one look and handed to whoever awaits it. Whatever is otherwise goes the usual way.

The same course as in `straight`, cut where a loop must be let go.
"""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections.abc import Callable
from math import inf
from threading import get_ident
from typing import TYPE_CHECKING, Any, TypeVar

from motorbus.bus.course import Course, TurnsLock
from motorbus.bus.interruption import closed
from motorbus.bus.run import taken
from motorbus.bus.straight import charted
from motorbus.core.operation import UNLIKE, Data, Exchange, Unlike
from motorbus.errors import LinkError

if TYPE_CHECKING:
    from motorbus.bus.aio import AsyncBus
    from motorbus.bus.turns import Turns
    from motorbus.link.base import Link

T = TypeVar("T")


async def glide(bus: AsyncBus, exchange: Exchange[T]) -> T | Unlike:
    """Carry this out and return its value; `UNLIKE` when nothing was sent, and it must go the usual way.

    Raises what `AsyncBus.run` does. Whoever is cancelled leaves it in the air, where it lands, or its time ends.
    """
    loop, turns, watch = asyncio.get_running_loop(), bus.turns, bus.watch
    if exchange.whole is None or bus.link.virtual or turns.chores:
        return UNLIKE
    watch.start(loop)
    if not watch.sees(loop):
        return UNLIKE
    news: asyncio.Future[Any] = loop.create_future()
    around = sys.exception()
    try:
        try:
            course = rise(turns, bus.link, exchange, _bell(loop, news))
            if course is None:
                return UNLIKE
            watch.expect(course, news)
            value = await news
        except BaseException as interruption:
            _cut_short(turns, exchange, held=not closed(interruption, around))
            raise
    except BaseException as interruption:  # a second one may fall into what the first has brought about
        if not closed(interruption, around):
            let_go(turns.lock)
        raise
    if (
        value is UNLIKE
    ):  # it came in pieces, or is not the one that is due: it was a flight like any other then
        value = taken(turns, course.exchange, course.result())
    return value  # type: ignore[no-any-return]


def _cut_short(turns: Turns, exchange: Exchange[Any], held: bool) -> None:
    """Whoever waits for this waits no more; in the air it stays until it lands, or its time is over."""
    if held:
        let_go(turns.lock)
    try:
        with turns.lock:
            for flight in turns.flying.values():
                if isinstance(flight, Course) and flight.holder is exchange:
                    turns.abandon(flight)
                    return
    finally:  # a task is cancelled, and the interrupt falls in here
        if held:
            let_go(turns.lock)


def let_go(lock: TurnsLock) -> None:
    """After an interrupt, which may fall between any two lines: release the lock as often as it is held."""
    with contextlib.suppress(RuntimeError):  # not held (any more): the usual case
        while True:
            lock.release()


def _bell(loop: asyncio.AbstractEventLoop, news: asyncio.Future[Any]) -> Callable[[], None]:
    """What is called, in whatever thread, when the course has ended in the usual way."""
    here = get_ident()

    def ended() -> None:
        if not news.done():
            news.set_result(UNLIKE)

    def ring() -> None:
        if get_ident() == here:
            ended()
            return
        with contextlib.suppress(RuntimeError):  # its loop is closed: nobody waits any more
            loop.call_soon_threadsafe(ended)

    return ring


def rise(turns: Turns, link: Link, exchange: Exchange[Any], wake: Callable[[], None]) -> Course | None:
    """Send this at once; None when nothing was sent, and it must go the usual way. Raises LinkError."""
    course: Course | None = exchange.course
    if course is None or course.turns is not turns:
        course = charted(turns, exchange)
        if course is None:
            return None
    lock = turns.lock
    lock.acquire()
    try:
        if (
            turns.flying or course.holder.course is not course
        ):  # of another task; that need not change the era
            return None
        if turns.group is not course.group:
            turns.regroup(course)
        first = course.first
        if first.length == course.length and first.run >= course.most:
            course = course.twin
        if (course.era != lock.era and not course.fits()) or turns.trace.subscriptions:
            return None
        now, free = link.now(), turns.free_at
        if free > now and turns.takes_time:
            return None
        if arrived := link.read(-inf):  # what is here already cannot answer a request that has not left
            with lock:
                turns.feed(arrived, link.now())
            return None
        course.sent_at, course.done, course.wake = now, False, wake
        course.deadline = (free if free > now else now) + course.wait
        lock.owing = True
        turns.aloft = turns.flying[course.lane] = course
        turns.echo.recent.append(course.request)  # type: ignore[arg-type]  # bytes, as the bus is calm
        link.write(course.request)
    except LinkError as error:
        with lock:
            turns.lost(error)
        raise
    finally:
        lock.release()
    return course


def touch_down(turns: Turns, link: Link, course: Course, news: asyncio.Future[Any]) -> bool:
    """Something has come: True when it is the whole answer, which is handed over, or a piece of it, which is kept; else
    all of it has been taken in."""
    looked, arrived = link.now(), link.read(-inf)
    if len(arrived) == 1 and _is_it(turns, link, course, news, arrived[0]):
        return True
    with turns.lock:
        turns.feed(arrived, link.now(), looked)
    return False


def _is_it(turns: Turns, link: Link, course: Course, news: asyncio.Future[Any], data: Data) -> bool:
    lock, is_it = turns.lock, False
    try:
        try:
            lock.acquire()
            at = min(link.now(), course.deadline)  # a loop that was held up takes it in late
            if turns.aloft is course and not news.done():
                if len(course.joined(data)) < course.size:
                    course.held.append((at, [data]))
                    is_it = True
                else:
                    is_it = _ends(course, news, data, at)
            lock.release()
        except BaseException:
            let_go(lock)
            raise
    except BaseException:  # as in `glide`
        let_go(lock)
        raise
    return is_it


def _ends(course: Course, news: asyncio.Future[Any], last: Data, at: float) -> bool:
    """With this the answer is there: hand it over. False where it is none as it should be, or another look is needed,
    as its last packet came in pieces: then a byte may follow that is one too many."""
    if at - course.sent_at < course.least or (course.held and len(last) < course.length):
        return False
    data = course.joined(last) if course.held else last
    value = course.whole(data, at)
    if value is UNLIKE:
        return False
    course.held = []
    course.lands(data, at)
    news.set_result(value)
    return True
