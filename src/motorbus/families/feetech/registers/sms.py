"""The two register maps of SMS servos: SMBL (firmware 2.40 to 2.69) and the older SMCL (firmware 1.x), little-endian.

SMBL is laid out as STS. SMCL has its offset, mode and protection elsewhere, no torque limit, and its lock at 48, where
SMBL, STS and HLS have the torque limit: unlocked by another map it is limp.

FD lists firmware 1.0 to 1.19 and 1.20 to 1.39 apart. The published extract has the rows of the first and gives both the
same map, and so does this file; SDK headers of that time are of two kinds, too (see `protection_current`). Few defaults
of these servos are published, and FD's column "default" is no proof of one.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.request import Effect
from motorbus.families.feetech.registers.rows import derived, row
from motorbus.families.feetech.registers.sts import STS

_LIKE_STS = "laid out as in the STS map; this is not published for SMS servos"
_UNIT = f"1 count/s when bit 2 of phase is set, else 50: {_LIKE_STS}"
_BIT_4 = "bit 4 is the angle limit on an STS3215; nothing confirms that for SMS. Chosen: as on STS"

# fmt: off
SMBL: Final = derived(
    STS, "smbl", "SMS brushless servos (SM..BL), firmware 2.40 to 2.69, little-endian", "FD",
    row("model_major model_minor status_return_level min_position_limit max_position_limit max_temperature "
        "max_voltage min_voltage max_torque led_mask dead_band_cw dead_band_ccw protection_current homing_offset "
        "operating_mode acceleration torque_limit lock present_velocity present_load present_voltage "
        "present_temperature moving present_current", source="FD SDK"),
    row("byte_order", source="SMS_PAGE"),
    row("id", source="EX3 FD SDK"),
    row("baud_rate", source="FD SMS_PAGE", note="SMS servos ship with 115200 bit/s",
        conflict="FD: 5 to 7 are 76800, 57600 and 38400 bit/s; lerobot and rustypot name other rates, and are wrong. "
        "Chosen: FD"),
    row("return_delay", source="FD SMS_PAGE", conflict="",
        note="in 2 µs; values below 50 act as 50 (100 µs), 0 is that minimum too"),
    row("min_position_limit max_position_limit", conflict="", note="both limits 0 mean many turns, as on STS"),
    row("phase", note=f"{STS['phase'].note}; bits {_LIKE_STS}"),
    row("unload_mask led_mask hardware_error", conflict=_BIT_4),
    row("integral_limit", source="FD HLS_TABLE",
        conflict="FD: the integral limit; lerobot: the high byte of min_start_force. Chosen: FD"),
    row("min_start_force", conflict="FD: one byte, 0 to 254; lerobot: two bytes. Chosen: one byte"),
    row("angular_resolution", high=128),
    row("homing_offset", note="present = (encoder - offset) mod 4096, measured on STS in position mode only"),
    row("operating_mode", note="that it takes effect at once, even when locked, was measured on STS"),
    row("torque_enable", source="FD SDK CLI",
        note="128 writes homing_offset; its state after power-up varies; that writing a goal position turns it on was "
        "measured on STS"),
    row("goal_position", source="EX4 FD SDK", note="relative in step mode, where writing it again moves again"),
    row("goal_time", source="EX4 FD", note="FD calls it goal PWM",
        conflict="FD: the duty in 0.1 % in PWM mode; the manual: a time. Chosen: each in its mode"),
    row("goal_velocity", source="EX4 FD SDK", note=_UNIT),
    row("torque_limit", note="loaded from max_torque at power-up; on SCS and SMCL this is the lock"),
    row("lock", note="a locked write still changes the live value: measured on STS"),
    row("present_position", source="EX2 FD SDK", note=""),
    row("present_velocity", note=_UNIT),
    row("goal_position_echo", source="HLS_TABLE LEROBOT", conflict=STS["goal_position_echo"].conflict,
        note="laid out as in the STS map, where it is in doubt too"),
    row("present_current", note="supply side on STS; always 0 there when bit 5 of phase is set"),
    shipped={"firmware_major": 2, "model_major": 8, "baud_rate": 4, "return_delay": 250},
)

SMCL: Final = derived(
    SMBL, "smcl", "old SMS servos (SM60/80/85/100/150-360M), firmware 1.0 to 1.39, little-endian", "FD",
    row("min_start_force protection_current homing_offset operating_mode torque_enable goal_position goal_velocity "
        "lock present_position", source="FD SDK_SMSCL"),
    row("byte_order", source="SMS_PAGE"),
    row("id", source="EX3 FD"),
    row("baud_rate", source="FD SMS_PAGE", conflict="FD: 0 to 254; the SDK: 0 to 7. Chosen: 0 to 7"),
    row("return_delay", source="FD SMS_PAGE"),
    row("min_position_limit max_position_limit", note=""),
    row("max_torque", effect=Effect.TORQUE, note="of the stall torque; there is no torque limit beside it"),
    row("phase", high=254, note=f"{STS['phase'].note}; its bits are not published"),
    row("unload_mask led_mask hardware_error", conflict=_BIT_4),
    row("min_start_force", size=2, high=1000),
    row("protection_current",
        conflict="older SDK headers: at 36 and 37; FD: at 28 for all of firmware 1. Chosen: 28"),
    row("homing_offset", address=33,
        conflict="FD's English file and old SDKs: sign at bit 15; its Chinese file and newer SDKs: at bit 11. Chosen: "
        "bit 11"),
    row("operating_mode", address=35, high=2, choices={0: "position", 1: "velocity", 2: "PWM"}),
    row("overcurrent_time", address=36),
    row("protective_torque", address=37),
    row("overload_time", address=38),
    row("overload_torque", address=39),
    row("torque_enable", note="128 writes homing_offset; its state after power-up varies"),
    row("acceleration", conflict="FD: at 41; the oldest SDK headers have no such register. Chosen: FD"),
    row("goal_position", note="",
        conflict="FD: -32766 to 32766 without a sign bit; the SDK: sign at bit 15. Chosen: bit 15"),
    row("goal_time", note="duty in 0.1 % in PWM mode",
        conflict="FD: goal PWM, sign at bit 10; the SDK: goal time, and the sign of a duty at bit 15. Chosen: bit 10"),
    row("goal_velocity", low=0,
        conflict="FD: 0 to 32766, no sign; the SDK: sign at bit 15. Chosen: it is read so, and only 0 and above is "
        "written"),
    row("goal_velocity present_velocity", note="in counts/s by the SDK's examples"),
    row("lock", address=48, note="at 55 in SMBL, STS and HLS, where this address is the torque limit"),
    row("present_current", note="the unit is that of other maps"),
    shipped={"firmware_major": 1, "model_major": 6, "baud_rate": 4, "return_delay": 250},
    without="integral_limit angular_resolution velocity_p velocity_i torque_limit goal_position_echo moving_threshold "
    "dts velocity_unit hts max_velocity_limit max_acceleration acceleration_multiplier",
)
# fmt: on
