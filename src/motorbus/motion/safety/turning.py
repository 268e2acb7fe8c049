"""Who was told to go on without an end, and has not been stopped for certain since.

A stop that has left may have been lost on the wire. So what ends it is that its device has accepted a stop, or an order
to rest: it has answered that, or what was written was read back. Who thinks that it goes on though it rests tells it to
stop once more; who thinks that it rests though it goes on leaves it turning.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from motorbus.core.request import Stops

if TYPE_CHECKING:
    from motorbus.motion.capabilities import AxisVerbs


class Begun:
    """One order that goes on, and how often its node had `accepted` to stop before it left."""

    __slots__ = ("accepted",)

    def __init__(self, accepted: int) -> None:
        self.accepted = accepted


class Turning:
    """The nodes of one bus that were told to go on; `accepted` says how often a node has accepted to stop by now."""

    def __init__(self, accepted: Stops | None = None) -> None:
        self.accepted: Stops = accepted or _never
        self._begun: dict[int, Begun] = {}

    def begins(self, node: int) -> None:
        """It is told to go on without an end."""
        self._begun[node] = Begun(self.accepted(node))

    def goes_on(self, node: int) -> bool:
        """Whether it was told so, as far as is known, and has accepted no stop since."""
        return self.last(node) is not None

    def last(self, node: int) -> Begun | None:
        """The order by which it goes on; None while it does not."""
        begun = self._begun.get(node)
        return None if begun is None or begun.accepted != self.accepted(node) else begun

    def rests(self, node: int, since: Begun | None) -> None:
        """It is certain that the order `since` has ended; one that came after it goes on."""
        if since is not None and self._begun.get(node) is since:
            del self._begun[node]


class Resting:
    """What an axis went on by when somebody began to stop it; call `certain` once it is certain that it rests."""

    def __init__(self, axis: AxisVerbs) -> None:
        gate: Any = axis.bus.interlock
        self._node = axis.spec.node
        self._lock = axis.bus.turn
        self._turning: Turning | None = getattr(gate, "turning", None)
        self._since = None if self._turning is None else self._turning.last(self._node)

    def certain(self) -> None:
        """Its device has accepted the stop, whatever was answered on the way."""
        if self._turning is not None:
            with self._lock:
                self._turning.rests(self._node, self._since)


def _never(_: int) -> int:
    """Of nodes whose stops nobody counts."""
    return 0
