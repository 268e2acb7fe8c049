"""Who may tell an axis what to do: whoever told it last.

A movement that is led gives a new goal every few milliseconds. When somebody else has stopped an axis in between, has
let it go, or has begun another movement with it, the next goal must not leave: so each goal is asked, in the moment in
which it leaves, whether the command is still with those who made it.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, TypeVar

from motorbus.core.operation import Exchange, Operation, Stops, Together, outcome
from motorbus.errors import Interrupted, MotorbusError

if TYPE_CHECKING:
    from motorbus.motion.axis import AxisVerbs

T = TypeVar("T")
_COPIED = ("lane", "rank", "effect", "goals", "timeout", "repeatable", "tells_position")


class Command:
    """The command over some axes of one bus, from now on until somebody else tells one of them something.

    What counts is what was told to the axes from here, and every stop that left on their bus, whoever sent it.
    """

    def __init__(self, axes: Iterable[AxisVerbs]) -> None:
        self.axes = tuple(axes)
        self._orders: dict[str, int] = {}
        self._stops = {axis.name: _stops(axis) for axis in self.axes}
        self._count()

    def _count(self) -> None:
        self._orders = {axis.name: axis.orders for axis in self.axes}

    def depart(self) -> None:
        """A movement begins: from here on it is known that they move. Raises Interrupted as `check`."""
        self.check()
        for axis in self.axes:
            axis.departs()
        self._count()

    def held(self) -> list[AxisVerbs]:
        """Those that nobody else has told anything since."""
        return [
            axis for axis in self.axes if axis.orders == self._orders[axis.name] and not self._stopped(axis)
        ]

    def check(self) -> None:
        """Raise Interrupted when the command over one of them is lost."""
        if error := self.lost():
            raise error

    def lost(self) -> MotorbusError | None:
        """The error for an axis that somebody else has told something since; None when there is none."""
        for axis in self.axes:
            if axis.orders != self._orders[axis.name] or self._stopped(axis):
                return Interrupted(
                    f"{axis.name}: the movement was ended by another order",
                    cause="it was stopped, let go or told to move from elsewhere",
                    advice="the others of the movement were stopped; give the order again if it is still wanted",
                    node=axis.spec.node,
                )
        return None

    def guarded(self, exchange: Exchange[T]) -> Exchange[T]:
        """The same exchange, which does not leave once the command is lost."""
        own = exchange.refusal

        def refusal(stops: Stops) -> MotorbusError | None:
            return (own(stops) if own is not None else None) or self.lost()

        rest: dict[str, Any] = {name: getattr(exchange, name) for name in _COPIED}
        if (other := exchange.other) is not None:
            rest["other"] = lambda: self.guarded(other())
        return Exchange(exchange.request, exchange.replies, exchange.read, refusal=refusal, **rest)

    def stop(self) -> Operation[dict[str, MotorbusError]]:
        """Stop those that nobody else has told anything since; gives the error of each that did not accept, by name."""
        axes = self.held()
        ended = yield from Together([outcome(axis.able["stop"](axis.device)) for axis in axes])
        errors = {
            axis.name: told for axis, told in zip(axes, ended, strict=True) if isinstance(told, MotorbusError)
        }
        for axis in axes:
            axis.under_way = axis.under_way and axis.name in errors
        return errors

    def _stopped(self, axis: AxisVerbs) -> bool:
        return _stops(axis) != self._stops[axis.name]


def _stops(axis: AxisVerbs) -> int:
    """How many stops have left for it on its bus, whoever sent them."""
    count: int = axis.bus.turns.known.stops(axis.spec.node)
    return count
