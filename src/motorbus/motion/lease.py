"""The lease: who moves a machine for another renews it by a heartbeat; when it is lost the machine stops."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from contextlib import suppress
from math import inf
from threading import Event, Thread
from typing import Final

from motorbus.bus.base import BaseBus
from motorbus.bus.blocking import run_on
from motorbus.core.steps import Procedure
from motorbus.errors import Refused

LOG = logging.getLogger("motorbus.motion")
RETRY: Final = 0.5  # s after which the stop is sent again to axes that did not accept it
LOOK: Final = 0.05  # s between two looks at the lease

Stop = Callable[[BaseBus], Procedure[bool]]
"""Stops what moves on a bus; False where an axis did not accept it."""


class Lease:
    """The right to move a machine, for `seconds` after each `beat`; without `seconds` until it ends.

    A lease that was not renewed in time is lost; it stays lost until `reset`.
    """

    def __init__(self, now: Callable[[], float], seconds: float = inf) -> None:
        self.seconds: Final = seconds
        self._now = now
        self._until = now() + seconds

    @property
    def lost(self) -> bool:
        """It was not renewed in time."""
        return self._now() > self._until

    def beat(self) -> None:
        """Renew it. Raises Refused if it is lost."""
        if self.lost:
            raise lease_lost("the machine")
        self._until = self._now() + self.seconds

    def reset(self) -> None:
        """Take it again after a loss. Nothing is sent."""
        self._until = self._now() + self.seconds


def lease_lost(name: str) -> Refused:
    """The error for an axis that must not move because the lease is lost."""
    return Refused(
        f"{name}: the motion lease was not renewed in time", reason="lease", advice="lease.reset()"
    )


class LeaseWatch:
    """Stops what moves on these buses when the lease is lost, again every 0.5 s until each axis has accepted it.

    A thread does that, so a program that hangs is stopped. In virtual time, which passes only while the program waits,
    nothing does: there the gate refuses the next goal, and the movement ends by that.
    """

    def __init__(self, lease: Lease, buses: Iterable[BaseBus], stop: Stop) -> None:
        self._lease = lease
        self._buses = tuple(buses)
        self._stop = stop
        self._ended = Event()

    def start(self) -> None:
        """Begin to watch."""
        if self._lease.seconds < inf and not any(bus.link.virtual for bus in self._buses):
            Thread(target=self._watch, name="motorbus lease", daemon=True).start()

    def end(self) -> None:
        """Stop watching."""
        self._ended.set()

    def _watch(self) -> None:
        going = set(self._buses)
        while not self._ended.wait(LOOK):
            if not self._lease.lost:
                going = set(self._buses)
                continue
            with suppress(Exception):  # a bus that is gone: again after a pause
                accepted = run_on({bus: self._stop(bus) for bus in going})
                going -= {bus for bus, value in accepted.items() if value is True}
            if going:
                LOG.warning("the lease is lost, and not every axis has accepted the stop")
                self._ended.wait(RETRY)
