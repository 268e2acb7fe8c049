"""Several buses at the same time: an operation on each, all carried out by one thread or by one task.

Every bus keeps its own turns; here is only how one who waits can wait for all of them. Where time is real, that is
one wait on all descriptors, until the first moment that matters on any bus. Where it is virtual, nothing happens
unless somebody waits, so all clocks go from one event to the next together, and whoever acts, acts at the time that
all the others show. Where both meet, the virtual ones follow the wall clock (decision record 0026).
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
import weakref
from collections.abc import Iterable, Mapping, Sequence
from math import inf
from threading import get_ident
from typing import Any, Generic, TypeVar

from motorbus.bus.aio import AsyncBus
from motorbus.bus.crank import IDLE, crank, push, take_in
from motorbus.bus.face import BusFace
from motorbus.bus.pump import Bus
from motorbus.bus.relay import NAP, SHORT
from motorbus.bus.run import Run
from motorbus.core.operation import Runnable
from motorbus.errors import MotorbusError
from motorbus.link.waiting import wait_any

B = TypeVar("B", bound=BusFace)

ASK_AGAIN = 0.001  # s between two looks at a link without descriptor


class Part(Generic[B]):
    """One bus of a concert and the run there; `origin` is what its clock shows when the clock of all shows 0."""

    def __init__(self, bus: B, wanted: Runnable[Any], origin: float, wake: Any) -> None:
        self.bus = bus
        self.link = bus.link
        self.turns = bus.turns
        self.origin = origin
        self.run: Run[Any] = Run(bus.turns, wanted, now=bus.link.now, report=bus.listener(None), wake=wake)
        self.events = getattr(bus.link, "due", None)
        self.due = 0.0

    @property
    def going(self) -> bool:
        """Its operation has not ended."""
        return not self.run.root.finished

    @property
    def time(self) -> float:
        """s on the clock of all."""
        return self.link.now() - self.origin

    def next(self) -> float:
        """When something happens here next, as far as anybody can know; s on the link's clock, at most `IDLE` away."""
        with self.turns.lock:
            moment = min(self.turns.due(), self.run.deadline)
        if self.events is not None:
            moment = min(moment, self.events())
        now = self.link.now()
        return min(max(moment, now), now + IDLE)

    def push(self) -> bool:
        """Send what may go; True when somebody can go on at once."""
        settled = self.turns.settled
        push(self.link, self.turns)
        return self.turns.settled != settled

    def reach(self, until: float) -> bool | None:
        """Let time pass until then, or until something comes; False when the link is lost, None when others pump."""
        return take_in(self.link, self.turns, until)


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


# -- what blocking and async have in common -----------------------------------------------------------------------


def advance(parts: Iterable[Part[Any]]) -> bool:
    """Step everything that can go on; False when all have ended. Raises what is no error of ours, once."""
    going = False
    for part in parts:
        if not part.going:
            continue
        if not part.run.advance():
            going = True
        elif part.run.interruption is None and not isinstance(part.run.root.error, MotorbusError | None):
            raise part.run.root.error
    return going


def results(parts: Mapping[str, Part[Any]]) -> dict[str, Any]:
    """What each returned, or its MotorbusError; raises the interruption, or what else went wrong, if there was any."""
    told: dict[str, Any] = {}
    cut: BaseException | None = None
    for name, part in parts.items():
        try:
            told[name] = part.run.result()
        except MotorbusError as error:
            told[name] = error
        except BaseException as error:  # each part notes there what its cleaning up failed with
            cut = cut or error
    if cut is not None:
        raise cut
    return told


def clock_of(parts: Sequence[Part[Any]]) -> Part[Any] | None:
    """Who sets the pace: a part whose time is real; None when all are virtual."""
    return next((part for part in parts if not part.link.virtual), None)


def step(parts: Sequence[Part[Any]]) -> bool:
    """All clocks are virtual: they go to the next moment at which something happens on any bus, and no further.

    False when somebody else is at work on one of the buses, and time passes by that.
    """
    going = [part for part in parts if part.going]
    if sum([part.push() for part in going]):
        return True
    first = min(going, key=_next)
    free = first.reach(first.next()) is not None
    moment = first.time
    for part in parts:
        until = moment + part.origin
        if part.link.now() < until and part.reach(until) is None and part.going:
            free = False
    return free


