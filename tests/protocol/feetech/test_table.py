"""The STS map row by row, and every way it writes a negative number."""

from __future__ import annotations

from math import isclose, tau

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from motorbus.core.register import Access, Coding, Register, Storage
from motorbus.core.request import Effect
from motorbus.errors import RequestError
from motorbus.families.feetech.table import ALARM_BITS, STS
from tests.families.feetech.maps import spread
from tests.protocol.feetech.vectors import VALID

# address: name, bytes, sign bit (None: unsigned), lowest, highest, shipped
ROWS: dict[int, tuple[str, int, int | None, int, int, int | None]] = {
    0: ("firmware_major", 1, None, 0, 255, 3),
    1: ("firmware_minor", 1, None, 0, 255, 10),
    2: ("byte_order", 1, None, 0, 1, 0),
    3: ("model_major", 1, None, 0, 255, 9),
    4: ("model_minor", 1, None, 0, 255, 3),
    5: ("id", 1, None, 0, 253, 1),
    6: ("baud_rate", 1, None, 0, 7, 0),
    7: ("return_delay", 1, None, 0, 254, 0),
    8: ("status_return_level", 1, None, 0, 1, 1),
    9: ("min_position_limit", 2, 15, 0, 4094, 0),
    11: ("max_position_limit", 2, 15, 0, 4095, 4095),
    13: ("max_temperature", 1, None, 0, 100, 70),
    14: ("max_voltage", 1, None, 0, 254, 80),
    15: ("min_voltage", 1, None, 0, 254, 40),
    16: ("max_torque", 2, None, 0, 1000, 1000),
    18: ("phase", 1, None, 0, 255, 12),
    19: ("unload_mask", 1, None, 0, 255, 44),
    20: ("led_mask", 1, None, 0, 255, 47),
    21: ("position_p", 1, None, 0, 254, 32),
    22: ("position_d", 1, None, 0, 254, 32),
    23: ("position_i", 1, None, 0, 254, 0),
    24: ("min_start_force", 1, None, 0, 254, 16),
    25: ("integral_limit", 1, None, 0, 254, 0),
    26: ("dead_band_cw", 1, None, 0, 32, 1),
    27: ("dead_band_ccw", 1, None, 0, 32, 1),
    28: ("protection_current", 2, None, 0, 1023, 500),
    30: ("angular_resolution", 1, None, 1, 4, 1),
    31: ("homing_offset", 2, 11, -2047, 2047, 0),
    33: ("operating_mode", 1, None, 0, 3, 0),
    34: ("protective_torque", 1, None, 0, 100, 20),
    35: ("overload_time", 1, None, 0, 254, 200),
    36: ("overload_torque", 1, None, 0, 100, 80),
    37: ("velocity_p", 1, None, 0, 254, 10),
    38: ("overcurrent_time", 1, None, 0, 254, 200),
    39: ("velocity_i", 1, None, 0, 254, 10),
    40: ("torque_enable", 1, None, 0, 128, 0),
    41: ("acceleration", 1, None, 0, 254, 0),
    42: ("goal_position", 2, 15, -32766, 32766, None),
    44: ("goal_time", 2, 10, -1000, 1000, 0),
    46: ("goal_velocity", 2, 15, -32766, 32766, 0),
    48: ("torque_limit", 2, None, 0, 1000, 1000),
    55: ("lock", 1, None, 0, 1, 1),
    56: ("present_position", 2, 15, -32767, 32767, None),
    58: ("present_velocity", 2, 15, -32767, 32767, None),
    60: ("present_load", 2, 10, -1000, 1000, None),
    62: ("present_voltage", 1, None, 0, 255, None),
    63: ("present_temperature", 1, None, 0, 255, None),
    64: ("reg_write_pending", 1, None, 0, 1, 0),
    65: ("hardware_error", 1, None, 0, 255, 0),
    66: ("moving", 1, None, 0, 1, None),
    67: ("goal_position_echo", 2, 15, -32767, 32767, None),
    69: ("present_current", 2, 15, -32767, 32767, None),
    80: ("moving_threshold", 1, None, 0, 255, None),
    81: ("dts", 1, None, 0, 255, None),
    82: ("velocity_unit", 1, None, 0, 255, None),
    83: ("hts", 1, None, 0, 255, None),
    84: ("max_velocity_limit", 1, None, 0, 255, None),
    85: ("max_acceleration", 1, None, 0, 255, None),
    86: ("acceleration_multiplier", 1, None, 0, 255, None),
}
UNITS = {
    "rad": (
        "min_position_limit max_position_limit dead_band_cw dead_band_ccw homing_offset goal_position "
        "present_position goal_position_echo"
    ),
    "rad/s": "goal_velocity present_velocity",
    "rad/s²": "acceleration",
    "V": "max_voltage min_voltage present_voltage",
    "A": "protection_current present_current",
    "°C": "max_temperature present_temperature",
    "s": "return_delay overload_time overcurrent_time",
    "fraction": ("max_torque min_start_force protective_torque overload_torque torque_limit present_load"),
}
EFFECTS = {
    Effect.IDENTITY: "id baud_rate",
    Effect.TORQUE: "torque_enable torque_limit",
    Effect.MOTION: (
        "goal_position goal_time goal_velocity operating_mode homing_offset angular_resolution phase"
    ),
}


