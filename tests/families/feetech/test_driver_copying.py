"""What may be copied from one servo to another, in every map: settings, and never what belongs to one servo alone."""

from __future__ import annotations

import pytest

from motorbus.core.entry import Storage
from motorbus.core.operation import Effect
from motorbus.families.feetech.driver import copyable
from motorbus.families.feetech.table import TABLES

NEVER = {*range(7), 18, *range(77, 87)}
"""Identity, id and rate; the phase register; the factory's own."""


@pytest.mark.parametrize("name", TABLES)
def test_what_belongs_to_one_servo_alone_is_never_copied(name: str) -> None:
    rows = copyable(TABLES[name])
    assert NEVER.isdisjoint(row.address for row in rows)
    assert {"homing_offset", "second_id", "id", "baud_rate", "phase"}.isdisjoint(row.name for row in rows)
    assert all(row.storage is Storage.EEPROM and row.writable and not row.protected for row in rows)
    assert Effect.IDENTITY not in {row.effect for row in rows}


@pytest.mark.parametrize("name", TABLES)
def test_the_calibration_is_left_out_wherever_a_map_has_it(name: str) -> None:
    """31 on STS, SMBL and HLS, 33 on SMCL, 34 on SCS2; SCS2 has a protection time at 31, which is copied."""
    table = TABLES[name]
    place = {"sts": 31, "smbl": 31, "hls": 31, "smcl": 33, "scs2": 34}.get(name)
    assert ("homing_offset" in table) == (place is not None)
    copied = {row.address for row in copyable(table)}
    assert place not in copied
    assert (31 in copied) == (name == "scs2")


@pytest.mark.parametrize("name", TABLES)
def test_settings_are_copied(name: str) -> None:
    names = [row.name for row in copyable(TABLES[name])]
    assert {"max_temperature", "max_torque", "position_p", "min_position_limit", "unload_mask"} <= set(names)
    assert len(names) == len(set(names))