def _next(part: Part[Any]) -> float:
    return part.next() - part.origin


def follow(part: Part[Any], clock: Part[Any]) -> float:
    """A virtual clock goes where the real one is, or to what comes first; in how many s something happens there."""
    settled = part.turns.settled
    if part.going:
        part.push()
    until = clock.time + part.origin
    reached = not part.reach(until) or part.link.now() >= until
    if part.turns.settled != settled or not reached:
        return 0.0
    return part.next() - part.link.now() if part.going else inf


# -- blocking -----------------------------------------------------------------------------------------------------


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
        caught: BaseException | None = None
        while True:
            try:
                if caught is not None:
                    _interrupt(parts, caught)
                else:
                    for part in parts:
                        part.bus.relay.bells.add(bell.ring)
                    _bring_together(parts, bell)
                while advance(parts):
                    _turn(parts, bell, clock)
                for part in parts:
                    part.bus.relay.bells.discard(bell.ring)
                return
            except BaseException as interruption:  # dealt with above, where a second one is caught too
                caught = interruption


def _interrupt(parts: Sequence[_Pumped], interruption: BaseException) -> None:
    for part in parts:
        part.bus.relay.recover()
    for part in parts:
        part.run.interrupt(interruption)


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


# -- on an event loop ---------------------------------------------------------------------------------------------


class LoopConcert:
    """Carries out an operation on each of several async buses. Any number of tasks may call `run`."""

    def __init__(self, buses: Mapping[str, AsyncBus], origins: Mapping[str, float]) -> None:
        self._buses = buses
        self._origins = origins

    async def run(self, operations: Mapping[str, Runnable[Any]]) -> dict[str, Any]:
        """As `Concert.run`. A cancelled task first cleans up on every bus, then raises CancelledError."""
        news, loop = asyncio.Event(), asyncio.get_running_loop()

        def wake() -> None:
            with contextlib.suppress(RuntimeError):  # its loop is closed: nobody waits any more
                loop.call_soon_threadsafe(news.set)

        parts = {
            name: Part(self._buses[name], wanted, self._origins[name], wake)
            for name, wanted in operations.items()
        }
        await _play(list(parts.values()), news)
        return results(parts)


async def _play(parts: Sequence[Part[AsyncBus]], news: asyncio.Event) -> None:
    clock = clock_of(parts)
    caught: BaseException | None = None
    while True:
        try:
            if caught is not None:
                _cut(parts, caught)
            else:
                await _gather(parts)
            while advance(parts):
                await _look(parts, news, clock)
            return
        except GeneratorExit:  # nobody will await us again: clean up here and now
            _cut(parts, asyncio.CancelledError())
            while advance(parts):
                for part in parts:
                    if part.going:
                        crank(part.link, part.turns, inf)
            raise
        except BaseException as interruption:
            caught = interruption


def _cut(parts: Sequence[Part[Any]], interruption: BaseException) -> None:
    for part in parts:
        part.run.interrupt(interruption)


async def _gather(parts: Sequence[Part[AsyncBus]]) -> None:
    """Nobody begins before the latest of them; a clock that is real is waited for."""
    if not any(part.link.virtual for part in parts):
        return
    latest = max(part.time for part in parts)
    for part in parts:
        until = latest + part.origin
        while (now := part.link.now()) < until:
            if not part.link.virtual:
                await asyncio.sleep(until - now)
            elif not part.reach(until):
                break


async def _look(parts: Sequence[Part[AsyncBus]], news: asyncio.Event, clock: Part[Any] | None) -> None:
    """Let time pass."""
    if clock is None:
        step(parts)
        await asyncio.sleep(0)
        return
    seconds = NAP
    for part in parts:
        if part.link.virtual:
            seconds = min(seconds, follow(part, clock))
        elif part.going:
            part.bus.watch.start(asyncio.get_running_loop())
            part.bus.watch.crank()
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(max(0.0, seconds)):
            await news.wait()
    news.clear()
