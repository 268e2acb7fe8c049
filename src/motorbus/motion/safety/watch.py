"""Who of the axes that are led on one bus is asked next how he fares, and what his answer means.

Positions come in every cycle; torque, supply, heat and load do not. So one device at a time is asked for these, behind
a cycle and as seldom as will do: each every quarter of a second, and altogether a tenth of what the wire carries. A
restart shows in the first answer after it. A motor that pushes too hard for too long, or is too hot, ends the movement;
it keeps its torque then, for what it holds might fall.

It sends nothing: whoever leads the axes asks what is due, and gives the answer back.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from math import inf
from typing import TYPE_CHECKING, Final

from motorbus.bus.base import BaseBus
from motorbus.core.family import Health
from motorbus.core.request import Request
from motorbus.core.steps import Emit, Sleep, catch
from motorbus.errors import Faulted, MotorbusError, NoReply, Overloaded, WireError
from motorbus.motion.safety import restarts
from motorbus.motion.safety.restarts import HEALTH
from motorbus.motion.safety.strain import Strain, Verdict

if TYPE_CHECKING:
    from motorbus.motion.capabilities import AxisVerbs

SHARE: Final = 0.1
"""Of what the wire carries: asking how they fare takes no more, so on a slow line each is asked more seldom."""
OVERDUE: Final = 4
"""Times `HEALTH` after which an axis is asked although its cycle has no room for that."""
LOST: Final = (NoReply, WireError)
"""The errors of an answer that was lost on the wire: the next one will tell."""
NOBODY: Final[Mapping[int, float]] = {}


class Watch:
    """Watches axes of one bus; those whose devices do not tell how they fare are left out.

    `fault` is the last error that was raised for a device that has restarted or let go.
    """

    def __init__(self, bus: BaseBus, axes: Iterable[AxisVerbs]) -> None:
        self._bus: Final = bus
        self._axes: Final = {axis.spec.node: axis for axis in axes if "health" in axis.able}
        self._strains: Final[dict[int, Strain | None]] = {}
        self._turns: Final[deque[int]] = deque()
        self._last: Final[dict[int, float]] = {}
        self._alarms: Final[dict[int, tuple[str, ...]]] = {}
        self.fault: Faulted | None = None
        self._free = -inf
        self._next = inf

    # -- who is watched ------------------------------------------------------------------------------------------------

    async def begin(self, axes: Iterable[AxisVerbs]) -> None:
        """Watch these from here on: they have got torque, and no goal yet. Each is asked once.

        Raises Faulted and Overloaded as `take`; an answer that is lost is forgiven.
        """
        for axis in axes:
            node = axis.spec.node
            restarts.armed(axis)
            if node not in self._axes:
                continue
            self.dismiss(node)
            self._strains[node] = Strain() if axis.spec.guard else None
            self._turns.appendleft(node)
            told = await catch(axis.able.health(axis.device))
            await self._took(node, told, NOBODY, await Sleep(0))

    def dismiss(self, node: int) -> None:
        """It is led no more, and asked no more."""
        if node in self._strains:
            del self._strains[node]
            self._last.pop(node, None)
            if node in self._turns:
                self._turns.remove(node)
            self._plan()

    def alarms(self, axis: AxisVerbs) -> tuple[str, ...]:
        """The alarms that its device told of when it was asked last; () when there were none, or nobody knows."""
        return self._alarms.get(axis.spec.node, ())

    # -- whom to ask, and what the answer means ------------------------------------------------------------------------

    def due(self, now: float, slack: float = inf) -> Request[Health] | None:
        """What is to be asked next, None when nothing is: nobody's turn, or no room in the `slack` (s) of this cycle.

        `now` is s on the link's clock. Whoever has been due for long is asked whether there is room or not.
        """
        if now < self._next:
            return None
        node = self._turns[0]
        overdue = now >= self._last.get(node, -inf) + OVERDUE * HEALTH
        if slack <= 0.0 and not overdue:
            return None
        wanted = self._axes[node].able.health(self._axes[node].device)
        if not isinstance(
            wanted, Request
        ):  # others set it up anew, and it is not known well enough for the moment
            self._passed(node, now, 0.0)
            return None
        if self._air(wanted) > slack and not overdue:
            return None
        return wanted

    def take(
        self,
        node: int,
        told: Health | MotorbusError,
        goals: Mapping[int, float],
        now: float,
        places: Mapping[int, float] = NOBODY,
    ) -> None:
        """What came of asking this node. `goals` and `places`: where each was told to be and was heard last (rad of
        its device), so far as that is known. One that was dismissed meanwhile is judged no more.

        Raises Faulted for a device that has restarted or let go: its axis is at fault then. Raises Overloaded for one
        that pushes too hard for too long, or is too hot; that changes nothing.
        """
        if node not in self._strains:
            return
        axis, strain = self._axes[node], self._strains[node]
        self._passed(node, now, HEALTH * SHARE if isinstance(told, MotorbusError) else self._cost(node))
        if isinstance(told, MotorbusError):
            if not isinstance(told, LOST):  # it does not tell, though devices of its kind do
                self.dismiss(node)
            return
        self._alarms[node] = told.state.alarm
        error = restarts.looked_at(axis, told, led=True)
        if error is not None:
            self.fault = error
            self.dismiss(node)
            raise error
        if strain is None:
            return
        state = told.state
        if state.position is None and node in places:
            state = state._replace(position=places[node])
        verdict = strain.take(state, goals.get(node))
        if verdict in (Verdict.OVERLOADED, Verdict.HOT):
            raise _overloaded(axis, strain, state.at)

    async def asking(
        self,
        slack: float = inf,
        goals: Mapping[int, float] = NOBODY,
        places: Mapping[int, float] = NOBODY,
    ) -> None:
        """Ask who is due, if anybody is, and judge the answer; raises as `take`."""
        wanted = self.due(await Sleep(0), slack)
        if wanted is not None:
            node = self._turns[0]  # whose turn it is when the answer comes may be another's
            told = await catch(wanted)
            await self._took(node, told, goals, await Sleep(0), places)

    async def examine(self, axis: AxisVerbs) -> None:
        """Ask this one at once, for it does not do as it was told. Raises as `take` what is the matter with it."""
        node = axis.spec.node
        if node in self._strains:
            self._turns.remove(node)
            self._turns.appendleft(node)
            told = await catch(axis.able.health(axis.device))
            await self._took(node, told, NOBODY, await Sleep(0))

    async def _took(
        self,
        node: int,
        told: Health | MotorbusError,
        goals: Mapping[int, float],
        now: float,
        places: Mapping[int, float] = NOBODY,
    ) -> None:
        try:
            self.take(node, told, goals, now, places)
        except Faulted:
            axis = self._axes[node]
            await Emit(restarts.FaultNoted(axis.name, restarts.why(axis)))
            raise

    # -- turns -----------------------------------------------------------------------------------------------------

    def _passed(self, node: int, now: float, cost: float) -> None:
        """It was asked, which took so much of the wire (s)."""
        self._turns.remove(node)
        self._turns.append(node)
        self._last[node] = now
        self._free = now + cost / SHARE
        self._plan()

    def _plan(self) -> None:
        first = self._turns[0] if self._turns else None
        self._next = inf if first is None else max(self._last.get(first, -inf) + HEALTH, self._free)

    def _cost(self, node: int) -> float:
        wanted = self._axes[node].able.health(self._axes[node].device)
        return self._air(wanted) if isinstance(wanted, Request) else 0.0

    def _air(self, request: Request[Health]) -> float:
        return self._bus.driver.air_time(request, self._bus.rate)


def _overloaded(axis: AxisVerbs, strain: Strain, now: float) -> Overloaded:
    spec, sample, bearable = axis.spec, strain.sample, strain.bearable
    assert sample is not None
    figures = [
        text
        for value, text in (
            (sample.load, f"load {abs(sample.load or 0):.0%}"),
            (sample.current, f"current {abs(sample.current or 0):.2f} A"),
            (sample.temperature, f"{sample.temperature or 0:.0f} °C"),
        )
        if value is not None
    ]
    felt = ", ".join(figures) + (f"; alarms: {', '.join(sample.alarm)}" if sample.alarm else "")
    keeps = "it keeps its torque; `guard = false` in its table of the machine file ends this watch"
    if strain.verdict is Verdict.HOT:
        return Overloaded(
            f"{axis.name} ({spec.device}) is too hot: {felt}",
            reason="heat",
            expected=f"below {bearable.hot:g} °C, and once it is too hot below {bearable.cool:g} °C again",
            cause="it holds or moves too much for too long, or its surroundings are hot",
            advice=f"take the load off it and let it cool; all of the movement were told to stop, and {keeps}",
            node=spec.node,
        )
    since = 0.0 if strain.since is None else now - strain.since
    return Overloaded(
        f"{axis.name} ({spec.device}) has pushed too hard for {since:.1f} s without coming to its goal: {felt}",
        reason="load",
        expected=f"less than {bearable.seconds:g} s of load {bearable.load:.0%} or {bearable.current:g} A while it is "
        f"more than {bearable.off:g} rad of its device off its goal",
        cause="something blocks it, or the load is too heavy",
        advice=f"clear the way, or take the load off it; all of the movement were told to stop, and {keeps}",
        node=spec.node,
    )
