"""What passes the quick way would pass a close look as well, and is noted as given once, in the same way."""

from __future__ import annotations

from math import nan
from typing import Any, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.aimed import Aim, Aimed
from motorbus.core.operation import Answer, Effect, Exchange, Goal
from motorbus.errors import Refused
from motorbus.motion.safety.gate import Gate
from motorbus.motion.safety.guard import Bounds, Guard
from motorbus.motion.safety.lease import Lease
from motorbus.motion.safety.track import FRESH

NOW = 10.0
QUESTION: Exchange[Answer] = Exchange(b"?")
LEASES = ("none", "not needed", "free", "held", "attended", "lost")


class Seen(NamedTuple):
    """What was read of a node lately: so long ago (s), here (rad), and before that there (rad; None: nothing)."""

    age: float
    here: float
    before: float | None


class World(NamedTuple):
    """All that a gate knows when it is asked."""

    guarded: frozenset[int]
    measured: bool
    step: float
    seen: dict[int, Seen]
    faults: frozenset[int]
    lease: str
    attended: bool


def lease_of(kind: str) -> Lease | None:
    if kind == "none":
        return None
    lease = Lease(0.5, needed=kind != "not needed")
    if kind in ("held", "attended"):
        lease.take("me", NOW - 0.1, attended=kind == "attended")
    if kind == "lost":
        lease.take("me", 1.0)
    return lease


class Made:
    """A gate of this world, and what its guards were told."""

    def __init__(self, world: World) -> None:
        self.gate = gate = Gate()
        self.told: list[tuple[int, bool]] = []
        heard: dict[int, tuple[Exchange[Any], Answer]] = {}
        gate.watch(heard, lambda: NOW)
        gate.lease, gate.attended = lease_of(world.lease), world.attended
        gate.faults.update(dict.fromkeys(world.faults, "worn"))
        for node in sorted(world.guarded):
            gate.guards[node] = self._guard(node, world)
        for node, seen in world.seen.items():
            guard = gate.guards.get(node)
            if seen.before is not None and guard is not None and guard.track is not None:
                guard.track.take(seen.before, NOW - seen.age - 0.01)
            where: Any = lambda _, node=node, seen=seen: {node: seen.here}  # noqa: E731 - a value
            heard[node] = Exchange(b"?", tells_position=where), Answer((), (), NOW - seen.age)

    def _guard(self, node: int, world: World) -> Guard:
        return Guard(
            f"n{node}",
            Bounds(-2.0, 2.0, world.step, 3.0),
            measures=world.measured,
            ask=lambda: QUESTION,
            ordered=lambda moves: self.told.append((node, moves)),
        )

    def passes_closely(self, exchange: Exchange[Any]) -> bool:
        if self.gate.look(exchange):
            return False
        try:
            self.gate(exchange)
        except Refused:
            return False
        return True


def order(goals: tuple[Goal, ...]) -> Aimed:
    return Aimed(b"\x01", Aim([goal.node for goal in goals], lambda _: goals, lambda _: None), ())


def place(value: float, node: int = 1) -> Goal:
    return Goal(node, "position", value, -3.0, 3.0)


NODES = (1, 2, 3)
SEEN = st.builds(
    Seen,
    st.sampled_from((0.0, 0.1, FRESH, FRESH + 0.1)),
    st.floats(-2.5, 2.5),
    st.none() | st.floats(-2.5, 2.5),
)
WORLDS = st.builds(
    World,
    guarded=st.sampled_from((frozenset[int](), frozenset((1,)), frozenset((1, 2)), frozenset(NODES))),
    measured=st.sampled_from((True, True, False)),
    step=st.sampled_from((0.2, 5.0)),
    seen=st.fixed_dictionaries({}, optional=dict.fromkeys(NODES, SEEN)),
    faults=st.sampled_from((frozenset[int](), frozenset[int](), frozenset((1,)), frozenset((9,)))),
    lease=st.sampled_from(LEASES),
    attended=st.booleans(),
)
GOALS = st.lists(st.builds(place, st.floats(-3.0, 3.0), st.sampled_from(NODES)), min_size=1, max_size=3)
SPEEDS = st.sampled_from(((), (Goal(1, "speed", 1.0, 0.0, 9.0),), (Goal(2, "time", 0.1, -1.0, 1.0),)))


