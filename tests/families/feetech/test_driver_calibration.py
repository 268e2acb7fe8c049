"""The present pose gets another name: three ways, each proven by two readings, and never one that overflows."""

from __future__ import annotations

import math
from typing import Any

import pytest

from motorbus.core.request import Effect
from motorbus.errors import DeviceError, MotorbusError, OutcomeUnknown, RequestError, VerificationFailed
from motorbus.families.feetech.driver import Node, calibrate, zero
from motorbus.families.feetech.driver.calibration import shortest
from motorbus.families.feetech.table import CONTROL, TABLES, Middle
from tests.families.feetech.driver_script import (
    Line,
    Played,
    low_high,
    packet,
    play,
    reads,
    unheard,
    watch,
    writes,
)
from tests.families.feetech.maps import eeprom, met, prepares_as, simulated

COUNT = math.tau / 4096
OFF, OPEN, LOCK, LOCKED = writes(3, 40, 0), writes(3, 55, 0), writes(3, 55, 1), reads(3, 55, 1)
IDLE = reads(3, 64, 0)
STILL = reads(3, 55, 0)
MIDDLE, DONE, GIVEN_UP = writes(3, 40, 128), (STILL, LOCK, LOCKED), (OFF, LOCK, LOCKED)


def pose(position: int, offset: int, sign: int = 0x800) -> tuple[Line, Line]:
    """Offset (register 31) and position (56) as they are read."""
    code = offset if offset >= 0 else -offset | sign
    return reads(3, 31, code & 255, code >> 8), reads(3, 56, *low_high(position))


def offset_written(offset: int, sign: int = 0x800) -> tuple[Line, Line]:
    code = offset if offset >= 0 else -offset | sign
    return writes(3, 31, code & 255, code >> 8), reads(3, 31, code & 255, code >> 8)


def by_offset(before: tuple[int, int], offset: int, reads_then: int) -> tuple[Line, ...]:
    return (
        *(prepares_as("sts"), *pose(*before), OPEN, OFF, IDLE, *pose(*before)),
        *(STILL, *offset_written(offset), *pose(reads_then, offset), *DONE),
    )


# -- byte by byte --------------------------------------------------------------------------------------------


def test_the_middle_by_the_torque_switch() -> None:
    script = (
        *(prepares_as("sts"), *pose(600, 0), OPEN, OFF, IDLE, *pose(600, 0)),
        *(STILL, MIDDLE, OFF, *pose(2048, -1448), *DONE),
    )
    played = watch(calibrate(Node(3)), *script)
    assert played.alone == 1
    assert Effect.MOTION not in {request.effect for request in played.requests}
    told = play(calibrate(Node(3)), *script)
    assert told.before == pytest.approx(600 * COUNT)
    assert told.after == pytest.approx(math.pi)
    assert (told.raw_old_offset, told.raw_new_offset, told.how, told.note) == (0, -1448, "switch", "")
    assert told.new_offset == pytest.approx(-1448 * COUNT)


def test_any_other_pose_by_the_offset() -> None:
    told = play(calibrate(Node(3), 100 * COUNT), *by_offset((600, 0), 500, 100))
    assert (told.how, told.raw_new_offset) == ("offset", 500)


def test_the_old_offset_is_added_back_first() -> None:
    play(calibrate(Node(3), 100 * COUNT), *by_offset((600, 1000), 1500, 100))
    play(calibrate(Node(3), 100 * COUNT), *by_offset((4000, 200), 4, 100))


def test_the_way_around_is_the_shortest() -> None:
    assert [shortest(way, 4096) for way in (0, 2047, 2048, 4095, -2048, -2049)] == [
        *(0, 2047, -2048, -1),
        *(-2048, 2047),
    ]
    play(calibrate(Node(3), 4000 * COUNT), *by_offset((100, 0), 196, 4000))


def test_the_one_pose_that_does_not_fit_reads_one_count_beside() -> None:
    """lerobot#3370: count 4095 is to be 2047, which needs an offset of 2048 in a register that ends at 2047."""
    told = play(calibrate(Node(3), 2047 * COUNT), *by_offset((4095, 0), -2047, 2046))
    assert "reads -1 count beside" in told.note
    assert told.after == pytest.approx(2046 * COUNT)


