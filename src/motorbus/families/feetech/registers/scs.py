"""The two register maps of SCS servos: SCS (firmware 0.x) and SCS2 (firmware 3.20 to 3.39), big-endian, 1024 counts.

A word has its high byte at the lower address, the other way round than in all other maps, and no checksum can tell: a
little-endian goal is a valid packet for another position. There is no operating mode: both limits 0 make a motor of it,
which register 44 drives. The lock is at 48, where STS, SMBL and HLS have the torque limit. There is no acceleration:
lerobot and rustypot list one at 41, and neither FD, nor the SCS table, nor the SDK has it.

A count is 300/1024 degrees here, the arc of an SCS0009; other models differ. Defaults: SCS memory table 1902.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.request import Effect
from motorbus.families.feetech.registers.rows import AMPERE, SCS_COUNT, derived, factory, row, setting
from motorbus.families.feetech.registers.sts import STS

_ARC = "the arc of a count depends on the model"
_SHIPPED = {
    "firmware_major": 0, "model_major": 5, "byte_order": 1, "return_delay": 0, "max_temperature": 80,
    "min_position_limit": 20, "max_position_limit": 1003, "max_voltage": 90, "min_voltage": 45,
    "max_torque": 1000, "phase": 0, "unload_mask": 36, "led_mask": 37, "position_p": 15, "position_d": 15,
    "position_i": 0, "min_start_force": 30, "dead_band_cw": 1, "dead_band_ccw": 1, "protective_torque": 20,
    "overload_time": 100, "overload_torque": 80,
}  # fmt: skip
_FACTORY = "pwm_max_step moving_threshold dts min_velocity_limit max_velocity_limit factory_acceleration"

# fmt: off
SCS: Final = derived(
    STS, "scs", "SCS servos, firmware 0.0 to 0.39, big-endian", "FD SCS_TABLE",
    row("baud_rate torque_enable goal_position goal_time goal_velocity lock present_position present_velocity "
        "present_load", source="FD SCS_TABLE SDK_SCS"),
    row("dead_band_cw dead_band_ccw present_position present_velocity", scale=SCS_COUNT, note=_ARC),
    row("min_position_limit max_position_limit goal_position", scale=SCS_COUNT, sign_bit=None, low=0, high=1023,
        note=_ARC),
    row("byte_order", source="HLS_TABLE SMS_PAGE", note="called END by the vendor",
        conflict="0 is documented for STS, SMS and HLS; nothing has been published for SCS. Chosen: 1, big"),
    row("id", conflict="servos ship with 1; some SCS tables print 0 as shipped. Chosen: 1"),
    row("baud_rate", conflict="FD: 0 to 10; the SDK: 0 to 7; public headers: 0 to 11. Chosen: 0 to 10",
        note="SCS servos ship with 1000000 or 500000 bit/s, by model"),
    row("return_delay", source="SCS_TABLE",
        conflict="the SCS table: in 2 µs, shipped 0; FD: reserved, and 250. Chosen: the SCS table"),
    row("min_position_limit max_position_limit", effect=Effect.MOTION,
        conflict="FD: sign at bit 15; the SCS table: none. Chosen: none",
        note=f"both limits 0 make a motor of it, which goal_time then drives; {_ARC}"),
    row("max_torque", effect=Effect.TORQUE, note="of the stall torque; there is no torque limit beside it"),
    row("phase", source="BYTES_SCS FD SCS_TABLE"),
    row("position_i", source="SCS_TABLE",
        conflict="the SCS table: at 23; FD has none. Chosen: the SCS table"),
    row("min_start_force", size=2, high=1000),
    setting("hysteresis", 28, 1, "SCS angle", 254, "SCS_TABLE", 1,
        conflict="the SCS table: at 28; rustypot: at 27, which is the dead band; FD has none. Chosen: the SCS table"),
    row("protective_torque", address=37),
    row("overload_time", address=38, scale=0.04, note="in 40 ms, where other series have 10 ms"),
    row("overload_torque", address=39),
    row("torque_enable", high=2, choices={0: "off, damped", 1: "on", 2: "off, free"},
        note="its state after power-up varies"),
    row("goal_time", sign_bit=None, low=0, high=65535,
        conflict="FD: sign at bit 10 for the time too, so that one of 1024 ms and more reads as a negative number; the "
        "SCS table: for the duty alone; the SDK: a time of 16 bits. Chosen: the SCS table and the SDK",
        note="position mode: the time of the move in ms, used when the velocity is 0; motor mode: duty in 0.1 %, sign "
        "at bit 10"),
    row("goal_velocity", scale=SCS_COUNT, sign_bit=None, low=0,
        note=f"0 means the time counts, and without one what bit 3 of phase says; {_ARC}"),
    row("lock", address=48,
        note="at 55 in STS, SMBL and HLS, where this address is the torque limit; a locked write still changes the "
        "live value: measured on STS"),
    row("present_current", unit="", scale=1.0, source="SDK_SCS", note="no unit is published",
        conflict="the SDK: at 69; FD has none. Chosen: it is offered, and may mean nothing"),
    *(factory(name, address, 1, "number", 255, "LEROBOT") for address, name in enumerate(_FACTORY.split(), 78)),
    row("moving_threshold min_velocity_limit max_velocity_limit", note="in 50 counts/s"),
    row("dts", note="ms"),
    row("factory_acceleration", note="lerobot calls it Acceleration_2"),
    shipped=_SHIPPED, order="big",
    without="integral_limit protection_current angular_resolution homing_offset operating_mode velocity_p "
    "overcurrent_time velocity_i acceleration torque_limit goal_position_echo velocity_unit hts max_acceleration "
    "acceleration_multiplier",
)

SCS2: Final = derived(
    SCS, "scs2", "SCS servos of the second kind (SCSXX-2), firmware 3.20 to 3.39, big-endian", "FD",
    row("byte_order", source="HLS_TABLE SMS_PAGE"),
    row("baud_rate", note="", conflict="FD: 0 to 7; public headers: 0 to 11. Chosen: 0 to 7"),
    row("return_delay hysteresis", source="SCS_TABLE"),
    row(f"hysteresis {_FACTORY}", conflict="FD's map of SCS2 has no such register. Chosen: as in the SCS map"),
    row("goal_time",
        conflict="FD: the duty alone; the SCS table: in position mode the time. Chosen: both, as on SCS",
        note="motor mode: duty in 0.1 %, sign at bit 10; position mode: the time of the move in ms, used when the "
        "velocity is 0"),
    setting("overcurrent_time", 31, 1, "40 ms", 254, "FD",
        note="taken to be in 40 ms as the other protection time of SCS"),
    setting("protection_current", 32, 2, "current", 1023, "FD", note="the unit is that of other maps"),
    setting("homing_offset", 34, 1, "SCS angle", (-127, 127), "FD", 0, sign_bit=7, effect=Effect.MOTION,
        protected=True, note=f"one byte, sign at bit 7; {_ARC}"),
    row("present_current", unit="A", scale=AMPERE, note="the unit is that of other maps"),
    shipped={"firmware_major": 3, "model_major": 9, "byte_order": 1}, order="big", without="position_i",
)
# fmt: on