def named(words: str) -> set[str]:
    return set(words.split())


# --- the rows -----------------------------------------------------------------------------------------------


def test_the_map_has_these_rows_and_no_others() -> None:
    told = {
        row.address: (row.name, row.size, row.sign_bit, row.low, row.high, row.default)
        for row in STS.values()
    }
    assert told == ROWS
    assert [row.address for row in STS.values()] == sorted(ROWS)


def test_no_two_rows_overlap_and_every_word_is_little_endian() -> None:
    covered = [row.address + at for row in STS.values() for at in range(row.size)]
    assert len(covered) == len(set(covered))
    assert {row.order for row in STS.values()} == {"little"}


def test_only_rows_with_a_sign_bit_are_signed() -> None:
    for row in STS.values():
        assert (row.coding is Coding.SIGN_MAGNITUDE) == (row.sign_bit is not None)
        assert max(abs(row.low), abs(row.high)) < 1 << (
            8 * row.size if row.sign_bit is None else row.sign_bit
        )


def test_every_row_says_where_it_is_from_in_plain_words() -> None:
    for row in STS.values():
        assert len(row.source) > 10
        assert not any(f"S{number}" in row.source.replace("STS", "") for number in range(1, 8))


def test_what_is_kept_lies_below_40_and_what_is_forgotten_above() -> None:
    for row in STS.values():
        expected = (
            Storage.EEPROM if row.address < 40 else Storage.RAM if row.address < 80 else Storage.FACTORY
        )
        assert row.storage is expected


def test_feedback_identity_and_factory_rows_cannot_be_written() -> None:
    read_only = {row.address for row in STS.values() if row.access is Access.READ}
    assert read_only == {address for address in ROWS if address < 5 or address >= 56}
    assert all(row.readable for row in STS.values())


def test_what_must_not_be_copied_between_servos_is_protected() -> None:
    assert {row.address for row in STS.values() if row.protected} == {*range(7), 18, 31, *range(80, 87)}


def test_every_write_says_the_worst_it_can_do() -> None:
    effects = {effect: named(words) for effect, words in EFFECTS.items()}
    for row in STS.values():
        expected = next((effect for effect, names in effects.items() if row.name in names), None)
        if expected is None:
            lasting = row.writable and (row.storage is Storage.EEPROM or row.name == "lock")
            expected = Effect.PERSISTENT if lasting else Effect.NONE
        assert row.effect is expected, row.name


def test_rows_have_the_units_of_the_api() -> None:
    units = {name: unit for unit, words in UNITS.items() for name in named(words)}
    assert {row.name: row.unit for row in STS.values() if row.unit} == units


@pytest.mark.parametrize(
    ("name", "raw", "value"),
    [
        ("goal_position", 4096, tau),
        ("goal_position", -1024, -tau / 4),
        ("goal_velocity", 1000, 1.5339807878856412),
        ("acceleration", 254, 38.96311201229528),
        ("present_current", 500, 3.25),
        ("present_voltage", 121, 12.1),
        ("present_load", -50, -0.05),
        ("torque_limit", 1000, 1.0),
        ("overload_torque", 80, 0.8),
        ("return_delay", 250, 0.0005),
        ("overload_time", 200, 2.0),
        ("present_temperature", 30, 30),
        ("homing_offset", 2048 - 1, tau * 2047 / 4096),
        ("goal_time", 500, 500),
    ],
)
def test_values_are_raw_times_scale(name: str, raw: int, value: float) -> None:
    assert isclose(STS[name].to_value(raw), value, rel_tol=1e-12)
    assert STS[name].to_raw(value) == raw


