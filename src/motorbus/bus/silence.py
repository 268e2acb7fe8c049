"""A node that stays silent and is asked again: the straight way of its probe.

Whoever polls what is not there does little else, and what runs once after some milliseconds of waiting runs cold: it
costs by how many places it touches. So where one question waits, to one doubtful node, and nothing else is under way,
its probe leaves at once; and where nothing at all has come by its deadline, that is settled at once. Whatever is
otherwise goes the usual way from wherever it is. A test proves that both give the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import TYPE_CHECKING, Any

from motorbus.bus.ticket import Flight, Retune
from motorbus.core.operation import Rank, Timeout

if TYPE_CHECKING:
    from motorbus.bus.turns import Turns
    from motorbus.link.base import Link


class Silence:
    """What the turns of a bus know of a probe that is all there is to do. The caller holds the lock."""

    _queues: Sequence[Sequence[Flight | Retune]]

    def sole_probe(self: Any, link: Link) -> Flight | None:
        """The probe that must leave now; nothing else waits, flies or is to be looked at."""
        turns: Turns = self
        wanted = self._sole()
        if wanted is None or turns.chores or turns.gone is not None or turns.leaving or turns.stopping:
            return None
        if (
            turns.listening
            or turns.trace.subscriptions
            or turns.window > 1
            or turns.family.link.kind != "bytes"
        ):
            return None
        exchange, now = wanted.exchange, link.now()
        if len(exchange.replies) != 1 or exchange.rank is Rank.STOP or exchange.timeout is Timeout.SCAN:
            return None
        node = exchange.replies[0].node
        trust = turns.trust.nodes.get(node)
        if trust is None or not trust.tainted or now < trust.quiet_until:
            return None
        if not turns.echo.is_out or turns.receiver.held or (now < turns.free_at and turns.takes_time):
            return None
        stale = link.read(now)  # what has already arrived cannot answer a request that has not left
        if stale:
            turns.feed(stale, now)
            return None
        self._look_at = inf
        probe = Flight(turns.trust.probe(node, now), wanted.owner, parent=wanted)
        self._launch(probe, now)
        return probe

    def _sole(self: Any) -> Flight | None:
        if self.flying or self._timers or self._claims or self.latched:
            return None
        wanted = None
        for queue in self._queues:
            if queue:
                if wanted is not None or len(queue) > 1:
                    return None
                (wanted,) = queue
        return wanted if type(wanted) is Flight and not wanted.done else None

    def is_unanswered(self: Any, probe: Flight, now: float) -> bool:
        """Its time is over and nothing has come, and that is settled; False where there is more to look at."""
        turns: Turns = self
        lane = probe.exchange.lane
        if len(turns.flying) != 1 or turns.flying.get(lane) is not probe or now < probe.deadline:
            return False
        if (
            probe.got
            or probe.noise
            or probe.spoiled
            or probe.surplus
            or probe.done
            or probe.put_aside is not None
        ):
            return False
        if not turns.echo.is_out or turns.receiver.held or self._timers or self._claims:
            return False
        (due,) = probe.exchange.replies  # type: ignore[misc]  # a probe has exactly one reply
        turns.trust.missed(lane, due, now, self._quiet)
        turns.statistics.of(due.node).errors["silence"] += 1
        self._probe_failed(probe, probe.parent, "silence", now)
        del turns.flying[lane]
        return True
