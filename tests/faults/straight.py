"""What the faults of a line strike on the straight way: prepared servos, and exchanges as a control loop keeps them.

The rig of the plain kinds makes a new exchange for each call, and such a one never goes straight. These are kept and
run again and again. Whoever uses them counts how many have landed (`Landings`) and how many of those in the air were
struck (`StraightRig.struck`): if none was, nothing is proved of the straight way.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from motorbus.core.family import Positions, Simulator
from motorbus.core.operation import Data, Exchange
from motorbus.families import feetech
from motorbus.families.feetech import Servo
from motorbus.link.base import Delivery, Line, PerfectLine, Side
from tests.faults.rig import FEEDBACK, Rig

GROUP = (1, 2, 3)
WORD = 2
GAP = 0.001
"""s: replies of one train follow each other sooner."""


class Adapter:
    """Gathers what its servos say one behind the other, and hands over the whole train when its last one speaks."""

    def __init__(self, simulator: Simulator) -> None:
        self.simulator = simulator
        self.tune = simulator.tune
        self.receive = simulator.receive
        self.due = simulator.due
        self._held: list[tuple[float, Data]] = []

    @property
    def nodes(self) -> Mapping[int, Any]:
        return self.simulator.nodes

    def advance(self, to: float) -> list[tuple[float, Data]]:
        self._held += self.simulator.advance(to)
        following = self.simulator.due()
        if not self._held or (following is not None and following - self._held[-1][0] < GAP):
            return []
        train, self._held = self._held, []
        return [(train[-1][0], b"".join(data for _, data in train if isinstance(data, bytes)))]


class Overseen:
    """Carries as another line does, and counts what it strikes while a flight goes straight."""

    def __init__(self, line: Line, rig: StraightRig) -> None:
        self.line = line
        self.rig = rig

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        aloft = self.rig.bus.turns.aloft
        deliveries = self.line.carry(sender, data, at)
        if sender is Side.DEVICE and aloft is not None:
            self.rig.struck += deliveries != [Delivery(at, Side.HOST, data)]
        return deliveries


@dataclass
class StraightRig(Rig):
    """Three servos that are known, each of them somewhere else, and what is kept to ask them.

    `struck` counts the answers to straight flights that did not come as they were sent, `missing` the servos that were
    said not to have answered.
    """

    ids: tuple[int, ...] = GROUP
    struck: int = 0
    missing: int = 0

    def __post_init__(self) -> None:
        line, self.line = self.line, PerfectLine()
        super().__post_init__()
        self.link.simulator = Adapter(self.simulator)
        self.hosts = [Servo(self.bus, id) for id in GROUP]
        for host in self.hosts:
            host.prepare()
        table = self.hosts[0].table
        assert table is not None
        self.row = table["present_position"]
        self.positions = feetech.sync_read_positions(self.hosts)
        self.states = feetech.sync_read_states(self.hosts)
        self.blocks = feetech.sync_read_raw(56, WORD, self.hosts)
        self.order = feetech.sync_writer(self.hosts, "goal_position")
        self.felt = self.bus.run(self.states).values[1]
        self.hosts[0].position()
        self.put(line)

    def put(self, line: Line) -> None:
        self.line = line
        self.link.line = Overseen(line, self)

    @property
    def position(self) -> Exchange[float]:
        """What `position()` of the first one has kept."""
        exchange: Exchange[float] = self.hosts[0].kept["present_position"][1]
        return exchange

    def stir(self) -> int:
        """Each is somewhere else, where it has not been lately; where the first one is."""
        raw = super().stir()
        for id, servo in self.servos.items():
            servo.raw_position = raw + 5 * id
        return raw + 5

    def agree(self, told: Mapping[int, int]) -> None:
        """Each is where it is said to be (raw); one may be missing where something goes wrong."""
        assert told == {id: self.servos[id].raw_position for id in told}
        self.missing += len(GROUP) - len(told)
        assert len(told) == len(GROUP) or type(self.line) is not PerfectLine

    def agree_places(self, told: Positions) -> None:
        """The same in rad."""
        self.agree({id: self.row.to_raw(value) for id, value in told.values.items()})


class KeptKind(NamedTuple):
    """An exchange that is kept: how it is carried out and judged, which one that is, and the bytes of its answer."""

    act: Callable[[StraightRig], None]
    kept: Callable[[StraightRig], Exchange[Any]]
    back: int


def position(rig: StraightRig) -> None:
    raw = rig.stir()
    assert rig.row.to_raw(rig.hosts[0].position()) == raw


def sync_read_positions(rig: StraightRig) -> None:
    rig.stir()
    rig.agree_places(rig.bus.run(rig.positions))


def sync_read_raw(rig: StraightRig) -> None:
    rig.stir()
    found = rig.bus.run(rig.blocks)
    rig.agree({id: int.from_bytes(data, "little") for id, data in found.items()})


def sync_read_states(rig: StraightRig) -> None:
    """Only where they are has changed."""
    rig.stir()
    told = rig.bus.run(rig.states).values
    for state in told.values():
        assert state._replace(at=rig.felt.at, position=rig.felt.position) == rig.felt
    rig.agree({id: rig.row.to_raw(state.position or 0.0) for id, state in told.items()})


def volley(rig: StraightRig) -> None:
    """Goals leave in one write with the question where they are. Each is to stay where it is."""
    rig.stir()
    places = [rig.servos[id].raw_position for id in GROUP]
    _, told = rig.bus.volley(rig.order([float(rig.row.to_value(place)) for place in places]), rig.positions)
    rig.agree_places(told)
    assert places == [rig.servos[id].memory["goal_position"] for id in GROUP]


KEPT = {
    "position()": KeptKind(position, lambda rig: rig.position, 8),
    "sync_read_positions": KeptKind(sync_read_positions, lambda rig: rig.positions, 3 * 8),
    "sync_read_raw": KeptKind(sync_read_raw, lambda rig: rig.blocks, 3 * 8),
    "volley": KeptKind(volley, lambda rig: rig.positions, 3 * 8),
    "sync_read_states": KeptKind(sync_read_states, lambda rig: rig.states, 3 * (6 + FEEDBACK)),
}
"""By what a user calls; each asserts that what it is told is true."""


def poised(rig: StraightRig, kind: KeptKind) -> None:
    """Until the next one has its shorter form. The line is sound."""
    kind.act(rig)
    while rig.bus.turns.trust.alike(kind.kept(rig)):
        kind.act(rig)
