"""The two register maps of SCS servos: SCS (firmware 0.x) and SCS2 (firmware 3.20 to 3.39), big-endian, 1024 counts.

A word has its high byte at the lower address, the other way round than in all other maps, and no checksum can tell: a
little-endian goal is a good packet for another position. There is no operating mode: both limits 0 make a motor of it,
which register 44 drives. The lock is at 48, where STS, SMBL and HLS have the torque limit. There is no acceleration:
lerobot and rustypot list one at 41, and neither FD, nor the SCS table, nor the SDK has it.

A count is reckoned as 300/1024 degrees, the arc of an SCS0009; what other models turn through is their own affair.
Defaults are those of the SCS memory table 1902.
"""

from __future__ import annotations

from math import radians
from typing import Final

from motorbus.core.register import Access, Coding, Register, Storage, changed
from motorbus.core.request import Effect
from motorbus.families.feetech.table.borrowed import borrowed
from motorbus.families.feetech.table.codes import ALARM_BITS_OF, rates
from motorbus.families.feetech.table.phase import PHASE_BITS
from motorbus.families.feetech.table.sources import (
    FD,
    HEADERS,
    HLS_TABLE,
    LEROBOT,
    SCS_TABLE,
    SDK_SCS,
    SMS_PAGE,
    SPECIAL_SCS,
)
from motorbus.families.feetech.table.sts import AMPERE, STS

SCS_COUNT: Final = radians(300) / 1024
"""One count of an SCS servo, in rad, as an SCS0009 has it."""
_TIME: Final = 0.04
"""One count of a protection time, in s."""

_BOTH = f"{FD}; {SCS_TABLE}"
_ALL = f"{_BOTH}; {SDK_SCS}"
_ARC = "the arc of a count depends on the model"
_DELAY = "the SCS table: in 2 µs, shipped 0; FD: reserved, and 250. Chosen: the SCS table"
_SHIPPED = {
    "firmware_major": 0, "model_major": 5, "byte_order": 1, "return_delay": 0, "max_temperature": 80,
    "min_position_limit": 20, "max_position_limit": 1003, "max_voltage": 90, "min_voltage": 45,
    "max_torque": 1000, "phase": 0, "unload_mask": 36, "led_mask": 37, "position_p": 15, "position_d": 15,
    "position_i": 0, "min_start_force": 30, "dead_band_cw": 1, "dead_band_ccw": 1, "protective_torque": 20,
    "overload_time": 100, "overload_torque": 80,
}  # fmt: skip
_ROWS = borrowed(
    STS,
    source=_BOTH,
    order="big",
    defaults=_SHIPPED,
)


def _row(name: str, **differences: object) -> Register:
    return changed(_ROWS[name], **differences)


def _position(name: str, **differences: object) -> Register:
    return _row(name, scale=SCS_COUNT, **{"note": _ARC, **differences})


def _factory(name: str, address: int, note: str = "") -> Register:
    return Register(
        name=name, address=address, size=1, access=Access.READ, storage=Storage.FACTORY, order="big", high=255,
        protected=True, source=LEROBOT, note=note,
    )  # fmt: skip


_UNSIGNED = {"coding": Coding.UNSIGNED, "sign_bit": None, "low": 0}

_SETTINGS = (
    _row(
        "byte_order", source=f"{HLS_TABLE}; {SMS_PAGE}",
        conflict="0 is documented for STS, SMS and HLS; nothing has been published for SCS. Chosen: 1, big",
        note="called END by the vendor",
    ),
    _row("id", conflict="servos ship with 1; some SCS tables print 0 as shipped. Chosen: 1"),
    _row(
        "baud_rate", high=10, choices=rates("scs"), source=_ALL,
        conflict="FD: 0 to 10; the SDK: 0 to 7; public headers: 0 to 11. Chosen: 0 to 10",
        note="SCS servos ship with 1000000 or 500000 bit/s, by model",
    ),
    _row("return_delay", source=SCS_TABLE, conflict=_DELAY),
    *(
        _position(
            name, **_UNSIGNED, high=1023, effect=Effect.MOTION,
            conflict="FD: sign at bit 15; the SCS table: none. Chosen: none",
            note=f"both limits 0 make a motor of it, which goal_time then drives; {_ARC}",
        )
        for name in ("min_position_limit", "max_position_limit")
    ),
    _row("max_torque", effect=Effect.TORQUE, note="of the stall torque; there is no torque limit beside it"),
    _row("phase", bits=PHASE_BITS["scs"], source=f"{SPECIAL_SCS}; {_BOTH}"),
    _row("unload_mask", bits=ALARM_BITS_OF["scs"]),
    _row("led_mask", bits=ALARM_BITS_OF["scs"]),
    _row("position_i", source=SCS_TABLE, conflict="the SCS table: at 23; FD has none. Chosen: the SCS table"),
    _row("min_start_force", size=2, high=1000),
    *(_position(name) for name in ("dead_band_cw", "dead_band_ccw")),
    changed(
        _position("dead_band_cw"), name="hysteresis", address=28, high=254, source=SCS_TABLE,
        conflict="the SCS table: at 28; rustypot: at 27, which is the dead band; FD has none. Chosen: the SCS table",
        note="",
    ),
    _row("protective_torque", address=37),
    _row("overload_time", address=38, scale=_TIME, note="in 40 ms, where other series have 10 ms"),
    _row("overload_torque", address=39),
)  # fmt: skip

