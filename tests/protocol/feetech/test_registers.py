"""All six maps against a list typed by hand from the vendor's data, and rules that hold in each of them.

The list (`typed_rows.py`) says everything a second time on purpose, independent of how maps are derived.
"""

from __future__ import annotations

from itertools import pairwise
from math import tau

import pytest

from motorbus.core.register import Access, Coding, Register, RegisterMap, Storage
from motorbus.core.request import Effect
from motorbus.errors import RequestError
from motorbus.families.feetech.registers import HLS, SCS, SCS2, SMBL, SMCL, STS, TABLES
from motorbus.families.feetech.registers.codes import ALARM_BITS, BAUD_CODES, BAUD_CODES_OF, PHASE_BITS
from motorbus.families.feetech.registers.rows import SOURCES
from tests.protocol.feetech.typed_rows import COMMON, IN_DOUBT, ROWS
from tests.protocol.feetech.vectors import VALID

# Raw values that a map's own documents give as shipped.
SHIPPED = {
    "smbl": {"baud_rate": 4, "return_delay": 250},
    "smcl": {"baud_rate": 4, "return_delay": 250},
    "scs": {
        "min_position_limit": 20, "max_position_limit": 1003, "max_temperature": 80, "max_voltage": 90,
        "min_voltage": 45, "max_torque": 1000, "phase": 0, "unload_mask": 36, "led_mask": 37, "position_p": 15,
        "position_d": 15, "position_i": 0, "min_start_force": 30, "dead_band_cw": 1, "dead_band_ccw": 1,
        "hysteresis": 1, "protective_torque": 20, "overload_time": 100, "overload_torque": 80,
        "torque_enable": 0, "goal_time": 0, "goal_velocity": 0, "lock": 1, "return_delay": 0,
    },
    "hls": {"max_torque": 980, "torque_limit": 980, "baud_rate": 0},
}  # fmt: skip
SCALES = {
    ("smbl", "goal_velocity"): 0.00153398, ("smcl", "present_position"): 0.00153398,
    ("scs", "goal_position"): 0.00511327, ("scs", "overload_time"): 0.04, ("scs", "goal_velocity"): 0.00511327,
    ("scs2", "homing_offset"): 0.00511327, ("scs2", "overcurrent_time"): 0.04, ("scs2", "dead_band_cw"): 0.00511327,
    ("scs2", "present_current"): 0.0065,
    ("hls", "goal_velocity"): 0.0766990, ("hls", "present_velocity"): 0.0766990, ("hls", "goal_torque"): 0.0065,
    ("hls", "acceleration"): 0.153398, ("hls", "protection_current"): 0.0065, ("hls", "overcurrent_time"): 0.01,
}  # fmt: skip
ALL = [(table, row) for table in TABLES.values() for row in table.values()]
OF_EACH = pytest.mark.parametrize("table", TABLES.values(), ids=lambda table: str(table.name))


