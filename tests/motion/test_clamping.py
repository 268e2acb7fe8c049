"""Who asks for it has goals brought within their limits, and hears of each."""

from __future__ import annotations

from math import inf, nan, radians
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import LimitExceeded, RequestError
from motorbus.motion import limits
from motorbus.motion.clamping import SPAN, Clamped, Tidings, check_policy, kept
from motorbus.motion.machine import AxisSpec

SPEC = AxisSpec(
    device="arm#1", unit="deg", low=-1.0, high=2.0, max_velocity=1.0, max_acceleration=4.0, max_step=0.5
)


def clamped(goal: float, **options: Any) -> tuple[float, Clamped | None]:
    return kept("elbow", SPEC, goal, policy="clamp", **options)


@pytest.mark.parametrize("goal", [-1.0, 0.3, 2.0])
def test_what_is_allowed_stays_as_it_is_and_nothing_is_told(goal: float) -> None:
    assert clamped(goal) == kept("elbow", SPEC, goal) == (goal, None)


def test_as_a_rule_what_goes_too_far_is_refused() -> None:
    with pytest.raises(LimitExceeded, match="elbow"):
        kept("elbow", SPEC, 2.1)
    with pytest.raises(LimitExceeded, match="one command may be"):
        kept("elbow", SPEC, 1.0, measured=0.0)


@pytest.mark.parametrize(
    ("goal", "measured", "given", "reason"),
    [
        (2.1, None, 2.0, "limits"),
        (-9.0, None, -1.0, "limits"),
        (1.0, 0.0, 0.5, "step"),
        (2.3, 1.8, 2.0, "limits"),
        (9.0, 1.0, 1.5, "step"),
        (0.0, 2.8, 2.3, "step"),
    ],
)
def test_who_asks_for_it_gets_the_nearest_that_is_allowed_and_hears_of_it(
    goal: float, measured: float | None, given: float, reason: str
) -> None:
    assert clamped(goal, measured=measured) == (given, Clamped("elbow", goal, given, reason))


def test_the_limits_of_the_device_hold_as_well() -> None:
    assert clamped(2.0, device=(-radians(90), radians(90)))[0] == pytest.approx(radians(90))


@pytest.mark.parametrize("goal", [nan, inf, -inf])
def test_what_is_no_number_is_never_made_into_one(goal: float) -> None:
    with pytest.raises(LimitExceeded, match="its goal is"):
        clamped(goal)


def test_another_policy_is_none() -> None:
    with pytest.raises(RequestError, match="'bend' is no policy"):
        kept("elbow", SPEC, 0.0, policy="bend")  # type: ignore[arg-type]


@given(st.floats(-50, 50), st.floats(-1, 2) | st.none())
def test_what_is_given_is_allowed_and_no_other_allowed_place_is_nearer(
    goal: float, measured: float | None
) -> None:
    given_, told = clamped(goal, measured=measured)
    limits.check_goal("elbow", SPEC, given_, measured=measured)
    assert (told is None) == (given_ == goal)
    low, high = (-1.0, 2.0) if measured is None else (max(-1.0, measured - 0.5), min(2.0, measured + 0.5))
    assert abs(given_ - goal) <= max(low - goal, goal - high, 0.0) + 1e-6


def test_of_many_clamps_of_an_axis_the_first_is_told_and_one_in_a_while() -> None:
    tidings = Tidings()
    one, other = (Clamped(name, 9.0, 2.0, "limits") for name in ("elbow", "wrist"))
    told = [number for number in range(1000) if tidings.worth(one, 3.0 + number * SPAN / 100)]
    assert told == [0, 100, 200, 300, 400, 500, 600, 700, 800, 900]
    assert tidings.worth(other, 3.0)
    assert not tidings.worth(other, 3.0 + 0.9 * SPAN)


def test_there_are_two_policies() -> None:
    check_policy("reject")
    check_policy("clamp")
    for policy in ("", None, "Clamp"):
        with pytest.raises(RequestError, match="is no policy"):
            check_policy(policy)
