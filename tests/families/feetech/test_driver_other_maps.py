"""Servos of other maps than STS: read and written by name, moved and held, each by the bytes of its own map.

Packets are typed by hand, with the byte order and units of each map.
"""

from __future__ import annotations

from math import radians, tau

import pytest

from motorbus.core.operation import Effect
from motorbus.errors import DeviceError, LimitExceeded, MotionError, RequestError
from motorbus.families.feetech import driver
from motorbus.families.feetech.driver import Node, Promise
from motorbus.families.feetech.table import TABLES
from tests.families.feetech.driver_script import Line, looks, play, reads, watch, writes
from tests.families.feetech.maps import eeprom, met, prepares_as

OTHERS = [name for name in TABLES if name != "sts"]
COUNT = tau / 4096
SCS_COUNT = radians(300) / 1024
IS_ON = reads(3, 40, 1)


def before(*velocity: int) -> Line:
    """Registers 40 to 47 of a limp servo, with this goal velocity and what others have left."""
    return reads(3, 40, 0, 7, 0, 9, 0x2C, 1, *velocity)


# --- reading ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", OTHERS)
def test_it_is_known_by_its_own_map_and_writable(name: str) -> None:
    node = Node(3)
    found = play(driver.prepare(node), reads(3, 0, *eeprom(name)))
    assert (found.table, found.details["register_map"], node.table) == (name, name, TABLES[name])
    assert node.writable
    assert found.details["writable"] is True


@pytest.mark.parametrize("name", OTHERS)
def test_every_register_is_read_by_its_name(name: str) -> None:
    node = met(name)
    bytes_of = {row.name: (row.address, row.encode(max(row.low, 1))) for row in TABLES[name].values()}
    for row, (address, data) in bytes_of.items():
        raws = play(driver.read_raw(node, row), reads(3, address, *data))
        assert raws == {row: max(TABLES[name][row].low, 1)}


def test_scs_words_have_their_high_byte_first() -> None:
    values = play(
        driver.read(met("scs"), "present_position", "present_velocity"),
        reads(3, 56, 0x02, 0x00, 0x80, 0x0A),
    )
    assert values == {
        "present_position": pytest.approx(radians(150)),
        "present_velocity": pytest.approx(-10 * radians(300) / 1024),
    }


def test_hls_velocity_counts_in_steps_of_50_whatever_phase_says() -> None:
    for phase in (0, 4, 12):
        value = play(driver.read(met("hls", at_18=phase), "present_velocity"), reads(3, 58, 20, 0x80))
        assert value == {"present_velocity": pytest.approx(-1000 * COUNT)}


def test_smbl_velocity_is_told_by_bit_2_of_phase_as_on_sts() -> None:
    for phase, unit in ((4, 1), (0, 50)):
        value = play(driver.read(met("smbl", at_18=phase), "present_velocity"), reads(3, 58, 20, 0))
        assert value == {"present_velocity": pytest.approx(20 * unit * COUNT)}


def test_the_angular_resolution_stretches_positions_where_a_map_has_one() -> None:
    for name, factor in (("smbl", 3), ("hls", 3), ("smcl", 1)):
        value = play(driver.read(met(name, at_30=3), "present_position"), reads(3, 56, 100, 0))
        assert value == {"present_position": pytest.approx(100 * factor * COUNT)}


def test_offsets_have_their_sign_where_the_map_has_it() -> None:
    for name, address, data, counts in (
        ("smbl", 31, (0x74, 0x0E), -1652),
        ("smcl", 33, (0x74, 0x0E), -1652),
        ("hls", 31, (0x74, 0x86), -1652),
    ):
        value = play(driver.read(met(name), "homing_offset"), reads(3, address, *data))
        assert value == {"homing_offset": pytest.approx(counts * COUNT)}


def test_telemetry_of_an_hls_servo() -> None:
    block = (0, 8, 20, 0, 50, 4, 74, 30, 0, 0, 1, 0, 8, 100, 0)
    state = play(driver.telemetry(met("hls")), reads(3, 56, *block))
    assert state.position == pytest.approx(2048 * COUNT)
    assert state.velocity == pytest.approx(1000 * COUNT)
    assert (state.load, state.temperature) == (-0.05, 30)
    assert state.voltage == pytest.approx(7.4)
    assert state.current == pytest.approx(0.65)