def spread(row: Register) -> list[int]:
    """Raw values of a row from end to end: all of a row of one byte, and a thousand or so of a longer one."""
    step = max(1, (row.high - row.low) // 997)
    between = {*range(row.low, row.high + 1, step), -1, 0, 1, row.high - 1, row.high}
    return sorted(raw for raw in between if row.low <= raw <= row.high)


def typed(register_map: str) -> list[str]:
    lines = (COMMON + ROWS[register_map]).split("\n")
    return sorted((line for line in lines if line), key=lambda line: int(line.split()[0]))


def line_of(row: Register) -> str:
    storage = {Storage.EEPROM: "E", Storage.RAM: "S", Storage.FACTORY: "F"}[row.storage]
    sign = "-" if row.sign_bit is None else row.sign_bit
    return f"{row.address} {row.name} {row.size} {storage} {row.access.value} {sign} {row.low} {row.high}"


# --- against the list ---------------------------------------------------------------------------------------


def test_there_are_six_maps_and_the_usual_one_comes_first() -> None:
    assert list(TABLES.items()) == [
        ("sts", STS), ("smbl", SMBL), ("smcl", SMCL), ("scs", SCS), ("scs2", SCS2), ("hls", HLS),
    ]  # fmt: skip


@OF_EACH
def test_the_map_has_these_rows_and_no_others(table: RegisterMap) -> None:
    assert [line_of(row) for row in table.values()] == typed(table.name)


@pytest.mark.parametrize("name", SHIPPED)
def test_it_ships_as_its_documents_say(name: str) -> None:
    assert {row: TABLES[name][row].default for row in SHIPPED[name]} == SHIPPED[name]


def test_a_default_of_an_sts3215_is_no_default_of_another_servo() -> None:
    for name in ("max_voltage", "protection_current", "unload_mask", "position_p", "phase"):
        assert STS[name].default is not None
        assert [SMBL[name].default, SMCL[name].default, HLS[name].default] == [None, None, None]


def test_units_are_those_of_the_series() -> None:
    scales = {(name, row): TABLES[name][row].scale for name, row in SCALES}
    assert scales == {key: pytest.approx(scale, rel=1e-5) for key, scale in SCALES.items()}
    assert SCS["present_current"].unit == ""


def test_the_same_name_means_the_same_quantity_in_every_map() -> None:
    units: dict[str, set[str]] = {}
    for _, row in ALL:
        units.setdefault(row.name, set()).add(row.unit)
    assert {name: found for name, found in units.items() if len(found) > 1} == {"present_current": {"", "A"}}


def test_the_address_of_the_lock_is_another_thing_in_half_of_the_maps() -> None:
    at_48 = {table.name: row.name for table in TABLES.values() if (row := table.at(48))}
    assert at_48 == {
        "sts": "torque_limit", "smbl": "torque_limit", "hls": "torque_limit",
        "smcl": "lock", "scs": "lock", "scs2": "lock",
    }  # fmt: skip
    assert {table.name for table in TABLES.values() if table.at(55)} == {"sts", "smbl", "hls"}


# --- rules --------------------------------------------------------------------------------------------------


@OF_EACH
def test_rows_do_not_overlap_and_have_one_or_two_bytes(table: RegisterMap) -> None:
    assert {row.size for row in table.values()} == {1, 2}
    for before, after in pairwise(table.values()):
        assert before.address + before.size <= after.address


@OF_EACH
def test_eeprom_lies_below_40_ram_below_77_and_the_rest_is_the_makers(table: RegisterMap) -> None:
    for row in table.values():
        expected = (
            Storage.EEPROM if row.address < 40 else Storage.RAM if row.address < 77 else Storage.FACTORY
        )
        assert row.storage is expected, row.name


@OF_EACH
def test_one_byte_order_holds_for_all_rows(table: RegisterMap) -> None:
    assert {row.order for row in table.values()} == {"big" if table.name in ("scs", "scs2") else "little"}


@OF_EACH
def test_defaults_and_choices_are_in_range(table: RegisterMap) -> None:
    for row in table.values():
        assert row.default is None or row.low <= row.default <= row.high, row.name
        assert all(row.low <= choice <= row.high for choice in row.choices), row.name
        assert all(bit < 8 * row.size for bit in row.bits), row.name


@OF_EACH
def test_what_must_not_be_copied_between_servos_is_protected(table: RegisterMap) -> None:
    protected = {row.name for row in table.values() if row.protected}
    own = {"id", "baud_rate", "phase", "homing_offset", "second_id"} & set(table)
    assert protected == own | {
        row.name for row in table.values() if not row.writable and row.storage is not Storage.RAM
    }


@OF_EACH
def test_every_write_has_its_strongest_effect(table: RegisterMap) -> None:
    moving = {
        *("goal_position", "goal_time", "goal_velocity", "goal_torque", "operating_mode", "homing_offset"),
        *("angular_resolution", "phase", "control_loop"),
        *(("min_position_limit", "max_position_limit") if table.name in ("scs", "scs2") else ()),
    }
    limit = "torque_limit" if "torque_limit" in table else "max_torque"  # the one that acts at once
    for row in table.values():
        expected = (
            Effect.NONE if not row.writable
            else Effect.MOTION if row.name in moving
            else Effect.TORQUE if row.name in ("torque_enable", limit)
            else Effect.IDENTITY if row.name in ("id", "second_id", "baud_rate")
            else Effect.PERSISTENT if row.storage is Storage.EEPROM or row.name == "lock"
            else Effect.NONE
        )  # fmt: skip
        assert row.effect is expected, row.name


@OF_EACH
def test_every_row_says_where_it_is_from_and_not_from_a_table_of_another_series(table: RegisterMap) -> None:
    for row in table.values():
        assert len(row.source) > 10
        assert table is STS or "STS3215 memory table" not in row.source, row.name
        assert table is STS or "V3.6" not in row.note + row.conflict, row.name


@OF_EACH
def test_what_is_in_doubt_is_marked_and_nothing_else_is(table: RegisterMap) -> None:
    assert {row.address for row in table.values() if row.conflict} == set(IN_DOUBT[table.name])


@OF_EACH
def test_a_conflict_says_what_was_chosen(table: RegisterMap) -> None:
    for row in table.values():
        if row.conflict:
            sources, chosen, what = row.conflict.partition(" Chosen: ")
            assert len(sources) > 15, row.name
            assert chosen, row.name
            assert what, row.name


WHO = (
    "FD",
    "V3.6",
    "lerobot",
    "rustypot",
    "SDK",
    "HLS table",
    "SCS table",
    "servolab",
    "newer pages",
    "header",
)


@OF_EACH
def test_a_note_without_a_conflict_never_names_two_sources(table: RegisterMap) -> None:
    for row in table.values():
        assert "chosen" not in row.note.lower(), row.name
        assert sum(who in row.note for who in WHO) < 2, row.name


# --- bytes --------------------------------------------------------------------------------------------------


@OF_EACH
def test_every_row_brings_its_raw_values_back(table: RegisterMap) -> None:
    for row in table.values():
        for raw in spread(row):
            coded = row.encode(raw)
            code = int.from_bytes(coded, "big" if table.name in ("scs", "scs2") else "little")
            assert len(coded) == row.size, row.name
            assert code == abs(raw) | (1 << (row.sign_bit or 0) if raw < 0 else 0), row.name
            assert (row.decode(coded), row.to_raw(row.to_value(raw))) == (raw, raw), row.name


def test_the_same_number_has_its_bytes_the_other_way_round_on_scs() -> None:
    assert STS["goal_position"].encode(0x0208) == bytes.fromhex("08 02")
    assert SCS["goal_position"].encode(0x0208) == bytes.fromhex("02 08")
    assert SCS["present_velocity"].decode(bytes.fromhex("80 05")) == -5
    assert SCS2["homing_offset"].encode(-100) == bytes.fromhex("E4")
    assert HLS["homing_offset"].encode(-4095) == bytes.fromhex("FF 8F")
    assert SMCL["homing_offset"].encode(-1652) == bytes.fromhex("74 0E")
    assert HLS["goal_torque"].encode(-500) == bytes.fromhex("F4 81")


def test_signed_rows_are_sign_magnitude_and_no_others_are() -> None:
    for _, row in ALL:
        assert (row.coding is Coding.SIGN_MAGNITUDE) == (row.sign_bit is not None)
        assert row.access in (Access.READ, Access.READ_WRITE)


@OF_EACH
def test_notes_speak_only_of_registers_that_the_map_has(table: RegisterMap) -> None:
    every = {row.name for other in TABLES.values() for row in other.values()}
    for row in table.values():
        named = {word.strip(".,:;()") for word in f"{row.note} {row.conflict}".split()} & every - {
            "id",
            "lock",
            "phase",
            "moving",
        }
        assert named <= set(table), row.name


# --- signs and units ----------------------------------------------------------------------------------------


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
        ("overload_torque", 80, 0.8),
        ("return_delay", 250, 0.0005),
        ("overload_time", 200, 2.0),
        ("present_temperature", 30, 30),
        ("goal_time", 500, 500),
    ],
)
def test_values_are_raw_times_scale(name: str, raw: int, value: float) -> None:
    assert STS[name].to_value(raw) == pytest.approx(value, rel=1e-12)
    assert STS[name].to_raw(value) == raw


