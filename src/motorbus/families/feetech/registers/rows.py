"""What the rows of the six maps are made of: their sources, their units, and one function for each kind of row.

A row cites its sources by their keys in `SOURCES`. Where sources disagree, `conflict` says which one has what and what
was chosen.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from math import radians, tau
from typing import Any, Final, TypeAlias

from motorbus.core.register import Access, ByteOrder, Coding, Register, RegisterMap, Storage
from motorbus.core.request import Effect
from motorbus.families.feetech.registers.codes import ALARM_BITS, BAUD_CODES, BAUD_CODES_OF, PHASE_BITS

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
COUNT: Final = tau / 4096  # rad
SCS_COUNT: Final = radians(300) / 1024  # rad, of an SCS0009; other models differ, see `models`
AMPERE: Final = 0.0065  # A, of one count
_UNITS: Final = {
    "number": ("", 1.0),
    "angle": ("rad", COUNT),
    "velocity": ("rad/s", COUNT),
    "acceleration": ("rad/s²", 100 * COUNT),
    "SCS angle": ("rad", SCS_COUNT),
    "fraction": ("fraction", 0.001),
    "percent": ("fraction", 0.01),
    "current": ("A", AMPERE),
    "voltage": ("V", 0.1),
    "temperature": ("°C", 1.0),
    "2 µs": ("s", 2e-6),
    "10 ms": ("s", 0.01),
    "40 ms": ("s", 0.04),
}
"""Quantity of a row -> unit and scale."""


def _register(
    access: Access,
    storage: Storage,
    name: str,
    address: int,
    size: int,
    quantity: str,
    span: int | tuple[int, int],
    source: str,
    default: int | None = None,
    **facts: Any,
) -> Register:
    """A row. `span` is its raw range, or the high end of one from 0; a sign bit makes it sign-magnitude."""
    low, high = span if isinstance(span, tuple) else (0, span)
    unit, scale = _UNITS[quantity]
    row = Register(
        name=name,
        address=address,
        size=size,
        access=access,
        storage=storage,
        source="",
        unit=unit,
        scale=scale,
        low=low,
        high=high,
        default=default,
    )
    return _changed(row, {"source": source, **facts})


identity = partial(_register, Access.READ, Storage.EEPROM, protected=True)
setting = partial(_register, Access.READ_WRITE, Storage.EEPROM, effect=Effect.PERSISTENT)
command = partial(_register, Access.READ_WRITE, Storage.RAM)
feedback = partial(_register, Access.READ, Storage.RAM)
factory = partial(_register, Access.READ, Storage.FACTORY, protected=True)

Difference: TypeAlias = tuple[str, dict[str, Any]]


def row(names: str, **facts: Any) -> Difference:
    """What these rows, named with blanks between, have otherwise than the base of the map."""
    return names, facts


def _changed(row: Register, facts: dict[str, Any]) -> Register:
    """The row with these facts; a source is given by its keys."""
    facts = dict(facts)
    if "source" in facts:
        facts["source"] = "; ".join(SOURCES[key] for key in facts["source"].split())
    if "sign_bit" in facts:
        facts["coding"] = Coding.UNSIGNED if facts["sign_bit"] is None else Coding.SIGN_MAGNITUDE
    return replace(row, **facts)


_SHIPPED: Final[Mapping[str, int]] = dict.fromkeys(
    (
        *("byte_order", "homing_offset", "operating_mode", "torque_enable", "acceleration", "goal_time"),
        *("goal_velocity", "reg_write_pending", "hardware_error"),
    ),
    0,
) | dict.fromkeys(("id", "status_return_level", "angular_resolution", "lock"), 1)
"""Defaults that FD has in every map with the row, and no other source contradicts.

Two are not FD's: servos ship with the id 1, where FD has 0; and FD has no row for the byte order.
"""
_GENERAL_NOTES: Final = (
    *("byte_order", "id", "baud_rate", "return_delay", "status_return_level", "min_position_limit"),
    *("max_position_limit", "max_torque", "phase", "unload_mask", "position_d", "integral_limit"),
    *("dead_band_cw", "dead_band_ccw", "angular_resolution", "protective_torque", "overload_time"),
    *("overload_torque", "torque_enable", "acceleration", "goal_position", "goal_velocity", "lock"),
    *("present_position", "present_velocity", "present_load", "reg_write_pending", "moving"),
)
_GENERAL_CONFLICTS: Final = (
    *("byte_order", "id", "return_delay", "min_position_limit", "max_position_limit"),
    *("protective_torque", "overload_torque"),
)


def derived(
    base: RegisterMap,
    name: str,
    title: str,
    source: str,
    *rows: Register | Difference,
    shipped: Mapping[str, int],
    without: str = "",
    order: ByteOrder = "little",
) -> RegisterMap:
    """The map that `source` describes, as the differences of its rows to those of another map, applied in order.

    A row loses what was only known of the other map: its source, default, note and conflict, unless they are general;
    rows that the maker sets keep all. `shipped` are defaults (raw).
    """
    found = {row.name: row for row in base.values() if row.name not in without.split()}
    shipped = {**_SHIPPED, **shipped}
    for row in found.values():
        if row.storage is not Storage.FACTORY:
            facts: dict[str, Any] = {"source": source, "default": shipped.get(row.name)}
            facts["note"] = row.note if row.name in _GENERAL_NOTES else ""
            facts["conflict"] = row.conflict if row.name in _GENERAL_CONFLICTS else ""
            found[row.name] = _changed(row, facts)
    rates = {code: f"{BAUD_CODES[code]} bit/s" for code in BAUD_CODES_OF[name]}
    found["baud_rate"] = replace(found["baud_rate"], high=max(rates), choices=rates)
    found["phase"] = replace(found["phase"], bits=PHASE_BITS[name])
    for alarm in ("unload_mask", "led_mask", "hardware_error"):
        found[alarm] = replace(found[alarm], bits=ALARM_BITS[name])
    for one in rows:
        if isinstance(one, Register):
            found[one.name] = one
        else:
            names, facts = one
            found |= {name: _changed(found[name], facts) for name in names.split()}
    ordered = sorted(found.values(), key=lambda row: row.address)
    return RegisterMap(name, [replace(row, order=order) for row in ordered], title=title)
