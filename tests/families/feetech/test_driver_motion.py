"""Holding without a jump, moving in one packet, standing still; and everything that is refused beforehand."""

from __future__ import annotations

from math import inf, nan, radians, tau
from typing import Any

import pytest

from motorbus.core.goal import Goal, Stays
from motorbus.core.operation import Effect, Rank
from motorbus.errors import DeviceError, LimitExceeded, MotionError, OutcomeUnknown, RequestError
from motorbus.families.feetech.driver import Node, enable_torque, move
from motorbus.families.feetech.driver.motion import move_block, way
from motorbus.families.feetech.table import CONTROL, STS, TABLES
from tests.families.feetech.driver_script import (
    Line,
    low_high,
    play,
    prepared,
    prepares,
    reads,
    unheard,
    watch,
    writes,
)
from tests.families.feetech.maps import met, prepares_as

COUNT = tau / 4096
IS_ON = reads(3, 40, 1)
BEFORE = reads(3, 40, 0, 7, 0, 9, 1, 2, 3, 4)
"""Registers 40 to 47 of a limp servo, with an acceleration and an old goal."""


def stands(raw: int) -> Line:
    return reads(3, 56, *low_high(raw))


def on(*order: int) -> tuple[Line, Line]:
    """The switch with what was found in register 41 and this order behind it; and what it says then."""
    return writes(3, 40, 1, 7, *order), IS_ON


def goes(raw: int, *, acceleration: int = 0, velocity: int = 0) -> Line:
    return writes(3, 41, acceleration, *low_high(raw), 0, 0, *low_high(velocity))


# -- torque on -----------------------------------------------------------------------------------------------


def test_the_goal_becomes_the_present_position_in_the_packet_that_switches_torque_on() -> None:
    played = watch(enable_torque(Node(3)), prepares(), BEFORE, stands(1304), *on(*low_high(1304)))
    order = played.exchanges[3]
    assert order.effect is Effect.MOTION
    here = 1304 * COUNT
    assert order.goals == (Goal(3, "position", here, here, here, Stays.ON),)


def test_limits_and_mode_are_read_anew_each_time() -> None:
    play(enable_torque(prepared(at_33=1)), prepares(), BEFORE, stands(5), *on(5, 0))


def test_torque_that_is_off_again_at_once_is_told() -> None:
    order, _ = on(5, 0)
    with pytest.raises(MotionError, match="its torque is off") as caught:
        play(enable_torque(Node(3)), prepares(), BEFORE, stands(5), order, reads(3, 40, 0))
    assert "lost its supply for a moment" in caught.value.cause


@pytest.mark.parametrize("jump", [nan, inf, -0.1, True, "1", None])
def test_a_jump_that_bounds_nothing_costs_no_packet(jump: Any) -> None:
    with pytest.raises(RequestError, match="is no way that it may jump"):
        play(enable_torque(Node(3), jump=jump))


@pytest.mark.parametrize(
    ("mode", "lines"),
    [
        (1, [BEFORE, *on(0, 9, 1, 2, 0, 0)]),
        (2, [BEFORE, *on(0, 9, 0, 0)]),
        (3, [writes(3, 40, 1), IS_ON]),
    ],
)
def test_other_modes_start_at_rest(mode: int, lines: list[Line]) -> None:
    play(enable_torque(Node(3)), prepares(at_33=mode), *lines)


def test_an_undocumented_mode_is_refused() -> None:
    with pytest.raises(RequestError, match="operating mode 4"):
        play(enable_torque(Node(3)), prepares(at_33=4))


@pytest.mark.parametrize(("raw", "limit"), [(90, 100), (3005, 3000)])
def test_beyond_its_limits_a_servo_would_jump_so_torque_stays_off(raw: int, limit: int) -> None:
    narrow = prepares(at_9=100, at_11=0xB8, at_12=0x0B)
    with pytest.raises(LimitExceeded, match="it would jump to") as caught:
        play(enable_torque(Node(3)), narrow, BEFORE, stands(raw))
    assert f"{limit * COUNT:.4g}" in caught.value.summary
    play(enable_torque(Node(3), jump=10 * COUNT), narrow, BEFORE, stands(raw), *on(*low_high(limit)))


