"""Row L6 on a host whose waits end on a tick of 15.6 ms only, as those of some systems do, in virtual time.

Replies come as late as they may: at the very deadline of whoever waits. None of them counts as missing, and who gets
none is told so by the tick after its deadline. Such a host is either woken by what comes and only its time-outs are
coarse, or it sleeps and looks: then it sees what came at its next tick, and that may be after the deadline.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from math import ceil, inf
from typing import Any

import pytest

from motorbus.bus.pace import MARGIN
from motorbus.core.operation import Data, Timeout
from motorbus.errors import NoReply
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.link.memory import MemoryLink
from tests.conftest import Figures, Rounds
from tests.faults.scenes import IDS, KINDS, Scene

TICK = 1 / 64
"""s; 15.6 ms."""
KEPT = ("read", "write", "sync read", "read together", "torque", "dump")
READS = [name for name in KINDS if name.partition(" ")[2] in KEPT]


class Exact(MemoryLink):
    """A host that is woken at the moment it wants; `expired` counts the waits in which nothing came."""

    expired = late = 0

    def _read_virtual(self, until: float) -> list[Data]:
        waits = until > self.clock.now
        arrived = super()._read_virtual(self._woken(until) if waits else until)
        if waits and arrived:
            self._seen(until)
        self.expired += waits and not arrived
        return arrived

    def _woken(self, until: float) -> float:
        return until

    def _seen(self, until: float) -> None:
        """Something has come."""


class TimeOuts(Exact):
    """A host whose time-outs end on a tick; what comes wakes it at once. `late` are those it has waited longer for."""

    def _woken(self, until: float) -> float:
        return tick(until)

    def _seen(self, until: float) -> None:
        self.late += self.clock.now > until


class Sleeps(TimeOuts):
    """A host that sleeps and looks: what comes is seen at its next tick."""

    def _seen(self, until: float) -> None:
        self.clock.now = tick(self.clock.now)
        self._happen_until(self.clock.now)
        super()._seen(until)


def tick(at: float) -> float:
    """The next one."""
    return at if at == inf else ceil(at / TICK) * TICK


class Latest(PerfectLine):
    """Each reply comes at the very deadline of whoever has waited longest; `count` are those, `shortest` the delay."""

    def __init__(self) -> None:
        self.count = 0
        self.shortest = inf
        self.flying: dict[Any, Any] = {}

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST or not self.flying:
            return super().carry(sender, data, at)
        deadline = min(flight.deadline for flight in self.flying.values())
        self.count += deadline > at
        self.shortest = min(self.shortest, deadline - at)
        return [Delivery(max(at, deadline), Side.HOST, data)]


class Deaf(PerfectLine):
    """Nothing comes back; `swallowed` counts that."""

    swallowed = 0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST:
            return super().carry(sender, data, at)
        self.swallowed += 1
        return []


def scene(family: str, host: type[Exact]) -> Scene:
    """A scene on such a host, on which everything is right as yet."""
    there = Scene(family, link=host, pace=True)
    for device in there.devices:
        assert device.ping()
    return there


def spoilt(there: Scene) -> int:
    """How often something was asked again, or counted as wrong."""
    ledgers = there.bus.statistics.nodes.values()
    return sum(one.retries + sum(one.errors.values()) for one in ledgers)


@pytest.mark.parametrize("host", [TimeOuts, Sleeps])
@pytest.mark.parametrize("name", READS)
def test_l6_a_reply_at_the_very_deadline_is_not_missed_by_coarse_timers(
    name: str, host: type[Exact], rounds: Rounds, figures: Figures
) -> None:
    kind = KINDS[name]
    there = scene(kind.family, host)
    kind.prepare(there)
    line = there.link.line = Latest()
    line.flying = there.bus.turns.flying
    calls = rounds(2_000, 20)
    for _ in range(calls):
        if "read" in name:
            there.stir()
        assert kind.done(there, there.bus.run(kind.act(there)))
        there.link.advance(0.003)
    assert line.count >= calls
    assert line.shortest >= 0.9 * MARGIN[Timeout.REPLY], "as late as that"
    false = spoilt(there)
    assert false == 0
    assert isinstance(there.link, Exact)
    assert bool(there.link.late) is (host is Sleeps), "it was asleep at the deadline"
    figures(
        f"L6 replies at their deadline, {host.__name__}: {name}",
        family=kind.family, calls=calls, late=line.count, false_time_outs=false,
    )  # fmt: skip


ASK: dict[str, Callable[[Scene], Any]] = {
    "read": Scene.asked,
    "ping": lambda there: there.said("ping"),
}


def silence(family: str, what: str, host: type[Exact], rest: float) -> tuple[float, int, int]:
    """s that this takes when nobody answers, the waits in it, and the requests."""
    there = scene(family, host)
    there.link.advance(rest)
    line = there.link.line = Deaf()
    began, link = there.link.now(), there.link
    assert isinstance(link, Exact)
    link.expired = 0
    with suppress(NoReply):
        assert there.bus.run(ASK[what](there)) is False
    assert line.swallowed
    return link.now() - began, link.expired, line.swallowed


@pytest.mark.parametrize("host", [TimeOuts, Sleeps])
@pytest.mark.parametrize("what", ASK)
@pytest.mark.parametrize("family", IDS)
def test_l6_who_gets_no_reply_is_told_by_the_tick_after_his_deadline(
    family: str, what: str, host: type[Exact], rounds: Rounds, figures: Figures
) -> None:
    """A call has several: of each try, and of the quiet between them. It loses no more than a tick at each."""
    calls, over = rounds(1_000, 25), list[float]()
    for number in range(calls):
        rest = number * 0.00137
        exact, waits, asked = silence(family, what, Exact, rest)
        took, coarse, again = silence(family, what, host, rest)
        assert again == asked
        assert coarse <= waits
        assert exact <= took + 1e-9
        assert took < exact + coarse * TICK
        over.append(took - exact)
    assert max(over) > TICK / 4, "its ticks are coarse"
    figures(
        f"L6 nobody answers, {host.__name__}: {what}",
        family=family, calls=calls, late=calls, waits=waits, longest_s=round(took, 4), most_over_s=round(max(over), 4),
    )  # fmt: skip
