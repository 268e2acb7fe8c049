"""The two register maps of SCS servos: SCS (firmware 0.x) and SCS2 (firmware 3.20 to 3.39), big-endian, 1024 counts.

A word has its high byte at the lower address, the other way round than in all other maps, and no checksum can tell: a
little-endian goal is a valid packet for another position. There is no operating mode: both limits 0 make a motor of it,
which register 44 drives. The lock is at 48, where STS, SMBL and HLS have the torque limit. There is no acceleration:
lerobot and rustypot list one at 41, and neither FD, nor the SCS table, nor the SDK has it.

A count is 300/1024 degrees here, the arc of an SCS0009; other models differ. Defaults: SCS memory table 1902.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.register import Coding, RegisterMap, changed
from motorbus.core.request import Effect
from motorbus.families.feetech.registers.codes import ALARM_BITS, PHASE_BITS, rates
from motorbus.families.feetech.registers.rows import (
    AMPERE,
    NUMBER,
    SCS_COUNT,
    borrowed,
    cited,
    differing,
    factory,
    setting,
)
from motorbus.families.feetech.registers.sts import STS

_TIME = 0.04  # s, of one count of a protection time
_ARC = "the arc of a count depends on the model"
_DELAY = "the SCS table: in 2 µs, shipped 0; FD: reserved, and 250. Chosen: the SCS table"
_SHIPPED = {
    "firmware_major": 0, "model_major": 5, "byte_order": 1, "return_delay": 0, "max_temperature": 80,
    "min_position_limit": 20, "max_position_limit": 1003, "max_voltage": 90, "min_voltage": 45,
    "max_torque": 1000, "phase": 0, "unload_mask": 36, "led_mask": 37, "position_p": 15, "position_d": 15,
    "position_i": 0, "min_start_force": 30, "dead_band_cw": 1, "dead_band_ccw": 1, "protective_torque": 20,
    "overload_time": 100, "overload_torque": 80,
}  # fmt: skip
_UNSIGNED = {"coding": Coding.UNSIGNED, "sign_bit": None, "low": 0}
_STS = borrowed(STS, "FD SCS_TABLE", _SHIPPED, order="big")
_FACTORY = "pwm_max_step moving_threshold dts min_velocity_limit max_velocity_limit factory_acceleration"

# fmt: off
SCS: Final = _STS.derive(
    "scs",
    *differing(_STS, "byte_order", source="HLS_TABLE SMS_PAGE", note="called END by the vendor",
        conflict="0 is documented for STS, SMS and HLS; nothing has been published for SCS. Chosen: 1, big"),
    *differing(_STS, "id", conflict="servos ship with 1; some SCS tables print 0 as shipped. Chosen: 1"),
    *differing(_STS, "baud_rate", high=10, choices=rates("scs"), source="FD SCS_TABLE SDK_SCS",
        conflict="FD: 0 to 10; the SDK: 0 to 7; public headers: 0 to 11. Chosen: 0 to 10",
        note="SCS servos ship with 1000000 or 500000 bit/s, by model"),
    *differing(_STS, "return_delay", source="SCS_TABLE", conflict=_DELAY),
    *differing(_STS, "min_position_limit max_position_limit", scale=SCS_COUNT, **_UNSIGNED, high=1023,
        effect=Effect.MOTION, conflict="FD: sign at bit 15; the SCS table: none. Chosen: none",
        note=f"both limits 0 make a motor of it, which goal_time then drives; {_ARC}"),
    *differing(_STS, "max_torque", effect=Effect.TORQUE,
        note="of the stall torque; there is no torque limit beside it"),
    *differing(_STS, "phase", bits=PHASE_BITS["scs"], source="BYTES_SCS FD SCS_TABLE"),
    *differing(_STS, "unload_mask led_mask hardware_error", bits=ALARM_BITS["scs"]),
    *differing(_STS, "position_i", source="SCS_TABLE",
        conflict="the SCS table: at 23; FD has none. Chosen: the SCS table"),
    *differing(_STS, "min_start_force", size=2, high=1000),
    *differing(_STS, "dead_band_cw dead_band_ccw", scale=SCS_COUNT, note=_ARC),
    setting("hysteresis", 28, 1, ("rad", SCS_COUNT), 254, "SCS_TABLE", 1, order="big",
        conflict="the SCS table: at 28; rustypot: at 27, which is the dead band; FD has none. Chosen: the SCS table"),
    *differing(_STS, "protective_torque", address=37),
    *differing(_STS, "overload_time", address=38, scale=_TIME, note="in 40 ms, where other series have 10 ms"),
    *differing(_STS, "overload_torque", address=39),

    *differing(_STS, "torque_enable", high=2, choices={0: "off, damped", 1: "on", 2: "off, free"},
        source="FD SCS_TABLE SDK_SCS", note="its state after power-up varies"),
    *differing(_STS, "goal_position", scale=SCS_COUNT, **_UNSIGNED, high=1023, source="FD SCS_TABLE SDK_SCS",
        note=_ARC),
    *differing(_STS, "goal_time", **_UNSIGNED, high=65535, source="FD SCS_TABLE SDK_SCS",
        conflict="FD: sign at bit 10 for the time too, so that one of 1024 ms and more reads as a negative number; the "
        "SCS table: for the duty alone; the SDK: a time of 16 bits. Chosen: the SCS table and the SDK",
        note="position mode: the time of the move in ms, used when the velocity is 0; motor mode: duty in 0.1 %, sign "
        "at bit 10"),
    *differing(_STS, "goal_velocity", scale=SCS_COUNT, **_UNSIGNED, source="FD SCS_TABLE SDK_SCS",
        note=f"0 means the time counts, and without one what bit 3 of phase says; {_ARC}"),
    *differing(_STS, "lock", address=48, source="FD SCS_TABLE SDK_SCS",
        note="at 55 in STS, SMBL and HLS, where this address is the torque limit; a locked write still changes the "
        "live value: measured on STS"),

    *differing(_STS, "present_position present_velocity", scale=SCS_COUNT, source="FD SCS_TABLE SDK_SCS", note=_ARC),
    *differing(_STS, "present_load", source="FD SCS_TABLE SDK_SCS"),
    *differing(_STS, "present_current", unit="", scale=1.0, source="SDK_SCS", note="no unit is published",
        conflict="the SDK: at 69; FD has none. Chosen: it is offered, and may mean nothing"),
    factory("pwm_max_step", 78, 1, NUMBER, 255, "LEROBOT", order="big"),
    factory("moving_threshold", 79, 1, NUMBER, 255, "LEROBOT", order="big", note="in 50 counts/s"),
    factory("dts", 80, 1, NUMBER, 255, "LEROBOT", order="big", note="ms"),
    factory("min_velocity_limit", 81, 1, NUMBER, 255, "LEROBOT", order="big", note="in 50 counts/s"),
    factory("max_velocity_limit", 82, 1, NUMBER, 255, "LEROBOT", order="big", note="in 50 counts/s"),
    factory("factory_acceleration", 83, 1, NUMBER, 255, "LEROBOT", order="big",
        note="lerobot calls it Acceleration_2"),
    without=(
        *("integral_limit", "protection_current", "angular_resolution", "homing_offset", "operating_mode"),
        *("velocity_p", "overcurrent_time", "velocity_i", "acceleration", "torque_limit", "goal_position_echo"),
        *("velocity_unit", "hts", "max_acceleration", "acceleration_multiplier"),
    ),
    title="SCS servos, firmware 0.0 to 0.39, big-endian",
)

_SHARED = (
    *("min_position_limit", "max_position_limit", "dead_band_cw", "dead_band_ccw", "overload_time", "torque_enable"),
    *("goal_position", "goal_velocity", "lock", "present_position", "present_velocity"),
)
_UNPUBLISHED = "FD's map of SCS2 has no such register. Chosen: as in the SCS map"


def _scs2_base() -> RegisterMap:
    """The SCS rows as FD's map of SCS2 has them; what is general of SCS keeps its note and conflict."""
    rows = borrowed(SCS, "FD", {"firmware_major": 3, "model_major": 9, "byte_order": 1})
    return rows.derive(
        "scs2",
        *(changed(rows[name], note=SCS[name].note, conflict=SCS[name].conflict) for name in _SHARED),
        *(changed(SCS[name], conflict=_UNPUBLISHED) for name in _FACTORY.split()),
    )


