"""The async pump: carries out operations on an event loop. Policy is in `turns`, as for the blocking pump.

Over a link with virtual time whoever awaits turns the crank; elsewhere `watch` learns when there is something to do.
"""

from __future__ import annotations

import asyncio
import os
from functools import cached_property
from math import inf
from typing import Any, Self, TypeVar

from motorbus.bus.crank import crank
from motorbus.bus.face import BusFace
from motorbus.bus.glide import glide, let_go
from motorbus.bus.interruption import closed, foremost
from motorbus.bus.run import Notify, Run
from motorbus.bus.watch import Watch, ringer
from motorbus.core.operation import UNLIKE, Closed, Exchange, Runnable

T = TypeVar("T")


class AsyncBus(BusFace):
    """An open bus on the running event loop. Any number of tasks may call `run`; use it in an `async with`."""

    @cached_property
    def watch(self) -> Watch:
        return Watch(self.link, self.turns)

    async def run(self, operation: Runnable[T], report: Notify | None = None) -> T:
        """Carry out an operation as `Bus.run` does. A cancelled task first cleans up, then raises CancelledError."""
        if isinstance(operation, Exchange) and (value := await glide(self, operation)) is not UNLIKE:
            return value
        news = asyncio.Event()
        run = Run(self.turns, operation, now=self.link.now, report=self.listener(report), wake=ringer(news))
        try:
            try:
                while not run.advance():
                    await self._turn(news)
            except BaseException as interruption:
                await self._clean_up(run, news, interruption)
        except BaseException as interruption:  # a second one fell between the first and what deals with it
            await self._clean_up(run, news, interruption)
        return run.result()

    async def _clean_up(self, run: Run[Any], news: asyncio.Event, caught: BaseException) -> None:
        """Let what was interrupted come to its end; one more interrupt meanwhile makes it hurry."""
        at_once = False
        while True:
            try:
                if not (at_once := at_once or closed(caught, run.around)):
                    let_go(self.turns.lock)
                run.interrupt(Closed() if isinstance(caught, GeneratorExit) else caught)
                while not run.advance():
                    await self._turn(news) if not at_once else crank(self.link, self.turns, inf)
                break
            except BaseException as interruption:
                caught = interruption
        if at_once:
            raise foremost(caught, run.told())

    async def _turn(self, news: asyncio.Event) -> None:
        if self.link.virtual:
            crank(self.link, self.turns, inf)
            await asyncio.sleep(0)
            return
        await self.watch.turn(news)

    async def close(self) -> None:
        """Give the port back. Nothing is sent to the devices: they go on doing what they were told."""
        self.watch.close()
        self._hang_up()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *exc: object) -> None:
        await self.close()


if os.environ.get("MOTORBUS_ENGINE") == "new":  # until every part runs on it
    from motorbus.bus import asynchronous

    AsyncBus = asynchronous.AsyncBus  # type: ignore[assignment, misc]