def test_telemetry_of_an_scs_servo_tells_no_current() -> None:
    block = (2, 0, 0, 5, 0x04, 0x32, 60, 30, 0, 0, 1, 0, 0, 0x12, 0x34)
    state = play(driver.telemetry(met("scs")), reads(3, 56, *block))
    assert state.position == pytest.approx(radians(150))
    assert state.load == -0.05
    assert state.voltage == pytest.approx(6.0)
    assert state.current is None
    with pytest.raises(DeviceError, match="nobody has published whether it tells its present current"):
        play(driver.current(met("scs")))


def test_alarms_have_the_names_of_its_map() -> None:
    node = met("scs")
    play(driver.read(node, "moving"), reads(3, 66, 0, error=0x21))
    assert node.alarm == ("voltage", "overload")
    node = met("hls")
    play(driver.read(node, "moving"), reads(3, 66, 0, error=0x10))
    assert node.alarm == ("undefined bit 4",)


def test_limits_are_told_unless_nobody_knows_what_they_mean() -> None:
    assert met("hls").limits == pytest.approx((0, 4095 * COUNT))
    assert met("scs", at_11=0x03, at_12=0xFF).limits == pytest.approx((0, 1023 * radians(300) / 1024))
    assert met("scs", at_11=0, at_12=0).limits is None
    assert met("smcl", at_11=0, at_12=0).limits is None


def test_a_register_of_another_map_is_refused_with_a_name() -> None:
    with pytest.raises(RequestError, match="table scs has no register 'torque_limit'"):
        play(driver.read(met("scs"), "torque_limit"))


# --- writing ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "address", "goal"),
    [
        ("smbl", 42, (0, 8)),
        ("smcl", 42, (0, 8)),
        ("hls", 42, (0, 8)),
        ("scs", 42, (2, 0)),
        ("scs2", 42, (2, 0)),
    ],
)
def test_a_goal_by_name_has_the_byte_order_of_its_map(name: str, address: int, goal: tuple[int, int]) -> None:
    to = 2048 * COUNT if name in ("smbl", "smcl", "hls") else 512 * SCS_COUNT
    played = watch(driver.write(met(name), goal_position=to), writes(3, address, *goal))
    (order,) = played.exchanges[0].goals
    assert order.quantity == "position"
    assert order.value == pytest.approx(to)


@pytest.mark.parametrize(
    ("name", "lock"), [("smbl", 55), ("smcl", 48), ("scs", 48), ("scs2", 48), ("hls", 55)]
)
def test_eeprom_is_unlocked_where_its_map_has_the_lock(name: str, lock: int) -> None:
    play(
        driver.write(met(name), led_mask=1),
        *looks(writes(3, 20, 1)),
        writes(3, lock, 0),
        *(writes(3, 40, 0), reads(3, 64, 0)),
        *(writes(3, 20, 1), reads(3, 20, 1)),
        *(reads(3, lock, 0), writes(3, lock, 1), reads(3, lock, 1)),
    )


def test_a_goal_torque_of_0_is_refused_where_it_bounds_the_current() -> None:
    for changes in ({}, {"at_33": 1}):
        with pytest.raises(RequestError, match="without force") as caught:
            play(driver.write(met("hls", **changes), goal_torque=0.0))
        assert "disable_torque()" in caught.value.advice
    (exchange,) = watch(
        driver.write(met("hls", at_33=2), goal_torque=-1.3), writes(3, 44, 200, 0x80)
    ).exchanges
    (goal,) = exchange.goals
    assert goal.quantity == "current"
    assert goal.value == pytest.approx(-1.3)


def test_what_gives_a_goal_another_meaning_is_written_to_a_limp_servo() -> None:
    played = watch(driver.write(met("hls"), control_loop=1), writes(3, 40, 0), writes(3, 53, 1))
    assert played.exchanges[1].effect is Effect.NONE
    with pytest.raises(RequestError, match="adjoining RAM registers only"):
        play(driver.reg_write(met("hls"), control_loop=1))


