"""Velocity, acceleration and bound of the current as bytes beside a goal; a bound never becomes 0 by rounding."""

from __future__ import annotations

from math import tau

import pytest

from motorbus.errors import RequestError
from motorbus.families.feetech.driver.orders import NO_LOAD
from motorbus.families.feetech.driver.pace import burst, ramp_of, speed_at_least
from motorbus.families.feetech.table import HLS, SCS, STS
from tests.families.feetech.maps import met

COUNT = tau / 4096


def test_behind_the_goal_come_time_or_bound_and_velocity() -> None:
    assert burst(met("sts"), STS, 1000 * COUNT, None) == b"\0\0\xe8\3"
    assert burst(met("scs"), SCS, 256 * SCS["goal_velocity"].scale, None) == b"\0\0\1\0"
    assert burst(met("hls"), HLS, 1000 * COUNT, 1.3) == b"\xc8\0\x14\0"


def test_a_velocity_that_rounds_to_0_is_no_maximum() -> None:
    with pytest.raises(RequestError, match="is less than this servo can be told") as caught:
        burst(met("hls"), HLS, 20 * COUNT, 1.3)
    assert "0.0767 to" in caught.value.expected


def test_before_the_goal_comes_the_acceleration_where_there_is_one() -> None:
    assert ramp_of(met("sts"), STS, None) == b"\0"
    assert ramp_of(met("hls"), HLS, 5000 * COUNT) == b"\x32"
    assert ramp_of(met("scs"), SCS, None) == b""
    with pytest.raises(RequestError, match="no acceleration register"):
        ramp_of(met("scs"), SCS, 1.0)


def test_who_follows_goals_is_bound_by_no_less_than_he_was_told() -> None:
    assert speed_at_least(met("sts"), STS, 1000 * COUNT) == 1000
    assert speed_at_least(met("sts"), STS, 1000.2 * COUNT) == 1001
    assert speed_at_least(met("hls"), HLS, 1001 * COUNT) == 21
    assert speed_at_least(met("hls"), HLS, 1e-9) == 1


def test_who_follows_goals_and_was_told_no_speed_has_the_maximum_as_his_map_says_it() -> None:
    assert speed_at_least(met("sts", at_18=12), STS, None) == 0
    assert speed_at_least(met("sts", at_18=4), STS, None) == NO_LOAD
    assert speed_at_least(met("hls"), HLS, None) == NO_LOAD // 50
    assert speed_at_least(met("sts", at_18=4), STS, 1e9) == NO_LOAD
