"""Being told to end, and losing the terminal, leave a machine as Ctrl-C does: by its exit policy.

Without a handler SIGTERM and SIGHUP end a process at once, and no `with` gets to its end: arms go on holding, or do
what they were told last. So while a robot is in its `with`, in the main thread, they raise SystemExit there, with the
code that a shell shows for the signal. A second one shortens the waiting, as a second Ctrl-C does. A handler that the
program has set, `SIG_IGN` included, is never replaced; whoever has one of his own closes the robot from there.

Python runs a handler between any two steps of the program: also when the end of the `with` has been called and has not
got to its first `try` yet. What is raised there skips all of it, and nobody is stopped. So a handler looks where it
was called: from the end of a robot it raises nothing, but keeps the interruption for it. Python's own handler, which
raises KeyboardInterrupt wherever it is, does not look; a blocking robot stands in for it meanwhile, and raises the
same. (An event loop that is run inside its `with` then leaves Ctrl-C to it, too: it interrupts instead of cancelling.)
"""

from __future__ import annotations

import asyncio
import signal
import threading
from collections.abc import Callable
from types import CodeType, FrameType
from typing import Any, Final, TypeVar

NAMES: Final = ("SIGTERM", "SIGHUP", "SIGBREAK")
"""Told to end, the terminal or the console is closed (SIGBREAK is how Windows tells it)."""
SIGNALLED: Final = 128
"""What a shell adds to the number of the signal that has ended a process."""

Heard = Callable[[BaseException, FrameType | None], None]
Function = TypeVar("Function", bound=Callable[..., Any])


class Signals:
    """The signals that end a process, as long as they are `taken`, each told to `heard`: what it raises, and where.

    With `python` also those, Ctrl-C among them, which have the handler of Python that raises KeyboardInterrupt.
    """

    def __init__(self, heard: Heard, *, python: bool = False) -> None:
        self._heard = heard
        self._python = python
        self._taken: dict[int, Any] = {}
        self._over = False

    def take(self) -> None:
        """Take those that nobody else has; none outside the main thread, for Python allows no other to do so."""
        if threading.current_thread() is not threading.main_thread():
            return
        for name in (*NAMES, "SIGINT"):
            number = getattr(signal, name, None)
            if number is not None and self._free(name, before := signal.getsignal(number)):
                self._taken[number] = before
                signal.signal(number, self._told)

    def give_back(self) -> None:
        """Let them do again what they did before; one for which the program has set a handler since stays with that.

        Outside the main thread, where Python allows no other handler, theirs stay and only hand on what comes.
        """
        if threading.current_thread() is not threading.main_thread():
            self._over = True
            return
        for number, before in self._taken.items():
            if signal.getsignal(number) == self._told:
                signal.signal(number, before)

    def _free(self, name: str, handler: object) -> bool:
        """A program that lets Ctrl-C end it at once has said so: that is not how Python begins."""
        if handler is signal.default_int_handler:
            return self._python
        return handler is signal.SIG_DFL and name in NAMES

    def _told(self, number: int, frame: FrameType | None) -> None:
        if self._over:
            signal.signal(number, self._taken[number])
            signal.raise_signal(number)
            return
        python = self._taken[number] is signal.default_int_handler
        self._heard(KeyboardInterrupt() if python else SystemExit(SIGNALLED + number), frame)


# -- where the program may be interrupted ------------------------------------------------------------------------------

_CUT: Final[dict[CodeType, bool]] = {}
"""Whether what is marked may be cut off."""


class Kept:
    """The interruptions that fell where a robot must not be cut off, until they may be raised."""

    def __init__(self) -> None:
        self._errors: list[BaseException] = []
        self._over = False

    def keep(self, error: BaseException) -> None:
        """It is raised later; at once when nothing is left to be cut off."""
        if self._over:
            raise error
        self._errors.append(error)

    def release(self) -> None:
        """Raise what has come, if anything: the first of them stands for all."""
        if self._errors:
            first = self._errors[0]
            self._errors.clear()
            raise first

    def end(self, first: BaseException | None) -> None:
        """From now on none is kept. Raise the first that has come: this one, where there is one, was before them."""
        self._over = True
        if first is not None:
            raise first
        self.release()


def uncut(method: Function) -> Function:
    """Marks a method that is not cut off, nor is what it calls: the `_kept` of its object gets the interruptions."""
    _CUT[method.__code__] = False
    return method


def cut(method: Function) -> Function:
    """Marks what may be cut off though it is called from there: its caller catches what is raised in it."""
    _CUT[method.__code__] = True
    return method


def interrupted(error: BaseException, frame: FrameType | None) -> None:
    """Raise it, here and now, or keep it for whoever must not be cut off where the program is."""
    while frame is not None and frame.f_code not in _CUT:
        frame = frame.f_back
    if frame is None or _CUT[frame.f_code]:
        raise error
    frame.f_locals["self"]._kept.keep(error)


# -- on an event loop --------------------------------------------------------------------------------------------------


class Cancelling:
    """On an event loop the task that is in the `async with` is cancelled; SystemExit is raised when that is left."""

    def __init__(self) -> None:
        self._task = asyncio.current_task()
        self._loop = asyncio.get_running_loop()
        self.error: BaseException | None = None

    def __call__(self, error: BaseException, frame: FrameType | None) -> None:
        """A signal came: tell the task, which may wait; another one shortens what it does before it ends."""
        self.error = self.error or error
        if self._task is not None:
            self._loop.call_soon_threadsafe(self._task.cancel)

    def check(self) -> None:
        """Raise SystemExit where a signal has come."""
        if self.error is not None:
            raise self.error
