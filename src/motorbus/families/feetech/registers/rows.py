"""What the rows of the six maps are made of: their sources, their units, and one function for each kind of row.

A row cites its sources by their keys in `SOURCES`. Where sources disagree, `conflict` says which one has what and what
was chosen.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import radians, tau
from typing import Any, Final, TypeAlias

from motorbus.core.register import Access, Coding, Register, RegisterMap, Storage, changed
from motorbus.core.request import Effect

_MANUAL = "FEETECH serial bus servo protocol manual V1.01"
SOURCES: Final[Mapping[str, str]] = {
    "FD": "FD 1.9.8.5 register configuration",
    "V36": "STS3215 memory table V3.6",
    "HLS_TABLE": "HLS memory table",
    "SCS_TABLE": "SCS memory table 1902 of FD 1.9.8, as published in a public header",
    "SMS_PAGE": "FEETECH page on SMS servos",
    "BYTES": "FEETECH notes on special bytes of STS servos",
    "BYTES_HLS": "FEETECH notes on special bytes, HLS",
    "BYTES_SCS": "FEETECH notes on special bytes, SCS",
    "EX2": f"{_MANUAL}, example 2",
    "EX3": f"{_MANUAL}, example 3",
    "EX4": f"{_MANUAL}, example 4",
    "REG_WRITE": f"{_MANUAL}, REG WRITE",
    "SDK": "FEETECH SDK header SMS_STS.h",
    "SDK_SCS": "FEETECH SDK header SCSCL.h",
    "SDK_SMSCL": "FEETECH SDK, SMSCL",
    "SDK_HLS": "FEETECH SDK, hls.py",
    "LEROBOT": "lerobot, motors/feetech/tables.py",
    "CLI": "measured by feetech-cli on an STS3215",
    "SERVOLAB": "measured by servolab on an STS3215, firmware 3.10",
}
"""Key -> source."""

Quantity: TypeAlias = tuple[str, float]
COUNT: Final = tau / 4096  # rad
SCS_COUNT: Final = radians(300) / 1024  # rad, of an SCS0009; other models differ, see `models`
AMPERE: Final = 0.0065  # A, of one count

NUMBER: Final[Quantity] = ("", 1.0)
ANGLE: Final[Quantity] = ("rad", COUNT)
VELOCITY: Final[Quantity] = ("rad/s", COUNT)
FRACTION: Final[Quantity] = ("fraction", 0.001)
PERCENT: Final[Quantity] = ("fraction", 0.01)
CURRENT: Final[Quantity] = ("A", AMPERE)
VOLTAGE: Final[Quantity] = ("V", 0.1)
CELSIUS: Final[Quantity] = ("°C", 1.0)
SECONDS: Final[Quantity] = ("s", 0.01)


def _register(
    access: Access,
    storage: Storage,
    name: str,
    address: int,
    size: int,
    quantity: Quantity,
    span: int | tuple[int, int],
    source: str,
    default: int | None = None,
    *,
    sign_bit: int | None = None,
    **facts: Any,
) -> Register:
    """A row. `span` is its raw range, or the high end of one from 0; a sign bit makes it sign-magnitude."""
    low, high = span if isinstance(span, tuple) else (0, span)
    return Register(
        name=name,
        address=address,
        size=size,
        access=access,
        storage=storage,
        source=cited(source),
        coding=Coding.UNSIGNED if sign_bit is None else Coding.SIGN_MAGNITUDE,
        sign_bit=sign_bit,
        unit=quantity[0],
        scale=quantity[1],
        low=low,
        high=high,
        default=default,
        **facts,
    )


def cited(keys: str) -> str:
    """Keys of sources, separated by blanks -> the sources."""
    return "; ".join(SOURCES[key] for key in keys.split())


identity = partial(_register, Access.READ, Storage.EEPROM, protected=True)
setting = partial(_register, Access.READ_WRITE, Storage.EEPROM, effect=Effect.PERSISTENT)
command = partial(_register, Access.READ_WRITE, Storage.RAM)
feedback = partial(_register, Access.READ, Storage.RAM)
factory = partial(_register, Access.READ, Storage.FACTORY, protected=True)

SHIPPED_EVERYWHERE: Final[Mapping[str, int]] = {
    "byte_order": 0,
    "id": 1,
    "status_return_level": 1,
    "angular_resolution": 1,
    "homing_offset": 0,
    "operating_mode": 0,
    "torque_enable": 0,
    "acceleration": 0,
    "goal_time": 0,
    "goal_velocity": 0,
    "lock": 1,
    "reg_write_pending": 0,
    "hardware_error": 0,
}
"""Defaults that FD has in every map with the row, and no other source contradicts.

Two are not FD's: servos ship with the id 1, where FD has 0; and FD has no row for the byte order.
"""
_GENERAL_NOTES: Final = (
    *("id", "status_return_level", "max_torque", "phase", "unload_mask", "position_d", "protective_torque"),
    *("overload_torque", "present_load", "reg_write_pending", "moving"),
)
_GENERAL_CONFLICTS: Final = ("id", "protective_torque", "overload_torque")


def borrowed(
    table: RegisterMap, source: str, shipped: Mapping[str, int] | None = None, **fields: object
) -> RegisterMap:
    """The rows of this map as the base of another one, which `source` describes.

    A row loses what was only known of the first map: its source, default, note and conflict, unless they are general.
    `shipped` are defaults (raw) of the other map, `fields` what all of its rows have, as order="big".
    """
    defaults = {**SHIPPED_EVERYWHERE, **(shipped or {})}

    def borrow(row: Register) -> Register:
        facts: dict[str, object] = {"source": cited(source), "default": defaults.get(row.name), **fields}
        facts["note"] = row.note if row.name in _GENERAL_NOTES else ""
        facts["conflict"] = row.conflict if row.name in _GENERAL_CONFLICTS else ""
        return changed(row, **facts)

    return table.derive(table.name, *(borrow(row) for row in table.values()))


def differing(table: RegisterMap, names: str, **differences: object) -> tuple[Register, ...]:
    """Rows of this map, named with blanks between, with some fields replaced; a source is given by its keys."""
    if isinstance(keys := differences.get("source"), str):
        differences["source"] = cited(keys)
    return tuple(changed(table[name], **differences) for name in names.split())
