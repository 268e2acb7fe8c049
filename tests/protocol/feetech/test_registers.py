"""All six maps against a list typed by hand from the vendor's data, and rules that hold in each of them.

The list (`typed_rows.py`) says everything a second time on purpose, independent of how maps are derived.
"""

from __future__ import annotations

from itertools import pairwise

import pytest

from motorbus.core.register import Coding, Register, RegisterMap, Storage
from motorbus.core.request import Effect
from motorbus.errors import RequestError
from motorbus.families.feetech.registers import HLS, SCS, SCS2, SMBL, SMCL, STS, TABLES
from motorbus.families.feetech.registers.codes import ALARM_BITS, BAUD_CODES, BAUD_CODES_OF, PHASE_BITS
from motorbus.families.feetech.registers.rows import SOURCES
from tests.protocol.feetech.typed_rows import IN_DOUBT, ROWS
from tests.protocol.feetech.vectors import VALID

# Raw values that a map's own documents give as shipped.
SHIPPED: dict[str, dict[str, int | None]] = {
    "smbl": {"baud_rate": 4, "return_delay": 250, "max_voltage": None, "position_p": None, "phase": None},
    "smcl": {"baud_rate": 4, "return_delay": 250, "max_voltage": None, "position_p": None, "phase": None},
    "scs": {
        "min_position_limit": 20, "max_position_limit": 1003, "max_temperature": 80, "max_voltage": 90,
        "min_voltage": 45, "max_torque": 1000, "phase": 0, "unload_mask": 36, "led_mask": 37, "position_p": 15,
        "position_d": 15, "position_i": 0, "min_start_force": 30, "dead_band_cw": 1, "dead_band_ccw": 1,
        "hysteresis": 1, "protective_torque": 20, "overload_time": 100, "overload_torque": 80,
        "torque_enable": 0, "goal_time": 0, "goal_velocity": 0, "lock": 1, "return_delay": 0,
    },
    "hls": {"max_torque": 980, "torque_limit": 980, "baud_rate": 0, "unload_mask": None, "position_p": None},
}  # fmt: skip
SCALES = {
    ("sts", "goal_position"): 0.00153398, ("sts", "acceleration"): 0.153398, ("sts", "present_voltage"): 0.1,
    ("sts", "present_load"): 0.001, ("sts", "overload_torque"): 0.01, ("sts", "return_delay"): 2e-6,
    ("smbl", "goal_velocity"): 0.00153398, ("smcl", "present_position"): 0.00153398,
    ("scs", "goal_position"): 0.00511327, ("scs", "overload_time"): 0.04, ("scs", "goal_velocity"): 0.00511327,
    ("scs2", "homing_offset"): 0.00511327, ("scs2", "overcurrent_time"): 0.04, ("scs2", "dead_band_cw"): 0.00511327,
    ("scs2", "present_current"): 0.0065,
    ("hls", "goal_velocity"): 0.0766990, ("hls", "present_velocity"): 0.0766990, ("hls", "goal_torque"): 0.0065,
    ("hls", "acceleration"): 0.153398, ("hls", "protection_current"): 0.0065, ("hls", "overcurrent_time"): 0.01,
}  # fmt: skip
OF_EACH = pytest.mark.parametrize("table", TABLES.values(), ids=lambda table: str(table.name))


def line_of(row: Register) -> str:
    storage = {Storage.EEPROM: "E", Storage.RAM: "S", Storage.FACTORY: "F"}[row.storage]
    sign = "-" if row.sign_bit is None else row.sign_bit
    return f"{row.address} {row.name} {row.size} {storage} {row.access.value} {sign} {row.low} {row.high}"


@OF_EACH
def test_the_map_has_these_rows_and_no_others(table: RegisterMap) -> None:
    lines = [line.split(" : ") for line in ROWS.strip().split("\n")]
    typed = [row for row, maps in lines if maps == "all" or table.name in maps.split()]
    assert [line_of(row) for row in table.values()] == typed
    assert {row.order for row in table.values()} == {"big" if table in (SCS, SCS2) else "little"}


