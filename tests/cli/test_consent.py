"""A way of more than 180 degrees needs agreement, whichever command sends the goal."""

from __future__ import annotations

import math

import pytest

import motorbus
from motorbus.cli.consent import consent_to, consent_to_ways, goals_among
from motorbus.cli.exits import NeedsConsent, Unforeseeable
from motorbus.cli.output import Output
from motorbus.errors import LimitExceeded
from motorbus.families.feetech import Servo
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run

FAR = [
    ["move", "BUS#1=300deg"],
    ["write", "BUS#1", "goal_position=300deg"],
    ["write", "BUS#1", "goal_position=3413raw", "--expert"],
]


@pytest.fixture
def aside(arm: Simulation) -> Simulation:
    """The arm with servo 1 at 30 degrees."""
    with motorbus.open(arm.url) as bus:
        Servo(bus, 1).move(math.radians(30))
    return arm


@pytest.mark.parametrize("words", FAR, ids=" ".join)
def test_a_long_way_needs_agreement(words: list[str], run: Run, aside: Simulation) -> None:
    before = aside[1].memory["goal_position"], aside[1].status()
    spoken = [word.replace("BUS", aside.url) for word in words]
    ran = run(*spoken)
    assert (ran.code, ran.out) == (8, "")
    assert "move #1 by 270 degrees" in ran.err
    assert (aside[1].memory["goal_position"], aside[1].status()) == before
    assert run(*spoken, "--dry-run").code == 0
    assert (aside[1].memory["goal_position"], aside[1].status()) == before
    assert run(*spoken, "--yes").code == 0


def test_only_angles_that_move_are_ways(arm: Simulation) -> None:
    with motorbus.open(arm.url) as bus:
        one = Servo(bus, 1)
        one.identify()
        assert one.table is not None
        values = {"goal_position": 1.0, "goal_velocity": 9.0, "min_position_limit": 0.0}
        assert goals_among(one, [one.table[name] for name in values], values) == [(one, 1.0)]


def test_the_border_is_half_a_turn(arm: Simulation) -> None:
    with motorbus.open(arm.url) as bus:
        one = Servo(bus, 1)
        here = one.position()
        consent_to_ways([(one, here + math.pi), (one, here - 3.0)], Output(), yes=False)
        consent_to_ways([(one, here + 4.0)], Output(), yes=True)
        with pytest.raises(NeedsConsent, match="#1 by 229 degrees"):
            consent_to_ways([(one, here + 4.0)], Output(), yes=False)


def test_what_would_be_refused_anyway_is_told_before_anybody_is_asked(arm: Simulation) -> None:
    def rehearse() -> None:
        raise LimitExceeded("too far")

    with motorbus.open(arm.url) as bus:
        one = Servo(bus, 1)
        here = one.position()
        with pytest.raises(LimitExceeded):
            consent_to_ways([(one, here + 4.0)], Output(), yes=False, rehearse=rehearse)
        consent_to_ways([(one, here + 1.0)], Output(), yes=False, rehearse=rehearse)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("write BUS#1 goal_position=400deg", "lies outside"),
        ("write BUS#1 id=4", "may lose it"),
    ],
)
def test_nobody_is_asked_about_what_is_refused_anyway(
    words: str, says: str, run: Run, arm: Simulation
) -> None:
    ran = run(*words.replace("BUS", arm.url).split())
    assert ran.code == (2 if "id=" in words else 8)
    assert says in ran.err
    assert "nobody agreed" not in ran.err


def test_what_cannot_be_foreseen_is_no_refusal() -> None:
    def rehearse() -> None:
        raise Unforeseeable("an answer decides")

    with pytest.raises(NeedsConsent, match="save it"):
        consent_to("save it", Output(), yes=False, rehearse=rehearse)
    consent_to("save it", Output(), yes=True, rehearse=rehearse)
