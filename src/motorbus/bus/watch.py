"""How an event loop learns that a link has something: by its descriptor, or by a thread that waits for bytes."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from math import inf
from threading import Thread
from typing import Any

from motorbus.bus.absence import back
from motorbus.bus.course import Course
from motorbus.bus.crank import push, take_in
from motorbus.bus.glide import touch_down
from motorbus.bus.turns import Turns
from motorbus.errors import LinkError
from motorbus.link.base import Link

NAP = 0.05  # s; a waiting task looks at its own tickets at least this often
LOOK = 0.05  # s; how long the reader thread of a link without descriptor waits at a time


def ringer(news: asyncio.Event) -> Callable[[], None]:
    """Sets this on the running loop, from whatever thread."""
    loop = asyncio.get_running_loop()

    def ring() -> None:
        with contextlib.suppress(RuntimeError):  # its loop is closed: nobody waits any more
            loop.call_soon_threadsafe(news.set)

    return ring


class Watch:
    """Turns the crank whenever the loop sees that bytes have come or that something is due."""

    def __init__(self, link: Link, turns: Turns) -> None:
        self.link = link
        self.turns = turns
        self._loop: asyncio.AbstractEventLoop | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._look_at = inf  # when that goes off, on the clock of the link
        self._awaited: tuple[Course, asyncio.Future[Any]] | None = None
        self._losses = 0  # so many there were when this link was found
        self._watched: int | None = None

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Watch the link on this loop; does nothing when it is watched, or is gone and not there again."""
        losses = self.turns.losses
        if self._loop is loop and self._losses == losses:
            return
        self.close()  # the loop before this one is gone, or the port: its number may soon be that of another file
        if not back(self.turns):
            return
        self._loop, self._losses = loop, losses
        self._watched = descriptor = self.link.fileno()
        if descriptor is not None:
            with contextlib.suppress(ValueError):  # closed: the next look says so
                loop.add_reader(descriptor, self._ready)
        else:
            Thread(target=self._read, args=(losses,), name="motorbus reader", daemon=True).start()

    async def turn(self, news: asyncio.Event) -> None:
        """One turn of the crank for a task that waits for news."""
        self.start(asyncio.get_running_loop())
        self.crank()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(NAP):
                await news.wait()
        news.clear()

    def crank(self) -> None:
        """Everything that can be done without waiting; then be back when something is due."""
        self._look_at = inf  # what is due may be another thing from now on
        if self.turns.gone is not None and not self._found_again():
            with self.turns.lock:
                self.turns.expire(self.link.now())
            return
        if not take_in(self.link, self.turns, -inf):
            self.close()  # a dead descriptor would be ready for ever
            return
        push(self.link, self.turns)
        self._look_when(self.turns.due())

    def sees(self, loop: asyncio.AbstractEventLoop) -> bool:
        """Is the descriptor of the link watched on this loop? Then whatever comes is seen at once."""
        return self._loop is loop and self._watched is not None

    def expect(self, course: Course, news: asyncio.Future[Any]) -> None:
        """The answer to this is awaited: it is handed over when it comes."""
        self._awaited = course, news
        self._look_when(course.deadline)

    def _ready(self) -> None:
        """Something has come: mostly the whole answer that is awaited."""
        awaited = self._awaited
        if awaited is not None and self.turns.aloft is awaited[0]:
            with contextlib.suppress(LinkError):  # the next look says so
                if touch_down(self.turns, self.link, *awaited):
                    return
        self.crank()

    def _look_when(self, due: float) -> None:
        """Be back when something is due. A timer that goes off before that stays as it is, and costs nothing."""
        if self._loop is None or due >= self._look_at:
            return
        if self._timer is not None:
            self._timer.cancel()
        self._look_at = due
        self._timer = self._loop.call_later(max(0.0, due - self.link.now()), self.crank)

    def _found_again(self) -> bool:
        loop = self._loop
        self.close()  # while the number is still ours
        if not back(self.turns):
            return False
        if loop is not None:
            self.start(loop)
        return True

    def _read(self, losses: int) -> None:
        while self._watches(losses) and take_in(self.link, self.turns, self.link.now() + LOOK):
            push(self.link, self.turns)

    def _watches(self, losses: int) -> bool:
        return self._loop is not None and self._losses == losses

    def close(self) -> None:
        """Watch no longer."""
        loop, self._loop = self._loop, None
        descriptor, self._watched = self._watched, None
        if loop is not None and descriptor is not None and not loop.is_closed():
            with contextlib.suppress(ValueError, OSError):
                loop.remove_reader(descriptor)
        if self._timer is not None:
            self._timer.cancel()
        self._look_at = inf
