"""What a bus asks before it sends a motion request."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from motorbus.core.request import Request
from motorbus.core.steps import Runnable


class Interlock(Protocol):
    """Judges requests that move a motor or switch its torque before they are sent. The safety gate is one."""

    def check(self, request: Request[Any], now: float, /) -> None:
        """Raise MotorbusError if this request must not leave at `now` (s).

        Called at every attempt, never for a stop.
        """

    def required_reads(self, request: Request[Any], /) -> Sequence[Runnable[Any]]:
        """The reads that must be carried out before this request can be checked."""

    def stopped(self, nodes: Sequence[int], /) -> None:
        """A stop for these nodes (empty: all) was requested and will be sent. May be called from any thread."""
