"""What a write by name comes to: checked before it is sent, grouped, with its effect and its goals."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, nan, tau
from typing import Any

import pytest

from motorbus.core.entry import Entry, Storage, Value
from motorbus.core.operation import Effect, Goal
from motorbus.errors import RequestError
from motorbus.families.feetech.driver.exchanges import Block
from motorbus.families.feetech.driver.orders import (
    NO_LOAD,
    blocks,
    check_names,
    check_values,
    only_block,
    orders_of,
)
from motorbus.families.feetech.table import STS, TABLES
from tests.families.feetech.driver_script import prepared
from tests.families.feetech.maps import met

COUNT = tau / 4096
HUGE = pytest.param(10**400, id="huge"), pytest.param(10**5000, id="beyond printing")


def made(changes: Mapping[str, int] | None = None, /, **values: Value) -> list[Block]:
    node = prepared(**(changes or {}))
    return list(blocks(node, orders_of(node, STS, values)))


def test_adjoining_registers_become_one_block_whatever_their_order() -> None:
    (block,) = made(goal_velocity=1000 * COUNT, goal_time=0, goal_position=2048 * COUNT)
    assert (block.address, block.data.hex()) == (42, "00080000e803")
    assert (block.effect, block.repeatable) == (Effect.MOTION, True)


def test_a_gap_parts_blocks() -> None:
    assert [(b.address, b.data.hex()) for b in made(torque_limit=0.5, acceleration=1.0, position_p=7)] == [
        (21, "07"),
        (41, "07"),
        (48, "f401"),
    ]


def test_the_greatest_effect_counts() -> None:
    assert [b.effect for b in made(acceleration=1.0)] == [Effect.NONE]
    assert [b.effect for b in made(acceleration=1.0, torque_enable=0)] == [Effect.TORQUE]


def test_a_goal_is_what_is_really_sent_with_the_limits_of_the_servo() -> None:
    (block,) = made({"at_12": 0x08}, goal_position=1.0)
    assert block.goals == (Goal(3, "position", 652 * COUNT, 0.0, 2303 * COUNT),)


def test_in_step_mode_a_goal_is_a_way_and_not_repeatable() -> None:
    (block,) = made({"at_33": 3}, goal_position=-1.0)
    assert block.goals == (Goal(3, "relative", -652 * COUNT, -30719 * COUNT, 30719 * COUNT),)
    assert block.repeatable is False
    assert [b.repeatable for b in made({"at_33": 3}, goal_velocity=1.0)] == [True]


def test_in_position_mode_a_velocity_bounds_and_0_is_as_fast_as_it_can() -> None:
    (bound,) = made({}, goal_velocity=100 * COUNT)[0].goals
    assert (bound.node, bound.quantity) == (3, "speed")
    assert bound.value == pytest.approx(100 * COUNT)
    (fastest,) = made({}, goal_velocity=0)[0].goals
    assert fastest.value == pytest.approx(NO_LOAD * COUNT)
    (still,) = made({"at_18": 0}, goal_velocity=0)[0].goals
    assert still[:3] == (3, "speed", 0.0)


def test_velocity_and_duty_are_goals_too() -> None:
    (block,) = made({"at_33": 1, "at_18": 0b1000}, goal_velocity=-100 * COUNT)
    assert block.data == b"\x02\x80"
    (goal,) = block.goals
    assert goal.quantity == "velocity"
    assert goal.value == pytest.approx(-100 * COUNT)
    (block,) = made({"at_33": 2}, goal_time=-500)
    assert block.data == b"\xf4\x05"
    assert block.goals == (Goal(3, "load", -0.5, -1.0, 1.0),)


@pytest.mark.parametrize(
    "row", [row for row in STS.values() if row.effect is Effect.MOTION and row.storage is Storage.RAM]
)
def test_whatever_moves_says_where_to(row: Entry) -> None:
    (block,) = made({}, **{row.name: 0})
    assert block.effect is Effect.MOTION
    assert block.goals


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"id": 7}, "use set_id"),
        ({"id": 254}, "how the servo is found"),
        ({"baud_rate": 4}, "use set_baud"),
        ({"phase": 12}, "one servo alone"),
        ({"homing_offset": 0.0}, "use calibrate"),
        ({"max_acceleration": 254}, "one servo alone"),
        ({"model_major": 9}, "one servo alone"),
        ({"present_position": 0.0}, "only be read"),
        ({"lock": 0}, "open lock"),
        ({"torque_enable": 1}, "jump to an old goal"),
        ({"torque_enable": 128}, "use calibrate"),
        ({"position_p": 255}, "out of range 0..254"),
        ({"max_voltage": 30.0}, "out of range"),
        ({"goal_position": nan}, "not a finite number"),
        ({"torque_limit": inf}, "not a finite number"),
        ({"led_mask": True}, "not a finite number"),
        ({"goal_positon": 1.0}, "perhaps goal_position"),
    ],
)
def test_what_no_servo_would_be_given_is_refused_before_anything_is_sent(
    values: dict[str, Value], message: str
) -> None:
    with pytest.raises(RequestError, match=message) as caught:
        check_values(values)
    assert "nothing was sent" in str(caught.value)


def test_a_fraction_of_a_plain_number_is_refused() -> None:
    with pytest.raises(RequestError, match="not a whole number"):
        check_values({"position_p": 1.5})


@pytest.mark.parametrize("values", [{"lock": 1}, {"torque_enable": 0}, {"goal_velocity": 100.0}, {}])
def test_what_some_servo_may_be_given_passes(values: dict[str, Value]) -> None:
    check_values(values)


def test_what_depends_on_the_servo_is_checked_when_it_is_known() -> None:
    with pytest.raises(RequestError, match="goal_velocity: raw value 65190 is out of range"):
        made(goal_velocity=100.0)
    assert made({"at_18": 0b1000}, goal_velocity=100.0)[0].data == (1304).to_bytes(2, "little")


def test_a_refusal_names_the_servo() -> None:
    with pytest.raises(RequestError) as caught:
        made(phase=1)
    assert caught.value.node == 3


def test_a_name_nobody_knows_is_refused_with_suggestions() -> None:
    with pytest.raises(RequestError, match="perhaps present_voltage"):
        check_names(["present_position", "present_volts"])


@pytest.mark.parametrize(
    "values",
    [{"goal_position": 1.0, "goal_velocity": 1.0}, {"led_mask": 1}, {}, {"acceleration": 1.0, "lock": 1}],
)
def test_one_block_of_ram_is_one_block_of_ram(values: dict[str, Value]) -> None:
    node = prepared()
    with pytest.raises(RequestError, match="adjoining RAM registers only"):
        only_block(node, orders_of(node, STS, values), "REG WRITE")


@pytest.mark.parametrize("mode", [1, 2])
def test_no_goal_position_goes_to_a_servo_that_heeds_none(mode: int) -> None:
    with pytest.raises(RequestError, match="heeds no goal position in operating mode") as caught:
        made({"at_33": mode}, goal_position=1.0)
    assert "set_mode('position')" in caught.value.advice
    assert [block.address for block in made({"at_33": 3}, goal_position=1.0)] == [42]


@pytest.mark.parametrize(("name", "mode"), [("sts", 7), ("hls", 3), ("hls", 4), ("smbl", 9)])
def test_no_goal_goes_to_a_servo_whose_goals_nobody_explains(name: str, mode: int) -> None:
    """Mode 3 of HLS drives with a duty, and no source says which register takes it."""
    node, table = met(name, at_33=mode), TABLES[name]
    for row in (one for one in table if one.startswith("goal_") and table[one].effect is Effect.MOTION):
        with pytest.raises(RequestError, match=f"nobody has published what {row} does"):
            orders_of(node, table, {row: 0})
    assert orders_of(node, table, {"torque_enable": 0}) == [(table["torque_enable"], 0)]


@pytest.mark.parametrize("value", [1e308, -1e308, *HUGE, None, "1", 1j, [1.0], True, nan, inf])
@pytest.mark.parametrize("name", ["goal_position", "goal_velocity", "position_p", "min_position_limit"])
def test_what_is_no_number_for_a_register_is_a_bad_request(name: str, value: Any) -> None:
    with pytest.raises(RequestError) as caught:
        made(**{name: value})
    assert len(caught.value.summary) < 120