def test_a_state_of_the_torque_that_is_off_may_be_written_and_others_not() -> None:
    play(driver.write(met("scs"), torque_enable=2), writes(3, 40, 2))
    for name in ("sts", "hls"):
        with pytest.raises(RequestError, match="jump to an old goal"):
            play(driver.write(met(name), torque_enable=2))


@pytest.mark.parametrize("name", TABLES)
def test_torque_off_works_on_every_map(name: str) -> None:
    play(driver.disable_torque(met(name)), writes(3, 40, 0))


def test_a_name_that_only_another_map_has_is_no_register_of_an_sts_servo() -> None:
    with pytest.raises(RequestError, match="table sts has no register 'goal_torque'"):
        play(driver.write(met("sts"), goal_torque=0.5))


# --- holding and stopping -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["smbl", "smcl"])
def test_little_endian_servos_hold_where_they_stand(name: str) -> None:
    play(
        driver.enable_torque(Node(3)),
        *(prepares_as(name), before(1, 0), reads(3, 56, 24, 5), writes(3, 40, 1, 7, 24, 5), IS_ON),
    )
    play(driver.stop(met(name)), prepares_as(name), reads(3, 56, 24, 5), writes(3, 42, 24, 5))


@pytest.mark.parametrize("name", ["scs", "scs2"])
def test_big_endian_servos_hold_where_they_stand(name: str) -> None:
    play(
        driver.enable_torque(Node(3)),
        *(prepares_as(name), before(0, 1), reads(3, 56, 2, 13), writes(3, 40, 1, 7, 2, 13), IS_ON),
    )
    told = play(driver.stop(met(name)), prepares_as(name), reads(3, 56, 2, 13), writes(3, 42, 2, 13))
    assert told is Promise.HOLD_ACCEPTED


def test_where_velocity_0_is_standstill_torque_comes_on_with_a_velocity_for_the_goals_that_follow() -> None:
    play(
        driver.enable_torque(Node(3)),
        *(prepares_as("scs"), before(0, 0), reads(3, 56, 2, 13)),
        *(writes(3, 40, 1, 7, 2, 13, 0, 0, 0x0D, 0x48), IS_ON),
    )
    play(
        driver.enable_torque(Node(3)),
        *(prepares_as("sts", at_18=4), before(0, 0), reads(3, 56, 24, 5)),
        *(writes(3, 40, 1, 7, 24, 5, 0, 0, 0x48, 0x0D), IS_ON),
    )


def test_an_scs_servo_beyond_its_limits_is_not_switched_on() -> None:
    narrow = eeprom("scs", at_10=100, at_11=3, at_12=0x20)
    with pytest.raises(LimitExceeded, match="it would jump to"):
        play(
            driver.enable_torque(Node(3)),
            *(reads(3, 0, *narrow), before(0, 0), reads(3, 56, 0, 90)),
        )


@pytest.mark.parametrize(("speed", "burst"), [((0, 0), (0x2C, 1, 68, 0)), ((9, 0), (0x2C, 1))])
def test_hls_holds_with_a_bound_of_its_current_beside_the_goal(
    speed: tuple[int, ...], burst: tuple[int, ...]
) -> None:
    play(
        driver.enable_torque(Node(3)),
        *(prepares_as("hls"), reads(3, 44, 0x2C, 1), before(*speed), reads(3, 56, 24, 5)),
        *(writes(3, 40, 1, 7, 24, 5, *burst), IS_ON),
    )
    play(driver.stop(met("hls")), prepares_as("hls"), reads(3, 56, 24, 5), writes(3, 42, 24, 5))


@pytest.mark.parametrize(
    ("name", "changes", "address", "promise"),
    [
        ("smcl", {"at_35": 1}, 46, Promise.ZERO_VELOCITY_ACCEPTED),
        ("smcl", {"at_35": 2}, 44, Promise.ZERO_DUTY_ACCEPTED),
        ("scs", {"at_11": 0, "at_12": 0}, 44, Promise.ZERO_DUTY_ACCEPTED),
        ("scs2", {"at_11": 0, "at_12": 0}, 44, Promise.ZERO_DUTY_ACCEPTED),
        ("hls", {"at_33": 2}, 44, Promise.ZERO_CURRENT_ACCEPTED),
    ],
)
def test_other_modes_begin_and_end_at_rest(
    name: str, changes: dict[str, int], address: int, promise: Promise
) -> None:
    asked, found = prepares_as(name, **changes), (7, 0, 9, 0x2C, 1)
    play(
        driver.enable_torque(Node(3)),
        *(asked, before(0, 99), writes(3, 40, 1, *found[: address - 41], 0, 0), IS_ON),
    )
    assert play(driver.stop(met(name, **changes)), asked, writes(3, address, 0, 0)) is promise


