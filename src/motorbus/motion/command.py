"""Who may tell an axis what to do: whoever told it last.

A movement that is led gives a new goal every few milliseconds. When somebody else has stopped an axis in between, has
let it go, or has begun another movement with it, the next goal must not leave: so each goal is asked, in the moment in
which it leaves, whether the command is still with those who made it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from copy import copy
from functools import partial
from typing import TYPE_CHECKING, Any, Final, TypeVar

from motorbus.bus import failures
from motorbus.core.request import (
    Effect,
    Precondition,
    Priority,
    Request,
    SetpointGroup,
    SetpointWrite,
    Step,
    Stops,
)
from motorbus.core.steps import Exclusive, Gather, Runnable, Shielded, catch, gather
from motorbus.errors import Interrupted, MotorbusError

if TYPE_CHECKING:
    from motorbus.motion.capabilities import AxisVerbs
    from motorbus.motion.reckoning import Movement

T = TypeVar("T")

GUARDED: Final = frozenset({Effect.TORQUE, Effect.MOTION})
"""What an exchange does to the world that nobody may do any more once the command is lost."""
NEVER: Final = -1
"""No count of stops: every axis is looked at anew."""


class Command:
    """The command over some axes of one bus, from now on until somebody else tells one of them something.

    What counts is what was told to the axes from here, and every stop that left on their bus, whoever sent it. When the
    port of the bus is lost, the command is: also where somebody else was told of that, and it is there again by now.
    """

    def __init__(self, axes: Iterable[AxisVerbs]) -> None:
        self.axes = tuple(axes)
        self._bus = self.axes[0].bus if self.axes else None
        self._losses = 0 if self._bus is None else self._bus.loss_count
        self._stopping = self._stopped_by_now()
        self._stops = {axis.name: _stops(axis) for axis in self.axes}
        self._orders: dict[str, int] = {}
        self._counts: tuple[tuple[AxisVerbs, int], ...] = ()
        self._aim: tuple[SetpointGroup, SetpointGroup] | None = None
        self._count()

    def _count(self) -> None:
        self._orders = {axis.name: axis.orders for axis in self.axes}
        self._counts = tuple((axis, axis.orders) for axis in self.axes)

    def _stopped_by_now(self) -> int:
        """How many stops have left on the bus, for whomever: while there are no more, nobody has to be looked at."""
        return 0 if self._bus is None else self._bus.stop_count()

    def depart(self, movement: Movement | None = None) -> None:
        """A movement begins: from here on it is known that they move. Raises Interrupted as `check`.

        Of an axis that is reckoned a `movement` is kept account of: `AxisVerbs.departs`.
        """
        self.check()
        for axis in self.axes:
            axis.departs(movement)
        self._count()

    def held(self) -> list[AxisVerbs]:
        """Those that nobody else has told anything since."""
        return [
            axis for axis in self.axes if axis.orders == self._orders[axis.name] and not self._stopped(axis)
        ]

    def untold(self) -> list[AxisVerbs]:
        """Those that nobody else has told anything from here since, whatever stops have left on their bus."""
        return [axis for axis, orders in self._counts if axis.orders == orders]

    def joined(self, other: Command) -> Command:
        """The command over the axes of both, on the same bus, each from when it was taken, the later one counts.

        Whatever was told to one of them since is as good as told to all.
        """
        found = copy(other)
        found._aim = None
        axes = {axis.name: axis for axis in (*self.axes, *other.axes)}
        found.axes = tuple(axes.values())
        if other._bus is None:
            found._bus, found._losses = self._bus, self._losses
        elif self._bus is not None:
            found._losses = min(self._losses, other._losses)
        found._stopping = NEVER
        found._stops = self._stops | other._stops
        found._orders = self._orders | other._orders
        found._counts = tuple((axis, found._orders[axis.name]) for axis in found.axes)
        return found

    def rest(self) -> Command:
        """The command over those that nobody else has told anything since, without the others."""
        found, held = copy(self), self.held()
        found._aim = None
        found.axes = tuple(held)
        found._counts = tuple((axis, self._orders[axis.name]) for axis in held)
        return found

    def check(self) -> None:
        """Raise Interrupted when the command over one of them is lost, LinkLost when their port was gone since."""
        if error := self.lost():
            raise error

    def lost(self) -> MotorbusError | None:
        """The error for an axis that somebody else has told something since; None when there is none."""
        if self._bus is not None and self._bus.loss_count != self._losses:
            return failures.outlived()
        stopping = self._stopped_by_now()
        if stopping == self._stopping:
            for axis, orders in self._counts:
                if axis.orders != orders:
                    return _lost(axis)
            return None
        for axis in self.axes:
            if axis.orders != self._orders[axis.name] or self._stopped(axis):
                return _lost(axis)
        self._stopping = stopping  # those were for others
        return None

    def guarded(self, request: Request[T]) -> Request[T]:
        """The same exchange, which does not leave once the command is lost."""
        if isinstance(request, SetpointWrite):
            aimed: Any = request.with_group(self._aim_of(request.group))
            return aimed  # type: ignore[no-any-return]
        own = request.precondition
        return Request(
            request.wire,
            request.expected,
            request.decode,
            lane=request.lane,
            priority=request.priority,
            effect=request.effect,
            setpoints=request.setpoints,
            reply_within=request.reply_within,
            repeatable=request.repeatable,
            reports_position=request.reports_position,
            precondition=self._refusal if own is None else partial(self._either, own),
        )

    def _aim_of(self, aim: SetpointGroup) -> SetpointGroup:
        """The same aim, of which nothing leaves once the command is lost; kept, for a loop asks in each cycle."""
        known = self._aim
        if known is None or known[0] is not aim:
            own = SetpointGroup(aim.nodes, aim.to_setpoints, partial(self._either, aim.precondition))
            known = self._aim = aim, own
        return known[1]

    def _refusal(self, _: Stops) -> MotorbusError | None:
        return self.lost()

    def _either(self, own: Precondition, stops: Stops) -> MotorbusError | None:
        return own(stops) or self.lost()

    async def watched(self, operation: Runnable[T]) -> T:
        """The same operation, of which nothing that moves or gives torque leaves once the command is lost.

        It is for what takes several exchanges, as getting ready does: whoever lets an axis go in the middle of that
        must find it limp afterwards. Each such exchange is `guarded`, also those that are said together or alone;
        what stops or lets go (`Priority.STOP`) always leaves. Raises Interrupted in the place of an exchange that did
        not leave.
        """
        if isinstance(operation, Step):
            only: T = await self._watching(operation)
            return only
        advance: Callable[[], Step[Any]] = partial(operation.send, None)
        try:
            while True:
                try:
                    step = advance()
                except StopIteration as end:
                    value: T = end.value
                    return value
                try:
                    advance = partial(operation.send, await self._watching(step))
                except GeneratorExit:
                    raise
                except BaseException as error:
                    advance = partial(operation.throw, error)
        finally:
            operation.close()

    def _watching(self, step: Step[Any]) -> Step[Any]:
        if isinstance(step, Request):
            return (
                self.guarded(step) if step.effect in GUARDED and step.priority is not Priority.STOP else step
            )
        if isinstance(step, Gather):
            return gather(*[self.watched(one) for one in step.runnables])
        if isinstance(step, Exclusive):
            return Exclusive(self.watched(step.runnable))
        if isinstance(step, Shielded):
            return Shielded(self.watched(step.runnable))
        return step

    async def stop(self, *, anew: bool = False) -> dict[str, MotorbusError]:
        """Stop those that nobody else has told anything since; gives the error of each that did not accept, by name.

        With `anew` also those for which a stop has left on their bus, where nobody knows whether it was accepted.
        """
        axes = self.untold() if anew else self.held()
        ended = await gather(*[catch(axis.able.stop(axis.device)) for axis in axes])
        errors = {
            axis.name: told for axis, told in zip(axes, ended, strict=True) if isinstance(told, MotorbusError)
        }
        for axis in axes:
            if axis.name not in errors:
                axis.accepted_stop()
        return errors

    def _stopped(self, axis: AxisVerbs) -> bool:
        return _stops(axis) != self._stops[axis.name]


def _lost(axis: AxisVerbs) -> Interrupted:
    return Interrupted(
        f"{axis.name}: the movement was ended by another order",
        cause="it was stopped, let go or told to move from elsewhere",
        advice="the others of the movement were told to stop; give the order again if it is still wanted",
        node=axis.spec.node,
    )


def _stops(axis: AxisVerbs) -> int:
    """How many stops have left for it on its bus, whoever sent them."""
    count: int = axis.bus.stop_count(axis.spec.node)
    return count
