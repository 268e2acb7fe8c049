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
from motorbus.families.feetech.registers.codes import PHASE_BITS, rates
from motorbus.families.feetech.registers.rows import borrowed, differing
from motorbus.families.feetech.registers.sts import STS

_STS = borrowed(STS, "FD", {"firmware_major": 2, "model_major": 8})
_LIKE_STS = "laid out as in the STS map; this is not published for SMS servos"
_BIT_4 = "bit 4 is the angle limit on an STS3215; nothing confirms that for SMS. Chosen: as on STS"
_FACTORY = (
    "moving_threshold dts velocity_unit hts max_velocity_limit max_acceleration acceleration_multiplier"
)

# fmt: off
SMBL: Final = _STS.derive(
    "smbl",
    *differing(_STS, "byte_order", source="SMS_PAGE", note=STS["byte_order"].note),
    *differing(_STS, "model_major model_minor status_return_level max_temperature max_voltage min_voltage max_torque "
        "dead_band_cw dead_band_ccw protection_current present_load present_voltage present_temperature moving",
        source="FD SDK"),
    *differing(_STS, "id", source="EX3 FD SDK"),
    *differing(_STS, "baud_rate", high=11, default=4, choices=rates("smbl"), source="FD SMS_PAGE",
        conflict="FD: 5 to 7 are 76800, 57600 and 38400 bit/s; lerobot and rustypot name other rates, and are wrong. "
        "Chosen: FD",
        note="SMS servos ship with 115200 bit/s"),
    *differing(_STS, "return_delay", default=250, source="FD SMS_PAGE",
        note="in 2 µs; values below 50 act as 50 (100 µs), 0 is that minimum too"),
    *differing(_STS, "min_position_limit max_position_limit", source="FD SDK",
        note="both limits 0 mean many turns, as on STS"),
    *differing(_STS, "phase", bits=PHASE_BITS["smbl"], note=f"{STS['phase'].note}; bits {_LIKE_STS}"),
    *differing(_STS, "led_mask", source="FD SDK", conflict=_BIT_4),
    *differing(_STS, "unload_mask hardware_error", conflict=_BIT_4),
    *differing(_STS, "integral_limit", source="FD HLS_TABLE", note=STS["integral_limit"].note,
        conflict="FD: the integral limit; lerobot: the high byte of min_start_force. Chosen: FD"),
    *differing(_STS, "min_start_force", conflict="FD: one byte, 0 to 254; lerobot: two bytes. Chosen: one byte"),
    *differing(_STS, "angular_resolution", high=128, note="multiplies the angle of a count"),
    *differing(_STS, "homing_offset", source="FD SDK",
        note="present = (encoder - offset) mod 4096, measured on STS in position mode only"),
    *differing(_STS, "operating_mode", source="FD SDK",
        note="that it takes effect at once, even when locked, was measured on STS"),

    *differing(_STS, "torque_enable", source="FD SDK CLI",
        note="128 writes homing_offset; its state after power-up varies; that writing a goal position turns it on was "
        "measured on STS"),
    *differing(_STS, "acceleration", source="FD SDK", note="0 means the maximum"),
    *differing(_STS, "goal_position", source="EX4 FD SDK",
        note="relative in step mode, where writing it again moves again"),
    *differing(_STS, "goal_time", source="EX4 FD", note="FD calls it goal PWM",
        conflict="FD: the duty in 0.1 % in PWM mode; the manual: a time. Chosen: each in its mode"),
    *differing(_STS, "goal_velocity", source="EX4 FD SDK",
        note=f"1 count/s when bit 2 of phase is set, else 50: {_LIKE_STS}"),
    *differing(_STS, "torque_limit", source="FD SDK",
        note="loaded from max_torque at power-up; on SCS and SMCL this is the lock"),
    *differing(_STS, "lock", source="FD SDK", note="a locked write still changes the live value: measured on STS"),

    *differing(_STS, "present_position", source="EX2 FD SDK"),
    *differing(_STS, "present_velocity", source="FD SDK",
        note=f"1 count/s when bit 2 of phase is set, else 50: {_LIKE_STS}"),
    *differing(_STS, "goal_position_echo", source="HLS_TABLE LEROBOT", conflict=STS["goal_position_echo"].conflict,
        note="laid out as in the STS map, where it is in doubt too"),
    *differing(_STS, "present_current", source="FD SDK",
        note="supply side on STS; always 0 there when bit 5 of phase is set"),
    *(row for row in STS.values() if row.name in _FACTORY.split()),
    title="SMS brushless servos (SM..BL), firmware 2.40 to 2.69, little-endian",
)

