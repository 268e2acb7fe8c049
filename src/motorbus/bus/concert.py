"""Several buses at the same time: an operation on each, all carried out by the thread that asked.

There is one wait on the descriptors of all buses, until the first moment that matters on any of them. Meanwhile this
thread pumps every bus where no other does; where one does, a bell tells that it has brought something, or ceased
(decision record 0026).
"""

from __future__ import annotations

import contextlib
import socket
import weakref
from collections.abc import Iterable, Mapping, Sequence
from math import inf
from threading import get_ident
from typing import Any

from motorbus.bus.absence import back
from motorbus.bus.crank import IDLE, take_in
from motorbus.bus.part import Part, advance, clock_of, follow, results, step
from motorbus.bus.pump import Bus
from motorbus.bus.relay import NAP, SHORT
from motorbus.core.operation import Runnable
from motorbus.link.wait import wait_any

ASK_AGAIN = 0.001  # s between two looks at a link without descriptor


class _Pumped(Part[Bus]):
    """On a blocking bus, where other threads may be at work too."""

    def reach(self, until: float) -> bool | None:
        relay = self.bus.relay
        if not relay.claim():
            return None
        try:
            return super().reach(until)
        finally:
            relay.hand_over()

    def prepare(self) -> tuple[bool, float]:
        """Send what may go. Is the wire to be watched from here, and how long (s) has that time?"""
        relay, turns = self.bus.relay, self.turns
        if turns.gone is not None and not back(turns):
            return False, self._without()
        with relay.changed:
            mine = relay.claim()
            settled = self.push()
            now = self.link.now()
            self.due = min(turns.due(), self.run.deadline) if not settled else now
        if mine:
            return True, self.due - now
        known = turns.settled
        take_in(self.link, turns, -inf)  # the one who pumps may wait for something far away
        return False, 0.0 if turns.settled != known else min(NAP, max(self.due - now, SHORT))

    def _without(self) -> float:
        """The link is gone: what is due is settled without it; how long (s) until something is."""
        with self.turns.lock:
            self.turns.expire(self.link.now())
            self.due = min(self.turns.due(), self.run.deadline)
        return min(NAP, max(self.due - self.link.now(), SHORT))


class Bell:
    """Wakes the thread that waits for several buses; any other thread may ring it."""

    def __init__(self) -> None:
        weakref.finalize(self, _close, pair := socket.socketpair())  # both at once, whatever comes in between
        self._ear, self._clapper = pair
        for end in pair:
            end.setblocking(False)
        self.descriptor = self._ear.fileno()
        self.thread = 0

    def ring(self) -> None:
        """Something has been settled, or nobody pumps any more."""
        if get_ident() != self.thread:
            with contextlib.suppress(OSError):  # it has been rung often enough
                self._clapper.send(b".")

    def wait(self, descriptors: list[int], seconds: float) -> list[int]:
        """Which of these can be read; all of them when one is closed. Ends as well when it is rung, or in `seconds`."""
        try:
            found = wait_any([self.descriptor, *descriptors], max(0.0, seconds))
        except (OSError, ValueError):  # closed by another thread: whoever reads it will say so
            return descriptors
        if self.descriptor in found:
            with contextlib.suppress(OSError):
                self._ear.recv(4096)
        return found


def _close(ends: Iterable[socket.socket]) -> None:
    for end in ends:
        end.close()


class Concert:
    """Carries out an operation on each of several blocking buses. Any number of threads may call `run`."""

    def __init__(self, buses: Mapping[str, Bus], origins: Mapping[str, float]) -> None:
        self._buses = buses
        self._origins = origins
        self._bells: list[Bell] = []

    def run(self, operations: Mapping[str, Runnable[Any]]) -> dict[str, Any]:
        """What each returns, or the MotorbusError that it raised, by the names of the buses.

        Whatever else is raised in one of them, KeyboardInterrupt included, interrupts them all; it is raised when all
        have cleaned up.
        """
        bell = self._bell()
        parts = {
            name: _Pumped(self._buses[name], wanted, self._origins[name], bell.ring)
            for name, wanted in operations.items()
        }
        self._play(list(parts.values()), bell)
        self._bells.append(bell)
        return results(parts)

    def _bell(self) -> Bell:
        try:
            bell = self._bells.pop()
        except IndexError:
            bell = Bell()
        bell.thread = get_ident()
        return bell

    def _play(self, parts: Sequence[_Pumped], bell: Bell) -> None:
        clock = clock_of(parts)
        try:
            try:
                for part in parts:
                    part.bus.relay.bells.add(bell.ring)
                _bring_together(parts, bell)
                _go_on(parts, bell, clock)
            except BaseException as interruption:
                _clean_up(parts, bell, clock, interruption)
        except BaseException as interruption:  # a second one fell between the first and what deals with it
            _clean_up(parts, bell, clock, interruption)


def _go_on(parts: Sequence[_Pumped], bell: Bell, clock: Part[Any] | None) -> None:
    """To the end of them all; nobody rings for us then."""
    while advance(parts):
        _turn(parts, bell, clock)
    for part in parts:
        part.bus.relay.bells.discard(bell.ring)


def _clean_up(parts: Sequence[_Pumped], bell: Bell, clock: Part[Any] | None, caught: BaseException) -> None:
    """Let them all come to their end; one more interrupt meanwhile makes them hurry."""
    while True:
        try:
            for part in parts:
                part.bus.relay.recover()
            for part in parts:
                part.run.interrupt(caught)
            _go_on(parts, bell, clock)
            return
        except BaseException as interruption:
            caught = interruption


def _bring_together(parts: Sequence[_Pumped], bell: Bell) -> None:
    """Nobody begins before the latest of them; a clock that is real is waited for."""
    if not any(part.link.virtual for part in parts):
        return
    latest = max(part.time for part in parts)
    for part in parts:
        until = latest + part.origin
        while (now := part.link.now()) < until:
            alive = part.reach(min(until, now + IDLE))
            if alive is None:
                bell.wait([], SHORT)
            elif not alive:
                break


def _turn(parts: Sequence[_Pumped], bell: Bell, clock: Part[Any] | None) -> None:
    """Let time pass."""
    if clock is not None:
        _wait(parts, bell, clock)
    elif not step(parts):
        bell.wait([], SHORT)


def _wait(parts: Sequence[_Pumped], bell: Bell, clock: Part[Any]) -> None:
    """Until something comes on any bus, or something is due; then take it in."""
    watched: dict[_Pumped, int | None] = {}
    seconds = IDLE
    try:
        for part in parts:
            if part.link.virtual:
                seconds = min(seconds, follow(part, clock))
            elif part.going:
                mine, left = part.prepare()
                if mine:
                    watched[part] = part.link.fileno()
                    left = min(left, _silence(part)) if watched[part] is None else left
                seconds = min(seconds, left)
        found = bell.wait([one for one in watched.values() if one is not None], seconds)
        for part, descriptor in watched.items():
            if descriptor is None or descriptor in found or part.link.now() >= part.due:
                take_in(part.link, part.turns, -inf)
    finally:
        for part in watched:
            part.bus.relay.hand_over()


def _silence(part: _Pumped) -> float:
    """For how long (s) a link without descriptor need not be looked at."""
    return ASK_AGAIN if part.events is None else part.events() - part.link.now()