def test_defaults_and_units_are_those_of_the_documents() -> None:
    shipped = {name: {row: TABLES[name][row].default for row in rows} for name, rows in SHIPPED.items()}
    assert shipped == SHIPPED
    scales = {(name, row): TABLES[name][row].scale for name, row in SCALES}
    assert scales == {key: pytest.approx(scale, rel=1e-5) for key, scale in SCALES.items()}
    units: dict[str, set[str]] = {}
    for table in TABLES.values():
        for row in table.values():
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
def test_places_ranges_and_coding_fit_together(table: RegisterMap) -> None:
    for before, after in pairwise(table.values()):
        assert before.address + before.size <= after.address
    for row in table.values():
        eeprom_or_ram = Storage.EEPROM if row.address < 40 else Storage.RAM
        assert row.storage is (eeprom_or_ram if row.address < 77 else Storage.FACTORY), row.name
        assert (row.coding is Coding.SIGN_MAGNITUDE) == (row.sign_bit is not None)
        assert row.default is None or row.low <= row.default <= row.high, row.name
        assert all(row.low <= choice <= row.high for choice in row.choices), row.name
        for raw in {row.low, -1, 0, 1, row.high} & {*range(row.low, row.high + 1)}:
            assert row.decode(row.encode(raw)) == raw, row.name
            assert row.to_raw(row.to_value(raw)) == raw, row.name
        for outside in (row.low - 1, row.high + 1, 1 << 20):
            with pytest.raises(RequestError, match="out of range"):
                row.encode(outside)


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
def test_sources_doubts_and_notes_are_those_of_the_map(table: RegisterMap) -> None:
    every = {row.name for other in TABLES.values() for row in other.values()}
    words = every - {"id", "lock", "phase", "moving"}
    assert {row.address for row in table.values() if row.conflict} == set(IN_DOUBT[table.name])
    for row in table.values():
        assert {*row.source.split("; ")} <= set(SOURCES.values())
        assert table is STS or "V3.6" not in row.source + row.note + row.conflict, row.name
        assert not row.conflict or row.conflict.partition(" Chosen: ")[2], row.name
        assert "chosen" not in row.note.lower(), row.name
        named = {word.strip(".,:;()") for word in f"{row.note} {row.conflict}".split()} & words
        assert named <= set(table), row.name


def test_every_source_is_cited() -> None:
    cited = {key for table in TABLES.values() for row in table.values() for key in row.source.split("; ")}
    assert cited == set(SOURCES.values())


# --- bytes and codes ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("table", "name", "raw", "data"),
    [
        (STS, "goal_position", 0x0208, "08 02"),
        (SCS, "goal_position", 0x0208, "02 08"),
        (SCS, "present_velocity", -5, "80 05"),
        (SCS2, "homing_offset", -100, "E4"),
        (HLS, "homing_offset", -4095, "FF 8F"),
        (SMCL, "homing_offset", -1652, "74 0E"),
        (SMBL, "goal_time", -1000, "E8 07"),
        (HLS, "goal_torque", -500, "F4 81"),
    ],
)
def test_values_on_the_wire(table: RegisterMap, name: str, raw: int, data: str) -> None:
    assert (table[name].encode(raw), table[name].decode(bytes.fromhex(data))) == (bytes.fromhex(data), raw)


def test_telemetry_of_an_sts3215() -> None:
    telemetry = next(vector for vector in VALID if vector.id == "telemetry").parameters
    rows = [row for row in STS.values() if 56 <= row.address < 71]
    assert {row.name: row.decode(telemetry[row.address - 56 :][: row.size]) for row in rows} == {
        "present_position": 1304, "present_velocity": 0, "present_load": -50, "present_voltage": 121,
        "present_temperature": 30, "reg_write_pending": 0, "hardware_error": 0, "moving": 1,
        "goal_position_echo": 0, "present_current": 300,
    }  # fmt: skip


def test_codes_and_bits_are_those_of_the_vendor_and_the_series() -> None:
    assert list(BAUD_CODES.items()) == list(enumerate((
        1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400, 19_200, 14_400, 9_600, 4_800,
    )))  # fmt: skip
    for name, table in TABLES.items():
        codes = BAUD_CODES_OF[name]
        assert table["baud_rate"].choices == {code: f"{BAUD_CODES[code]} bit/s" for code in codes}
        assert table["baud_rate"].high == max(codes)
        masks = [table[row].bits for row in ("hardware_error", "unload_mask", "led_mask")]
        assert masks == [ALARM_BITS[name]] * 3
        assert table["phase"].bits == PHASE_BITS[name]
