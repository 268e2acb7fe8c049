"""How a machine is left when a program ends, however that comes: hold, torque off, park, or leave it alone.

Only axes that were given torque or moved from here are concerned, and each does what the machine file says of it. What
moves is stopped first, whatever happens to some; then what is to be limp lets go, once it was seen to rest or half a
second has passed; parking comes last, for it takes its time. An interruption while this goes on takes the looking and
the parking away; stops and letting go are gone on with. What it cuts off on a bus has its clean-up there, and that a
further one cuts short too: a device whose settings were borrowed for a movement may keep them until `recover`. Blocking
and async robots carry out the same steps, so they are said as what comes next.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping
from typing import Any, Final, TypeAlias

from motorbus.core.steps import Procedure, catch
from motorbus.errors import Interrupted, MotorbusError, NotHomed, Stalled
from motorbus.motion import capabilities as one
from motorbus.motion.body import Body
from motorbus.motion.capabilities import AxisVerbs
from motorbus.motion.moving.verbs import park
from motorbus.motion.parallel import Parallel
from motorbus.motion.safety.gate import Gate
from motorbus.motion.safety.standstill import Rest, watched
from motorbus.motion.several import Act, Told, errors_of, everyone, gathered, insisted, of_each

TRIES: Final = 3
"""How often a step is begun again that an interruption took away before it had visited everyone."""
PATIENCE: Final = 0.5
"""s for which what was stopped is looked at, at most, before it is let go."""

How: TypeAlias = "Callable[[list[AxisVerbs], Act[Any]], Procedure[Told]]"


class Leaving:
    """What is to be done yet before a machine is left: ask for `work`, carry it out, and ask again until it is None.

    `errors` by the names of the axes, `said` is what a person ought to know. Whoever carries it out calls `hurry` when
    an interruption comes, and `failed` with what the work raised.
    """

    def __init__(self, body: Body) -> None:
        self.errors: dict[str, MotorbusError] = {}
        self.said: list[str] = []
        self._body = body
        self._axes = {
            name: axis
            for name, axis in body.axes.items()
            if (axis.engaged or goes_on(axis) or _fell(axis)) and axis.spec.exit != "leave"
        }
        self._visited: set[tuple[str, str]] = set()
        self._tries: dict[str, int] = {}
        self._parks: list[list[str]] | None = None
        self._parking: list[str] = []
        self._hurried = False

    def work(self) -> Parallel[Any] | None:
        """What to do next; None when all is done."""
        return (
            self._visit("stop", self._to_stop(), one.stop)
            or self._visit("look", self._to_look_at(), self._looked, everyone)
            or self._visit("let go", self._to_let_go(), one.disable_torque)
            or self._park()
            or self._visit("stop again", self._to_stop_again(), one.stop)
        )

    def hurry(self) -> None:
        """Somebody does not want to wait: nothing is looked at or parked any more."""
        self._hurried = True
        waiting = [self._parked()] if self._parks is None else self._parks
        skipped = [name for names in [self._parking, *waiting] for name in names if name not in self.errors]
        if skipped:
            self.said.append(f"{', '.join(skipped)}: not parked, for it was interrupted")
        self._parks, self._parking = [], []

    def failed(self, error: MotorbusError) -> None:
        """The work raised this. Axes that could not park together try alone, unless something was in their way."""
        names, self._parking = self._parking, []
        for name in names:
            self.errors[name] = error
        if len(names) > 1 and not isinstance(error, Stalled | Interrupted) and self._parks is not None:
            self._parks += [[name] for name in names]

    @property
    def error(self) -> MotorbusError | None:
        """One error for everything that failed, None when nothing did."""
        return gathered(self.errors) if self.errors else None

    # -- who -----------------------------------------------------------------------------------------------------------

    def _to_stop(self) -> list[str]:
        """Those under way. After an emergency stop nothing moves, and a goal would be refused."""
        moving = [name for name, axis in self._axes.items() if moves(axis)]
        latched = [name for name in moving if self._latched(name)]
        if latched and not self._tries:
            self.said.append(
                f"{', '.join(latched)}: not stopped once more, for the emergency stop is still in force"
            )
        return [name for name in moving if name not in latched]

    def _to_look_at(self) -> list[str]:
        """Who was stopped, and is to be limp: what is let go while it moves goes on by its own weight."""
        stopped = [name for name in self._to_let_go() if ("stop", name) in self._visited]
        return [] if self._hurried else [name for name in stopped if name not in self.errors]

    def _to_let_go(self) -> list[str]:
        return [name for name, axis in self._axes.items() if axis.spec.exit == "torque_off"]

    def _parked(self) -> list[str]:
        return [name for name, axis in self._axes.items() if axis.spec.exit == "park"]

    def _to_stop_again(self) -> list[str]:
        return [name for name in self._parked() if self._axes[name].under_way and not self._latched(name)]

    def _latched(self, name: str) -> bool:
        return bool(self._body.buses[self._axes[name].spec.bus].latched)

    # -- what ----------------------------------------------------------------------------------------------------------

    async def _looked(self, axis: AxisVerbs) -> None:
        if await _rest(axis) is not Rest.STOPPED:
            self.said.append(f"{axis.name}: not seen to rest before it was let go")

    def _visit(
        self, step: str, names: Iterable[str], act: Act[Any], how: How = insisted
    ) -> Parallel[Any] | None:
        """Do it to each of these who has not been visited in this step; None when there is none left."""
        axes = {name: self._axes[name] for name in names if (step, name) not in self._visited}
        if not axes or self._tries.get(step, 0) >= TRIES:
            return None
        self._tries[step] = self._tries.get(step, 0) + 1
        parts = self._body.by_bus(axes)

        def combine(results: Mapping[str, Any]) -> None:
            told = of_each(parts, results)
            self._visited.update((step, name) for name in told)
            self.errors.update(errors_of(told))

        return Parallel({bus: how(there, self._noting(step, act)) for bus, there in parts.items()}, combine)

    def _noting(self, step: str, act: Act[Any]) -> Act[Any]:
        """The same, which counts as visited as soon as it has ended, even when an interruption takes the result."""

        async def noted(axis: AxisVerbs) -> Any:
            try:
                told = await act(axis)
            except MotorbusError as error:
                self.errors[axis.name] = error
                self._visited.add((step, axis.name))
                raise
            self._visited.add((step, axis.name))
            return told

        return noted

    def _park(self) -> Parallel[Any] | None:
        if self._parks is None:
            self._parks = self._first_parks()
        self._parking = []
        if not self._parks:
            return None
        self._parking = self._parks.pop(0)
        for name in self._parking:
            self.errors.pop(name, None)
        return park(self._body, list(self._parking))

    def _first_parks(self) -> list[list[str]]:
        """All that can be parked, together: not what is latched, could not be stopped, or is nobody knows where."""
        able: list[str] = []
        for name in self._parked():
            axis = self._axes[name]
            if self._latched(name):
                self.said.append(f"{name}: not parked, for the emergency stop is still in force")
            elif _lost(axis):
                self.said.append(f"{name}: not parked, for the lease of the machine was lost")
            elif name not in self.errors and self._known(axis):
                able.append(name)
        return [able] if able else []

    def _known(self, axis: AxisVerbs) -> bool:
        if axis.reckoning is None:
            return True
        try:
            axis.reckoning.known(axis.name)
        except NotHomed as error:
            self.errors[axis.name] = error
            return False
        return True


def _fell(axis: AxisVerbs) -> bool:
    """It had torque from here when it came to be at fault, and may have some again: letting go is all that is done."""
    return axis.restarts.fell and axis.spec.exit == "torque_off"


async def _rest(axis: AxisVerbs) -> Rest:
    """Whether an axis that was stopped rests; raises nothing, for it is let go all the same."""
    if "position" not in axis.able:
        return Rest.UNSEEN
    told = await catch(watched(lambda: axis.able.position(axis.device), PATIENCE))
    return Rest.UNSEEN if isinstance(told, MotorbusError) else told[0]


# -- without its holder ------------------------------------------------------------------------------------------------


async def given_up(axes: Iterable[AxisVerbs], again: Container[str] = ()) -> dict[str, MotorbusError]:
    """The axes of one bus when the lease is lost: what moves is stopped, then what is to be limp lets go.

    What moves is stopped whatever its `exit` says, `leave` included: nobody is there any more. Nothing is parked, for
    that would be a movement; who would be parked stays where it stops. After an emergency stop nothing is to be done.
    Those whose names are in `again` are stopped as well. Gives the errors by name; every axis is visited.
    """
    there = [axis for axis in axes if not axis.bus.latched]
    told = await insisted([axis for axis in there if moves(axis) or axis.name in again], one.stop)
    limp = [axis for axis in there if axis.engaged and axis.spec.exit == "torque_off"]
    return errors_of(told) | errors_of(await insisted(limp, one.disable_torque))


async def stopped_going_on(axes: Iterable[AxisVerbs]) -> dict[str, MotorbusError]:
    """Those axes of one bus that were told to go on without an end are told to stop. Gives the errors by name."""
    there = [axis for axis in axes if goes_on(axis) and not axis.bus.latched]
    return errors_of(await insisted(there, one.stop))


def moves(axis: AxisVerbs) -> bool:
    """Whether it was ordered to move, and has not come to its end as far as anybody knows."""
    return axis.under_way or goes_on(axis)


def goes_on(axis: AxisVerbs) -> bool:
    """Whether it was told to go on without an end, by whatever spelling, and nothing else since."""
    gate = axis.bus.interlock
    return isinstance(gate, Gate) and gate.goes_on(axis.spec.node)


def _lost(axis: AxisVerbs) -> bool:
    gate = axis.bus.interlock
    return isinstance(gate, Gate) and gate.loss() is not None
