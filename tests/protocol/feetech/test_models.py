"""Model, map and alarms of a servo by its numbers; how servos of each map are commanded."""

from __future__ import annotations

from itertools import product
from math import pi

import pytest

from motorbus.core.register import Storage
from motorbus.families.feetech.models import MODELS, choose, map_for, model_number
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.registers.codes import alarms
from motorbus.families.feetech.traits import TRAITS, Mode

# firmware major, lowest and highest minor, byte order: map; typed from the vendor's list
FIRMWARE = {
    (0, 0, 39, "big"): "scs",
    (1, 0, 39, "little"): "smcl",
    (2, 40, 69, "little"): "smbl",
    (3, 0, 39, "little"): "sts",
    (3, 20, 39, "big"): "scs2",
    (3, 40, 59, "little"): "hls",
}


def listed(major: int, minor: int, order: str) -> str:
    found = [
        name
        for (there, lowest, highest, needed), name in FIRMWARE.items()
        if (there, needed) == (major, order) and lowest <= minor <= highest
    ]
    return "".join(found)


def test_firmware_and_byte_order_choose_the_map_whatever_the_model_is() -> None:
    for major, minor, order in product((0, 1, 2, 3, 4, 20, 255), range(256), ("little", "big")):
        assert map_for(major, minor, order) == listed(major, minor, order)
    firmwares = [(major, minor) for major in (0, 1, 2, 3, 4, 20) for minor in range(0, 80, 3)]
    for (number, model), firmware, end in product(MODELS.items(), firmwares, (0, 1)):
        assert choose(firmware, number, end) == (listed(*firmware, model.order), model.order, model)
    for end, order in ((0, "little"), (1, "big"), (255, "big")):  # of an unknown model
        assert choose((3, 30), (10, 27), end) == (listed(3, 30, order), order, None)
        assert choose((0, 5), (77, 7), end) == (listed(0, 5, order), order, None)


@pytest.mark.parametrize(
    ("major", "minor", "name", "order", "number"),
    [
        (5, 4, "SCS0009", "big", 1284),
        (6, 26, "SM60-360M", "little", 6662),
        (8, 44, "SM85BLHV", "little", 11272),
        (9, 2, "STS3032", "little", 521),
        (9, 3, "STS3215", "little", 777),
        (9, 20, "SCSXX-2", "big", 2324),
        (10, 18, "HLS3950", "little", 4618),
        (10, 5, "STS3045BL", "little", 1290),
    ],
)
def test_a_model_has_a_name_a_byte_order_and_a_number(
    major: int, minor: int, name: str, order: str, number: int
) -> None:
    assert MODELS[major, minor][:2] == (name, order)
    assert model_number(major, minor, order) == number


def test_all_models_of_the_vendors_configuration_are_known_and_their_arcs_certain_or_in_doubt() -> None:
    counts = {major: sum(1 for found, _ in MODELS if found == major) for major in (5, 6, 8, 9, 10)}
    assert counts == {5: 12, 6: 14, 8: 25, 9: 19, 10: 23}
    for model in MODELS.values():
        assert {TABLES[name]["goal_position"].order for name in model.maps} == {model.order}
        count = TABLES[model.maps[0]]["present_position"].scale
        assert model.arc_doubt or count * model.resolution == pytest.approx(model.arc * pi / 180)
    certain = {model.name for model in MODELS.values() if model.order == "big" and not model.arc_doubt}
    assert certain == {"SCS0009"}
    assert {MODELS[5, minor].arc for minor in (15, 25)} == {200.0}


def test_alarms_have_the_names_of_the_series() -> None:
    assert alarms(0b1101_1111) == (
        "voltage", "sensor", "temperature", "current", "angle", "undefined bit 6", "undefined bit 7",
    )  # fmt: skip
    assert alarms(0b1001, "scs") == ("voltage", "undefined bit 3")
    assert alarms(0b1001, "scs2") == ("voltage", "current")
    assert alarms(0x10, "hls") == ("undefined bit 4",)
    assert alarms(0x10, "smbl") == alarms(0x10, "of no map") == ("angle",)


@pytest.mark.parametrize("name", TABLES)
def test_every_role_is_that_of_a_row_in_ram(name: str) -> None:
    traits, table = TRAITS[name], TABLES[name]
    for role in (traits.duty, traits.current, traits.limit, traits.time, traits.acceleration):
        assert not role or (table[role].storage is Storage.RAM and table[role].writable)
    assert set(traits.modes) <= set(table["operating_mode"].choices if traits.modes else ())
    assert traits.calibrates in ("", "instruction") or "homing_offset" in table
    if traits.duty:
        assert traits.duty_row(table).encode(-1000) in (b"\xe8\x07", b"\x07\xe8")


def test_the_mode_follows_from_register_or_limits() -> None:
    modes = [
        ("sts", 0, (0, 4095), Mode.POSITION),
        ("sts", 3, (0, 0), Mode.STEP),
        ("smcl", 3, (0, 0), None),
        ("hls", 2, (0, 4095), Mode.CURRENT),
        ("hls", 4, (0, 4095), None),
        ("scs", None, (0, 0), Mode.PWM),
        ("scs", None, (0, 1023), Mode.POSITION),
    ]
    for name, code, limits, mode in modes:
        assert TRAITS[name].mode_of(code, limits) is mode
    assert (TRAITS["sts"].code(Mode.PWM), TRAITS["hls"].code(Mode.PWM)) == (2, 3)
    assert TRAITS["sts"].code(Mode.CURRENT) is None
    assert TRAITS["scs"].has == (Mode.POSITION, Mode.PWM)


@pytest.mark.parametrize(
    ("name", "unit", "zero", "turns", "bridge"),
    [
        ("sts", True, True, True, True),
        ("smbl", True, True, True, True),
        ("smcl", False, False, False, False),
        ("scs", False, True, False, False),
        ("scs2", False, True, False, False),
        ("hls", False, False, True, False),
    ],
)
def test_bits_of_the_phase_byte(name: str, unit: bool, zero: bool, turns: bool, bridge: bool) -> None:
    traits = TRAITS[name]
    assert traits.velocity_scale(0) == (50 if unit else 1)
    assert traits.velocity_scale(0xFF) == 1
    assert (traits.zero_is_maximum(0xFF), traits.zero_is_maximum(0xF7)) == (zero, False)
    assert (traits.tells_turns(0xFF), traits.tells_turns(0xEF)) == (turns, False)
    assert traits.tells_current(0) == (name != "scs")
    assert traits.tells_current(0xFF) == (name != "scs" and not bridge)