def test_at_that_pose_the_servo_is_not_left_to_reckon_the_middle() -> None:
    told = play(calibrate(Node(3), how="switch"), *by_offset((0, 0), -2047, 2047))
    assert (told.how, told.note != "") == ("offset", True)


def test_where_the_register_is_wider_it_fits() -> None:
    told = play(
        calibrate(Node(3), 2047 * COUNT, "offset"),
        *(prepares_as("hls"), *pose(4095, 0, 0x8000), OPEN, OFF, IDLE, *pose(4095, 0, 0x8000)),
        *(STILL, *offset_written(-2048, 0x8000), *pose(2047, -2048, 0x8000), *DONE),
    )
    assert told.note == ""


def test_hls_are_told_the_position_by_an_instruction() -> None:
    told = play(
        calibrate(Node(3), 1024 * COUNT),
        *(prepares_as("hls"), *pose(600, 0, 0x8000), OPEN, OFF, IDLE, *pose(600, 0, 0x8000)),
        *(STILL, Line(packet(3, 0x0B, 0, 4), packet(3, 0))),
        *(*pose(1024, -424, 0x8000), *DONE),
    )
    assert told.how == "instruction"


def test_old_sms_have_the_offset_at_33_and_the_lock_at_48() -> None:
    before = (reads(3, 33, 0, 0), reads(3, 56, *low_high(2000)))
    told = play(
        calibrate(Node(3)),
        *(prepares_as("smcl"), *before, writes(3, 48, 0), OFF, IDLE, *before, reads(3, 48, 0), MIDDLE, OFF),
        *(reads(3, 33, 48, 8), reads(3, 56, *low_high(2048)), reads(3, 48, 0)),
        *(writes(3, 48, 1), reads(3, 48, 1)),
    )
    assert (told.how, told.raw_new_offset) == ("switch", -48)


def test_scs2_have_one_byte_for_it_and_the_high_byte_first() -> None:
    before = (reads(3, 34, 0), reads(3, 56, 2, 100))
    told = play(
        calibrate(Node(3)),
        *(prepares_as("scs2"), *before, writes(3, 48, 0), OFF, IDLE, *before, reads(3, 48, 0)),
        *(writes(3, 34, 100), reads(3, 34, 100), reads(3, 34, 100), reads(3, 56, 2, 0)),
        *(reads(3, 48, 0), writes(3, 48, 1), reads(3, 48, 1)),
    )
    assert (told.how, told.raw_new_offset) == ("offset", 100)
    assert told.new_offset == pytest.approx(100 * math.radians(300) / 1024)
    below = (reads(3, 34, 100), reads(3, 56, 1, 0x9C))
    play(
        calibrate(Node(3)),
        *(prepares_as("scs2"), *below, writes(3, 48, 0), OFF, IDLE, *below, reads(3, 48, 0)),
        *(writes(3, 34, 0), reads(3, 34, 0), reads(3, 34, 0), reads(3, 56, 2, 0)),
        *(reads(3, 48, 0), writes(3, 48, 1), reads(3, 48, 1)),
    )


def test_a_servo_that_acknowledges_nothing_is_judged_by_its_readings() -> None:
    level_0 = prepares_as("sts", status_return_level=0)
    play(
        calibrate(Node(3)),
        *(level_0, *pose(600, 0), unheard(OPEN), reads(3, 55, 0), unheard(OFF), reads(3, 40, 0), IDLE),
        *(*pose(600, 0), STILL, unheard(MIDDLE), unheard(OFF), reads(3, 40, 0), *pose(2048, -1448)),
        *(reads(3, 55, 0), unheard(LOCK), LOCKED, LOCKED),
    )


def test_a_lost_acknowledgement_is_no_failure() -> None:
    play(
        calibrate(Node(3)),
        *(prepares_as("sts"), *pose(600, 0), OPEN, OFF, IDLE, *pose(600, 0)),
        *(STILL, unheard(MIDDLE), OFF, *pose(2048, -1448), *DONE),
    )