def test_many_turns_have_room_for_every_position() -> None:
    turns = prepares(at_11=0, at_12=0)
    play(enable_torque(Node(3)), turns, BEFORE, stands(-6015), *on(*low_high(-6015)))


def test_when_the_goal_is_in_doubt_so_is_the_torque() -> None:
    order, _ = on(*low_high(1304))
    with pytest.raises(OutcomeUnknown):
        play(
            enable_torque(Node(3)),
            *(prepares(), BEFORE, stands(1304), unheard(order), unheard(reads(3, 40, 0, 0, 0, 0))),
        )


def test_a_stranger_is_not_switched_on() -> None:
    with pytest.raises(DeviceError):
        play(enable_torque(Node(3)), prepares(at_0=9))


# -- move ----------------------------------------------------------------------------------------------------


def test_a_move_is_one_packet() -> None:
    wish = move(prepared(), 2048 * COUNT, velocity=1000 * COUNT, acceleration=5000 * COUNT, wait=False)
    _, exchange = watch(wish, prepares(), goes(2048, acceleration=50, velocity=1000)).exchanges
    assert (exchange.effect, exchange.repeatable, exchange.rank) == (Effect.MOTION, True, Rank.CONTROL)
    where, speed = exchange.goals
    assert where == Goal(3, "position", 2048 * COUNT, 0.0, 4095 * COUNT)
    assert (speed.node, speed.quantity) == (3, "speed")
    assert speed.value == pytest.approx(1000 * COUNT)


def test_a_new_servo_is_asked_for_its_limits_first() -> None:
    wish = move(Node(3), 1.0, wait=False)
    played = watch(wish, prepares(at_12=0x08), goes(652))
    assert played.exchanges[1].goals[0] == Goal(3, "position", 652 * COUNT, 0.0, 2303 * COUNT)


def test_goals_are_sign_magnitude() -> None:
    play(
        move(prepared(), -1000 * COUNT, wait=False),
        *(prepares(at_11=0, at_12=0), writes(3, 41, 0, 0xE8, 0x83, 0, 0, 0, 0)),
    )


@pytest.mark.parametrize(
    ("phase", "velocity", "raw"),
    [(12, None, 0), (12, 50, 50), (8, 50, 1), (8, 5000, 100), (4, None, 3400), (0, None, 68), (4, 7, 7)],
)
def test_velocity_by_the_unit_of_the_servo_and_no_velocity_is_the_maximum(
    phase: int, velocity: int | None, raw: int
) -> None:
    wish = move(prepared(), 0.0, velocity=velocity and velocity * COUNT, wait=False)
    play(wish, prepares(at_18=phase), goes(0, velocity=raw))


@pytest.mark.parametrize(
    "bounds",
    [{"velocity": 0.0}, {"velocity": 0.0005}, {"acceleration": 0.0}, {"acceleration": 0.05}],
)
def test_a_bound_too_small_to_be_said_is_not_turned_into_no_bound(bounds: dict[str, float]) -> None:
    with pytest.raises(RequestError, match="not above 0, or is less than"):
        play(move(prepared(), 1.0, **bounds), prepares())  # type: ignore[arg-type]


@pytest.mark.parametrize("bounds", [{"velocity": 1000.0}, {"acceleration": 1000.0}])
def test_a_bound_beyond_the_register_is_refused(bounds: dict[str, float]) -> None:
    with pytest.raises(RequestError, match="out of range"):
        play(move(prepared(), 1.0, **bounds), prepares())  # type: ignore[arg-type]


@pytest.mark.parametrize("to", [nan, inf, -inf])
def test_a_goal_that_is_no_number_costs_no_packet(to: float) -> None:
    with pytest.raises(LimitExceeded, match="is no position"):
        play(move(Node(3), to))