@given(WORLDS, GOALS, SPEEDS)
def test_what_passes_would_pass_a_close_look_and_is_noted_the_same(
    world: World, goals: list[Goal], speeds: tuple[Goal, ...]
) -> None:
    quick, close = Made(world), Made(world)
    exchange = order((*goals, *speeds))
    if not quick.gate.passes(exchange):
        assert quick.told == []  # nothing is noted of what may not leave
        assert quick.passes_closely(exchange) == close.passes_closely(exchange)
        assert quick.told == close.told
        return
    assert close.passes_closely(exchange)
    assert quick.told == close.told
    if world.guarded:
        assert quick.told == [(goal.node, True) for goal in goals]


@given(WORLDS, GOALS)
def test_what_is_not_sure_is_always_looked_at_closely(world: World, goals: list[Goal]) -> None:
    made = Made(world)
    assert not made.gate.passes(Exchange(b"\x01", effect=Effect.MOTION, goals=tuple(goals)))
    assert made.told == []


FINE = World(frozenset((1,)), True, 5.0, {1: Seen(0.1, 0.0, None)}, frozenset(), "none", False)


@pytest.mark.parametrize("guarded", [frozenset((1,)), frozenset[int]()])
@pytest.mark.parametrize("lease", LEASES)
def test_a_lease_lets_pass_as_a_close_look_would(guarded: frozenset[int], lease: str) -> None:
    world = FINE._replace(guarded=guarded, lease=lease)
    passes = Made(world).gate.passes(order((place(0.5),)))
    assert passes == Made(world).passes_closely(order((place(0.5),)))
    assert passes == (lease not in ("free", "lost"))


def test_it_is_noted_once_for_each_goal_and_not_where_nobody_sends_it() -> None:
    made = Made(FINE)
    assert made.gate.passes(order((place(0.5),)))
    assert made.told == [(1, True)]
    assert made.gate.rehearsing().passes(order((place(0.5),)))
    assert made.told == [(1, True)]


@pytest.mark.parametrize(
    "world",
    [
        FINE._replace(faults=frozenset((1,))),
        FINE._replace(measured=False),
        FINE._replace(seen={}),
        FINE._replace(seen={1: Seen(FRESH + 0.1, 0.0, None)}),
        FINE._replace(seen={1: Seen(0.1, 2.0, -2.0)}),  # where no motor can have come so quickly
        FINE._replace(seen={1: Seen(0.1, -1.0, None)}, step=0.2),
        FINE._replace(guarded=frozenset((2,))),
    ],
)
def test_what_is_in_doubt_does_not_pass_the_quick_way(world: World) -> None:
    made = Made(world)
    assert not made.gate.passes(order((place(0.5),)))
    assert made.told == []


@pytest.mark.parametrize("value", [2.1, -2.1, nan])
def test_a_goal_outside_its_bounds_does_not_pass_the_quick_way(value: float) -> None:
    assert not Made(FINE).gate.passes(order((place(value),)))


def test_a_lease_is_judged_by_robot_time() -> None:
    """The clock shows 10 s, robot time began at 3 s of it, and the lease was taken when that was 6.9 s."""
    gate = Gate()
    gate.watch({}, lambda: NOW)
    gate.origin, gate.lease = 3.0, Lease(0.5)
    gate.lease.take("me", NOW - gate.origin - 0.1)
    order = Aimed(b"!", Aim((), lambda _: (), lambda _: None), ())
    assert gate.passes(order)
    gate.origin = 1.0
    assert not gate.passes(order)
