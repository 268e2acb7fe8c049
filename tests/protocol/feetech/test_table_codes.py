"""What a servo says of itself in small numbers: model, map, rate, alarms; the map for every pair of them."""

from __future__ import annotations

from itertools import product
from math import pi

import pytest

from motorbus.families.feetech.table import (
    ALARM_BITS_OF,
    BAUD_CODES,
    BAUD_CODES_OF,
    MODELS,
    TABLES,
    alarms,
    choose,
    map_for,
    model_number,
    velocity_scale,
)


@pytest.mark.parametrize(
    ("major", "minor", "order", "table"),
    [
        (0, 0, "big", "scs"), (0, 39, "big", "scs"), (0, 40, "big", ""), (0, 10, "little", ""),
        (1, 0, "little", "smcl"), (1, 39, "little", "smcl"), (1, 10, "big", ""),
        (2, 39, "little", ""), (2, 40, "little", "smbl"), (2, 69, "little", "smbl"), (2, 70, "little", ""),
        (3, 0, "little", "sts"), (3, 10, "little", "sts"), (3, 39, "little", "sts"),
        (3, 19, "big", ""), (3, 20, "big", "scs2"), (3, 39, "big", "scs2"), (3, 40, "big", ""),
        (3, 40, "little", "hls"), (3, 59, "little", "hls"), (3, 60, "little", ""),
        (20, 5, "little", ""), (255, 255, "little", ""), (3, 10, "", ""),
    ],
)  # fmt: skip
def test_the_map_follows_from_firmware_and_byte_order(major: int, minor: int, order: str, table: str) -> None:
    assert map_for(major, minor, order) == table


