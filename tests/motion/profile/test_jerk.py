"""The follower with limited jerk, where ruckig is; and where it is not, one message with the line that installs it.

There is no wheel of ruckig for Linux on ARM, so no dependency list asks for it there. What is to be judged is then the
message.
"""

from __future__ import annotations

import sys
from importlib.util import find_spec
from itertools import pairwise
from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import MotorbusError, RequestError
from motorbus.motion.profile import Follower, Limits, follower
from tests.motion.profile import followers
from tests.motion.profile.followers import PERIOD, Chase, chase, chases, limits

USUAL = Limits(1.0, 4.0)
JERK = 50.0
HERE = find_spec("ruckig") is not None
"""Whether it can be judged; the message can always be."""


def made(start: float, may: Limits) -> Follower:
    """A follower with limited jerk, or the other one where there is none: what they share holds of both."""
    return follower(start, may, jerk=JERK if HERE else None)


@given(st.floats(-10, 10), limits, chases)
def test_it_follows_gently_whatever_the_goals_do(start: float, may: Limits, goals: Chase) -> None:
    one = made(start, may)
    seen = chase(one, goals)
    followers.assert_gentle(seen, goals, may, min(may.acceleration, may.braking) if HERE else inf)
    followers.settle(one)


def test_acceleration_does_not_jump() -> None:
    one = made(0.0, USUAL)
    jerk = JERK if HERE else inf
    rates = [velocity for _, velocity in chase(one, [(1.0, 40), (-1.0, 30), (0.3, 60)])]
    gains = [(after - before) / PERIOD for before, after in pairwise(rates)]
    assert max(map(abs, gains)) > 1.0
    for before, after in pairwise([0.0, *gains]):
        assert abs(after - before) <= jerk * PERIOD * (1 + 1e-6)


def test_nonsense_is_refused() -> None:
    followers.assert_refuses_nonsense(made(0.0, USUAL))


def test_a_reset_starts_again() -> None:
    followers.assert_starts_again(made(0.0, USUAL))


@pytest.mark.parametrize("jerk", [0.0, -1.0, nan, inf])
def test_a_jerk_is_finite_and_above_nothing(jerk: float) -> None:
    with pytest.raises(RequestError if HERE else MotorbusError, match="jerk"):
        follower(0.0, USUAL, jerk=jerk)


def test_without_ruckig_it_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ruckig", None)
    with pytest.raises(MotorbusError, match="ruckig is not installed") as missing:
        follower(0.0, USUAL, jerk=JERK)
    assert "pip install 'motorbus[ruckig]'" in missing.value.advice
    assert "Linux for ARM" in missing.value.cause
    assert follower(0.0, USUAL).step(0.1, 1.0) > 0


def test_braking_keeps_within_the_jerk() -> None:
    one = made(0.0, USUAL)
    chase(one, [(5.0, 40)])
    here, quick = one.position, one.velocity
    one.halt()
    seen = chase(one, [(one.goal, 400)])
    assert one.goal > here + quick * quick / (2 * USUAL.acceleration) - 1e-9
    assert max(place for place, _ in seen) <= one.goal + 1e-9
    assert one.arrived
