"""What a FEETECH servo says of itself in small numbers: its model, its map, its rate, its alarms.

The register map follows from firmware version and byte order; the model number gives the name and the byte
order only. Guessing the map by the model is wrong: model major 10 holds servos of two maps. Variants of one
model (supply voltage, gear ratio) share a number, so those cannot be read at all.

Source of models and maps: FD 1.9.8.5 configuration, as published by the project FT_SCServo_Debug_Qt. Source
of the baud codes: FEETECH SDK headers SMS_STS.h and SCSCL.h (0 to 7) and public headers with twelve codes.
Some well-known libraries give 57600, 38400 and 19200 for the codes 5, 6 and 7; every source of the vendor
says 76800, 57600 and 38400. Source of the alarm bits: STS3215 memory table V3.6.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Final, NamedTuple, TypeAlias


class Model(NamedTuple):
    """The name of a model and the byte order of its two-byte registers ("little" or "big")."""

    name: str
    order: str


_Names: TypeAlias = Mapping[int | range, str]


def _models(major: int, order: str, names: _Names) -> Iterable[tuple[tuple[int, int], Model]]:
    for minors, name in names.items():
        for minor in minors if isinstance(minors, range) else (minors,):
            yield (major, minor), Model(name, order)


_SCS: _Names = {
    0: "SCSXX", 3: "SCS2304", 4: "SCS0009", 5: "SCS1025", 8: "SCS2332", 12: "SCS45", 15: "SCS15",
    16: "SCS315", 25: "SCS115", 35: "SCS215", 40: "SCS40", 60: "SCS6560",
}  # fmt: skip
_SMS: _Names = {
    range(9): "SM60-360M", 12: "SM80-360M", 16: "SM100-360M", 20: "SM150-360M", 24: "SM85-360M",
    26: "SM60-360M",
}  # fmt: skip
_SMS_BRUSHLESS: _Names = {
    range(11): "SM30BL", 16: "SM100-360M", 20: "SM150-360M", 24: "SM24BL", 25: "SM70BLHV", 29: "SM29BL(FT)",
    30: "SM30BL(FT)", 40: "SM40BLHV", 41: "SM80BLHV", 42: "SM45BLHV", 44: "SM85BLHV", 81: "SM160BLHV",
    120: "SM120BLHV", 121: "SM260BLHV", 220: "SM200BLHV",
}  # fmt: skip
_STS: _Names = {
    0: "STSXX", 1: "STS3015", 2: "STS3032", 3: "STS3215", 4: "STS3040", 5: "STS3020", 6: "STS3046",
    7: "STS3045", 8: "STS3235", 9: "STS3095", 10: "STS3095", 11: "STS3250",
}  # fmt: skip
_SCS_2: _Names = {
    15: "SCS15-2", 20: "SCSXX-2", 25: "SCS215-2", 35: "SCS225", 40: "SCS40-2", 41: "SCS25-2", 46: "SCS46-2",
}  # fmt: skip
_HTS_AND_HLS: _Names = {
    1: "HTS3235", 2: "HTS3032", 3: "HTS3240", 4: "HTS3235", 5: "STS3045BL", 6: "STS3046BL", 7: "HTS3032",
    8: "HTS3045", 9: "STS3009BL", 10: "HLS3606", 11: "HLS3612", 12: "HLS3620", 13: "HLS3625", 14: "HLS3640",
    15: "HLS3925", 16: "HLS3930", 17: "HLS3935", 18: "HLS3950", 19: "HLS3955", 20: "HLS3915", 21: "HLS3615",
    22: "HLS3960", 25: "STS3025BL",
}  # fmt: skip

MODELS: Final[Mapping[tuple[int, int], Model]] = MappingProxyType(
    {
        **dict(_models(5, "big", _SCS)),
        **dict(_models(6, "little", _SMS)),
        **dict(_models(8, "little", _SMS_BRUSHLESS)),
        **dict(_models(9, "little", _STS)),
        **dict(_models(9, "big", _SCS_2)),
        **dict(_models(10, "little", _HTS_AND_HLS)),
    }
)
"""(model major, model minor) -> name and byte order: identity, never proof of a capability."""


class _Firmware(NamedTuple):
    major: int
    minors: range
    order: str
    table: str


_FIRMWARE: Final = (
    _Firmware(0, range(40), "big", "scs"),
    _Firmware(1, range(40), "little", "smcl"),
    _Firmware(2, range(40, 70), "little", "smbl"),
    _Firmware(3, range(40), "little", "sts"),
    _Firmware(3, range(20, 40), "big", "scs2"),
    _Firmware(3, range(40, 60), "little", "hls"),
)


def map_for(firmware_major: int, firmware_minor: int, order: str) -> str:
    """The register map of this firmware and byte order ("little", "big"): scs, smcl, smbl, sts, scs2 or hls.

    "" when the firmware is unknown: such a device can be read and must not be written. A name that is not in
    `TABLES` is a map that is known and not described yet; it must not be written either.
    """
    for firmware in _FIRMWARE:
        if (firmware.major, firmware.order) == (firmware_major, order) and firmware_minor in firmware.minors:
            return firmware.table
    return ""


def model_number(major: int, minor: int, order: str) -> int:
    """The model as one number, the way the FEETECH SDKs print it: the word at register 3 (STS3215: 777)."""
    return int.from_bytes(bytes((major, minor)), "little" if order == "little" else "big")


BAUD_CODES: Final[Mapping[int, int]] = MappingProxyType(
    {
        0: 1_000_000,
        1: 500_000,
        2: 250_000,
        3: 128_000,
        4: 115_200,
        5: 76_800,
        6: 57_600,
        7: 38_400,
        8: 19_200,
        9: 14_400,
        10: 9_600,
        11: 4_800,
    }
)
"""Value of the baud rate register -> bit/s. STS servos know the first eight."""

ALARM_BITS: Final[Mapping[int, str]] = MappingProxyType(
    {
        0: "voltage",
        1: "sensor",
        2: "temperature",
        3: "current",
        4: "angle",
        5: "overload",
        6: "undefined bit 6",
        7: "undefined bit 7",
    }
)
"""Bits of the error byte, of the hardware error register, and of the unload and LED masks.

Newer STS pages of the vendor leave bit 4 unused; table V3.6 of the STS3215 calls it the angle limit.
"""


def alarms(error: int) -> tuple[str, ...]:
    """The names of all bits that are set in an error byte, undefined ones included; () when none is."""
    return tuple(name for bit, name in ALARM_BITS.items() if error >> bit & 1)


def velocity_scale(phase: int) -> int:
    """Counts/s of one unit in the velocity registers: 1 when bit 2 of the phase register is set, else 50.

    The rows hold for 1 (as shipped: phase 12); raw values of a servo with bit 2 clear mean 50 times as much.
    Source: FEETECH notes on special bytes of STS servos.
    """
    return 1 if phase & 0b100 else 50
