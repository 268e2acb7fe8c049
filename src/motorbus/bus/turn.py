"""The turn of a bus: a lock whose holder alone has requests in flight."""

from __future__ import annotations

from heapq import heapify, heappop, heappush
from itertools import count
from operator import itemgetter
from threading import Lock, get_ident
from time import monotonic
from typing import Final, Self

from motorbus.core.request import Priority

AGED: Final = 0.25
"""s after which a waiting thread goes first, whatever its priority."""

_Waiter = tuple[int, int, float, Lock, int]
"""Priority, number, since when (s), what wakes it, its thread."""


class Turn:
    """A lock given by priority, first come first served within one. The thread that holds it may take it again."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._guard = Lock()
        self._owner = 0
        self._depth = 0
        self._waiters: list[_Waiter] = []
        self._serial = count()

    @property
    def wanted(self) -> bool:
        """Other threads wait for it."""
        return bool(self._waiters)

    @property
    def held(self) -> bool:
        """A thread has it."""
        return self._lock.locked()

    def acquire(self, priority: Priority = Priority.POLL, timeout: float = -1.0) -> bool:
        """Take the turn; False when `timeout` s have passed without it (-1: no limit)."""
        me = get_ident()
        if self._owner == me:
            self._depth += 1
            return True
        free = not self._waiters and self._lock.acquire(blocking=False)
        if not free and not self._wait(priority, timeout, me):
            return False
        self._owner, self._depth = me, 1
        return True

    def __enter__(self) -> Self:
        self.acquire()
        return self

    def __exit__(self, *exc: object) -> None:
        self.release()

    def release(self) -> None:
        """Give it back, as often as it was taken; a thread that does not have it changes nothing."""
        if self._owner != get_ident():
            return
        self._depth -= 1
        if self._depth:
            return
        self._owner = 0
        self._lock.release()
        if self._waiters:
            with self._guard:
                self._pass_on()

    def _wait(self, priority: Priority, timeout: float, thread: int) -> bool:
        wake = Lock()
        wake.acquire()
        waiter = (priority, next(self._serial), monotonic(), wake, thread)
        with self._guard:
            heappush(self._waiters, waiter)
            self._pass_on()
        try:
            if wake.acquire(timeout=timeout):
                return True
        except BaseException:  # a signal handler has raised
            if self._withdraw(waiter):
                self._lock.release()
                with self._guard:
                    self._pass_on()
            raise
        return self._withdraw(waiter)

    def _withdraw(self, waiter: _Waiter) -> bool:
        """Wait no more; True when the turn was given at the last moment."""
        with self._guard:
            if waiter not in self._waiters:
                return True
            self._waiters.remove(waiter)
            heapify(self._waiters)
            return False

    def _pass_on(self) -> None:
        """Give a free turn to the first waiter, or to the oldest where that has waited too long."""
        if not self._waiters or not self._lock.acquire(blocking=False):
            return
        oldest = min(self._waiters, key=itemgetter(2))
        if monotonic() - oldest[2] > AGED:
            self._waiters.remove(oldest)
            heapify(self._waiters)
            oldest[3].release()
        else:
            heappop(self._waiters)[3].release()
