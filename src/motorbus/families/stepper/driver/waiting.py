"""What a run comes to: the judge of its acknowledgement, of its notices, of stops and of time.

A notice is two bytes without a checksum or a name. It counts as the end of this run when it came after the
acknowledgement, not sooner than a project of these numbers can be through in any reading, and when nobody had said stop
since: a stop that was not acknowledged may have been heard, and its own notice may come late. Nothing else is ever
`completed`. What this cannot tell apart is said in `running.run`.
"""

from __future__ import annotations

from enum import Enum
from math import inf, isinf
from typing import Final, NamedTuple

from motorbus.core.request import Notification
from motorbus.errors import MotorbusError
from motorbus.families.stepper import wire
from motorbus.families.stepper.driver.memory import Memory
from motorbus.families.stepper.program import Estimate, Plan
from motorbus.families.stepper.program.earliest import earliest
from motorbus.families.stepper.table import RATE

LONGER: Final = 1.2
"""How much longer than its slowest reading a project may take, an assumption."""
SPARE: Final = 2.0
"""s that it may take besides, an assumption."""
CLOCK: Final = 0.98
"""How much less a controller's clock may show than the host's until a notice is called too early, an assumption."""
SETTLES: Final = 20 / RATE
"""s, two bytes: the bus takes a reply that came in pieces in so much later, and a notice may be close behind it."""


class Outcome(Enum):
    """What is known of a run when the wait for it is over."""

    COMPLETED = "completed"
    STOPPED = "stopped"
    TIMEOUT = "timeout"
    UNKNOWN = "unknown"


class Ran(NamedTuple):
    """What came of a run.

    `seconds` from its acknowledgement to its notice, or from its sending where that was lost; None unless completed.
    `predicted` is what was expected; `why` says on what the outcome rests, in a sentence.
    """

    outcome: Outcome
    seconds: float | None
    predicted: Estimate
    why: str


class Wait:
    """One run, from its sending on: told what happens, in any order, it says what came of it.

    `ran` is None until that is known. `timeout` (s) is what the caller gave, None for the usual deadline. All moments
    are on the link's clock (s).
    """

    def __init__(self, memory: Memory, plan: Plan, asked: float, timeout: float | None = None) -> None:
        self.plan = plan
        self.asked = asked
        self.pending = True
        self.acknowledged: float | None = None
        self.ran: Ran | None = None
        self._memory = memory
        self._stops = memory.stops
        self._wanted = memory.wanted
        self._timeout = timeout
        self._least = earliest(plan.project) * CLOCK
        self._lost: MotorbusError | None = None
        self._button = False
        self._notices: list[tuple[float, bool]] = []

    # -- what happens -----------------------------------------------------------------------------------------------

    def begun(self, at: float) -> None:
        """The start was acknowledged at this moment."""
        self.acknowledged, self.pending = at, False

    def unacknowledged(self, error: MotorbusError) -> None:
        """Its acknowledgement did not come, or not as it should: it may have been heard all the same."""
        self._lost, self.pending = error, False

    def button(self) -> None:
        """Input 4, which stops projects, has become active."""
        self._button = True

    def heard(self, notice: Notification) -> bool:
        """A notice; True when whoever listens should look. One that two listeners hear counts as one."""
        if notice.kind == wire.COMPLETED:
            doubtful = self._memory.stopping > 0 or self._memory.wanted > self._wanted
            self._notices.append((notice.at, doubtful))
            self.look(notice.at)
        return self.pending or self.ran is not None

    # -- what is made of it -----------------------------------------------------------------------------------------

    @property
    def start(self) -> float:
        """When it began, as well as that is known."""
        return self.asked if self.acknowledged is None else self.acknowledged

    @property
    def deadline(self) -> float:
        """Until when its notice is waited for.

        The caller's time; else 1.2 times the slowest reading and 2 s. A wait for an input has no such time, but one for
        a project of which nobody knows whether it began has.
        """
        if self._timeout is not None:
            return self.start + self._timeout
        predicted = self.plan.estimate
        waits = bool(predicted.waits) and self._lost is None
        return inf if waits else self.start + predicted.high * LONGER + SPARE

    def look(self, now: float) -> None:
        """Say what came of it, if that can be said by now."""
        if self.ran is None and not self.pending and not self._memory.stopping:
            self.ran = self._ended() or (self._overdue() if now >= self.deadline else None)

    def _ended(self) -> Ran | None:
        if self._memory.stops > self._stops:
            return self._said(Outcome.STOPPED, "a stop by this host was accepted while it was waited for")
        if self._button:
            return self._said(Outcome.STOPPED, "input 4, which stops projects, was read active")
        counting = [(at, doubtful) for at, doubtful in self._notices if self._may_end(at)]
        if not counting:
            return None
        self._memory.owed = False
        at, doubtful = counting[0]
        if doubtful:
            return self._said(
                Outcome.UNKNOWN, "its notice came when a stop had been said that was not acknowledged"
            )
        since = "its acknowledgement" if self._lost is None else "it was sent; its acknowledgement was lost"
        return self._said(
            Outcome.COMPLETED, f"its notice came {max(0.0, at - self.start):.3f} s after {since}", at
        )

    def _may_end(self, at: float) -> bool:
        """Whether a notice of this moment can be the end of this run.

        Reckoned from its sending: how long a controller thinks before it acknowledges is not known.
        """
        return at > self.start - SETTLES and at - self.asked >= self._least

    def _overdue(self) -> Ran:
        waited = f"within {self.deadline - self.start:.1f} s"
        if self._lost is not None:
            why = f"the start was not acknowledged and no notice came {waited}: it may run or not"
            return self._said(Outcome.UNKNOWN, f"{why} ({self._lost.args[0]})")
        if self._notices:
            return self._said(
                Outcome.UNKNOWN, f"{self._too_early()}, and no other came {waited}; it may still run"
            )
        return self._said(Outcome.TIMEOUT, f"no notice came {waited}; it may still run")

    def _too_early(self) -> str:
        if isinf(self._least):
            return "a notice came, and this project never ends by itself"
        first = self._notices[0][0] - self.asked
        return f"a notice came {first:.3f} s after the start, and it cannot end before {self._least:.3f} s"

    def _said(self, outcome: Outcome, why: str, ended: float | None = None) -> Ran:
        seconds = None if ended is None else max(0.0, ended - self.start)
        return Ran(outcome, seconds, self.plan.estimate, why)
