"""One bus of several that work at the same time, and how time passes for all of them.

Every bus keeps its own turns; here is what those who wait for several share, blocking or async. Where time is
virtual, nothing happens unless somebody waits, so all clocks go from one event to the next together, and whoever acts,
acts at the time that all the others show. Beside a real clock the virtual ones follow it (decision record 0026).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import inf
from typing import Any, Generic, TypeVar

from motorbus.bus.absence import back
from motorbus.bus.crank import IDLE, push, reach
from motorbus.bus.face import BusFace
from motorbus.bus.interruption import foremost
from motorbus.bus.run import Run
from motorbus.core.operation import Runnable
from motorbus.errors import MotorbusError

B = TypeVar("B", bound=BusFace)


class Part(Generic[B]):
    """One bus of a concert and the run there; `origin` is what its clock shows when the clock of all shows 0."""

    def __init__(self, bus: B, wanted: Runnable[Any], origin: float, wake: Callable[[], None]) -> None:
        self.bus = bus
        self.link = bus.link
        self.turns = bus.turns
        self.origin = origin
        self.run: Run[Any] = Run(bus.turns, wanted, now=bus.link.now, report=bus.listener(None), wake=wake)
        self.events = getattr(bus.link, "due", None)
        self.due = 0.0

    @property
    def going(self) -> bool:
        """Its operation has not ended."""
        return not self.run.root.finished

    @property
    def time(self) -> float:
        """s on the clock of all."""
        return self.link.now() - self.origin

    def next(self) -> float:
        """When something happens here next, as far as anybody can know; s on the link's clock, at most `IDLE` away."""
        with self.turns.lock:
            moment = min(self.turns.due(), self.run.deadline)
        if self.events is not None:
            moment = min(moment, self.events())
        now = self.link.now()
        return min(max(moment, now), now + IDLE)

    def push(self) -> bool:
        """Send what may go; True when somebody can go on at once."""
        settled = self.turns.settled
        if self.turns.gone is None or back(self.turns):
            push(self.link, self.turns)
        return self.turns.settled != settled

    def reach(self, until: float) -> bool | None:
        """Let time pass until then, or until something comes; False when the link is lost, None when others pump."""
        return reach(self.link, self.turns, until)


def advance(parts: Iterable[Part[Any]]) -> bool:
    """Step everything that can go on; False when all have ended. Raises what is no error of ours, once."""
    going = False
    for part in parts:
        if not part.going:
            continue
        if not part.run.advance():
            going = True
        elif part.run.interruption is None and not isinstance(part.run.root.error, MotorbusError | None):
            raise part.run.root.error
    return going


def results(parts: Mapping[str, Part[Any]]) -> dict[str, Any]:
    """What each returned, or its MotorbusError; raises the interruption, or what else went wrong, if there was any."""
    told: dict[str, Any] = {}
    cut: BaseException | None = None
    for name, part in parts.items():
        try:
            told[name] = part.run.result()
        except MotorbusError as error:
            told[name] = error
        except BaseException as error:  # each part notes there what its cleaning up failed with
            cut = error if cut is None else foremost(cut, error)
    if cut is not None:
        raise cut
    return told


def clock_of(parts: Sequence[Part[Any]]) -> Part[Any] | None:
    """Who sets the pace: a part whose time is real; None when all are virtual."""
    return next((part for part in parts if not part.link.virtual), None)


def step(parts: Sequence[Part[Any]]) -> bool:
    """All clocks are virtual: they go to the next moment at which something happens on any bus, and no further.

    False when somebody else is at work on one of the buses, and time passes by that.
    """
    going = [part for part in parts if part.going]
    if sum([part.push() for part in going]):
        return True
    first = min(going, key=_next)
    free = first.reach(first.next()) is not None
    moment = first.time
    for part in parts:
        until = moment + part.origin
        if part.link.now() < until and part.reach(until) is None and part.going:
            free = False
    return free


def _next(part: Part[Any]) -> float:
    return part.next() - part.origin


def follow(part: Part[Any], clock: Part[Any]) -> float:
    """A virtual clock goes where the real one is, or to what comes first; in how many s something happens there."""
    settled = part.turns.settled
    if part.going:
        part.push()
    until = clock.time + part.origin
    reached = not part.reach(until) or part.link.now() >= until
    if part.turns.settled != settled or not reached:
        return 0.0
    if not part.going:
        return inf
    # an exchange that nobody wants any more may have ended, and made way for the next one
    return 0.0 if part.push() else part.next() - part.link.now()
