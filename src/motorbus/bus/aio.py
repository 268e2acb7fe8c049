"""The async pump: carries out operations on an event loop. Policy is in `turns`, as for the blocking pump.

Over a link with virtual time whoever awaits turns the crank; elsewhere `watch` learns when there is something to do.
"""

from __future__ import annotations

import asyncio
import contextlib
from functools import cached_property
from math import inf
from typing import Self, TypeVar

from motorbus.bus.crank import crank
from motorbus.bus.face import BusFace
from motorbus.bus.glide import glide, let_go
from motorbus.bus.run import Notify, Run
from motorbus.bus.watch import Watch
from motorbus.core.operation import UNLIKE, Exchange, Runnable

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
        news, loop = asyncio.Event(), asyncio.get_running_loop()

        def wake() -> None:
            with contextlib.suppress(RuntimeError):  # its loop is closed: nobody waits any more
                loop.call_soon_threadsafe(news.set)

        run = Run(self.turns, operation, now=self.link.now, report=self.listener(report), wake=wake)
        caught: BaseException | None = None
        while True:
            try:
                if caught is not None:
                    let_go(self.turns.lock)
                    run.interrupt(caught)
                while not run.advance():
                    await self._turn(news)
                break
            except GeneratorExit:  # nobody will await us again: clean up here and now
                run.interrupt(asyncio.CancelledError())
                while not run.advance():
                    crank(self.link, self.turns, inf)
                raise
            except BaseException as interruption:
                caught = interruption
        return run.result()

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