@pytest.mark.parametrize("name", ["velocity", "acceleration", "tolerance", "timeout"])
@pytest.mark.parametrize("value", [nan, inf, -1.0])
def test_bounds_that_are_no_numbers_cost_no_packet(name: str, value: float) -> None:
    with pytest.raises(RequestError, match="not a finite number above 0"):
        play(move(Node(3), 1.0, **{name: value}))  # type: ignore[arg-type]


def test_a_move_needs_position_mode() -> None:
    with pytest.raises(RequestError, match="operating mode velocity") as caught:
        play(move(prepared(), 1.0), prepares(at_33=1))
    assert "set_mode('position')" in caught.value.advice


def test_a_stranger_is_not_moved() -> None:
    with pytest.raises(DeviceError):
        play(move(Node(3), 1.0), prepares(at_0=9))


def test_a_servo_that_acknowledges_nothing_is_read_back() -> None:
    play(
        move(prepared(at_8=0), 2048 * COUNT, wait=False),
        prepares(at_8=0),
        *(unheard(goes(2048)), reads(3, 41, 0, 0, 8, 0, 0, 0, 0)),
    )


def test_waiting_ends_when_it_is_there() -> None:
    there = reads(3, 56, *low_high(2040), *[0] * 13)
    moving = reads(3, 56, *low_high(1000), *[0] * 8, 1, 0, 0, 0, 0)
    play(move(prepared(), 2048 * COUNT), prepares(), goes(2048), moving, moving, there)


def test_goals_are_rounded_to_what_the_servo_can_be_told() -> None:
    assert move_block(prepared(), STS, -1e-9).goals[0].value == 0


# -- of every map --------------------------------------------------------------------------------------------

SCS_COUNT = radians(300) / 1024


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("smbl", writes(3, 40, 1, 2, 0, 4, 0, 0, 0xF4, 1)),
        ("smcl", writes(3, 40, 1, 2, 0, 4, 0, 0, 0xF4, 1)),
        ("hls", writes(3, 40, 1, 2, 0, 4, 0xC8, 0, 10, 0)),
    ],
)
def test_a_move_of_a_little_endian_servo_is_one_packet_with_the_switch_in_it(name: str, line: Line) -> None:
    node = met(name)
    node.bound = 200
    wish = move(node, 1024 * COUNT, velocity=500 * COUNT, acceleration=200 * COUNT, wait=False)
    _, exchange, _ = watch(wish, prepares_as(name), line, IS_ON).exchanges
    assert exchange.effect is Effect.MOTION
    assert exchange.goals[0] == Goal(3, "position", 1024 * COUNT, 0.0, 4095 * COUNT)
    assert exchange.goals[1].quantity == "speed"


@pytest.mark.parametrize("name", ["scs", "scs2"])
def test_a_move_of_a_big_endian_servo_has_no_acceleration_and_no_time(name: str) -> None:
    wish = move(met(name), 512 * SCS_COUNT, velocity=500 * SCS_COUNT, wait=False)
    play(wish, prepares_as(name), writes(3, 40, 1, 0, 2, 0, 0, 0, 1, 0xF4), IS_ON)
    with pytest.raises(RequestError, match="no acceleration register") as caught:
        play(move(met(name), 1.0, acceleration=1.0), prepares_as(name))
    assert "register 41 is none of SCS" in caught.value.expected


@pytest.mark.parametrize("name", ["smbl", "smcl", "scs", "scs2", "hls"])
def test_a_move_whose_torque_is_off_again_is_told(name: str) -> None:
    node = met(name)
    node.bound = 200
    assert node.table is not None
    block = move_block(node, node.table, 0.5)
    with pytest.raises(MotionError, match="its torque is off"):
        play(move(node, 0.5), prepares_as(name), writes(3, 40, *block.data), reads(3, 40, 0))


