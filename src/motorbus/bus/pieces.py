"""The straight way of an answer that comes in pieces: most UARTs hand bytes over as they come.

What has come is kept with the course, and nobody is called before all of it is there. Whoever takes the lock of the
turns in the usual way meanwhile finds it taken in, as the pieces of any other flight.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from motorbus.bus.course import Course
from motorbus.core.operation import UNLIKE, Data

if TYPE_CHECKING:
    from motorbus.bus.pump import Bus

Then = Callable[[Any], None]
"""Is told what an answer means as soon as it has landed."""


def gathered(bus: Bus, course: Course, arrived: list[Data], latest: float, then: Then | None = None) -> Any:
    """Wait for the rest of the answer that has begun to come, and return what it means; `then` is done before that.

    What is there by now counts as no younger than `latest` (s).

    `UNLIKE` when it is none as it should be, or does not come: then `arrived` is what is not taken in yet. Raises
    LinkError; the caller lets go of the lock.
    """
    link = bus.link
    while keeps(course, arrived, link.now()):
        if course.size <= len(course.joined()):
            last = len(arrived[-1])
            arrived.clear()
            if last < course.length:  # the last packet came in pieces
                arrived += link.read(link.now() + course.settle)
            return UNLIKE if arrived else _meant(bus, course, latest, then)
        latest = course.deadline
        arrived[:] = link.read(latest)
    return UNLIKE


def keeps(course: Course, arrived: list[Data], at: float) -> bool:
    """Keep these pieces with the course; False where there are none, or the course is no longer in the air."""
    lock = course.lock
    lock.acquire()
    kept = bool(arrived) and course.turns.aloft is course
    if kept:
        course.held.append((at, list(arrived)))
    lock.release()
    return kept


def _meant(bus: Bus, course: Course, latest: float, then: Then | None) -> Any:
    """What the answer means of which all pieces have come."""
    lock, value = course.lock, UNLIKE
    lock.acquire()
    at = min(bus.link.now(), latest)
    if course.turns.aloft is course and at - course.sent_at >= course.least:
        data = course.joined()
        value = course.whole(data, at)
        if value is not UNLIKE:
            course.held = []  # first, or after an interrupt in between they would be those of the next flight
            course.lands(data, at)
            if then is not None:
                then(value)
            bus.relay.pumper = None
    lock.release()
    return value
