"""One warm body: the figure it was made from, and its limits."""

from __future__ import annotations

from math import inf

import pytest

from motorbus.families.feetech.simulator import thermal


def test_half_the_stall_torque_for_ten_minutes_is_15_degrees() -> None:
    # SO-ARM100#134: 1.5 kg at 10 cm, 15 of 30 kg·cm
    end = thermal.end(25.0, 0.5)
    assert thermal.after(600.0, 25.0, end) == pytest.approx(40.0, abs=0.01)
    assert thermal.after(4200.0, 25.0, end) == pytest.approx(40.8, abs=0.05)  # and there it stays


def test_the_sign_of_the_torque_is_of_no_account() -> None:
    assert thermal.end(25.0, -0.5) == thermal.end(25.0, 0.5)


def test_two_steps_are_as_one() -> None:
    once = thermal.after(1000.0, 30.0, 80.0)
    assert thermal.after(700.0, thermal.after(300.0, 30.0, 80.0), 80.0) == pytest.approx(once, rel=1e-12)


def test_after_its_lag_it_has_gone_63_percent_of_the_way() -> None:
    assert thermal.after(thermal.LAG, 0.0, 100.0) == pytest.approx(63.212, abs=0.001)


@pytest.mark.parametrize(("begin", "end", "limit"), [(30.0, 100.0, 70.0), (90.0, 30.0, 65.0)])
def test_the_moment_of_a_limit_is_when_it_is_there(begin: float, end: float, limit: float) -> None:
    assert thermal.after(thermal.until(limit, begin, end), begin, end) == pytest.approx(limit, rel=1e-12)


def test_by_hand() -> None:
    # from 30 towards 110: 70 is half of the way, ln 2 of the lag
    assert thermal.until(70.0, 30.0, 110.0) == pytest.approx(138.629, abs=0.001)


@pytest.mark.parametrize(
    ("begin", "end", "limit", "when"),
    [
        (30.0, 60.0, 70.0, inf),
        (30.0, 70.0, 70.0, inf),
        (80.0, 100.0, 70.0, inf),
        (70.0, 100.0, 70.0, 0.0),
        (60.0, 90.0, 50.0, inf),
    ],
)
def test_never_and_now(begin: float, end: float, limit: float, when: float) -> None:
    assert thermal.until(limit, begin, end) == when
