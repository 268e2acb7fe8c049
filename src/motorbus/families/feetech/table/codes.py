"""What a FEETECH servo says of itself in small numbers: its model, its map, its rate, its alarms.

The register map follows from firmware version and byte order; the model number gives the name and the byte
order only. Guessing the map by the model is wrong: model major 10 holds servos of two maps. Variants of one
model (supply voltage, gear ratio) share a number, so those cannot be read at all.

Source of models and maps: FD 1.9.8.5 configuration, as published by the project FT_SCServo_Debug_Qt. Source
of the baud codes: FEETECH SDK headers SMS_STS.h and SCSCL.h (0 to 7) and public headers with twelve codes.
Some well-known libraries give 57600, 38400 and 19200 for the codes 5, 6 and 7; every source of the vendor
says 76800, 57600 and 38400. Source of the alarm bits: STS3215 memory table V3.6, HLS and SCS memory tables.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Final, NamedTuple, TypeAlias


class Model(NamedTuple):
    """What a model number says: a name, and the byte order of its two-byte registers ("little" or "big").

    `maps` are the register maps that servos of this number usually have; only the firmware tells for sure.
    `resolution` is the counts of the position over `arc` degrees. `note` says what others call it.
    """

    name: str
    order: str
    maps: tuple[str, ...]
    note: str = ""

    @property
    def resolution(self) -> int:
        """Counts over `arc`: 4096 on little-endian servos, 1024 on big-endian ones."""
        return 4096 if self.order == "little" else 1024

    @property
    def arc(self) -> float:
        """Degrees that `resolution` counts are: a whole turn, or the 300 of an SCS0009, which others may not have."""
        return 360.0 if self.order == "little" else 300.0


_Names: TypeAlias = Mapping[int | range, str]


def _models(
    major: int, order: str, maps: tuple[str, ...], names: _Names
) -> Iterable[tuple[tuple[int, int], Model]]:
    for minors, name in names.items():
        for minor in minors if isinstance(minors, range) else (minors,):
            yield (major, minor), Model(name, order, maps, _NOTES.get((major, minor), ""))


_NOTES: Mapping[tuple[int, int], str] = {
    (5, 4): "FD calls it SCS009",
    (8, 44): "lerobot calls it sm8512bl",
    (9, 2): "rustypot calls it STS3036",
    (10, 5): "rustypot calls it SCS0043",
    (10, 18): "feetech-cli met this number on an HLS3960M",
}
_SCS: _Names = {
    0: "SCSXX", 3: "SCS2304", 4: "SCS0009", 5: "SCS1025", 8: "SCS2332", 12: "SCS45", 15: "SCS15",
    16: "SCS315", 25: "SCS115", 35: "SCS215", 40: "SCS40", 60: "SCS6560",
}  # fmt: skip
_SMS: _Names = {
    range(9): "SM60-360M", 12: "SM80-360M", 16: "SM100-360M", 20: "SM150-360M", 24: "SM85-360M",
    26: "SM60-360M",
}  # fmt: skip
_SMS_MAJOR_8: _Names = {16: "SM100-360M", 20: "SM150-360M"}
_SMS_BRUSHLESS: _Names = {
    range(11): "SM30BL", 24: "SM24BL", 25: "SM70BLHV", 29: "SM29BL(FT)",
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
_HTS: _Names = {
    1: "HTS3235", 2: "HTS3032", 3: "HTS3240", 4: "HTS3235", 5: "STS3045BL", 6: "STS3046BL", 7: "HTS3032",
    8: "HTS3045", 9: "STS3009BL", 25: "STS3025BL",
}  # fmt: skip
_HLS: _Names = {
    10: "HLS3606", 11: "HLS3612", 12: "HLS3620", 13: "HLS3625", 14: "HLS3640",
    15: "HLS3925", 16: "HLS3930", 17: "HLS3935", 18: "HLS3950", 19: "HLS3955", 20: "HLS3915", 21: "HLS3615",
    22: "HLS3960",
}  # fmt: skip

_ALL: Final = (
    *_models(5, "big", ("scs",), _SCS),
    *_models(6, "little", ("smcl",), _SMS),
    *_models(8, "little", ("smbl",), _SMS_BRUSHLESS),
    *_models(
        8, "little", ("smcl", "smbl"), _SMS_MAJOR_8
    ),  # named like those of major 6, numbered like SM..BL
    *_models(9, "little", ("sts",), _STS),
    *_models(9, "big", ("scs2",), _SCS_2),
    *_models(10, "little", ("sts",), _HTS),
    *_models(10, "little", ("hls",), _HLS),
)
MODELS: Final[Mapping[tuple[int, int], Model]] = MappingProxyType(dict(sorted(_ALL)))
"""(model major, model minor) -> name, byte order and usual maps: identity, never proof of a capability."""


class Firmware(NamedTuple):
    """These firmware versions (major, and a range of minors) with this byte order have this register map."""

    major: int
    minors: range
    order: str
    table: str


FIRMWARE: Final = (
    Firmware(0, range(40), "big", "scs"),
    Firmware(1, range(40), "little", "smcl"),
    Firmware(2, range(40, 70), "little", "smbl"),
    Firmware(3, range(40), "little", "sts"),
    Firmware(3, range(20, 40), "big", "scs2"),
    Firmware(3, range(40, 60), "little", "hls"),
)
"""Every firmware whose map is known; 3.20 to 3.39 is told apart by the byte order."""


class Choice(NamedTuple):
    """What a servo is by its first five registers.

    `table` is the name of its register map, "" when the firmware is unknown: such a device can be read by what all
    maps share, and must not be written. `model` is None when nobody knows the number; it may have a map all the same.
    """

    table: str
    order: str
    model: Model | None


def choose(firmware: tuple[int, int], model: tuple[int, int], end: int) -> Choice:
    """The register map, byte order and model of a servo, by firmware, model (major, minor each) and register 2.

    The model decides the byte order, and one that nobody knows tells it by register 2 (0: little); firmware and byte
    order decide the map. The model says nothing of the map: major 10 holds servos of two maps.
    Source: the algorithm of FD 1.9.8.5; that register 2 tells an unknown model's order is the vendor's documentation
    of that register, for FD takes the first map of the firmware then.
    """
    known = MODELS.get(model)
    order = known.order if known is not None else "little" if end == 0 else "big"
    return Choice(map_for(*firmware, order), order, known)


def map_for(firmware_major: int, firmware_minor: int, order: str) -> str:
    """The register map of this firmware and byte order ("little", "big"): scs, smcl, smbl, sts, scs2 or hls.

    "" when the firmware is unknown. Firmware 20.0 to 20.19, which FD knows too, is that of another kind of device.
    """
    for firmware in FIRMWARE:
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
"""Value of the baud rate register -> bit/s, as `BAUD_CODES_OF` allows them."""

BAUD_CODES_OF: Final[Mapping[str, range]] = MappingProxyType(
    {
        "sts": range(8),
        "smbl": range(12),
        "smcl": range(8),
        "scs": range(11),
        "scs2": range(8),
        "hls": range(8),
    }
)
"""Map -> the codes its servos take, as FD allows them; for SMCL, where FD allows 0 to 254, as the SDK names them."""


def rates(register_map: str) -> dict[int, str]:
    """The choices of the baud rate register in this map, for reading eyes."""
    return {code: f"{BAUD_CODES[code]} bit/s" for code in BAUD_CODES_OF[register_map]}


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
"""Bits of the error byte, of the hardware error register, and of the unload and LED masks, on STS and SMS.

