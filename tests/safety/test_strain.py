"""It takes current or load, distance and time together; heat needs nothing else."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.family import State
from motorbus.errors import RequestError
from motorbus.motion.safety.strain import SECONDS, USUAL, Bearable, Strain, Verdict

HARD: dict[str, Any] = {"load": 0.95, "position": 0.0}


def after(*samples: State, goal: float | None = 1.0) -> Verdict:
    strain = Strain()
    for sample in samples:
        strain.take(sample, goal)
    return strain.verdict


def test_a_moment_is_nothing_and_a_while_is_too_long() -> None:
    assert after(State(0.0, **HARD)) is Verdict.STRAINED
    assert after(State(0.0, **HARD), State(0.9, **HARD)) is Verdict.STRAINED
    assert after(State(0.0, **HARD), State(SECONDS, **HARD)) is Verdict.OVERLOADED


@pytest.mark.parametrize("sample", [{"load": -1.0}, {"current": 3.0}, {"current": -2.5}, {"load": 0.8}])
def test_either_sign_and_either_quantity_counts(sample: dict[str, Any]) -> None:
    assert after(*(State(at, position=0.0, **sample) for at in (0.0, 1.0))) is Verdict.OVERLOADED


@pytest.mark.parametrize(
    ("sample", "goal"),
    [
        ({"load": 1.0, "position": 0.95}, 1.0),
        ({"load": 0.5, "current": 1.0, "position": 0.0}, 1.0),
        ({"load": 1.0, "position": 0.0}, None),
        ({"load": 1.0}, 1.0),
        ({"position": 0.0}, 1.0),
        ({"load": nan, "current": nan, "position": nan}, 1.0),
    ],
)
def test_what_arrives_or_pushes_less_or_has_no_goal_is_easy(
    sample: dict[str, Any], goal: float | None
) -> None:
    assert after(State(0.0, **sample), State(9.0, **sample), goal=goal) is Verdict.EASY


@pytest.mark.parametrize(
    ("easy", "hard"),
    [
        ({"load": 0.7}, {"load": 0.9}),
        ({"current": 2.1}, {"current": 2.9}),  # a servo protects itself above 3.25 A, and drops its load then
        ({"load": 0.95, "position": 0.92}, {"load": 0.95, "position": 0.88}),
        ({"current": 2.9, "position": 1.08}, {"current": 2.9, "position": 1.12}),
        ({"load": 0.95, "velocity": 0.6}, {"load": 0.95, "velocity": 0.4}),
        ({"load": 0.95, "velocity": -0.6}, {"load": 0.95, "velocity": -0.4}),
    ],
)
def test_how_much_is_too_much_when_nobody_says_it(easy: dict[str, Any], hard: dict[str, Any]) -> None:
    mild, harsh = ({"position": 0.0, **sample} for sample in (easy, hard))
    assert after(*(State(at, **mild) for at in (0.0, 9.0))) is Verdict.EASY
    assert after(*(State(at, **harsh) for at in (0.0, 0.8))) is Verdict.STRAINED
    assert after(*(State(at, **harsh) for at in (0.0, 1.2))) is Verdict.OVERLOADED


def test_the_last_sample_is_kept_whatever_it_says() -> None:
    strain, easy, hard = Strain(), State(0.0, load=0.1, position=0.0), State(1.0, **HARD)
    kept = [strain.sample]
    for sample, goal in ((easy, 1.0), (hard, 1.0), (easy, None)):
        strain.take(sample, goal)
        kept.append(strain.sample)
    assert kept == [None, easy, hard, easy]


def test_one_easy_sample_in_between_begins_anew() -> None:
    easy = State(0.5, load=0.1, position=0.0)
    assert after(State(0.0, **HARD), easy, State(1.0, **HARD), State(1.9, **HARD)) is Verdict.STRAINED


def test_an_overload_stays_until_somebody_has_seen_to_it() -> None:
    strain = Strain()
    for at in (0.0, 1.0):
        strain.take(State(at, **HARD), 1.0)
    assert strain.take(State(2.0, load=0.0, position=1.0), 1.0) is Verdict.OVERLOADED
    strain.reset()
    assert strain.verdict is Verdict.EASY
    assert strain.take(State(3.0, **HARD), 1.0) is Verdict.STRAINED


def test_heat_stays_until_it_has_cooled_down() -> None:
    strain = Strain()
    verdicts = [
        strain.take(State(float(at), temperature=degrees), None)
        for at, degrees in enumerate((64.9, 65.0, 62.0, 60.0, 59.9))
    ]
    assert verdicts == [Verdict.EASY, Verdict.HOT, Verdict.HOT, Verdict.HOT, Verdict.EASY]


def test_a_reset_does_not_cool_it() -> None:
    strain = Strain()
    strain.take(State(0.0, temperature=80.0), None)
    strain.reset()
    assert strain.verdict is Verdict.HOT


def test_what_nobody_minds_is_never_too_much() -> None:
    strain = Strain(Bearable(load=inf, current=inf, hot=inf))
    for at in (0.0, 9.0):
        assert (
            strain.take(State(at, load=1.0, current=9.0, position=0.0, temperature=99.0), 1.0) is Verdict.EASY
        )


@pytest.mark.parametrize(
    "bearable",
    [
        Bearable(load=0.0),
        Bearable(off=-1.0),
        Bearable(seconds=inf),
        Bearable(current=nan),
        Bearable(hot=50.0),
    ],
)
def test_impossible_figures_are_refused(bearable: Bearable) -> None:
    with pytest.raises(RequestError, match="nothing that a motor could bear"):
        Strain(bearable)


@given(st.lists(st.tuples(st.floats(0.01, 0.5), st.booleans()), max_size=40))
def test_it_is_overloaded_exactly_when_it_lasted(steps: list[tuple[float, bool]]) -> None:
    strain, at, since, lasted = Strain(), 0.0, inf, False
    for seconds, hard in steps:
        at += seconds
        since = min(since, at) if hard else inf
        lasted = lasted or at - since >= USUAL.seconds
        sample = State(at, load=0.9 if hard else 0.2, position=0.0)
        assert (strain.take(sample, 1.0) is Verdict.OVERLOADED) == lasted