_SMBL = borrowed(SMBL, "FD", {"firmware_major": 1, "model_major": 6, "baud_rate": 4, "return_delay": 250})
SMCL: Final = _SMBL.derive(
    "smcl",
    *differing(_SMBL, "byte_order", source="SMS_PAGE", note=STS["byte_order"].note),
    *differing(_SMBL, "id", source="EX3 FD"),
    *differing(_SMBL, "baud_rate", high=7, choices=rates("smcl"), source="FD SMS_PAGE",
        conflict="FD: 0 to 254; the SDK: 0 to 7. Chosen: 0 to 7", note="SMS servos ship with 115200 bit/s"),
    *differing(_SMBL, "return_delay", source="FD SMS_PAGE", note=SMBL["return_delay"].note),
    *differing(_SMBL, "max_torque", effect=Effect.TORQUE,
        note="of the stall torque; there is no torque limit beside it"),
    *differing(_SMBL, "phase", bits=PHASE_BITS["smcl"], high=254,
        note=f"{STS['phase'].note}; its bits are not published"),
    *differing(_SMBL, "unload_mask led_mask hardware_error", conflict=_BIT_4),
    *differing(_SMBL, "min_start_force", size=2, high=1000, source="FD SDK_SMSCL"),
    *differing(_SMBL, "protection_current", source="FD SDK_SMSCL",
        conflict="older SDK headers: at 36 and 37; FD: at 28 for all of firmware 1. Chosen: 28"),
    *differing(_SMBL, "homing_offset", address=33, source="FD SDK_SMSCL",
        conflict="FD's English file and old SDKs: sign at bit 15; its Chinese file and newer SDKs: at bit 11. Chosen: "
        "bit 11"),
    *differing(_SMBL, "operating_mode", address=35, high=2, choices={0: "position", 1: "velocity", 2: "PWM"},
        source="FD SDK_SMSCL"),
    *differing(_SMBL, "overcurrent_time", address=36),
    *differing(_SMBL, "protective_torque", address=37),
    *differing(_SMBL, "overload_time", address=38),
    *differing(_SMBL, "overload_torque", address=39),

    *differing(_SMBL, "torque_enable", source="FD SDK_SMSCL",
        note="128 writes homing_offset; its state after power-up varies"),
    *differing(_SMBL, "acceleration", note="0 means the maximum",
        conflict="FD: at 41; the oldest SDK headers have no such register. Chosen: FD"),
    *differing(_SMBL, "goal_position", source="FD SDK_SMSCL",
        conflict="FD: -32766 to 32766 without a sign bit; the SDK: sign at bit 15. Chosen: bit 15"),
    *differing(_SMBL, "goal_time", note="duty in 0.1 % in PWM mode",
        conflict="FD: goal PWM, sign at bit 10; the SDK: goal time, and the sign of a duty at bit 15. Chosen: bit 10"),
    *differing(_SMBL, "goal_velocity", low=0, source="FD SDK_SMSCL", note="in counts/s by the SDK's examples",
        conflict="FD: 0 to 32766, no sign; the SDK: sign at bit 15. Chosen: it is read so, and only 0 and above is "
        "written"),
    *differing(_SMBL, "lock", address=48, source="FD SDK_SMSCL",
        note="at 55 in SMBL, STS and HLS, where this address is the torque limit"),

    *differing(_SMBL, "present_position", source="FD SDK_SMSCL"),
    *differing(_SMBL, "present_velocity", note="in counts/s by the SDK's examples"),
    *differing(_SMBL, "present_current", note="the unit is that of other maps"),
    without=(
        *("integral_limit", "angular_resolution", "velocity_p", "velocity_i", "torque_limit", "goal_position_echo"),
        *_FACTORY.split(),
    ),
    title="old SMS servos (SM60/80/85/100/150-360M), firmware 1.0 to 1.39, little-endian",
)
# fmt: on
