"""Who may move, until when, and whether somebody attends.

A program that moves motors for itself needs no lease: when it is gone it sends nothing. One that moves them for
somebody else, behind a page or on another machine, does: whoever holds the lease says from time to time that he is
still there. When he is silent the lease is lost; then what moves is stopped, and nothing moves until somebody has said
that it may. A lease has no clock: the time comes in, in s, and never goes back.

Endless motion, which only its stop ends, needs one who *attends*: he sees the machine and keeps his hand on the stop.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from math import inf, isfinite
from typing import Final

from motorbus.errors import Refused, RequestError

LASTS: Final = 0.5
"""s from one heartbeat to the loss of the lease."""


def check_lasts(lasts: object) -> None:
    """Raise RequestError for what is no time (s) that a lease can last; None is for one that does not run out."""
    number = isinstance(lasts, int | float) and not isinstance(lasts, bool) and isfinite(lasts) and lasts > 0
    if lasts is not None and not number:
        raise RequestError(
            f"a lease cannot last {lasts!r} s", expected="a finite number above 0", advice="nothing was sent"
        )


class Standing(Enum):
    """How a lease stands."""

    FREE = "nobody holds it"
    HELD = "somebody holds it, and is there"
    LOST = "who held it fell silent; nothing moves until it is reset"


class Lease:
    """The right to move, which one holder has at a time. It `lasts` so long (s) after each heartbeat.

    With None it does not run out: that is for a holder who is this very program, for when that is gone it sends
    nothing. One that is `needed` lets nothing move while nobody holds it. `losses` counts how often it was lost. The
    `watchers` are called when its holder said something else than that he is there, and when it was reset.
    """

    def __init__(self, lasts: float | None = LASTS, *, needed: bool = True) -> None:
        check_lasts(lasts)
        self.lasts: Final = lasts
        self.needed: Final = needed
        self.holder = ""
        self.losses = 0
        self.watchers: Final[list[Callable[[], None]]] = []
        self._attended = False
        self._until = 0.0
        self._now = 0.0
        self._lost = ""

    # -- how it stands -------------------------------------------------------------------------------------------------

    def standing(self, now: float) -> Standing:
        """How it stands at this moment. A lease that has run out is lost from now on, whatever comes later."""
        self._now = max(self._now, now)
        if self.holder and self._now > self._until:
            self._lost, self.holder, self._attended = self.holder, "", False
            self.losses += 1
        if self._lost:
            return Standing.LOST
        return Standing.HELD if self.holder else Standing.FREE

    @property
    def until(self) -> float:
        """The moment (s) at which it runs out unless its holder says that he is there; infinite while nobody has it."""
        return self._until if self.holder else inf

    def loss(self, now: float) -> Refused | None:
        """The error for whom it was lost under, None while it is not lost. Something may have moved by then."""
        if self.standing(now) is not Standing.LOST:
            return None
        error = self._is_lost()
        error.unmoved = False
        error.advice = (
            "see that the machine is clear, reset the lease, and take it again; what moved was told to stop"
        )
        return error

    def lets_move(self, now: float) -> bool:
        """Whether `check` has nothing against it."""
        standing = self.standing(now)
        return standing is Standing.HELD or (standing is Standing.FREE and not self.needed)

    def is_attended(self, now: float) -> bool:
        """Whether it is held, and its holder attends."""
        return self.standing(now) is Standing.HELD and self._attended

    def check(self, now: float) -> None:
        """Raise Refused when it is lost, or is needed and nobody holds it: nothing may move then but to a stop."""
        standing = self.standing(now)
        if standing is Standing.LOST:
            raise self._is_lost()
        if standing is Standing.FREE and self.needed:
            raise Refused(
                "nobody holds the lease of this machine, so nothing may move",
                reason="lease",
                advice="take it first; nothing was sent",
            )

    # -- what its holder does ------------------------------------------------------------------------------------------

    def take(self, holder: str, now: float, *, attended: bool = False) -> None:
        """`holder` has it from now on, and again if it has it already. Raises Refused for another's, or a lost one."""
        if not holder:
            raise RequestError("a lease needs the name of its holder", advice="say who takes it")
        standing = self.standing(now)
        if standing is Standing.LOST:
            raise self._is_lost()
        if standing is Standing.HELD and self.holder != holder:
            raise Refused(
                f"{self.holder} holds the lease of this machine",
                reason="lease",
                expected=f"a lease that is free; this one is held {self._for}",
                advice="ask for it to be released; nothing was sent",
            )
        self.holder, self._attended = holder, attended
        self._prolong()
        self._tell()

    def beat(self, holder: str, now: float) -> None:
        """The holder is still there. Raises Refused when it is not, or no longer, the holder."""
        if self.standing(now) is Standing.LOST:
            raise self._is_lost()
        self._check_holder(holder)
        self._prolong()

    def attend(self, holder: str, now: float, attended: bool = True) -> None:
        """The holder attends from now on, or no longer. Raises as `beat`; it counts as one."""
        self.beat(holder, now)
        self._attended = attended
        self._tell()

    def release(self, holder: str, now: float) -> None:
        """The holder gives it back; nothing is lost by that. Raises as `beat`."""
        if self.standing(now) is Standing.LOST:
            raise self._is_lost()
        self._check_holder(holder)
        self.holder, self._attended = "", False
        self._tell()

    def reset(self, now: float) -> None:
        """Somebody says that a machine whose lease was lost may move again. The lease is free then."""
        self.standing(now)
        self._lost = ""
        self._tell()

    def _tell(self) -> None:
        for watcher in tuple(self.watchers):
            watcher()

    def _prolong(self) -> None:
        self._until = inf if self.lasts is None else self._now + self.lasts

    @property
    def _for(self) -> str:
        left = self._until - self._now
        return f"for {left:.2g} s at least" if isfinite(left) else "until its holder gives it back"

    def _check_holder(self, holder: str) -> None:
        if holder != self.holder or not holder:
            whose = f"{self.holder} holds it" if self.holder else "nobody holds it"
            raise Refused(
                f"{holder} does not hold the lease of this machine: {whose}",
                reason="lease",
                advice="take it first; nothing was sent",
            )

    def _is_lost(self) -> Refused:
        return Refused(
            f"the lease of this machine was lost: {self._lost} was silent for more than {self.lasts or 0.0:g} s",
            reason="lease",
            cause="its program ended or hung, or the connection to it is broken",
            advice="see that the machine is clear, reset the lease, and take it again; nothing was sent",
        )