def test_hls_in_velocity_mode_begins_at_rest_with_a_bound_of_its_current() -> None:
    play(
        driver.enable_torque(Node(3)),
        *(prepares_as("hls", at_33=1), reads(3, 44, 0, 1), before(9, 9)),
        *(writes(3, 40, 1, 7, 0, 9, 0, 1, 0, 0), IS_ON),
    )
    play(driver.stop(met("hls")), prepares_as("hls", at_33=1), writes(3, 46, 0, 0))


NO_REST = {
    "PWM mode of HLS": ("hls", {"at_33": 3}, "which register takes the duty"),
    "a mode nobody explains": ("hls", {"at_33": 4}, "operating mode 4, which is not documented"),
    "no limits on SMCL": ("smcl", {"at_11": 0, "at_12": 0}, "nobody has published what that means on smcl"),
}


@pytest.mark.parametrize("case", NO_REST)
def test_where_no_order_is_known_that_moves_nothing_it_says_so(case: str) -> None:
    name, changes, message = NO_REST[case]
    on = [IS_ON] if name == "smcl" else []  # where limits are in question, a limp one is left alone
    with pytest.raises(RequestError, match=message) as caught:
        play(driver.stop(Node(3)), prepares_as(name, **changes), *on)
    assert "disable_torque()" in caught.value.advice
    with pytest.raises(RequestError, match=message):
        play(driver.enable_torque(Node(3)), prepares_as(name, **changes))


def test_a_limp_servo_of_which_nobody_knows_what_would_hold_it_is_left_alone() -> None:
    asked = prepares_as("smcl", at_11=0, at_12=0)
    assert play(driver.stop(Node(3)), asked, reads(3, 40, 0)) is Promise.LIMP


@pytest.mark.parametrize("name", ["sts", "smbl", "hls"])
def test_a_servo_of_many_turns_that_tells_one_is_neither_held_nor_stopped_anywhere(name: str) -> None:
    turns = {"at_11": 0, "at_12": 0, "at_18": 12}
    bound = [reads(3, 44, 0x2C, 1)] if name == "hls" else []
    image, stands = [prepares_as(name, **turns), *bound, before(1, 0)], reads(3, 56, 24, 5)
    with pytest.raises(RequestError, match="nobody knows on which turn it stands"):
        play(driver.enable_torque(Node(3)), *image, stands)
    with pytest.raises(RequestError, match="nobody knows on which turn it stands"):
        play(driver.stop(met(name)), image[0], stands, IS_ON)
    held = writes(3, 40, 1, 7, 24, 5, *((0x2C, 1) if name == "hls" else ()))
    play(driver.enable_torque(Node(3), jump=48), *image, stands, held, IS_ON)


@pytest.mark.parametrize("name", ["sts", "smbl"])
def test_a_servo_of_many_turns_that_tells_them_holds_on_its_turn(name: str) -> None:
    turns = {"at_11": 0, "at_12": 0, "at_18": 28}
    asked, stands = prepares_as(name, **turns), reads(3, 56, 0x88, 0xC3)
    play(driver.stop(met(name)), asked, stands, writes(3, 42, 0x88, 0xC3), stands)
    away = (reads(3, 56, 0x88, 3), writes(3, 40, 0))
    with pytest.raises(MotionError, match="has forgotten its turns"):
        play(driver.stop(met(name)), asked, stands, writes(3, 42, 0x88, 0xC3), *away)
    order = (before(1, 0), stands, writes(3, 40, 1, 7, 0x88, 0xC3))
    with pytest.raises(MotionError, match="has forgotten its turns"):
        play(driver.enable_torque(met(name)), asked, *order, *away)
    play(driver.enable_torque(met(name)), asked, *order, stands, IS_ON)