def test_choices_and_bits_name_what_a_value_means() -> None:
    assert STS["operating_mode"].choices == {0: "position", 1: "velocity", 2: "PWM", 3: "step"}
    assert STS["baud_rate"].choices[5] == "76800 bit/s"
    assert set(STS["torque_enable"].choices) == {0, 1, 2, 128}
    for name in ("hardware_error", "unload_mask", "led_mask"):
        assert STS[name].bits == ALARM_BITS
    assert set(STS["phase"].bits) == set(range(8))
    for row in STS.values():
        assert all(row.low <= choice <= row.high for choice in row.choices)


def test_where_sources_disagree_the_row_says_so() -> None:
    disputed = (7, 11, 24, 25, 28, 30, 31, 41, 44, 55, 67)
    assert all((row := STS.at(address)) and row.conflict for address in disputed)
    assert all((row := STS.at(address)) and row.note for address in (9, 46, 85))


# --- signs --------------------------------------------------------------------------------------------------


def signed(bit: int, size: int) -> Register:
    most = (1 << bit) - 1
    return Register(
        name=f"sm{bit}",
        address=0,
        size=size,
        access=Access.READ_WRITE,
        storage=Storage.RAM,
        source="a row of this test",
        coding=Coding.SIGN_MAGNITUDE,
        sign_bit=bit,
        low=-most,
        high=most,
    )


SIGNED = [signed(15, 2), signed(11, 2), signed(10, 2), signed(7, 1)]


@pytest.mark.parametrize("row", SIGNED, ids=lambda row: row.name)
@given(data=st.data())
def test_every_signed_number_comes_back(row: Register, data: st.DataObject) -> None:
    raw = data.draw(st.integers(row.low, row.high))
    coded = row.encode(raw)
    bit = row.sign_bit or 0
    assert row.decode(coded) == raw
    assert int.from_bytes(coded, "little") == abs(raw) + (1 << bit if raw < 0 else 0)


@pytest.mark.parametrize("row", SIGNED, ids=lambda row: row.name)
@given(raw=st.integers(-(1 << 20), 1 << 20))
def test_a_magnitude_that_would_spill_into_the_sign_is_refused(row: Register, raw: int) -> None:
    assume(not row.low <= raw <= row.high)
    with pytest.raises(RequestError, match="out of range"):
        row.encode(raw)


@pytest.mark.parametrize("row", SIGNED, ids=lambda row: row.name)
def test_a_negative_zero_is_zero(row: Register) -> None:
    assert row.decode((1 << (row.sign_bit or 0)).to_bytes(row.size, "little")) == 0


@pytest.mark.parametrize("row", STS.values(), ids=lambda row: row.name)
def test_every_row_brings_its_raw_values_back(row: Register) -> None:
    for raw in spread(row):
        coded = row.encode(raw)
        assert len(coded) == row.size
        assert row.decode(coded) == raw
        assert row.to_raw(row.to_value(raw)) == raw
    for outside in (row.low - 1, row.high + 1):
        with pytest.raises(RequestError):
            row.encode(outside)


def test_signed_rows_are_sign_magnitude_as_on_the_wire() -> None:
    assert STS["homing_offset"].encode(-1652) == bytes.fromhex("74 0E")
    assert STS["goal_time"].encode(-1000) == bytes.fromhex("E8 07")
    assert STS["goal_position"].encode(-2608) == bytes.fromhex("30 8A")
    telemetry = next(vector for vector in VALID if vector.id == "telemetry").parameters
    told = {
        row.name: row.decode(telemetry[row.address - 56 :][: row.size])
        for row in STS.values()
        if 56 <= row.address < 71
    }
    assert told == {
        "present_position": 1304,
        "present_velocity": 0,
        "present_load": -50,
        "present_voltage": 121,
        "present_temperature": 30,
        "reg_write_pending": 0,
        "hardware_error": 0,
        "moving": 1,
        "goal_position_echo": 0,
        "present_current": 300,
    }
