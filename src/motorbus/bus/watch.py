"""How an event loop learns that a link has something: by its descriptor, or by a thread that waits for bytes."""

from __future__ import annotations

import asyncio
import contextlib
from math import inf
from threading import Thread

from motorbus.bus.absence import back
from motorbus.bus.crank import push, take_in
from motorbus.bus.turns import Turns
from motorbus.link.base import Link

LOOK = 0.05  # s; how long the reader thread of a link without descriptor waits at a time


class Watch:
    """Turns the crank whenever the loop sees that bytes have come or that something is due."""

    def __init__(self, link: Link, turns: Turns) -> None:
        self.link = link
        self.turns = turns
        self._loop: asyncio.AbstractEventLoop | None = None
        self._timer: asyncio.TimerHandle | None = None
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
                loop.add_reader(descriptor, self.crank)
        else:
            Thread(target=self._read, args=(losses,), name="motorbus reader", daemon=True).start()

    def crank(self) -> None:
        """Everything that can be done without waiting; then be back when something is due."""
        if self.turns.gone is not None and not self._found_again():
            with self.turns.lock:
                self.turns.expire(self.link.now())
            return
        if not take_in(self.link, self.turns, -inf):
            self.close()  # a dead descriptor would be ready for ever
            return
        push(self.link, self.turns)
        if self._timer is not None:
            self._timer.cancel()
        due = self.turns.due()
        if self._loop is not None and due < inf:
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
