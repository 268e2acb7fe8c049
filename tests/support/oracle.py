"""The judge of whatever a bus says: a value, a success, or one of four ways to fail.

A value is right only if the device held it at some instant of the call. A success means that it was applied within the
call. A failure says one of four things, and each is held against what became of it, then and ever after:

    NOT_SENT   nothing of it reached the device
    REJECTED   the device has read it and said no; nothing was applied
    UNREAD     something had to be read, and could not be; nothing of what was to be written was sent
    UNKNOWN    it was sent, and may have been applied, or may yet be
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import Enum
from math import inf
from typing import Final

from motorbus.errors import (
    DeviceError,
    LinkError,
    MotionError,
    MotorbusError,
    NoReply,
    OutcomeUnknown,
    PortBusy,
    PortNotFound,
    Refused,
    RequestError,
    VerificationFailed,
    WireError,
)
from motorbus.link.memory import MemoryLink
from tests.support.history import History, Raw

INSTANT: Final = 1e-6
"""s that pass before a call begins, so that what was just before it is not in its window."""


class Outcome(Enum):
    """What a failure says of what was asked for."""

    NOT_SENT = "not sent"
    REJECTED = "rejected by device"
    UNREAD = "not read"
    UNKNOWN = "outcome unknown"


SAYS: Final[tuple[tuple[type[MotorbusError], Outcome], ...]] = (
    (RequestError, Outcome.NOT_SENT),
    (Refused, Outcome.NOT_SENT),
    (PortNotFound, Outcome.NOT_SENT),
    (PortBusy, Outcome.NOT_SENT),
    (DeviceError, Outcome.REJECTED),
    (NoReply, Outcome.UNREAD),
    (WireError, Outcome.UNREAD),
    (OutcomeUnknown, Outcome.UNKNOWN),
    (VerificationFailed, Outcome.UNKNOWN),  # it was taken, and is not what is there
    (LinkError, Outcome.UNKNOWN),  # a port that goes away may have passed it on
    (MotionError, Outcome.UNKNOWN),  # ordered, and ended early
)
"""The first that fits counts."""


def outcome(error: MotorbusError) -> Outcome:
    """What this failure says. AssertionError when it says none of the four."""
    for kind, says in SAYS:
        if isinstance(error, kind):
            return says
    raise AssertionError(f"{type(error).__name__} does not say what became of what was asked for")


class FalseWord(AssertionError):
    """A value or a success was false."""


class Window:
    """One call: from when to when (s), and the error that it ended with, None when it succeeded."""

    def __init__(self, since: float) -> None:
        self.since = since
        self.until = inf
        self.error: MotorbusError | None = None

    @property
    def says(self) -> Outcome | None:
        """What its failure says; None when it succeeded."""
        return None if self.error is None else outcome(self.error)


class Oracle:
    """Judges the calls of one bus. `judged` counts the values and successes that were held against the truth.

    `ahead` is how much more time has passed for the devices than for the host (s). `failed` counts failures by what
    they said, `longest` is the longest call (s).
    """

    def __init__(self, link: MemoryLink, history: History, ahead: Callable[[], float] = lambda: 0.0) -> None:
        self.link = link
        self.history = history
        self.ahead = ahead
        self.judged = 0
        self.failed = dict.fromkeys(Outcome, 0)
        self.longest = 0.0
        self._never: dict[tuple[int, str], set[Raw]] = {}
        self._followed: dict[tuple[int, str], float] = {}

    def clock(self) -> float:
        """What the time is for the devices (s)."""
        return self.link.now() + self.ahead()

    @contextmanager
    def call(self, at_most: float = inf) -> Iterator[Window]:
        """What is called inside is judged by the window this gives. What takes more than `at_most` s hangs.

        An error of motorbus is kept in the window; any other is the test's to see.
        """
        self._pass()
        self._pass()
        window, began = Window(self.clock()), self.link.now()
        try:
            yield window
        except MotorbusError as error:
            window.error = error
            self.failed[outcome(error)] += 1
        window.until = self.clock()
        self.history.look(window.until)
        took = self.link.now() - began
        self.longest = max(self.longest, took)
        if took > at_most:
            raise FalseWord(f"it took {took:.3f} s, and at most {at_most:.3f} s were due") from window.error

    def told(self, window: Window, node: int, name: str, raw: Raw) -> None:
        """Judge a value that a call has brought."""
        held = self.history.held(node, name, window.since, window.until)
        self.judged += 1
        if raw not in held:
            raise FalseWord(
                f"node {node}: {name} was told to be {raw!r}; from {window.since:.6f} to {window.until:.6f} s it was "
                f"{sorted(held, key=str)}"
            )

    def wrote(self, window: Window, node: int, name: str, raw: Raw) -> None:
        """Judge a call that was to write this value, one that the row did not have before."""
        never = self._never.setdefault((node, name), set())
        self.follow(node, name, but=raw)
        if window.says is None:
            self.judged += 1
            self._applied(window, node, name, raw)
        elif window.says is not Outcome.UNKNOWN:
            self._unapplied(window, node, name, raw)
            never.add(raw)
            return
        never.discard(raw)

    def follow(self, node: int, name: str, but: Raw | None = None) -> None:
        """Nothing that was said not to have been written has been since; `but` is being written just now."""
        key, now = (node, name), self.clock()
        never = self._never.get(key, set()) - {but}
        since, self._followed[key] = self._followed.get(key, now), now
        if never and (found := never & set(self.history.applied(node, name, since, now))):
            raise FalseWord(f"node {node}: {name} = {found} was said not to be written, and was")

    def forget(self, node: int, name: str) -> None:
        """Something else may write this row too: what was said not to have been written counts no more."""
        self._never.pop((node, name), None)

    def _applied(self, window: Window, node: int, name: str, raw: Raw) -> None:
        held = self.history.held(node, name, window.since, window.until)
        if raw not in held:
            raise FalseWord(
                f"node {node}: writing {name} = {raw!r} succeeded, and it was {sorted(held, key=str)}"
            )

    def _unapplied(self, window: Window, node: int, name: str, raw: Raw) -> None:
        if raw in self.history.applied(node, name, window.since, window.until):
            assert window.says is not None
            raise FalseWord(
                f"node {node}: writing {name} = {raw!r} failed, by its error {window.says.value}, and was applied"
            ) from window.error

    def _pass(self) -> None:
        self.history.look(self.clock())
        self.link.advance(INSTANT)
