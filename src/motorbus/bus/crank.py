"""One turn of the crank: what every pump does between two looks at its operation.

Send what may be sent, wait for what comes (or for the next moment that matters), hand it to turns. Shared by the
blocking pump, the async pump and the stop thread, so that none of them has policy of its own.
"""

from __future__ import annotations

from typing import Any

from motorbus.bus.absence import back, rest
from motorbus.bus.ticket import Flight, Retune
from motorbus.bus.turns import Turns
from motorbus.errors import LinkError, LinkLost, MotorbusError
from motorbus.link.base import Link

IDLE = 0.25  # s; the longest wait when nothing is awaited from the wire


def crank(link: Link, turns: Turns, until: float) -> None:
    """Send, wait at most `until`, take in. A lost link fails everything awaited and does not raise."""
    if turns.gone is not None and not found_again(link, turns, until):
        return
    try:
        with turns.lock:
            settled = turns.settled
            now = flush(link, turns)
            due = turns.due() if turns.settled == settled else now  # somebody may go on at once
    except LinkError as error:
        with turns.lock:
            turns.lost(error)
    else:
        take_in(link, turns, min(until, due, now + IDLE))


def found_again(link: Link, turns: Turns, until: float) -> bool:
    """Is a link that was gone there again? If not, all that waited has failed; else time passes, at most `until`."""
    settled = turns.settled
    if back(turns):
        return True
    if turns.settled == settled:
        rest(turns, min(until, link.now() + IDLE))
    return False


def reach(link: Link, turns: Turns, until: float) -> bool:
    """`take_in`, for one who need not send; where the link is gone time passes without it."""
    if turns.gone is not None and not found_again(link, turns, until):
        return False
    return take_in(link, turns, until)


def take_in(link: Link, turns: Turns, until: float) -> bool:
    """Wait for bytes at most `until` and hand them to turns; False when the link is lost.

    Only what was due before this look is overdue after it: a host that was held up looks once more before it calls
    a node silent, for the reply may long have been in the buffer.
    """
    try:
        looked = link.now()
        arrived = link.read(until)
        with turns.lock:
            turns.feed(arrived, link.now(), looked)
    except LinkError as error:
        with turns.lock:
            turns.lost(error)
        return False
    return True


def push(link: Link, turns: Turns) -> None:
    """Put onto the wire whatever may go now, without waiting for anything."""
    try:
        with turns.lock:
            flush(link, turns)
    except LinkError as error:
        with turns.lock:
            turns.lost(error)


def flush(link: Link, turns: Turns) -> float:
    """Put onto the wire whatever may go now; the caller holds the lock. Returns the time."""
    if turns.chores:
        for chore in tuple(turns.chores):
            chore()
    now = link.now()
    if turns.gone is not None:  # or is there, and whoever opened it has not yet said what is forgotten
        return now
    if turns.waiting:
        drain(link, turns, now)
    while (out := turns.send(now)) is not None:
        if isinstance(out, Retune):
            retune(link, turns, out)
        else:
            link.write(out)
            turns.left(now)
    return now


def retune(link: Link, turns: Turns, ticket: Retune) -> None:
    """Change the rate, or begin or cease to listen only; a link that cannot is no reason to give up anything else."""
    if turns.gone is not None:
        turns.untuned = True
        turns.retuned(ticket)
        return
    try:
        link.tune(ticket.tune.rate, ticket.tune.listen_only or turns.listen_only)
    except MotorbusError as error:
        turns.retuned(ticket, error)
        if isinstance(error, LinkLost):
            turns.lost(error)
    else:
        turns.retuned(ticket)


def drain(link: Link, turns: Turns, now: float) -> None:
    """What has already arrived cannot answer a request that has not left: take it in first."""
    stale = link.read(now)
    if stale:
        turns.feed(stale, now)


def launch(link: Link, turns: Turns, *flights: Flight) -> bool:
    """The short path: True when the requests have left at once, all of them in one write; they are bytes if several.

    Of several none but the last is answered. Where the first cannot leave so it is queued, or already settled; what
    follows one that did not leave is left alone.
    """
    try:
        with turns.lock:
            now = link.now()
            if turns.idle and turns.gone is None and not (turns.leaving or turns.chores):
                drain(link, turns, now)
                requests: list[Any] = []
                for flight in flights:
                    request = turns.short(flight, now)
                    if request is None:
                        break
                    requests.append(request)
                if requests:
                    link.write(requests[0] if len(requests) == 1 else b"".join(requests))
                    turns.left(now)
                    return len(requests) == len(flights)
            turns.submit(flights[0], now)
    except LinkError as error:
        with turns.lock:
            turns.lost(error)
            for flight in flights:
                flight.finish(error=error)
    return False
