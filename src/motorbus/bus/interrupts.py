"""Signals that end a program are raised at the boundary of a request, never within one.

SIGINT, SIGTERM and SIGHUP get a handler of ours at `open`, in the main thread, where Python's default handler is
installed. The first signal is raised when the request in flight has ended; a procedure that is in a guarded change is
cancelled and cleans up first. A second signal shortens that clean-up; a third one goes to the default handler.
"""

from __future__ import annotations

import signal
from threading import current_thread, get_ident, main_thread
from types import FrameType
from typing import Any, Final

SIGNALS: Final = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
DEFAULTS: Final = (signal.SIG_DFL, signal.default_int_handler)


class Interrupts:
    """Deferred signals of the main thread.

    `depth` > 0 while a bus is in use; a signal is then kept in `pending`, unless the bus is `waiting` idle, which the
    signal ends.
    """

    def __init__(self) -> None:
        self.depth = 0
        self.pending: BaseException | None = None
        self.count = 0
        self.waiting = False
        self._installed: list[int] = []
        self._opened = 0

    def install(self) -> None:
        """Take over the default handlers, until `uninstall` was called as often."""
        if current_thread() is not main_thread():
            return
        self._opened += 1
        for number in SIGNALS if self._opened == 1 else ():
            if signal.getsignal(number) in DEFAULTS:
                signal.signal(number, self._handle)
                self._installed.append(number)

    def uninstall(self) -> None:
        """Give the default handlers back when the last bus is closed."""
        if current_thread() is not main_thread() or not self._opened:
            return
        self._opened -= 1
        if self._opened == 0:
            for number in self._installed:
                if signal.getsignal(number) == self._handle:
                    signal.signal(number, _default(number))
            self._installed.clear()

    def _handle(self, number: int, frame: FrameType | None) -> None:
        self.count = self.count + 1 if self.depth else 1
        if self.count > 2:
            signal.signal(number, _default(number))
            signal.raise_signal(number)
            return
        error = KeyboardInterrupt() if number == signal.SIGINT else SystemExit(128 + number)
        if not self.depth or self.waiting:
            self.waiting = False
            raise error
        self.pending = error

    def take(self) -> BaseException | None:
        """The signal that waits to be raised."""
        pending, self.pending = self.pending, None
        return pending


def _default(number: int) -> Any:
    return signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL


INTERRUPTS: Final = Interrupts()
ELSEWHERE: Final = Interrupts()
"""For other threads, which get no signals."""
MAIN: Final = main_thread().ident


def interrupts() -> Interrupts:
    """Those of this thread."""
    return INTERRUPTS if get_ident() == MAIN else ELSEWHERE
