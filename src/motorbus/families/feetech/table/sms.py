"""The two register maps of SMS servos: SMBL (firmware 2.40 to 2.69) and the older SMCL (firmware 1.x), little-endian.

SMBL is laid out as STS. SMCL has its offset, mode and protection elsewhere, no torque limit, and its lock at 48, where
SMBL, STS and HLS have the torque limit: unlocking it by the wrong map leaves a servo limp.

FD lists firmware 1.0 to 1.19 and 1.20 to 1.39 apart. The published extract has the rows of the first and gives both the
same map, and so does this file; SDK headers of that time are of two kinds, too (see `protection_current`).

What these servos ship with is published for few rows; the others have no default here. What FD puts in its column
"default" is no proof of it.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.register import Register, changed
from motorbus.core.request import Effect
from motorbus.families.feetech.table.borrowed import borrowed
from motorbus.families.feetech.table.codes import rates
from motorbus.families.feetech.table.phase import PHASE_BITS
from motorbus.families.feetech.table.sources import (
    CLI,
    FD,
    HLS_TABLE,
    LEROBOT,
    MANUAL,
    SDK,
    SDK_SMSCL,
    SMS_PAGE,
)
from motorbus.families.feetech.table.sts import STS

_BOTH = f"{FD}; {SDK}"
_ROWS = borrowed(STS, source=FD, defaults={"firmware_major": 2, "model_major": 8})
_LIKE_STS = "laid out as in the STS map; nobody has published this for SMS servos"


def _smbl(name: str, **differences: object) -> Register:
    return changed(_ROWS[name], **differences)


_BIT_4 = "bit 4 is the angle limit on an STS3215; nothing confirms that for SMS. Chosen: as on STS"
_NAMED_BY_SDK = (
    *("model_major", "model_minor", "status_return_level", "max_temperature", "max_voltage", "min_voltage"),
    *("max_torque", "dead_band_cw", "dead_band_ccw", "protection_current", "present_load"),
    *("present_voltage", "present_temperature", "moving"),
)
"""Rows that need no other word than that the SDK header, in one of its editions, names the register, as FD does."""
_FACTORY = ("moving_threshold", "dts", "velocity_unit", "hts", "max_velocity_limit", "max_acceleration")

SMBL: Final = _ROWS.derive(
    "smbl",
    _smbl("byte_order", source=SMS_PAGE, note=STS["byte_order"].note),
    _smbl("id", source=f"{MANUAL}, example 3; {_BOTH}"),
    _smbl(
        "baud_rate", high=11, default=4, choices=rates("smbl"), source=f"{FD}; {SMS_PAGE}",
        conflict="FD: 5 to 7 are 76800, 57600 and 38400 bit/s; lerobot and rustypot name other rates, and are wrong. "
        "Chosen: FD",
        note="SMS servos ship with 115200 bit/s",
    ),
    _smbl(
        "return_delay", default=250, source=f"{FD}; {SMS_PAGE}",
        note="in 2 µs; values below 50 act as 50 (100 µs), 0 is that minimum too",
    ),
    *(
        _smbl(name, source=_BOTH, note="both limits 0 mean many turns, as on STS")
        for name in ("min_position_limit", "max_position_limit")
    ),
    *(_smbl(name, source=_BOTH) for name in _NAMED_BY_SDK),
    _smbl("led_mask", source=_BOTH, conflict=_BIT_4),
    *(_smbl(name, conflict=_BIT_4) for name in ("unload_mask", "hardware_error")),
    _smbl("phase", bits=PHASE_BITS["smbl"], note=f"{STS['phase'].note}; bits {_LIKE_STS}"),
    _smbl(
        "integral_limit", source=f"{FD}; {HLS_TABLE}",
        conflict="FD: the integral limit; lerobot: the high byte of min_start_force. Chosen: FD",
        note="the greatest integral is 4 times this, 0 is none",
    ),
    _smbl("min_start_force", conflict="FD: one byte, 0 to 254; lerobot: two bytes. Chosen: one byte"),
    _smbl("angular_resolution", high=128, note="multiplies the angle of a count"),
    _smbl(
        "homing_offset", source=_BOTH,
        note="present = (encoder - offset) mod 4096, measured on STS in position mode only",
    ),
    _smbl(
        "operating_mode", source=_BOTH,
        note="that it takes effect at once, even when locked, was measured on STS",
    ),
    _smbl(
        "torque_enable", source=f"{_BOTH}; {CLI}",
        note="128 writes homing_offset; its state after power-up varies; that writing a goal "
        "position turns it on was measured on STS",
    ),
    _smbl("acceleration", source=_BOTH, note="0 means the maximum"),
    _smbl(
        "goal_position", source=f"{MANUAL}, example 4; {_BOTH}",
        note="relative in step mode, where writing it again moves again",
    ),
    _smbl(
        "goal_time", source=f"{MANUAL}, example 4; {FD}",
        conflict="FD: the duty in 0.1 % in PWM mode; the manual: a time. Chosen: each in its mode",
        note="FD calls it goal PWM",
    ),
    _smbl(
        "goal_velocity", source=f"{MANUAL}, example 4; {_BOTH}",
        note=f"1 count/s when bit 2 of phase is set, else 50: {_LIKE_STS}",
    ),
    _smbl(
        "torque_limit", source=_BOTH,
        note="loaded from max_torque at power-up; on SCS and SMCL this is the lock",
    ),
    _smbl("lock", source=_BOTH, note="a locked write still changes the live value: measured on STS"),
    _smbl("present_position", source=f"{MANUAL}, example 2; {_BOTH}"),
    _smbl(
        "present_velocity", source=_BOTH,
        note=f"1 count/s when bit 2 of phase is set, else 50: {_LIKE_STS}",
    ),
    _smbl(
        "goal_position_echo", source=f"{HLS_TABLE}; {LEROBOT}",
        conflict="the HLS table: here, for HLS; lerobot: at 71. Chosen: here, not to be relied on",
        note="laid out as in the STS map, where it is in doubt too",
    ),
    _smbl("present_current", source=_BOTH, note="supply side on STS; always 0 there when bit 5 of phase is set"),
    *(_smbl(name, source=LEROBOT, note=STS[name].note) for name in _FACTORY),
    _smbl(
        "acceleration_multiplier", source=LEROBOT, note=STS["acceleration_multiplier"].note
    ),
    title="SMS brushless servos (SM..BL), firmware 2.40 to 2.69, little-endian",
)  # fmt: skip

_MOVED = {
    "homing_offset": 33, "operating_mode": 35, "overcurrent_time": 36, "protective_torque": 37,
    "overload_time": 38, "overload_torque": 39, "lock": 48,
}  # fmt: skip
_GONE = (
    *(
        "integral_limit",
        "angular_resolution",
        "velocity_p",
        "velocity_i",
        "torque_limit",
        "goal_position_echo",
    ),
    *(*_FACTORY, "acceleration_multiplier"),
)


_OLD = borrowed(
    SMBL,
    source=FD,
    defaults={"firmware_major": 1, "model_major": 6, "baud_rate": 4, "return_delay": 250},
)


def _smcl(name: str, **differences: object) -> Register:
    """The row as SMBL has it, but for its place and for what is known of it."""
    return changed(_OLD[name], **{"address": _MOVED.get(name, _OLD[name].address), **differences})


SMCL: Final = _OLD.derive(
    "smcl",
    _smcl("byte_order", source=SMS_PAGE, note=STS["byte_order"].note),
    _smcl("id", source=f"{MANUAL}, example 3; {FD}"),
    _smcl(
        "baud_rate", high=7, choices=rates("smcl"), source=f"{FD}; {SMS_PAGE}",
        conflict="FD: 0 to 254; the SDK: 0 to 7. Chosen: 0 to 7", note="SMS servos ship with 115200 bit/s",
    ),
    _smcl("max_torque", effect=Effect.TORQUE, note="of the stall torque; there is no torque limit beside it"),
    _smcl("return_delay", source=f"{FD}; {SMS_PAGE}", note=SMBL["return_delay"].note),
    _smcl("phase", bits=PHASE_BITS["smcl"], high=254, note=f"{STS['phase'].note}; its bits are not published"),
    _smcl("min_start_force", size=2, high=1000, source=f"{FD}; {SDK_SMSCL}"),
    _smcl(
        "protection_current", source=f"{FD}; {SDK_SMSCL}",
        conflict="older SDK headers: at 36 and 37; FD: at 28 for all of firmware 1. Chosen: 28",
    ),
    _smcl(
        "homing_offset", source=f"{FD}; {SDK_SMSCL}",
        conflict="FD's English file and old SDKs: sign at bit 15; its Chinese file and newer SDKs: at bit 11. Chosen: "
        "bit 11",
    ),
    _smcl(
        "operating_mode", high=2, choices={0: "position", 1: "velocity", 2: "PWM"},
        source=f"{FD}; {SDK_SMSCL}",
    ),
    *(_smcl(name, conflict=_BIT_4) for name in ("unload_mask", "led_mask", "hardware_error")),
    *(_smcl(name) for name in ("overcurrent_time", "protective_torque", "overload_time", "overload_torque")),
    _smcl(
        "torque_enable", source=f"{FD}; {SDK_SMSCL}",
        note="128 writes homing_offset; its state after power-up varies",
    ),
    _smcl(
        "acceleration", conflict="FD: at 41; the oldest SDK headers have no such register. Chosen: FD",
        note="0 means the maximum",
    ),
    _smcl(
        "goal_position", source=f"{FD}; {SDK_SMSCL}",
        conflict="FD: -32766 to 32766 without a sign bit; the SDK: sign at bit 15. Chosen: bit 15",
    ),
    _smcl(
        "goal_time",
        conflict="FD: goal PWM, sign at bit 10; the SDK: goal time, and the sign of a duty at bit 15. Chosen: bit 10",
        note="duty in 0.1 % in PWM mode",
    ),
    _smcl(
        "goal_velocity", low=0, source=f"{FD}; {SDK_SMSCL}",
        conflict="FD: 0 to 32766, no sign; the SDK: sign at bit 15. Chosen: it is read so, and only 0 and above is "
        "written",
        note="in counts/s by the SDK's examples",
    ),
    _smcl(
        "lock", source=f"{FD}; {SDK_SMSCL}",
        note="at 55 in SMBL, STS and HLS, where this address is the torque limit",
    ),
    _smcl("present_position", source=f"{FD}; {SDK_SMSCL}"),
    _smcl("present_velocity", note="in counts/s by the SDK's examples"),
    _smcl("present_current", note="the unit is that of other maps"),
    without=_GONE,
    title="old SMS servos (SM60/80/85/100/150-360M), firmware 1.0 to 1.39, little-endian",
)  # fmt: skip
