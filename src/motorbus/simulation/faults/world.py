"""What happens to a simulated bus as a whole, at its moment: a pulled port, a supply that fails, a second device.

It is a simulator around another, so that every link and every mount can have it: what is to happen is a moment in its
course like any other. The devices are never asked for more than `core.family` says; what only some can is asked for by
name, and a script that wants it of others is refused before anything is served.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from heapq import heappop, heappush
from itertools import count
from math import inf
from typing import Any, NamedTuple, Protocol

from motorbus.core.family import SimulatedNode, Simulator
from motorbus.core.request import Data
from motorbus.errors import RequestError
from motorbus.simulation.faults.fault import Fault
from motorbus.simulation.told import told

_STORES = "midway"
_TWINS = "duplicate"


class Port(Protocol):
    """Where clients come in, when it can be pulled."""

    def unplug(self, *, seconds: float) -> None:
        """The port vanishes for so long (s), from now on. What is under way is lost."""


class _Event(NamedTuple):
    moment: float
    order: int
    act: Callable[[float], None]


class _Armed(NamedTuple):
    """Whose next store is cut, by which fault, and who is told when it is."""

    node: SimulatedNode
    fault: Fault
    tell: Callable[[float], None]


class World:
    """A `Simulator` around another, to which things happen. All else of the other is there too.

    `simulator`  the devices
    `port`       what is pulled by `unplug`; None: it cannot be, `why` says the reason
    `now`        the latest moment that it was told (s), at first the one at which its clock begins
    """

    def __init__(
        self, simulator: Simulator, *, port: Port | None = None, why: str = "", now: float = 0.0
    ) -> None:
        self.simulator = simulator
        self.port = port
        self.why = why
        self.now = now
        self._events: list[_Event] = []
        self._order = count()
        self._armed: list[_Armed] = []
        self._out: list[tuple[float, Data]] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self.__dict__["simulator"], name)

    @property
    def nodes(self) -> Mapping[int, SimulatedNode]:
        """The devices by their ids."""
        return self.simulator.nodes

    @property
    def scheduled(self) -> bool:
        """Something is still to happen."""
        return bool(self._events)

    # -- what is to happen --------------------------------------------------------------------------------------------

    def check(self, fault: Fault) -> None:
        """Raises RequestError when this cannot happen here."""
        if fault.action == "unplug" and self.port is None:
            raise RequestError(f"fault {fault}: there is no port here that could be pulled", cause=self.why)
        if fault.node is not None and fault.node not in self.nodes:
            raise RequestError(
                f"fault {fault}: there is no node {told(self.simulator, [fault.node])}",
                expected=f"one of {told(self.simulator, self.nodes)}",
            )
        if fault.action == "duplicate-id" and not hasattr(self.simulator, _TWINS):
            raise RequestError(
                f"fault {fault}: there can be no second device on this line",
                expected="a bus whose devices are told apart by their ids",
                cause="a device of this kind is alone on its line, and is not addressed there",
                advice="leave it out, or simulate devices that share a bus",
            )
        if (
            fault.action == "torn-eeprom"
            and fault.node is not None
            and not hasattr(self.nodes[fault.node], _STORES)
        ):
            raise RequestError(f"fault {fault}: what these devices store cannot be cut")

    def happen(self, fault: Fault, at: float, tell: Callable[[float], None] = lambda moment: None) -> None:
        """Let this happen at this moment (s). `tell` is called when something stored was torn, with the moment."""
        self.at(at, partial(self._do, fault, tell))

    def at(self, moment: float, act: Callable[[float], None]) -> None:
        """Do this at a moment to come, which it is given."""
        heappush(self._events, _Event(moment, next(self._order), act))

    @property
    def armed(self) -> tuple[Fault, ...]:
        """Whose turn has come, but nothing was stored since that could be torn."""
        return tuple(dict.fromkeys(one.fault for one in self._armed))

    def forget(self) -> None:
        """Nothing of what was to come happens any more, but a supply that is away comes back."""
        self._events = [one for one in self._events if getattr(one.act, "func", None) == self._plug]
        self._armed.clear()

    # -- what a simulator does ----------------------------------------------------------------------------------------

    def tune(self, rate: int) -> None:
        """The rate of the host (bit/s)."""
        self.simulator.tune(rate)

    def receive(self, data: Data, at: float) -> None:
        """The host's data have arrived."""
        self._run_until(at)
        self.now = max(self.now, at)
        self.simulator.receive(data, at)
        if self._armed:
            self._look()

    def advance(self, to: float) -> list[tuple[float, Data]]:
        """Everything that the devices begin to send up to this moment."""
        self._run_until(to)
        self._collect(to)
        said, self._out = self._out, []
        return said

    def due(self) -> float | None:
        """The next moment at which something happens by itself."""
        own = self.simulator.due()
        moment = inf if own is None else own
        if self._events:
            moment = min(moment, self._events[0].moment)
        if self._out:
            moment = min(moment, self._out[0][0])
        return None if moment == inf else moment

    # -- how it happens -----------------------------------------------------------------------------------------------

    def _run_until(self, to: float) -> None:
        while self._events and self._events[0].moment <= to:
            event = heappop(self._events)
            self._collect(event.moment)
            event.act(event.moment)

    def _collect(self, to: float) -> None:
        """Let time pass for the devices, and keep what they say meanwhile."""
        said = self.simulator.advance(to)
        self._out += said
        self.now = max(self.now, to)
        if self._armed:
            self._look()

    def _do(self, fault: Fault, tell: Callable[[float], None], moment: float) -> None:
        if fault.action == "unplug":
            if self.port is not None:
                self.port.unplug(seconds=fault.seconds)
        elif fault.action == "power-cycle":
            for node in self._whom(fault):
                node.power_cycle()
        elif fault.action == "brown-out":
            fallen = self._whom(fault)
            for node in fallen:
                node.unplug()
            self.at(moment + fault.seconds, partial(self._plug, fallen))
        elif fault.action == "duplicate-id":
            twin: Any = self.simulator
            if fault.node in self.nodes:
                twin.duplicate(fault.node)
        elif fault.action == "torn-eeprom":
            self._armed += [_Armed(node, fault, tell) for node in self._whom(fault)]
            self._look()

    def _whom(self, fault: Fault) -> list[SimulatedNode]:
        return [node for id, node in self.nodes.items() if fault.node in (None, id)]

    def _plug(self, nodes: list[SimulatedNode], moment: float) -> None:
        for node in nodes:
            node.plug()

    def _look(self) -> None:
        """Whoever stores something now has its supply cut in the middle of that."""
        for one in tuple(self._armed):
            middle: Callable[[], float] = getattr(one.node, _STORES)
            moment = middle()
            if moment < inf:
                self._armed.remove(one)
                self.at(max(moment, self.now), partial(self._cut, one))

    def _cut(self, one: _Armed, moment: float) -> None:
        one.node.power_cycle()
        one.tell(moment)
