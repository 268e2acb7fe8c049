"""Which register map, byte order and model a FEETECH servo has, by its first five registers.

The map follows from firmware version and byte order, the name and the byte order from the model number. The model does
not determine the map: model major 10 holds servos of two maps. Variants of one model (supply voltage, gear ratio) share
a number and cannot be told apart.
Source: FD 1.9.8.5 configuration, as published by the project FT_SCServo_Debug_Qt.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import radians, tau
from typing import Final, NamedTuple, TypeAlias


class Model(NamedTuple):
    """What a model number says: a name, and the byte order of two-byte registers ("little" or "big").

    `maps`       the register maps that servos of this number usually have; only the firmware tells for sure
    `arc`        degrees of all counts of the position
    `arc_doubt`  why the arc may be another one; "" if it is certain
    `note`       names that others give it
    """

    name: str
    order: str
    maps: tuple[str, ...]
    arc: float
    arc_doubt: str = ""
    note: str = ""

    @property
    def resolution(self) -> int:
        """Counts over `arc`."""
        return 4096 if self.order == "little" else 1024


SCS_ARC: Final = 300.0  # degrees of an SCS0009 (Waveshare wiki, SC09: 300°/1024)
_SCS15_ARC: Final = (
    200.0,
    "SCS15/SCS115 manual V1.02: 0.19° a count, so 195°; Waveshare SC15 guide: 180°; a public script: 200°",
)
_ARCS: Final = {(5, 4): (SCS_ARC, ""), (5, 15): _SCS15_ARC, (5, 25): _SCS15_ARC}
_ARC_UNKNOWN: Final = (SCS_ARC, "no source for this model; 300° is the arc of an SCS0009")
_NOTES: Final = {
    (5, 4): "FD calls it SCS009",
    (8, 44): "lerobot calls it sm8512bl",
    (9, 2): "rustypot calls it STS3036",
    (10, 5): "rustypot calls it SCS0043",
    (10, 18): "feetech-cli met this number on an HLS3960M",
}
_Names: TypeAlias = Mapping[int | range, str]
_SCS: Final[_Names] = {
    0: "SCSXX", 3: "SCS2304", 4: "SCS0009", 5: "SCS1025", 8: "SCS2332", 12: "SCS45", 15: "SCS15",
    16: "SCS315", 25: "SCS115", 35: "SCS215", 40: "SCS40", 60: "SCS6560",
}  # fmt: skip
_SMS: Final[_Names] = {
    range(9): "SM60-360M", 12: "SM80-360M", 16: "SM100-360M", 20: "SM150-360M", 24: "SM85-360M",
    26: "SM60-360M",
}  # fmt: skip
_SMS_BRUSHLESS: Final[_Names] = {
    range(11): "SM30BL", 24: "SM24BL", 25: "SM70BLHV", 29: "SM29BL(FT)", 30: "SM30BL(FT)", 40: "SM40BLHV",
    41: "SM80BLHV", 42: "SM45BLHV", 44: "SM85BLHV", 81: "SM160BLHV", 120: "SM120BLHV", 121: "SM260BLHV",
    220: "SM200BLHV",
}  # fmt: skip
_SMS_MAJOR_8: Final[_Names] = {16: "SM100-360M", 20: "SM150-360M"}  # named like those of major 6
_STS: Final[_Names] = {
    0: "STSXX", 1: "STS3015", 2: "STS3032", 3: "STS3215", 4: "STS3040", 5: "STS3020", 6: "STS3046",
    7: "STS3045", 8: "STS3235", 9: "STS3095", 10: "STS3095", 11: "STS3250",
}  # fmt: skip
_SCS_2: Final[_Names] = {
    15: "SCS15-2", 20: "SCSXX-2", 25: "SCS215-2", 35: "SCS225", 40: "SCS40-2", 41: "SCS25-2", 46: "SCS46-2",
}  # fmt: skip
_HTS: Final[_Names] = {
    1: "HTS3235", 2: "HTS3032", 3: "HTS3240", 4: "HTS3235", 5: "STS3045BL", 6: "STS3046BL", 7: "HTS3032",
    8: "HTS3045", 9: "STS3009BL", 25: "STS3025BL",
}  # fmt: skip
_HLS: Final[_Names] = {
    10: "HLS3606", 11: "HLS3612", 12: "HLS3620", 13: "HLS3625", 14: "HLS3640", 15: "HLS3925", 16: "HLS3930",
    17: "HLS3935", 18: "HLS3950", 19: "HLS3955", 20: "HLS3915", 21: "HLS3615", 22: "HLS3960",
}  # fmt: skip


def _models(
    major: int, order: str, maps: tuple[str, ...], names: _Names
) -> Iterable[tuple[tuple[int, int], Model]]:
    for minors, name in names.items():
        for minor in minors if isinstance(minors, range) else (minors,):
            number = (major, minor)
            arc = (360.0, "") if order == "little" else _ARCS.get(number, _ARC_UNKNOWN)
            yield number, Model(name, order, maps, *arc, _NOTES.get(number, ""))


MODELS: Final[Mapping[tuple[int, int], Model]] = dict(
    sorted(
        (
            *_models(5, "big", ("scs",), _SCS),
            *_models(6, "little", ("smcl",), _SMS),
            *_models(8, "little", ("smbl",), _SMS_BRUSHLESS),
            *_models(8, "little", ("smcl", "smbl"), _SMS_MAJOR_8),
            *_models(9, "little", ("sts",), _STS),
            *_models(9, "big", ("scs2",), _SCS_2),
            *_models(10, "little", ("sts",), _HTS),
            *_models(10, "little", ("hls",), _HLS),
        )
    )
)
"""(model major, model minor) -> model. It identifies a servo and does not prove a capability."""
NO_LOAD: Final[Mapping[str, float]] = {
    "STS3215": 3400 * tau / 4096,  # STS3215 memory table V3.6
    "STS3250": radians(60) / 0.133,  # data sheet A/0, 12 V
    "SCS15": 55 * tau / 60,  # data sheet, 6 V
}
"""Model -> its velocity (rad/s) without load, where a source tells it."""


FIRMWARE: Final = (
    (0, range(40), "big", "scs"),
    (1, range(40), "little", "smcl"),
    (2, range(40, 70), "little", "smbl"),
    (3, range(40), "little", "sts"),
    (3, range(20, 40), "big", "scs2"),
    (3, range(40, 60), "little", "hls"),
)
"""Major version, minor versions, byte order and map; the byte order tells 3.20 to 3.39 apart."""


class Choice(NamedTuple):
    """The map, byte order and model of a servo.

    `table` is the name of the map; "" for unknown firmware, then the servo is never written. `model` is None for an
    unknown number, which may have a known map.
    """

    table: str
    order: str
    model: Model | None


def choose(firmware: tuple[int, int], model: tuple[int, int], end: int) -> Choice:
    """What a servo is, by firmware and model (major, minor) and register 2.

    The model decides the byte order, for an unknown one register 2 does (0: little), as documented by the vendor.
    """
    known = MODELS.get(model)
    order = known.order if known is not None else "little" if end == 0 else "big"
    return Choice(map_for(*firmware, order), order, known)


def map_for(major: int, minor: int, order: str) -> str:
    """The name of the register map of this firmware and byte order; "" if unknown.

    Firmware 20.0 to 20.19, which FD knows too, is that of another kind of device.
    """
    for known, minors, its_order, table in FIRMWARE:
        if (known, its_order) == (major, order) and minor in minors:
            return table
    return ""


def model_number(major: int, minor: int, order: str) -> int:
    """The model as one number, as the FEETECH SDKs print it: the word at register 3 (STS3215: 777)."""
    return int.from_bytes(bytes((major, minor)), "little" if order == "little" else "big")
