"""An axis: its positions become angles of its device and come back, and its limits hold on both sides."""

from __future__ import annotations

from math import inf, isclose, isnan, nan, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.motion.machine import AxisSpec
from motorbus.motion.machine.model import FARTHEST, number
from tests.motion.machine.files import axes, axis

POSITIONS = st.floats(-1000, 1000)


@pytest.mark.parametrize(
    ("spec", "position", "angle"),
    [
        (axis(), 1.0, 1.0),
        (axis(zero=pi), 0.0, pi),
        (axis(zero=pi, sign=-1), 0.5, pi - 0.5),
        (axis(gear=3.0), pi / 2, 3 * pi / 2),
        (axis(zero=1.0, sign=-1, gear=2.0), -0.5, 2.0),
        (axis(travel=0.005), 0.005, 2 * pi),
        (axis(travel=0.005, gear=4.0, sign=-1, zero=1.0), 0.01, 1.0 - 16 * pi),
    ],
)
def test_a_position_is_an_angle_of_the_device(spec: AxisSpec, position: float, angle: float) -> None:
    assert spec.to_device(position) == pytest.approx(angle)
    assert spec.from_device(angle) == pytest.approx(position)


@given(axes(), POSITIONS)
def test_a_position_comes_back(spec: AxisSpec, position: float) -> None:
    angle = spec.to_device(position)
    lost = 1e-15 * (abs(angle) + abs(spec.zero)) / abs(spec.ratio)
    assert isclose(spec.from_device(angle), position, rel_tol=1e-14, abs_tol=max(4 * lost, 1e-300))


@given(axes(), POSITIONS)
def test_a_rate_comes_back(spec: AxisSpec, rate: float) -> None:
    assert isclose(spec.rate_from_device(spec.rate_to_device(rate)), rate, rel_tol=1e-14, abs_tol=1e-300)


@given(axes(), POSITIONS, POSITIONS)
def test_a_rate_is_what_positions_change_by(spec: AxisSpec, start: float, way: float) -> None:
    turned = spec.to_device(start + way) - spec.to_device(start)
    rounding = 1e-14 * (abs(spec.zero) + (abs(start) + abs(way)) * abs(spec.ratio))
    assert isclose(spec.rate_to_device(way), turned, rel_tol=1e-12, abs_tol=rounding)


@given(axes(), st.floats(0, 1))
def test_what_the_limits_allow_is_between_those_of_the_device(spec: AxisSpec, part: float) -> None:
    if spec.low is None or spec.high is None:
        assert spec.device_limits is None
        return
    assert spec.device_limits is not None
    low, high = spec.device_limits
    angle = spec.to_device(spec.low + (spec.high - spec.low) * part)
    slack = 1e-12 * (1 + abs(low) + abs(high))
    assert low <= high
    assert low - slack <= angle <= high + slack


def test_a_device_that_turns_the_other_way_has_its_limits_exchanged() -> None:
    assert axis(sign=-1, low=-1.0, high=2.0).device_limits == (-2.0, 1.0)


@given(axes())
def test_a_limit_that_went_to_the_device_and_came_back_is_still_allowed(spec: AxisSpec) -> None:
    spec = axis(sign=spec.sign, gear=spec.gear, zero=1.0, low=-1.0, high=1.0)
    for limit in (-1.0, 1.0):
        assert spec.allows(spec.from_device(spec.to_device(limit)))


@pytest.mark.parametrize(
    ("position", "allowed"),
    [(-1.0, True), (2.0, True), (2.001, False), (-1.001, False), (nan, False), (inf, False)],
)
def test_limits_allow_what_is_between_them(position: float, allowed: bool) -> None:
    assert axis(low=-1.0, high=2.0).allows(position) is allowed


@pytest.mark.parametrize(
    ("position", "allowed"), [(FARTHEST, True), (1.1 * FARTHEST, False), (nan, False), (-inf, False)]
)
def test_without_limits_all_that_a_file_could_say_is_allowed(position: float, allowed: bool) -> None:
    assert axis().allows(position) is allowed


def test_what_is_not_finite_stays_so() -> None:
    assert isnan(axis(zero=1.0).to_device(nan))
    assert axis(sign=-1).to_device(inf) == -inf
    assert isnan(axis().from_device(nan))


def test_a_device_has_a_bus_and_an_id() -> None:
    assert (axis(device="arm#0x25").bus, axis(device="arm#0x25").node) == ("arm", 37)
    assert [number(text) for text in ("7", "007", "0X1f")] == [7, 7, 31]


@pytest.mark.parametrize(
    ("spec", "said", "position", "shown"),
    [
        (axis(), "90 deg", pi / 2, "90.0 deg"),
        (axis(unit="rad"), "0.5", 0.5, "0.5000 rad"),
        (axis(unit="turn"), "1 turn", 2 * pi, "1.000 turn"),
        (axis(travel=0.005, unit="mm"), "12.5 mm", 0.0125, "12.50 mm"),
        (axis(travel=0.005, unit="m"), "0.5", 0.5, "0.5000 m"),
    ],
)
def test_people_see_and_say_positions_in_their_unit(
    spec: AxisSpec, said: str, position: float, shown: str
) -> None:
    assert spec.parse(said) == pytest.approx(position)
    assert spec.show(position) == shown


def test_nothing_has_no_sign() -> None:
    assert (axis().show(-0.0), axis().show(-0.0001), axis().show(-0.01)) == ("0.0 deg", "0.0 deg", "-0.6 deg")


def test_a_length_is_no_position_of_an_axis_that_turns() -> None:
    with pytest.raises(RequestError, match="measures length"):
        axis().parse("5 mm")
    with pytest.raises(RequestError, match="measures position"):
        axis(travel=0.005, unit="mm").parse("5 deg")
