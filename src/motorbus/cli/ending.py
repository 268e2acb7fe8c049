"""When work without an end of its own shall end: Enter or Ctrl-C asks for it, and what was done so far is kept."""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


class _Ending:
    """Asked again and again: has somebody said that it shall end?"""

    def __init__(self) -> None:
        self.asked = False
        self._keyboard = os.name != "nt" and sys.stdin is not None and sys.stdin.isatty()

    def __call__(self) -> bool:
        if self._keyboard and not self.asked and select.select([sys.stdin], [], [], 0)[0]:
            sys.stdin.readline()
            self.asked = True
        return self.asked


@contextmanager
def asked_to_end() -> Iterator[Callable[[], bool]]:
    """Within it Ctrl-C only asks, once; the second one interrupts as ever. Gives what says whether it was asked."""
    ending = _Ending()
    if threading.current_thread() is not threading.main_thread():
        yield ending  # Python lets only the main thread have handlers
        return
    before = signal.getsignal(signal.SIGINT)

    def ask(number: int, frame: object) -> None:
        ending.asked = True
        signal.signal(signal.SIGINT, before)

    signal.signal(signal.SIGINT, ask)
    try:
        yield ending
    finally:
        signal.signal(signal.SIGINT, before)