@pytest.mark.parametrize(
    ("name", "phase", "data"),
    [
        ("sts", 8, (0, 0)),
        ("smbl", 4, (0x48, 0x0D)),
        ("smcl", 12, (0x48, 0x0D)),
        ("hls", 12, (68, 0)),
        ("scs", 8, (0, 0)),
        ("scs", 0, (0x0D, 0x48)),
        ("scs2", 0, (0x0D, 0x48)),
    ],
)
def test_no_velocity_is_the_maximum_in_every_map(name: str, phase: int, data: tuple[int, int]) -> None:
    node = met(name, at_18=phase)
    node.bound = 200
    assert node.table is not None
    assert move_block(node, node.table, 0.0).data[-2:] == bytes(data)


@pytest.mark.parametrize("name", TABLES)
def test_what_a_move_says_lies_in_adjoining_registers(name: str) -> None:
    table, control = TABLES[name], CONTROL[name]
    rows = [control.acceleration, "goal_position", control.current or control.time, "goal_velocity"]
    places = [table[row] for row in rows if row]
    assert [row.address + row.size for row in places[:-1]] == [row.address for row in places[1:]]


@pytest.mark.parametrize(
    ("name", "changes", "tolerance"),
    [
        ("sts", {}, 0.05),
        ("hls", {}, 0.05),
        ("scs", {}, 10 * SCS_COUNT),
        ("smbl", {"at_30": 100}, 1000 * COUNT),
    ],
)
def test_in_position_is_ten_counts_where_these_are_more(
    name: str, changes: dict[str, int], tolerance: float
) -> None:
    node = met(name, **changes)
    assert node.table is not None
    assert way(node, node.table, 1.0).tolerance == pytest.approx(tolerance)
    assert way(node, node.table, 1.0, tolerance=0.01).tolerance == 0.01


@pytest.mark.parametrize("name", ["sts", "smbl", "hls"])
def test_goals_over_many_turns_go_as_far_as_is_published(name: str) -> None:
    node = met(name, at_11=0, at_12=0)
    node.bound = 200
    assert node.table is not None
    goal, _ = move_block(node, node.table, -30719 * COUNT).goals
    assert (goal.low, goal.high) == (-30719 * COUNT, 30719 * COUNT)


def test_a_servo_of_many_turns_that_tells_one_has_arrived_when_it_rests_there_within_its_turn() -> None:
    there = reads(3, 56, *low_high(104), *[0] * 13)
    play(move(Node(3), 8296 * COUNT), prepares(at_11=0, at_12=0), goes(8296), there)
    there = reads(3, 56, *low_high(8290), *[0] * 13)
    play(move(Node(3), 8296 * COUNT), prepares(at_11=0, at_12=0, at_18=28), goes(8296), there)


def test_smcl_with_both_limits_0_is_not_moved() -> None:
    with pytest.raises(RequestError, match="nobody has published what that means on smcl") as caught:
        play(move(Node(3), 1.0), prepares_as("smcl", at_11=0, at_12=0))
    assert "max_position_limit" in caught.value.advice


@pytest.mark.parametrize("name", ["scs", "scs2"])
def test_an_scs_motor_is_no_servo(name: str) -> None:
    with pytest.raises(RequestError, match="operating mode pwm") as caught:
        play(move(Node(3), 1.0), prepares_as(name, at_11=0, at_12=0))
    assert "set_mode('position')" in caught.value.advice


@pytest.mark.parametrize("name", TABLES)
def test_a_servo_of_any_map_that_acknowledges_nothing_is_read_back(name: str) -> None:
    node = met(name, at_8=0)
    node.bound = 200
    assert node.table is not None
    block = move_block(node, node.table, 0.5)
    sent = writes(3, block.address, *block.data)
    told = [] if node.control.goal_switches_on else [IS_ON]
    play(
        move(node, 0.5, wait=False),
        *(prepares_as(name, at_8=0), unheard(sent), reads(3, block.address, *block.data), *told),
    )
