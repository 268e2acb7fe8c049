"""The async pump: moves bytes between a link and turns on an event loop.

Where the link has a descriptor the loop watches it; elsewhere one reader thread per bus waits for bytes. Over a
link with virtual time whoever awaits turns the crank. Policy is in `turns`, as for the blocking pump.
"""

from __future__ import annotations

import asyncio
import contextlib
from math import inf
from threading import Thread
from typing import Self, TypeVar

from motorbus.bus.crank import crank, push, take_in
from motorbus.bus.face import BusFace
from motorbus.bus.run import Notify, Run
from motorbus.core.operation import Runnable

T = TypeVar("T")

NAP = 0.05  # s; a waiting task looks at its own tickets at least this often


class AsyncBus(BusFace):
    """An open bus on the running event loop. Any number of tasks may call `run`; use it in an `async with`."""

    _loop: asyncio.AbstractEventLoop | None = None
    _timer: asyncio.TimerHandle | None = None
    _watching = False

    async def run(self, operation: Runnable[T], report: Notify | None = None) -> T:
        """Carry out an operation and return its value; see `motorbus.bus.pump.Bus.run`.

        A cancelled task first cleans up, then raises CancelledError.
        """
        news = asyncio.Event()
        loop = self._watch()

        def wake() -> None:
            loop.call_soon_threadsafe(news.set)

        run = Run(
            self.turns,
            operation,
            now=self.link.now,
            report=report or self.report,
            wake=wake,
        )
        while True:
            try:
                while not run.advance():
                    await self._turn(news)
                break
            except GeneratorExit:  # nobody will await us again: clean up here and now
                run.interrupt(asyncio.CancelledError())
                while not run.advance():
                    crank(self.link, self.turns, inf)
                raise
            except BaseException as interruption:
                run.interrupt(interruption)
        return run.result()

    async def _turn(self, news: asyncio.Event) -> None:
        if self.link.virtual:
            crank(self.link, self.turns, inf)
            await asyncio.sleep(0)
            return
        self._crank()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(NAP):
                await news.wait()
        news.clear()

    def _watch(self) -> asyncio.AbstractEventLoop:
        loop = asyncio.get_running_loop()
        if not self._watching and not self.link.virtual:
            self._watching, self._loop = True, loop
            descriptor = self.link.fileno()
            if descriptor is not None:
                loop.add_reader(descriptor, self._crank)
            else:
                Thread(target=self._read, name="motorbus reader", daemon=True).start()
        return loop

    def _crank(self) -> None:
        """Everything that can be done without waiting; then be back when something is due."""
        take_in(self.link, self.turns, -inf)
        push(self.link, self.turns)
        if self._timer is not None:
            self._timer.cancel()
        due = self.turns.due()
        if self._loop is not None and due < inf:
            self._timer = self._loop.call_later(max(0.0, due - self.link.now()), self._crank)

    def _read(self) -> None:
        """For links without a descriptor: wait for bytes in a thread, take them in, tell the loop."""
        while self._watching and take_in(self.link, self.turns, self.link.now() + NAP):
            push(self.link, self.turns)

    async def close(self) -> None:
        """Give the port back. Nothing is sent to the devices: they go on doing what they were told."""
        descriptor = self.link.fileno()
        if self._watching and self._loop is not None and descriptor is not None:
            self._loop.remove_reader(descriptor)
        self._watching = False
        if self._timer is not None:
            self._timer.cancel()
        self.stopper.close()
        self.link.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *exc: object) -> None:
        await self.close()