def test_signed_rows_on_the_wire() -> None:
    assert STS["homing_offset"].encode(-1652) == bytes.fromhex("74 0E")
    assert STS["goal_time"].encode(-1000) == bytes.fromhex("E8 07")
    assert STS["goal_position"].encode(-2608) == bytes.fromhex("30 8A")
    telemetry = next(vector for vector in VALID if vector.id == "telemetry").parameters
    values = {
        row.name: row.decode(telemetry[row.address - 56 :][: row.size])
        for row in STS.values()
        if 56 <= row.address < 71
    }
    assert values == {
        "present_position": 1304, "present_velocity": 0, "present_load": -50, "present_voltage": 121,
        "present_temperature": 30, "reg_write_pending": 0, "hardware_error": 0, "moving": 1,
        "goal_position_echo": 0, "present_current": 300,
    }  # fmt: skip


@OF_EACH
def test_a_value_that_would_reach_into_the_sign_is_refused(table: RegisterMap) -> None:
    for row in table.values():
        for outside in (row.low - 1, row.high + 1, 1 << 20):
            with pytest.raises(RequestError, match="out of range"):
                row.encode(outside)
        if row.sign_bit is not None:
            assert (
                row.decode(
                    (1 << row.sign_bit).to_bytes(row.size, "little" if row.order == "little" else "big")
                )
                == 0
            )


# --- codes --------------------------------------------------------------------------------------------------


def test_baud_codes_are_those_of_the_vendor() -> None:
    assert list(BAUD_CODES.items()) == list(enumerate((
        1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400, 19_200, 14_400, 9_600, 4_800,
    )))  # fmt: skip
    for name, codes in BAUD_CODES_OF.items():
        row = TABLES[name]["baud_rate"]
        assert row.choices == {code: f"{BAUD_CODES[code]} bit/s" for code in codes}
        assert row.high == max(codes)


@OF_EACH
def test_bits_are_those_of_the_series(table: RegisterMap) -> None:
    for name in ("hardware_error", "unload_mask", "led_mask"):
        assert table[name].bits == ALARM_BITS[table.name]
    assert table["phase"].bits == PHASE_BITS[table.name]


def test_every_source_is_cited() -> None:
    cited = {source for _, row in ALL for source in row.source.split("; ")}
    assert cited == set(SOURCES.values())