def test_a_shaft_that_gives_way_when_it_goes_limp_is_reckoned_anew() -> None:
    play(
        calibrate(Node(3), 100 * COUNT),
        *(prepares_as("sts"), *pose(600, 0), OPEN, OFF, IDLE, *pose(590, 0)),
        *(STILL, *offset_written(490), *pose(98, 490), *DONE),
    )


def test_one_that_ignores_the_order_is_told_and_locked() -> None:
    played = Played(
        [
            *(prepares_as("sts"), *pose(600, 0), OPEN, OFF, IDLE, *pose(600, 0)),
            *(STILL, unheard(MIDDLE), OFF, *pose(600, 0), *GIVEN_UP),
        ]
    )
    with pytest.raises(DeviceError, match="did not change its homing offset") as caught:
        played.run(calibrate(Node(3)))
    assert isinstance(caught.value.__cause__, OutcomeUnknown)
    assert played.script == []


def test_a_reading_that_is_wrong_afterwards_is_told_with_both() -> None:
    script = [
        *(prepares_as("sts"), *pose(600, 0), OPEN, OFF, IDLE, *pose(600, 0)),
        *(STILL, MIDDLE, OFF, *pose(2048, -1000), *GIVEN_UP),
    ]
    played = Played(script)
    with pytest.raises(VerificationFailed, match="does not read as it must") as caught:
        played.run(calibrate(Node(3)))
    assert "position 2048, offset -1000 (raw); before: 600, 0" in str(caught.value)
    assert played.script == []


WHOLE = [
    *(prepares_as("sts"), *pose(600, 0), OPEN, OFF, IDLE, *pose(600, 0)),
    *(STILL, MIDDLE, OFF, *pose(2048, -1448), *DONE),
]


# -- refused before anything is written ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("to", "how", "message"),
    [
        (math.nan, "auto", "no position"),
        (math.inf, "auto", "no position"),
        (True, "auto", "no position"),
        (None, "by hand", "no way to calibrate"),
    ],
)
def test_nonsense_sends_nothing(to: Any, how: str, message: str) -> None:
    with pytest.raises(RequestError, match=message):
        play(calibrate(Node(3), to, how))


@pytest.mark.parametrize(
    ("to", "how", "message"),
    [
        (-0.1, "auto", "within one turn"),
        (math.tau, "auto", "within one turn"),
        (1.0, "switch", "for any pose but the middle"),
        (None, "instruction", "no way called instruction"),
    ],
)
def test_what_this_servo_cannot_do_writes_nothing(to: float | None, how: str, message: str) -> None:
    with pytest.raises(RequestError, match=message):
        play(calibrate(Node(3), to, how), prepares_as("sts"))


@pytest.mark.parametrize(("name", "mode"), [("sts", 1), ("sts", 2), ("sts", 3), ("hls", 2), ("smcl", 1)])
def test_in_other_modes_the_reading_ignores_the_offset(name: str, mode: int) -> None:
    with pytest.raises(RequestError, match="not in position mode") as caught:
        play(calibrate(Node(3)), prepares_as(name, operating_mode=mode))
    assert "set_mode('position')" in caught.value.advice


def test_a_motor_without_limits_has_no_pose() -> None:
    with pytest.raises(RequestError, match="not in position mode"):
        play(calibrate(Node(3)), prepares_as("scs2", min_position_limit=0, max_position_limit=0))


def test_scs_have_no_place_for_a_zero() -> None:
    for operation in (calibrate(Node(3)), zero(Node(3))):
        with pytest.raises(RequestError, match="scs has no homing offset") as caught:
            play(operation, prepares_as("scs"))
        assert "file of the machine" in caught.value.advice


def test_turns_that_were_counted_are_to_be_forgotten_first() -> None:
    counting = prepares_as("sts", phase=12 | 16)
    with pytest.raises(RequestError, match="raw position 6015") as caught:
        play(calibrate(Node(3)), counting, *pose(6015, 0))
    assert "bit 4 of its phase register" in caught.value.cause
    assert "clear_turns()" in caught.value.advice
    assert "set_many_turns(False)" in caught.value.advice
    play(
        calibrate(Node(3)),
        *(
            counting,
            *pose(600, 0),
            OPEN,
            OFF,
            IDLE,
            *pose(600, 0),
            STILL,
            MIDDLE,
            OFF,
            *pose(2048, -1448),
            *DONE,
        ),
    )


