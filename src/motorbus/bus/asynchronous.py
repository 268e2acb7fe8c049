"""The bus on an asyncio event loop: procedures of all tasks share one engine."""

from __future__ import annotations

import asyncio
from math import inf
from typing import Any, Final, Self, TypeVar

from motorbus.bus.base import IDLE, BaseBus
from motorbus.bus.tasks import Notify, TaskTree
from motorbus.core.operation import Runnable

T = TypeVar("T")

LOOK: Final = 0.001
"""s between two looks at a link without descriptor."""


class AsyncBus(BaseBus):
    """An open bus on the running event loop. Any number of its tasks may call `run`."""

    _loop: asyncio.AbstractEventLoop | None = None
    _descriptor: int | None = None
    _timer: asyncio.TimerHandle | None = None

    async def run(self, procedure: Runnable[T], report: Notify | None = None) -> T:
        """Run a procedure as `Bus.run` does. A cancelled task cleans up, then raises CancelledError."""
        news = asyncio.Event()
        tree = TaskTree(self.engine, procedure, now=self.now, report=self.listener(report), settled=news.set)
        try:
            while not self._advance(tree, news):
                try:
                    await self._wait(tree, news)
                except asyncio.CancelledError as error:
                    with self.turn:
                        tree.cancel(error)
        except GeneratorExit:  # the coroutine was closed: nothing is sent any more
            with self.turn:
                tree.drop()
            raise
        return tree.result()

    def _advance(self, tree: TaskTree[Any], news: asyncio.Event) -> bool:
        """Step the tree and send, until it waits for something; True when it has ended."""
        with self.turn:
            while not tree.advance():
                news.clear()
                self.send()
                if not news.is_set():
                    self._watch()
                    return False
        return True

    async def _wait(self, tree: TaskTree[Any], news: asyncio.Event) -> None:
        """Wait until something that the tree waits for has ended, or a moment that it waits for."""
        if self.link.virtual:
            with self.turn:
                self.receive(tree.next_moment())
            await asyncio.sleep(0)
            return
        moment = tree.next_moment()
        if moment == inf:
            await news.wait()
        else:
            timer = asyncio.get_running_loop().call_later(max(0.0, moment - self.now()), news.set)
            try:
                await news.wait()
            finally:
                timer.cancel()

    def _watch(self) -> None:
        """Have `_look` called when data has come, or at the next deadline."""
        if self.link.virtual:
            return
        loop = asyncio.get_running_loop()
        descriptor = self.link.fileno()
        if loop is not self._loop or descriptor != self._descriptor:
            self._unwatch()
            self._loop, self._descriptor = loop, descriptor
            if descriptor is not None and descriptor >= 0:
                loop.add_reader(descriptor, self._look)
        seconds = self.engine.next_deadline() - self.now()
        if self.engine.gone is not None:
            seconds = min(seconds, IDLE)
        elif descriptor is None and not (self.engine.idle and not self.engine.listeners):
            seconds = min(seconds, LOOK)
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if seconds < inf:
            self._timer = loop.call_later(max(0.0, seconds), self._look)

    def _look(self) -> None:
        with self.turn:
            self.receive(-inf)
            self.send()
            self._watch()

    def _unwatch(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._loop is not None and self._descriptor is not None and not self._loop.is_closed():
            self._loop.remove_reader(self._descriptor)
        self._loop = self._descriptor = None

    async def close(self) -> None:
        """Give the port back. Nothing is sent: devices keep doing what they were ordered."""
        self._unwatch()
        self._hang_up()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *exc: object) -> None:
        await self.close()
