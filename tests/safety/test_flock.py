"""Judged in one pass or one by one, it comes to the same: what passes, who is told, and what is known of each then."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from math import nan
from random import Random
from typing import Any, NamedTuple

import pytest

from motorbus.core.aimed import Aim, Aimed
from motorbus.core.operation import Answer, Effect, Exchange, Goal
from motorbus.motion.safety.flock import FLOCKS, Flock, Flocks
from motorbus.motion.safety.gate import Gate
from motorbus.motion.safety.guard import Bounds, Guard
from motorbus.motion.safety.lease import Lease
from motorbus.motion.safety.track import FRESH, Sample

NODES = (1, 2, 3)
NARROW, WIDE = Bounds(-0.5, 0.5, 0.2, 1.0), Bounds(-2.0, 2.0, 5.0, 3.0)


class Sure(Exchange[None]):
    """An order as sure as an `Aimed`, of which nothing is known beforehand: so its goals are judged one by one."""

    sure = True


class Order(NamedTuple):
    """Somebody orders these to go there (rad); with a goal that is none of a place, or lies outside the limits."""

    to: dict[int, float]
    other: str


class Reading(NamedTuple):
    """These tell where they are (rad), in one answer or each in its own, so old (s)."""

    here: dict[int, float]
    together: bool
    age: float


class Change(NamedTuple):
    """So many seconds go by, and what is said of one of them changes: its guard, its fault, or the lease of all."""

    seconds: float
    what: str
    node: int


class Made:
    """A gate with guards over all but perhaps one, and what came of all that happened to it."""

    def __init__(self, quick: bool, without: int | None) -> None:
        self.quick = quick
        self.now = 10.0
        self.gate = gate = Gate()
        self.told: list[tuple[int, bool]] = []
        self.heard: dict[int, tuple[Exchange[Any], Answer]] = {}
        self.aims: dict[tuple[int, ...], Aim] = {}
        self.goals: tuple[Goal, ...] = ()
        gate.watch(self.heard, lambda: self.now)
        for node in NODES:
            if node != without:
                gate.guards[node] = self.guard(node, WIDE)

    def guard(self, node: int, bounds: Bounds, measures: bool = True) -> Guard:
        told = {"ordered": lambda moves: self.told.append((node, moves))} if node != 3 else {}
        return Guard(f"n{node}", bounds, measures=measures, **told)  # type: ignore[arg-type]

    def takes(self, event: Order | Reading | Change) -> bool | None:
        if isinstance(event, Reading):
            self._reads(event)
            return None
        if isinstance(event, Change):
            self._changes(event)
            return None
        goals = tuple(
            _goal(node, to, event.other if place == 1 else "") for place, (node, to) in _numbered(event)
        )
        if not self.quick:
            return self.gate.passes(Sure(b"\x01", (), effect=Effect.MOTION, goals=goals))
        self.goals = goals
        aim = self.aims.setdefault(
            tuple(event.to), Aim(tuple(event.to), lambda _: self.goals, lambda _: None)
        )
        return self.gate.passes(Aimed(b"\x01", aim, ()))

    def _reads(self, event: Reading) -> None:
        answer = Answer((), (), self.now - event.age)
        for node, here in event.here.items():
            where: Any = (
                (lambda _: event.here) if event.together else (lambda _, node=node, here=here: {node: here})
            )
            one = answer if event.together else Answer((), (node,), answer.at)
            self.heard[node] = Exchange(b"?", tells_position=where), one

    def _changes(self, event: Change) -> None:
        self.now += event.seconds
        gate, node = self.gate, event.node
        if event.what in ("narrow", "wide", "unmeasured"):
            gate.guards[node] = self.guard(
                node, NARROW if event.what == "narrow" else WIDE, event.what != "unmeasured"
            )
        elif event.what == "gone":
            gate.guards.pop(node, None)
        elif event.what == "fault":
            gate.faults[node] = "worn"
        elif event.what == "mended":
            gate.faults.clear()
        elif event.what == "forgotten":
            gate.forget()
        elif event.what in ("lease", "no lease"):
            gate.lease = Lease(0.5) if event.what == "lease" else None
        elif event.what == "beat" and gate.lease is not None and not gate.lease.losses:
            gate.lease.take("me", self.now)

    def known(self) -> dict[int, tuple[Sample | None, Sample | None, bool]]:
        found = {}
        for node, guard in self.gate.guards.items():
            heard = self.heard.get(node)
            taken = heard is not None and guard.answer is heard[1]
            track = guard.track
            found[node] = (None, None, taken) if track is None else (track.sample, track.suspect, taken)
        return found


def _numbered(event: Order) -> list[tuple[int, tuple[int, float]]]:
    return list(enumerate(event.to.items()))


def _goal(node: int, to: float, other: str) -> Goal:
    if other == "speed":
        return Goal(node, "speed", 1.0, 0.0, 9.0)
    if other == "unlimited":
        return Goal(node, "position", to)
    if other == "outside":
        return Goal(node, "position", to, to + 0.1, to + 0.2)
    return Goal(node, "position", to, -3.0, 3.0)


CHANGES = ("narrow", "unmeasured", "gone", "fault", "forgotten", "lease", "beat")
MENDING = (Change(0.0, "mended", 1), Change(0.0, "no lease", 1))
OTHERS = ("speed", "unlimited", "outside")


def drawn(random: Random) -> Order | Reading | Change:
    """What happens next; as a rule a cycle of a loop goes on as the one before."""
    places = {node: random.choice(NEARBY) for node in NODES}
    what = random.random()
    if what < 0.45:
        return Order(places, "")
    if what < 0.75:
        return Reading(places, True, random.choice((0.0, 0.0, 0.0, 0.03)))
    if what < 0.85:
        return Change(random.choice((0.001, 0.01, 0.2, FRESH, FRESH + 0.01)), "", 1)
    node = random.choice(NODES)
    if what < 0.88:
        return Order(places | {node: random.choice(AWAY)}, random.choice(("", "", *OTHERS)))
    if what < 0.9:
        return Order({node: 0.0}, "")
    if what < 0.95:
        here = places if random.random() < 0.5 else {node: random.choice((*NEARBY, *AWAY, nan))}
        return Reading(
            here | {node: random.choice(AWAY)}, random.random() < 0.5, random.choice((0.0, 0.1, FRESH))
        )
    if what < 0.98:
        return random.choice((*MENDING, *(Change(0.0, "wide", one) for one in NODES)))
    return Change(0.0, random.choice(CHANGES), node)


NEARBY = (0.0, 0.002, -0.003, 0.004)
AWAY = (0.15, 0.3, -0.45, 1.2, -1.9, 2.4, -5.5)


def test_in_one_pass_it_comes_to_the_same_as_one_by_one(rounds: Callable[[int], int]) -> None:
    passed: Counter[bool | None] = Counter()
    for seed in range(max(1, rounds(10_000) // 10)):
        random = Random(seed)
        without = random.choice((None, None, None, *NODES))
        quick, slow = Made(True, without), Made(False, without)
        for _ in range(30):
            event = drawn(random)
            found = quick.takes(event)
            assert found == slow.takes(event), (seed, event)
            assert quick.told == slow.told, (seed, event)
            assert repr(quick.known()) == repr(slow.known()), (
                seed,
                event,
            )  # by what is said, for nan is not nan
            passed[found] += 1
    assert min(passed[True], passed[False]) > passed.total() / 20, passed


def flock() -> tuple[Made, Aim]:
    made = Made(True, None)
    made.takes(Reading(dict.fromkeys(NODES, 0.0), True, 0.0))
    assert made.takes(Order(dict.fromkeys(NODES, 0.1), ""))
    return made, made.aims[NODES]


def test_it_is_laid_out_once_and_anew_when_a_guard_is_another() -> None:
    made, aim = flock()
    flocks, guards = Flocks(), made.gate.guards
    first = flocks.of(aim, guards)
    assert isinstance(first, Flock)
    assert flocks.of(aim, guards) is first
    guards[2] = made.guard(2, NARROW)
    second = flocks.of(aim, guards)
    assert second is not first
    assert flocks.of(aim, guards) is second


@pytest.mark.parametrize("what", ["gone", "unmeasured"])
def test_there_is_none_where_one_has_no_guard_or_does_not_tell_where_it_is(what: str) -> None:
    made, aim = flock()
    made.takes(Change(0.0, what, 3))
    assert Flocks().of(aim, made.gate.guards) is None


def test_there_is_none_for_an_order_that_is_made_for_once() -> None:
    assert Flocks().of(None, {}) is None


def test_who_makes_a_new_aim_for_each_order_does_not_fill_the_memory() -> None:
    made, _ = flock()
    flocks, guards = Flocks(), made.gate.guards
    aims = [Aim(NODES, lambda _: (), lambda _: None) for _ in range(FLOCKS + 1)]
    first = flocks.of(aims[0], guards)
    for aim in aims[1:]:
        flocks.of(aim, guards)
    assert flocks.of(aims[0], guards) is not first


def test_only_who_wants_to_know_is_told() -> None:
    made, _ = flock()
    assert made.told == [(1, True), (2, True)]