_BASE = _scs2_base()
SCS2: Final = _BASE.derive(
    "scs2",
    *differing(_BASE, "byte_order", source="HLS_TABLE SMS_PAGE", note=SCS["byte_order"].note,
        conflict=SCS["byte_order"].conflict),
    *differing(_BASE, "baud_rate", high=7, choices=rates("scs2"),
        conflict="FD: 0 to 7; public headers: 0 to 11. Chosen: 0 to 7"),
    *differing(_BASE, "return_delay", source="SCS_TABLE", conflict=_DELAY),
    *differing(_BASE, "unload_mask led_mask hardware_error", bits=ALARM_BITS["scs2"]),
    *differing(_BASE, "hysteresis", source="SCS_TABLE", conflict=_UNPUBLISHED),
    *differing(_BASE, "goal_time",
        conflict="FD: the duty alone; the SCS table: in position mode the time. Chosen: both, as on SCS",
        note="motor mode: duty in 0.1 %, sign at bit 10; position mode: the time of the move in ms, used when the "
        "velocity is 0"),
    changed(STS["overcurrent_time"], address=31, order="big", scale=_TIME, default=None, source=cited("FD"),
        note="taken to be in 40 ms as the other protection time of SCS"),
    changed(STS["protection_current"], address=32, order="big", default=None, source=cited("FD"), conflict="",
        note="the unit is that of other maps"),
    changed(STS["homing_offset"], address=34, order="big", size=1, sign_bit=7, low=-127, high=127, scale=SCS_COUNT,
        source=cited("FD"), conflict="", note=f"one byte, sign at bit 7; {_ARC}"),
    *differing(_BASE, "present_current", unit="A", scale=AMPERE, note="the unit is that of other maps"),
    without=("position_i",),
    title="SCS servos of the second kind (SCSXX-2), firmware 3.20 to 3.39, big-endian",
)
# fmt: on