_COMMANDS = (
    _row(
        "torque_enable", high=2, choices={0: "off, damped", 1: "on", 2: "off, free"}, source=_ALL,
        note="its state after power-up varies",
    ),
    _position("goal_position", **_UNSIGNED, high=1023, source=_ALL),
    _row(
        "goal_time", source=_ALL,
        conflict="FD: sign at bit 10 for the time too, so that one of 1024 ms and more reads as a negative number; the "
        "SCS table: for the duty alone. Chosen: FD",
        note="position mode: the time of the way in ms, heeded when the velocity is 0; motor mode: duty in 0.1 %, sign "
        "at bit 10",
    ),
    _position(
        "goal_velocity", **_UNSIGNED, source=_ALL,
        note=f"0 means the time counts, and without one what bit 3 of phase says; {_ARC}",
    ),
    _row(
        "lock", address=48, source=_ALL,
        note="at 55 in STS, SMBL and HLS, where this address is the torque limit; a locked write still changes the "
        "live value: measured on STS",
    ),
)  # fmt: skip

_FEEDBACK = (
    _position("present_position", source=_ALL),
    _position("present_velocity", source=_ALL),
    _row("present_load", source=_ALL),
    _row("hardware_error", bits=ALARM_BITS_OF["scs"]),
    _row(
        "present_current", unit="", scale=1.0, source=SDK_SCS,
        conflict="the SDK: at 69; FD has none. Chosen: it is offered, and may mean nothing",
        note="no unit is published",
    ),
)  # fmt: skip

_FACTORY = (
    _factory("pwm_max_step", 78),
    _factory("moving_threshold", 79, "in 50 counts/s"),
    _factory("dts", 80, "ms"),
    _factory("min_velocity_limit", 81, "in 50 counts/s"),
    _factory("max_velocity_limit", 82, "in 50 counts/s"),
    _factory("factory_acceleration", 83, "lerobot calls it Acceleration_2"),
)

SCS: Final = _ROWS.derive(
    "scs",
    *_SETTINGS,
    *_COMMANDS,
    *_FEEDBACK,
    *_FACTORY,
    without=(
        *("integral_limit", "protection_current", "angular_resolution", "homing_offset", "operating_mode"),
        *(
            "velocity_p",
            "overcurrent_time",
            "velocity_i",
            "acceleration",
            "torque_limit",
            "goal_position_echo",
        ),
        *("velocity_unit", "hts", "max_acceleration", "acceleration_multiplier"),
    ),
    title="SCS servos, firmware 0.0 to 0.39, big-endian",
)

_SECOND = borrowed(
    SCS, source=FD, order="big", defaults={"firmware_major": 3, "model_major": 9, "byte_order": 1}
)
_UNPUBLISHED = "FD's map of SCS2 has no such register. Chosen: as in the SCS map"


def _scs2(name: str, **differences: object) -> Register:
    """The row as SCS has it, with what is said of it there."""
    return changed(_SECOND[name], **{"note": SCS[name].note, "conflict": SCS[name].conflict, **differences})


SCS2: Final = _SECOND.derive(
    "scs2",
    _scs2("byte_order", source=SCS["byte_order"].source),
    *(
        _scs2(name)
        for name in (
            *("min_position_limit", "max_position_limit", "dead_band_cw", "dead_band_ccw"),
            *("overload_time", "torque_enable", "goal_position", "goal_velocity", "lock"),
            *("present_position", "present_velocity"),
        )
    ),
    _scs2("baud_rate", high=7, choices=rates("scs2"), conflict=HEADERS, note=""),
    _scs2(
        "goal_time",
        conflict="FD: the duty alone; the SCS table: in position mode the time. Chosen: both, as on SCS",
        note="motor mode: duty in 0.1 %, sign at bit 10; position mode: the time of the way in ms, heeded when the "
        "velocity is 0",
    ),
    _scs2("return_delay", source=SCS_TABLE, conflict=_DELAY),
    _scs2("hysteresis", source=SCS_TABLE, conflict=_UNPUBLISHED),
    changed(
        STS["overcurrent_time"], address=31, order="big", scale=_TIME, default=None, source=FD,
        note="taken to be in 40 ms as the other protection time of SCS",
    ),
    changed(
        STS["protection_current"], address=32, order="big", default=None, source=FD, conflict="",
        note="the unit is that of other maps",
    ),
    changed(
        STS["homing_offset"], address=34, order="big", size=1, sign_bit=7, low=-127, high=127, scale=SCS_COUNT,
        source=FD, conflict="", note=f"one byte, sign at bit 7; {_ARC}",
    ),
    _scs2("present_current", unit="A", scale=AMPERE, conflict="", note="the unit is that of other maps"),
    *(_scs2(row.name, source=LEROBOT, conflict=_UNPUBLISHED) for row in _FACTORY),
    without=("position_i",),
    title="SCS servos of the second kind (SCSXX-2), firmware 3.20 to 3.39, big-endian",
)  # fmt: skip