Newer STS pages of the vendor leave bit 4 unused; table V3.6 of the STS3215 calls it the angle limit.
"""

_HLS_ALARMS: Final = MappingProxyType({**ALARM_BITS, 4: "undefined bit 4"})
_SCS_ALARMS: Final = MappingProxyType(
    {bit: name if bit in (0, 2, 5) else f"undefined bit {bit}" for bit, name in ALARM_BITS.items()}
)
ALARM_BITS_OF: Final[Mapping[str, Mapping[int, str]]] = MappingProxyType(
    {
        "sts": ALARM_BITS,
        "smbl": ALARM_BITS,
        "smcl": ALARM_BITS,
        "scs": _SCS_ALARMS,
        "scs2": _SCS_ALARMS,
        "hls": _HLS_ALARMS,
    }
)
"""Map -> its alarm bits. SCS servos have voltage, temperature and overload only; HLS pages leave bit 4 unused."""


def alarms(error: int, register_map: str = "sts") -> tuple[str, ...]:
    """The names of all bits that are set in an error byte, undefined ones included; () when none is.

    A map that is not known reads as STS, whose names are those of most servos.
    """
    bits = ALARM_BITS_OF.get(register_map, ALARM_BITS)
    return tuple(name for bit, name in bits.items() if error >> bit & 1)
