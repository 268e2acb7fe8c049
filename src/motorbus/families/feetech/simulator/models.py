"""The models that can be simulated: every known number in each of its maps.

STS motor: memory table V3.6 of the STS3215 (50 rpm without load, 150 mA); its current register ends at about
3.25 A. Voltages, shipped values and the motors of SMS, SCS and HLS have no source. # assumption
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from math import radians
from typing import Final

from motorbus.core.plant import Drive
from motorbus.core.register import RegisterMap
from motorbus.errors import RequestError
from motorbus.families.feetech.models import MODELS as NUMBERS
from motorbus.families.feetech.models import NO_LOAD, map_for
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.registers.codes import BAUD_CODES
from motorbus.families.feetech.traits import TRAITS, Traits

DEFAULT: Final = "sts3215"
_STS_DRIVE: Final = Drive(top_speed=3400.0, idle_current=0.15, stall_current=3.25)
_SCS_DRIVE: Final = Drive(top_speed=2048.0, idle_current=0.1, stall_current=1.0)


@dataclass(frozen=True)
class Model:
    """A model in one of its maps, with the firmware that it reports, its supply (V) and motor (counts/s, A).

    `shipped` are raw values of rows without a published default, `angle` is rad per count, `name` in lower case.
    """

    table: RegisterMap
    firmware: tuple[int, int]
    voltage: float
    drive: Drive
    shipped: dict[str, int]
    name: str = ""
    number: tuple[int, int] = 0, 0
    angle: float = 1.0

    @property
    def traits(self) -> Traits:
        return TRAITS[self.table.name]

    @property
    def identity(self) -> dict[str, int]:
        """Raw values of the rows that identify it."""
        names = ("firmware_major", "firmware_minor", "model_major", "model_minor")
        return dict(zip(names, (*self.firmware, *self.number), strict=True))

    @property
    def rate(self) -> int:
        """The rate as shipped, bit/s."""
        return BAUD_CODES[self.shipped.get("baud_rate", self.table["baud_rate"].default or 0)]


# fmt: off
_LIKE_STS: Final = {
    "min_position_limit": 0, "max_position_limit": 4095, "max_temperature": 70,
    "unload_mask": 44, "led_mask": 47, "position_p": 32, "position_d": 32, "position_i": 0,
    "min_start_force": 16, "dead_band_cw": 1, "dead_band_ccw": 1,
    "protection_current": 500, "overcurrent_time": 200, "max_voltage": 140,
}
_LOOPS: Final = {"integral_limit": 0, "velocity_p": 10, "velocity_i": 10}
_HLS: Final = _LIKE_STS | _LOOPS | {
    "second_id": 1, "min_voltage": 40, "phase": 0, "current_p": 50, "current_i": 50,
}
_SMCL: Final = _LIKE_STS | {
    "protective_torque": 20, "overload_time": 200, "overload_torque": 80,
    "max_torque": 1000, "min_voltage": 90, "phase": 0,
}
_SCS2: Final = {
    "return_delay": 0, "min_position_limit": 20, "max_position_limit": 1003,
    "max_temperature": 80, "max_voltage": 90, "min_voltage": 45, "max_torque": 1000, "phase": 0,
    "unload_mask": 36, "led_mask": 37, "position_p": 15, "position_d": 15, "min_start_force": 30,
    "dead_band_cw": 1, "dead_band_ccw": 1, "hysteresis": 1, "overcurrent_time": 50,
    "protection_current": 500, "protective_torque": 20, "overload_time": 100,
    "overload_torque": 80, "baud_rate": 0,
}
_LEROBOT: Final = {"max_acceleration": 254}  # what lerobot (configure_motors) writes
_SMBL: Final = _SMCL | _LOOPS | _LEROBOT | {"phase": 12, "torque_limit": 1000}
# fmt: on
_OF_MAP: Final = {
    "sts": Model(TABLES["sts"], (3, 10), 7.4, _STS_DRIVE, _LEROBOT),
    "smbl": Model(TABLES["smbl"], (2, 45), 12.0, _STS_DRIVE, _SMBL),
    "smcl": Model(TABLES["smcl"], (1, 10), 12.0, _STS_DRIVE, _SMCL),
    "scs": Model(TABLES["scs"], (0, 10), 6.0, _SCS_DRIVE, {"baud_rate": 0}),  # 1000000 or 500000 by model
    "scs2": Model(TABLES["scs2"], (3, 25), 6.0, _SCS_DRIVE, _SCS2),
    "hls": Model(TABLES["hls"], (3, 43), 12.0, _STS_DRIVE, _HLS),  # firmware met on HLS3955 and HLS3915
}
_STALL_CURRENTS: Final = {"SCS15": 1.5}  # A; data sheet
_HIGH_LIMITS: Final = {"max_voltage": 250, "min_voltage": 180}  # of models for 24 V, with HV in their name


def _all() -> Mapping[str, Sequence[Model]]:
    found: dict[str, list[Model]] = {}
    for number, known in NUMBERS.items():
        name, angle = known.name.lower(), radians(known.arc) / known.resolution
        for table in known.maps:
            one = replace(_OF_MAP[table], name=name, number=number, angle=angle)
            if known.name in NO_LOAD:
                speed = round(NO_LOAD[known.name] / angle, 6)
                stall = _STALL_CURRENTS.get(known.name, one.drive.stall_current)
                one = replace(one, drive=replace(one.drive, top_speed=speed, stall_current=stall))
            if "hv" in name:
                one = replace(one, voltage=24.0, shipped=one.shipped | _HIGH_LIMITS)
            found.setdefault(name, []).append(one)
    return found


_BY_NAME: Final = _all()
MODELS: Final[Mapping[str, Model]] = {name: known[0] for name, known in _BY_NAME.items()}
"""All models by name in lower case; of several numbers with one name the first."""


def model(name: str, firmware: str = "") -> Model:
    """The model with this name ("": sts3215) and firmware, as "3.9" ("": one that has its map).

    The firmware selects the map of a model that has several; for others only what it reports changes. Raises
    RequestError for an unknown name and a firmware that is no version.
    """
    known = _BY_NAME.get(name.lower() or DEFAULT)
    if known is None:
        near = get_close_matches(name.lower(), MODELS, n=3)
        raise RequestError(
            f"there is no simulated FEETECH model {name!r}",
            expected=f"perhaps {', '.join(near)}" if near else f"one of {len(MODELS)}, as {DEFAULT}",
            advice="docs/reference/feetech-registers.md lists them",
        )
    if not firmware:
        return known[0]
    words = firmware.split(".")
    if len(words) != 2 or not all(word.isdecimal() and int(word) < 256 for word in words):
        raise RequestError(f"option firmware: {firmware!r} is not a version", expected="as 3.9")
    major, minor = map(int, words)
    table = map_for(major, minor, known[0].table["goal_position"].order)
    chosen = next((one for one in known if one.table.name == table), known[0])
    return replace(chosen, firmware=(major, minor))


def models(names: str, firmwares: str, count: int) -> list[Model]:
    """The models of so many servos; names and firmwares are joined by "+" or ",", one or as many as servos.

    Raises RequestError as `model`, and for another number of names or firmwares.
    """
    pairs = zip(_spread("model", names, count), _spread("firmware", firmwares, count), strict=True)
    known: dict[tuple[str, str], Model] = {}
    return [known.setdefault(pair, model(*pair)) for pair in pairs]


def _spread(what: str, joined: str, count: int) -> list[str]:
    words = joined.replace(",", "+").split("+")
    if len(words) not in (1, count):
        raise RequestError(
            f"{len(words)} {what}s for {count} ids: {joined}",
            expected=f"one {what} for all, or one for each id, joined by +",
        )
    return words * (count // len(words))
