"""The turn of a bus: a lock whose holder alone has requests in flight. And what ends the sleep of a thread."""

from __future__ import annotations

import contextlib
from bisect import insort
from itertools import count
from math import inf
from threading import Condition, Lock, get_ident
from time import monotonic
from typing import Final, Self

from motorbus.core.request import Priority

AGED: Final = 0.25
"""s by which a thread that waits goes before one of the next higher priority that comes later; a stop goes first."""


class Turn:
    """A lock given by priority, first come first served within one. The thread that holds it may take it again."""

    def __init__(self) -> None:
        self._mutex = Lock()
        self._changed = Condition(self._mutex)
        self._owner = 0
        self._depth = 0
        self._waiters: list[tuple[float, int]] = []
        """When (s) each is due, and its number; the first is next."""
        self._serial = count()

    @property
    def wanted(self) -> bool:
        """Other threads wait for it."""
        return bool(self._waiters)

    def acquire(self, priority: Priority = Priority.POLL, timeout: float = -1.0) -> bool:
        """Take the turn; False when `timeout` s have passed without it (-1: no limit)."""
        me = get_ident()
        if self._owner == me:
            self._depth += 1
            return True
        with self._mutex:
            if not (self._owner or self._waiters) or self._wait(priority, timeout):
                self._owner, self._depth = me, 1
                return True
            return False

    def _wait(self, priority: Priority, timeout: float) -> bool:
        due = -inf if priority is Priority.STOP else monotonic() + AGED * priority
        waiter = (due, next(self._serial))
        insort(self._waiters, waiter)
        free = False
        try:
            free = self._changed.wait_for(
                lambda: not self._owner and self._waiters[0] == waiter, timeout if timeout >= 0 else None
            )
        finally:
            self._waiters.remove(waiter)
            if not free:  # the next one may have waited for this one
                self._changed.notify_all()
        return free

    def release(self) -> None:
        """Give it back, as often as it was taken; a thread that does not have it changes nothing."""
        if self._owner != get_ident():
            return
        self._depth -= 1
        if not self._depth:
            with self._mutex:
                self._owner = 0
                if self._waiters:
                    self._changed.notify_all()

    def __enter__(self) -> Self:
        self.acquire()
        return self

    def __exit__(self, *exc: object) -> None:
        self.release()


class Wake:
    """Ends a wait of one thread; `set` is for any thread and for signal handlers.

    The `get` of a SimpleQueue would do, but it waits for ever when its time-out passes too early (CPython 3.11, 3.12).
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._lock.acquire()

    def set(self) -> None:
        """End the present wait, or the next one."""
        with contextlib.suppress(RuntimeError):  # it is set already
            self._lock.release()

    def wait(self, seconds: float = -1.0) -> None:
        """Wait until `set`, at most `seconds` (-1: no limit)."""
        self._lock.acquire(timeout=seconds)
