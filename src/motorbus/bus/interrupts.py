"""Signals that end a program are raised at the boundary of a request, never within one.

SIGINT, SIGTERM and SIGHUP get a handler of ours when a bus is opened in the main thread, where Python's default
handler is installed. The first signal is raised when a single request has ended; a procedure is cancelled, its guards
are left, then the signal is raised. A second signal shortens that clean-up. Later ones are raised at once, wherever the
program is, unless the first came only just now; SIGTERM and SIGHUP go to the default handler then.
"""

from __future__ import annotations

import signal
from threading import current_thread, get_ident, main_thread
from time import monotonic
from types import FrameType
from typing import Any, Final

SIGNALS: Final = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name)
)
DEFERRED: Final = 0.25
"""s for which any number of signals is deferred."""
DEFAULTS: Final = (signal.SIG_DFL, signal.default_int_handler)


class Interrupts:
    """Deferred signals of the main thread.

    `depth` > 0 while a bus is in use; a signal is then kept in `pending`, unless all buses are idle: while `waiting` is
    True the handler raises it. As a context manager it defers the signals of a block. `count` is the number of signals
    that have come one after the other. `cleanups` is the number of `with` blocks that stop motors at their end: once a
    signal has been raised in one of them, the next is kept for that end.
    """

    def __init__(self) -> None:
        self.depth = 0
        self.pending: BaseException | None = None
        self.count = 0
        self.waiting = False
        self.cleanups = 0
        self._replaced: dict[int, Any] = {}
        self._opened = 0
        self._first_at = 0.0

    def install(self) -> bool:
        """Take over the default handlers, until `uninstall` was called as often; False outside the main thread."""
        if current_thread() is not main_thread():
            return False
        self._opened += 1
        for number in SIGNALS:
            if (handler := signal.getsignal(number)) in DEFAULTS:
                self._replaced[number] = handler
                signal.signal(number, self._handle)
        return True

    def uninstall(self) -> None:
        """Give the default handlers back when the last bus is closed; from another thread with the next signal."""
        self._opened -= 1
        if self._opened == 0 and current_thread() is main_thread():
            self._restore()

    def _restore(self) -> None:
        for number, handler in self._replaced.items():
            if signal.getsignal(number) == self._handle:
                signal.signal(number, handler)
        self._replaced.clear()

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if not self._opened and not self.depth and not self.cleanups:  # closed in another thread
            self._restore()
            signal.raise_signal(number)
            return
        self.count = self.count + 1 if self.depth or self.cleanups else 1
        if self.count == 1:
            self._first_at = monotonic()
        enough = self.count > 2 and monotonic() > self._first_at + DEFERRED
        default = self._replaced.get(number, signal.default_int_handler)
        is_python = default is signal.default_int_handler
        if enough and not is_python:
            signal.signal(number, default)
            signal.raise_signal(number)
        error = KeyboardInterrupt() if is_python else SystemExit(128 + number)
        if self.waiting or enough or (not self.depth and self.count == 1):
            self.waiting = False
            raise error
        self.pending = error

    def raise_pending(self) -> None:
        """Raise the signal that waits, if there is one."""
        if self.pending is None:
            return
        error, self.pending = self.pending, None
        if not self.depth:
            self.count = 1 if self.cleanups else 0
        raise error

    def __enter__(self) -> Interrupts:
        self.depth += 1
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        self.depth -= 1
        if not self.depth:
            self.raise_pending()
            if kind is None:
                self.count = 0


INTERRUPTS: Final = Interrupts()
ELSEWHERE: Final = Interrupts()
"""For other threads, which get no signals."""
MAIN: Final = main_thread().ident


def interrupts() -> Interrupts:
    """Those of this thread."""
    return INTERRUPTS if get_ident() == MAIN else ELSEWHERE
