"""Several buses at the same time, awaited: an operation on each, carried out by one task of an event loop.

Where time is real, the loop watches every bus as it does when that is alone, and this waits for news of any; where it
is virtual, whoever awaits lets it pass, on all buses alike.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

from motorbus.bus.aio import AsyncBus
from motorbus.bus.crank import crank
from motorbus.bus.glide import let_go
from motorbus.bus.interruption import closed, foremost
from motorbus.bus.part import Part, advance, clock_of, follow, results, step
from motorbus.bus.watch import NAP, ringer
from motorbus.core.operation import Runnable


class LoopConcert:
    """Carries out an operation on each of several async buses. Any number of tasks may call `run`."""

    def __init__(self, buses: Mapping[str, AsyncBus], origins: Mapping[str, float]) -> None:
        self._buses = buses
        self._origins = origins

    async def run(self, operations: Mapping[str, Runnable[Any]]) -> dict[str, Any]:
        """As `Concert.run`. A cancelled task first cleans up on every bus, then raises CancelledError."""
        news = asyncio.Event()
        wake = ringer(news)
        parts = {
            name: Part(self._buses[name], wanted, self._origins[name], wake)
            for name, wanted in operations.items()
        }
        await _play(list(parts.values()), news)
        return results(parts)


async def _play(parts: Sequence[Part[AsyncBus]], news: asyncio.Event) -> None:
    clock = clock_of(parts)
    try:
        try:
            await _gather(parts)
            while advance(parts):
                await _look(parts, news, clock)
        except BaseException as interruption:
            await _clean_up(parts, news, clock, interruption)
    except BaseException as interruption:  # a second one fell between the first and what deals with it
        await _clean_up(parts, news, clock, interruption)


async def _clean_up(
    parts: Sequence[Part[AsyncBus]], news: asyncio.Event, clock: Part[Any] | None, caught: BaseException
) -> None:
    """Let them all come to their end; one more interrupt meanwhile makes them hurry."""
    at_once = False
    while True:
        try:
            at_once = at_once or any(closed(caught, part.run.around) for part in parts)
            for part in parts if not at_once else ():
                let_go(part.turns.lock)
            for part in parts:
                part.run.interrupt(asyncio.CancelledError() if isinstance(caught, GeneratorExit) else caught)
            while advance(parts):
                await _look(parts, news, clock) if not at_once else _crank(parts)
            break
        except BaseException as interruption:
            caught = interruption
    if at_once:
        raise foremost(caught, *(part.run.told() for part in parts))


def _crank(parts: Sequence[Part[AsyncBus]]) -> None:
    for part in parts:
        if part.going:
            crank(part.link, part.turns, inf)


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
