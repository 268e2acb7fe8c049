"""Objects by name: one frame for each, all checked first, and each written the way its row asks for."""

from __future__ import annotations

import pytest

from motorbus.errors import DeviceError, LimitExceeded, RequestError
from motorbus.families.kst import driver
from motorbus.families.kst.driver.registers import VERBS
from motorbus.families.kst.table import TABLES
from tests.families.kst.bench import abort, bench, node, play


def test_named_objects_in_their_units() -> None:
    assert play(
        driver.read(node(), "present_position", "node_id"),
        ("605#4002600000000000", "4b02600084030000"),
        ("605#4000300000000000", "4f00300005000000"),
    ) == {"present_position": pytest.approx(1.5707963), "node_id": 5}
    assert play(
        driver.read_raw(node(), "present_position"), ("605#4002600000000000", "4b0260007cfc0000")
    ) == {"present_position": -900}


def test_all_that_it_tells_is_read_and_what_it_lacks_left_out() -> None:
    assert play(
        driver.read(node()),
        ("605#400A100000000000", abort(0x100A, 0x0602_0000)),
        ("605#4000300000000000", "4f00300005000000"),
        ("605#4002600000000000", "4b02600000000000"),
        ("605#4003600000000000", abort(0x6003, 0x0601_0001)),
    ) == {"node_id": 5, "present_position": 0.0}


def test_a_named_object_that_it_lacks_is_an_error() -> None:
    with pytest.raises(DeviceError, match="goal_position"):
        play(driver.read(node(), "goal_position"), ("605#4003600000000000", abort(0x6003, 0x0601_0001)))


def test_a_refusal_that_means_trouble_is_an_error_in_any_case() -> None:
    with pytest.raises(DeviceError, match="hardware error"):
        play(driver.read(node()), ("605#400A100000000000", abort(0x100A, 0x0606_0000)))


def test_protected_rows_name_the_verb_that_writes_them() -> None:
    protected = {row.name for table in TABLES.values() for row in table.values() if row.protected}
    assert {name for name in protected if not name.endswith("_version")} == set(VERBS)
    with pytest.raises(RequestError, match="save()"):
        play(driver.write(node(), store=1))


def test_a_goal_by_name_passes_the_limits_of_the_servo() -> None:
    with bench(profile="kst-ext") as there:
        servo = there.servo()
        servo.set_travel_limits(-0.2, 0.2)
        servo.write(goal_position=0.1)
        there.sent()
        with pytest.raises(Exception, match="lies outside"):
            servo.write(goal_position=0.3)
        assert [frame for frame in there.sent() if "0360" in frame] == []


@pytest.mark.parametrize("to", [2.0, float("nan"), pytest.param(10**400, id="huge")])
def test_a_goal_by_name_outside_the_range_is_refused_as_one_by_move_is(to: float) -> None:
    with pytest.raises(LimitExceeded, match="goal_position"):
        play(driver.write(node(), goal_position=to))


def test_limits_by_name_are_kept_and_read_back() -> None:
    with bench(profile="kst-ext") as there:
        servo = there.servo()
        servo.write(negative_limit=-0.5, positive_limit=0.75)
        frames = there.sent()
        assert frames.count("605#2210100173617665") == 1
        assert [frames.count(f"605#40{index}300000000000") for index in ("0A", "0B")] == [4, 3]
        there.sim().power_cycle()
        assert servo.travel_limits() == pytest.approx((-0.5, 0.75), abs=0.001)