@pytest.mark.parametrize(
    ("major", "minor", "name", "order", "number"),
    [
        (5, 4, "SCS0009", "big", 1284),
        (6, 8, "SM60-360M", "little", 2054),
        (6, 26, "SM60-360M", "little", 6662),
        (8, 44, "SM85BLHV", "little", 11272),
        (9, 2, "STS3032", "little", 521),
        (9, 3, "STS3215", "little", 777),
        (9, 11, "STS3250", "little", 2825),
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


def test_all_models_of_the_vendors_configuration_are_known() -> None:
    counts = {major: sum(1 for found, _ in MODELS if found == major) for major in (5, 6, 8, 9, 10)}
    assert counts == {5: 12, 6: 14, 8: 25, 9: 19, 10: 23}
    assert len(MODELS) == 93
    assert {model.order for (major, _), model in MODELS.items() if major in (6, 8, 10)} == {"little"}
    assert (9, 12) not in MODELS


def test_baud_codes_are_those_of_the_vendor() -> None:
    assert list(BAUD_CODES.values()) == [
        1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400, 19_200, 14_400, 9_600, 4_800,
    ]  # fmt: skip
    assert list(BAUD_CODES) == list(range(12))


def test_alarms_tell_every_bit() -> None:
    assert alarms(0) == ()
    assert alarms(0x20) == ("overload",)
    assert alarms(0b0001_1111) == ("voltage", "sensor", "temperature", "current", "angle")
    assert alarms(0xC1) == ("voltage", "undefined bit 6", "undefined bit 7")
    assert all(len(alarms(error)) == error.bit_count() for error in range(256))


@pytest.mark.parametrize(("phase", "scale"), [(12, 1), (4, 1), (8, 50), (0, 50), (0xFB, 50)])
def test_bit_2_of_the_phase_decides_the_unit_of_velocity(phase: int, scale: int) -> None:
    assert velocity_scale(phase) == scale


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
    assert len(found) <= 1
    return found[0] if found else ""


def test_every_firmware_there_can_be_has_its_map_or_none() -> None:
    for major, minor, order in product(range(256), range(256), ("little", "big")):
        assert map_for(major, minor, order) == listed(major, minor, order)


def test_every_model_with_every_firmware_has_the_map_of_its_byte_order() -> None:
    firmwares = [(major, minor) for major in (0, 1, 2, 3, 4, 20, 255) for minor in range(80)]
    for number, model in MODELS.items():
        for firmware, end in product(firmwares, (0, 1)):
            chosen = choose(firmware, number, end)
            assert chosen == (listed(*firmware, model.order), model.order, model)


@pytest.mark.parametrize(("end", "order"), [(0, "little"), (1, "big"), (255, "big")])
def test_a_model_nobody_knows_tells_its_byte_order_by_register_2(end: int, order: str) -> None:
    assert choose((3, 30), (10, 27), end) == (listed(3, 30, order), order, None)
    assert choose((3, 43), (10, 27), end) == (listed(3, 43, order), order, None)
    assert choose((0, 5), (77, 7), end) == (listed(0, 5, order), order, None)


@pytest.mark.parametrize(
    "firmware", [(0, 40), (1, 40), (2, 39), (2, 70), (3, 60), (4, 0), (20, 5), (255, 255)]
)
def test_an_unknown_firmware_has_no_map_whatever_the_model(firmware: tuple[int, int]) -> None:
    assert {choose(firmware, model, end).table for model in [*MODELS, (0, 0)] for end in (0, 1)} == {""}


def test_the_model_does_not_choose_the_map() -> None:
    assert choose((3, 10), (10, 18), 0).table == "sts"
    assert choose((3, 43), (9, 3), 0).table == "hls"


def test_a_model_says_which_maps_are_usual_and_all_of_them_have_its_byte_order() -> None:
    usual = {number: model.maps for number, model in MODELS.items()}
    assert usual[9, 3] == usual[10, 8] == usual[10, 25] == ("sts",)
    assert usual[10, 10] == usual[10, 22] == ("hls",)
    assert usual[8, 16] == ("smcl", "smbl")
    assert (usual[5, 4], usual[6, 0], usual[8, 44], usual[9, 15]) == (
        ("scs",),
        ("smcl",),
        ("smbl",),
        ("scs2",),
    )
    for model in MODELS.values():
        assert model.maps
        assert {TABLES[name]["goal_position"].order for name in model.maps} == {model.order}


def test_resolution_is_that_of_the_series() -> None:
    assert (MODELS[9, 3].resolution, MODELS[9, 3].arc) == (4096, 360)
    assert (MODELS[5, 4].resolution, MODELS[5, 4].arc) == (1024, 300)
    for model in MODELS.values():
        for name in model.maps:
            count = TABLES[name]["present_position"].scale
            assert count * model.resolution == pytest.approx(model.arc * pi / 180)


def test_models_that_others_call_otherwise_say_so() -> None:
    noted = {number for number, model in MODELS.items() if model.note}
    assert noted == {(5, 4), (8, 44), (9, 2), (10, 5), (10, 18)}


def test_every_map_takes_the_codes_its_register_names() -> None:
    assert {name: len(codes) for name, codes in BAUD_CODES_OF.items()} == {
        "sts": 8, "smbl": 12, "smcl": 8, "scs": 11, "scs2": 8, "hls": 8,
    }  # fmt: skip
    for name, codes in BAUD_CODES_OF.items():
        row = TABLES[name]["baud_rate"]
        assert row.choices == {code: f"{BAUD_CODES[code]} bit/s" for code in codes}
        assert row.high == max(codes)


def test_alarms_have_the_names_of_the_series() -> None:
    assert alarms(0b11_1111, "scs") == (
        "voltage", "undefined bit 1", "temperature", "undefined bit 3", "undefined bit 4", "overload",
    )  # fmt: skip
    assert alarms(0x10, "hls") == ("undefined bit 4",)
    assert alarms(0x10, "smbl") == alarms(0x10, "of no map") == ("angle",)
    assert set(ALARM_BITS_OF) == set(TABLES)
    for name, bits in ALARM_BITS_OF.items():
        assert set(bits) == set(range(8))
        assert TABLES[name]["hardware_error"].bits == bits