def test_an_offset_that_no_number_of_this_map_means_is_not_reckoned_with() -> None:
    with pytest.raises(DeviceError, match="offset is 5000"):
        play(calibrate(Node(3)), prepares_as("sts"), reads(3, 31, *low_high(5000)))


def test_a_far_pose_does_not_fit_one_byte() -> None:
    with pytest.raises(RequestError, match="388 counts") as caught:
        play(calibrate(Node(3)), prepares_as("scs2"), reads(3, 34, 0), reads(3, 56, 3, 132))
    assert "mount the horn" in caught.value.advice


def test_an_arc_has_ends_and_is_not_gone_around() -> None:
    """Counts 1000 and 20 of an SCS are nearly an arc apart, although 44 counts would do around a whole turn."""
    with pytest.raises(RequestError, match="980 counts"):
        play(
            calibrate(Node(3), 20 * math.radians(300) / 1024),
            *(prepares_as("scs2"), reads(3, 34, 0), reads(3, 56, 3, 232)),
        )


def test_another_resolution_is_not_reckoned_with() -> None:
    with pytest.raises(RequestError, match="angular resolution"):
        play(calibrate(Node(3)), prepares_as("sts", angular_resolution=2))


def test_where_its_zero_is_can_be_read() -> None:
    told = play(zero(Node(3)), prepares_as("sts"), *pose(600, -1448))
    assert told.position == pytest.approx(600 * COUNT)
    assert told.raw_offset == -1448
    assert told.offset == pytest.approx(-1448 * COUNT)
    assert told.limits == pytest.approx((0.0, 4095 * COUNT))


# -- on simulated servos of every map ------------------------------------------------------------------------


OFFSETS = [name for name in TABLES if CONTROL[name].middle is not Middle.NONE]


@pytest.mark.parametrize("name", OFFSETS)
def test_a_servo_of_every_map_keeps_its_new_middle(name: str) -> None:
    with simulated(name) as (real, servo):
        turn = CONTROL[name].turn
        real.raw_position = turn // 2 + 100
        told = servo.calibrate()
        assert (told.raw_new_offset, real.raw_position) == (100, turn // 2)
        assert real.memory["lock"] == 1
        assert real.memory["torque_enable"] == 0
        again = servo.calibrate()
        assert (again.raw_old_offset, again.raw_new_offset) == (100, 100)
        real.power_cycle()
        assert real.raw_position == turn // 2
        assert servo.position() == pytest.approx(told.after)


@pytest.mark.parametrize("name", [name for name in OFFSETS if CONTROL[name].turn == 4096])
def test_any_pose_can_have_any_name(name: str) -> None:
    with simulated(name) as (real, servo):
        for stands, goal in ((0, 2047), (4095, 2047), (1, 4095), (4000, 0), (2048, 2048), (0, 2048)):
            real.raw_position = stands
            told = servo.calibrate(goal * COUNT)
            assert abs(shortest(real.raw_position - goal, 4096)) == (1 if told.note else 0)
            assert abs(told.raw_new_offset) <= TABLES[name]["homing_offset"].high


def test_one_that_ignores_the_instruction_is_told_and_the_offset_does_it() -> None:
    with simulated("hls", calibrate="ignore") as (real, servo):
        real.raw_position = 1000
        with pytest.raises(DeviceError, match="did not change its homing offset"):
            servo.calibrate()
        assert real.memory["lock"] == 1
        assert servo.calibrate(how="offset").how == "offset"
        assert real.raw_position == 2048


def test_scs_servos_are_left_alone() -> None:
    with simulated("scs") as (real, servo):
        before = bytes(real.memory.live)
        with pytest.raises(MotorbusError, match="no homing offset"):
            servo.calibrate()
        assert bytes(real.memory.live)[:56] == before[:56]


def test_settings_are_read_again_afterwards() -> None:
    node = met("sts")
    play(calibrate(node, 100 * COUNT), *by_offset((600, 0), 500, 100))
    assert node.settings is None
    assert eeprom("sts")[31:33] == b"\0\0"
