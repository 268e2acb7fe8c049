"""Which register plays which part in each map: typed by hand once more, and every part is a row that fits it."""

from __future__ import annotations

import pytest

from motorbus.core.register import Storage
from motorbus.families.feetech.table import CONTROL, TABLES, Middle, Mode, mode_of


def test_every_map_has_its_control_and_no_other() -> None:
    assert set(CONTROL) == set(TABLES)


@pytest.mark.parametrize("name", TABLES)
def test_every_part_is_played_by_a_row_of_the_map_in_ram(name: str) -> None:
    control, table = CONTROL[name], TABLES[name]
    for part in (control.duty, control.current, control.limit, control.time, control.acceleration):
        assert not part or table[part].storage is Storage.RAM
    assert bool(control.modes) == ("operating_mode" in table)
    assert (control.middle is Middle.NONE) == ("homing_offset" not in table)
    assert bool(control.limit) == ("torque_limit" in table)


@pytest.mark.parametrize("name", [name for name in TABLES if CONTROL[name].modes])
def test_modes_are_choices_of_the_row(name: str) -> None:
    choices = TABLES[name]["operating_mode"].choices
    words = {
        code: choices[code].replace("constant current", "current").lower() for code in CONTROL[name].modes
    }
    assert words == {code: mode.value for code, mode in CONTROL[name].modes.items()}


@pytest.mark.parametrize(
    ("name", "code", "limits", "mode"),
    [
        ("sts", 0, (0, 4095), Mode.POSITION),
        ("sts", 2, (0, 0), Mode.PWM),
        ("sts", 3, (0, 0), Mode.STEP),
        ("smcl", 2, (0, 4095), Mode.PWM),
        ("smcl", 3, (0, 4095), None),
        ("hls", 2, (0, 4095), Mode.CURRENT),
        ("hls", 3, (0, 4095), Mode.PWM),
        ("hls", 4, (0, 4095), None),
        ("scs", None, (20, 1003), Mode.POSITION),
        ("scs", None, (0, 0), Mode.PWM),
        ("scs2", None, (0, 0), Mode.PWM),
        ("sts", None, (0, 4095), None),
    ],
)
def test_the_mode_follows_from_register_or_limits(
    name: str, code: int | None, limits: tuple[int, int], mode: Mode | None
) -> None:
    assert mode_of(name, code, limits) is mode


def test_the_code_of_a_mode_is_another_on_hls() -> None:
    assert CONTROL["sts"].code(Mode.PWM) == 2
    assert CONTROL["hls"].code(Mode.PWM) == 3
    assert CONTROL["hls"].code(Mode.STEP) is None
    assert CONTROL["scs"].code(Mode.POSITION) is None


def test_every_map_has_position_and_pwm_mode_and_its_own_besides() -> None:
    others = {name: set(one.has) - {Mode.POSITION, Mode.PWM} for name, one in CONTROL.items()}
    assert others == {
        "sts": {Mode.VELOCITY, Mode.STEP},
        "smbl": {Mode.VELOCITY, Mode.STEP},
        "smcl": {Mode.VELOCITY},
        "scs": set(),
        "scs2": set(),
        "hls": {Mode.VELOCITY, Mode.CURRENT},
    }
    assert all({Mode.POSITION, Mode.PWM} <= set(one.has) for one in CONTROL.values())


def test_that_a_goal_switches_torque_on_was_measured_on_sts_alone() -> None:
    assert [name for name, one in CONTROL.items() if one.goal_switches_on] == ["sts"]
