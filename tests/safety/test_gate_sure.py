"""The quick way of a gate, case by case: who is told, when what was heard is fetched, and what it is not for.

And what rounding adds to a limit, which the quick way leaves to the close look.
"""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.core.aimed import Aim, Aimed
from motorbus.core.operation import Answer, Effect, Exchange, Goal
from motorbus.errors import LimitExceeded
from motorbus.motion.safety.gate import Gate
from motorbus.motion.safety.guard import Bounds, Guard

NOW = 10.0
GOALS = tuple(Goal(node, "position", 0.1 * node, -3.0, 3.0) for node in (1, 2))


class Sure(Exchange[None]):
    """As sure as what a loop orders again and again, and made for once."""

    sure = True


def made_for_once(*goals: Goal) -> Sure:
    return Sure(b"\x01", effect=Effect.MOTION, goals=goals)


def made_again_and_again(*goals: Goal) -> Aimed:
    return Aimed(b"\x01", Aim([goal.node for goal in goals], lambda _: goals, lambda _: None), ())


class Watched:
    """A gate over two devices that have told where they are; the telling is fetched when the gate asks for it."""

    def __init__(self) -> None:
        self.gate = gate = Gate()
        self.told: list[tuple[int, bool]] = []
        self.fetched = 0
        self.heard: dict[int, tuple[Exchange[Any], Answer]] = {}
        gate.watch(self.heard, lambda: NOW, tell=self.fetch)
        for node in (1, 2):
            gate.guards[node] = Guard(
                f"n{node}",
                Bounds(-2.0, 2.0, 1.0, 3.0),
                ask=lambda: Exchange(b"?"),
                ordered=lambda moves, node=node: self.told.append((node, moves)),  # type: ignore[misc]
            )

    def fetch(self) -> None:
        self.fetched += 1
        answer = Answer((), (1, 2), NOW)
        self.heard.update(
            dict.fromkeys((1, 2), (Exchange(b"?", tells_position=lambda _: {1: 0.0, 2: 0.0}), answer))
        )


ORDERS = pytest.mark.parametrize("order", [made_for_once(*GOALS), made_again_and_again(*GOALS)])


@ORDERS
def test_whoever_set_the_guards_is_told_once_each(order: Exchange[Any]) -> None:
    watched = Watched()
    assert watched.gate.passes(order)
    assert watched.told == [(1, True), (2, True)]


@ORDERS
def test_nobody_is_told_of_what_nobody_sends(order: Exchange[Any]) -> None:
    watched = Watched()
    assert watched.gate.rehearsing().passes(order)
    assert watched.told == []


@ORDERS
def test_what_was_heard_last_is_fetched_before_it_is_judged(order: Exchange[Any]) -> None:
    watched = Watched()
    assert watched.gate.passes(order)
    assert watched.fetched == 1


def test_what_was_heard_last_is_fetched_before_anybody_is_asked_and_before_a_close_look() -> None:
    watched = Watched()
    order = Exchange[None](b"\x01", effect=Effect.MOTION, goals=GOALS)
    assert watched.gate.look(order) == []
    assert watched.fetched == 1
    watched.gate(order)
    assert watched.fetched == 2


def test_a_watch_without_one_keeps_who_fetches() -> None:
    watched = Watched()
    watched.gate.watch(watched.heard, lambda: NOW)
    assert watched.gate.passes(made_for_once(*GOALS))
    assert watched.fetched == 1


def test_what_is_not_sure_never_takes_the_quick_way() -> None:
    watched = Watched()
    assert not watched.gate.passes(Exchange(b"\x01", effect=Effect.MOTION, goals=GOALS))
    assert not Gate().passes(Exchange(b"\x01", effect=Effect.MOTION, goals=GOALS))
    assert (watched.told, watched.fetched) == ([], 0)


@pytest.mark.parametrize("attended", [False, True])
def test_without_guards_all_that_is_sure_passes_but_where_somebody_must_attend(attended: bool) -> None:
    gate = Gate()
    gate.attended = attended
    assert gate.passes(made_for_once(*GOALS)) is not attended


@pytest.mark.parametrize(("beyond", "passes"), [(0.9e-9, True), (1.1e-9, False)])
@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_what_rounding_adds_to_a_limit_passes_and_no_more(beyond: float, passes: bool, way: float) -> None:
    order = Exchange[None](
        b"!", effect=Effect.MOTION, goals=(Goal(1, "position", way * (1.0 + beyond), -1.0, 1.0),)
    )
    if passes:
        Gate()(order)
        return
    with pytest.raises(LimitExceeded, match="lies outside"):
        Gate()(order)
