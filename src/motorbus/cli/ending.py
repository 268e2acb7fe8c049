"""When work without an end of its own shall end: Enter or Ctrl-C asks for it, and what was done so far is kept."""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

END: Final = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""The signals by which a program is told to end."""


class _Ending:
    """Asked again and again: has somebody said that it shall end? `told` when it was a signal to the program."""

    def __init__(self) -> None:
        self.asked = False
        self.told = False
        self._keyboard = os.name != "nt" and sys.stdin is not None and sys.stdin.isatty()

    def __call__(self) -> bool:
        if self._keyboard and not self.asked and select.select([sys.stdin], [], [], 0)[0]:
            sys.stdin.readline()
            self.asked = True
        return self.asked


@contextmanager
def asked_to_end(*, also: Sequence[signal.Signals] = ()) -> Iterator[_Ending]:
    """Within it Ctrl-C only asks, once; the second one interrupts as ever. Gives what says whether it was asked.

    So do the signals in `also`, as those in `END`; whoever says so has to raise KeyboardInterrupt for them in the end.
    """
    ending = _Ending()
    if threading.current_thread() is not threading.main_thread():
        yield ending  # Python lets only the main thread have handlers
        return
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, *also)}

    def ask(number: int, frame: object) -> None:
        ending.asked = True
        ending.told = ending.told or number != signal.SIGINT
        restore()

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    for number in before:
        signal.signal(number, ask)
    try:
        yield ending
    finally:
        restore()
