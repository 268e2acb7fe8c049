"""Being told to end, and losing the terminal, leave a machine as Ctrl-C does: by its exit policy.

Without a handler SIGTERM and SIGHUP end a process at once, and no `with` gets to its end: arms go on holding, or do
what they were told last. So while a robot is in its `with`, in the main thread, they raise SystemExit there, with the
code that a shell shows for the signal. A second one shortens the waiting, as a second Ctrl-C does. A handler that the
program has set, `SIG_IGN` included, is never replaced; whoever has one of his own closes the robot from there.
"""

from __future__ import annotations

import asyncio
import signal
import threading
from collections.abc import Callable
from types import FrameType
from typing import Final

NAMES: Final = ("SIGTERM", "SIGHUP", "SIGBREAK")
"""Told to end, the terminal or the console is closed (SIGBREAK is how Windows tells it)."""
SIGNALLED: Final = 128
"""What a shell adds to the number of the signal that has ended a process."""

Heard = Callable[[int], None]


class Signals:
    """The signals that end a process, as long as they are `taken`, each told to `heard` by its number."""

    def __init__(self, heard: Heard) -> None:
        self._heard = heard
        self._taken: list[int] = []

    def take(self) -> None:
        """Take those that nobody else has; none outside the main thread, for Python allows no other to do so."""
        if threading.current_thread() is not threading.main_thread():
            return
        for name in NAMES:
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, self._told)
                self._taken.append(number)

    def give_back(self) -> None:
        """Let them do again what they did before; one for which the program has set a handler since stays with that."""
        while self._taken:
            number = self._taken.pop()
            if signal.getsignal(number) == self._told:
                signal.signal(number, signal.SIG_DFL)

    def _told(self, number: int, frame: FrameType | None) -> None:
        self._heard(number)


def ended(number: int) -> None:
    """Raise SystemExit for this signal, here and now."""
    raise SystemExit(SIGNALLED + number)


class Cancelling:
    """On an event loop the task that is in the `async with` is cancelled; SystemExit is raised when that is left."""

    def __init__(self) -> None:
        self._task = asyncio.current_task()
        self._loop = asyncio.get_running_loop()
        self.number = 0

    def __call__(self, number: int) -> None:
        """A signal came: tell the task, which may wait; another one shortens what it does before it ends."""
        self.number = self.number or number
        if self._task is not None:
            self._loop.call_soon_threadsafe(self._task.cancel)

    def check(self) -> None:
        """Raise SystemExit where a signal has come."""
        if self.number:
            ended(self.number)
