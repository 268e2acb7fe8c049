"""The HLS register map: firmware 3.40 to 3.59, little-endian (HLS36.., HLS39..), with current control.

Three differences from STS do harm when they are missed. Register 7 is a second id, where others have the return delay.
Register 44 is the goal torque: in position mode it bounds the current, so the usual seven bytes from 41 on, with zeros
where STS has a time, make a servo that never moves. A velocity counts in steps of 50 counts/s, whatever the phase says.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.request import Effect
from motorbus.families.feetech.registers.codes import ALARM_BITS, PHASE_BITS, rates
from motorbus.families.feetech.registers.rows import (
    COUNT,
    CURRENT,
    NUMBER,
    borrowed,
    command,
    differing,
    factory,
    feedback,
    setting,
)
from motorbus.families.feetech.registers.sts import STS

_STS = borrowed(STS, "FD HLS_TABLE", {"baud_rate": 0, "max_torque": 980, "torque_limit": 980})
_BITS = ALARM_BITS["hls"]
_VELOCITY = 50 * COUNT

# fmt: off
HLS: Final = _STS.derive(
    "hls",
    *differing(_STS, "firmware_major", default=3),
    *differing(_STS, "firmware_minor", default=43, note="3.43 and 3.45 were met"),
    *differing(_STS, "byte_order", source="HLS_TABLE", note=STS["byte_order"].note),
    *differing(_STS, "model_major", default=10),
    *differing(_STS, "id", source="EX3 FD HLS_TABLE", note=f"the main id; {STS['id'].note}"),
    *differing(_STS, "baud_rate", choices=rates("hls"), source="FD HLS_TABLE SDK_HLS",
        conflict="FD: 0 to 7; public headers: 0 to 11. Chosen: 0 to 7"),
    setting("second_id", 7, 1, NUMBER, 253, "FD HLS_TABLE", effect=Effect.IDENTITY, protected=True,
        note="obeyed for writes only; in other maps this is the return delay, and a 0 meant for that gives a servo the "
        "second id 0"),
    *differing(_STS, "min_position_limit max_position_limit", note="both limits 0 mean many turns"),
    *differing(_STS, "max_torque", source="HLS_TABLE", note=STS["max_torque"].note),
    *differing(_STS, "phase", bits=PHASE_BITS["hls"], source="BYTES_HLS FD HLS_TABLE",
        note=f"other bits than on STS: bit 2 is no unit of velocity here; {STS['phase'].note}"),
    *differing(_STS, "unload_mask led_mask hardware_error", bits=_BITS),
    *differing(_STS, "integral_limit", note=STS["integral_limit"].note),
    *differing(_STS, "dead_band_cw dead_band_ccw", high=16,
        conflict="HLS table: 0 to 16; FD: 0 to 32. Chosen: 0 to 16"),
    *differing(_STS, "protection_current", high=2047,
        conflict="HLS table: 0 to 2047; FD: 0 to 1023. Chosen: 0 to 2047", note="loaded into goal_torque at power-up"),
    *differing(_STS, "angular_resolution", high=128, note="multiplies the angle of a count"),
    *differing(_STS, "homing_offset", sign_bit=15, low=-4095, high=4095,
        note="sign at bit 15, where STS and SMS have bit 11"),
    *differing(_STS, "operating_mode", high=4,
        choices={0: "position", 1: "velocity", 2: "constant current", 3: "PWM", 4: "not documented"},
        conflict="FD: 0 to 4; the HLS table: 0 to 3. Chosen: 4 may be written; its effect is not known",
        note="other numbers than on STS"),
    setting("current_p", 34, 1, NUMBER, 254, "FD HLS_TABLE",
        note="current loop; on STS this address is the protective torque"),
    setting("current_i", 35, 1, NUMBER, 254, "FD HLS_TABLE",
        note="current loop; on STS this address is the overload time"),
    *differing(_STS, "velocity_p velocity_i", note="velocity mode"),

    *differing(_STS, "torque_enable", high=2, choices={0: "off", 1: "on", 2: "damped"}, source="FD HLS_TABLE SDK_HLS",
        conflict="FD: 0 to 254; the HLS table: 0 to 2. Chosen: 0 to 2",
        note="the position is set by the instruction 0x0B and not by 128"),
    *differing(_STS, "acceleration",
        note="0 means the maximum; HLS table: 8.7 °/s² for each unit, which is 100 counts/s²"),
    *differing(_STS, "goal_position", source="EX4 FD HLS_TABLE SDK_HLS",
        note="whether it turns torque on by itself has not been measured"),
    command("goal_torque", 44, 2, CURRENT, (-2047, 2047), "FD HLS_TABLE SDK_HLS", sign_bit=15, effect=Effect.MOTION,
        conflict="FD: -2048 to 2047; the HLS table: -2047 to 2047. Chosen: -2047 to 2047",
        note="in position and velocity mode the maximum current, so never 0 there; in constant current mode the goal; "
        "loaded from protection_current at power-up"),
    *differing(_STS, "goal_velocity", scale=_VELOCITY, source="EX4 FD HLS_TABLE SDK_HLS",
        note="50 counts/s (0.732 rpm) for each unit whatever phase says; 0 means standstill"),
    *differing(_STS, "torque_limit", note="loaded from max_torque at power-up",
        conflict="FD: a sign bit, and no negative range; the HLS table: none. Chosen: none"),
    command("live_p", 50, 1, NUMBER, 254, "FD HLS_TABLE", note="loaded from position_p at power-up"),
    command("live_d", 51, 1, NUMBER, 254, "FD HLS_TABLE", note="loaded from position_d at power-up"),
    command("live_i", 52, 1, NUMBER, 254, "FD HLS_TABLE", note="loaded from position_i at power-up"),
    command("control_loop", 53, 1, NUMBER, 1, "FD HLS_TABLE", effect=Effect.MOTION,
        choices={0: "dual loop", 1: "position only"}, note="Km; gone in later firmware"),
    *differing(_STS, "lock", source="FD HLS_TABLE SDK_HLS", note="on SCS and SMCL the lock is at 48"),

    *differing(_STS, "present_position", source="EX2 FD HLS_TABLE SDK_HLS",
        note="beyond 0 to 4095 when bit 4 of phase is set"),
    *differing(_STS, "present_velocity", scale=_VELOCITY, source="FD HLS_TABLE SDK_HLS",
        note="50 counts/s for each unit whatever phase says"),
    *differing(_STS, "moving", high=3, bits={0: "moving", 1: "goal not reached"}, note="bit 1 is of HLS only"),
    *differing(_STS, "goal_position_echo", source="HLS_TABLE"),
    *differing(_STS, "present_current", source="FD HLS_TABLE SDK_HLS",
        note="of the motor's phase; that of the supply is about this times the duty"),
    feedback("current_zero_offset", 73, 2, NUMBER, (-32767, 32767), "FD HLS_TABLE", sign_bit=15,
        note="FD calls it Eofs; no unit is published"),

    factory("vfk", 77, 1, NUMBER, 255, "HLS_TABLE"),
    factory("vkgi", 78, 1, NUMBER, 255, "HLS_TABLE"),
    factory("pfk", 79, 1, NUMBER, 255, "HLS_TABLE"),
    factory("moving_threshold", 80, 1, NUMBER, 255, "HLS_TABLE", note="in units of velocity"),
    factory("dts", 81, 1, NUMBER, 255, "HLS_TABLE", note="ms"),
    factory("efk", 82, 1, NUMBER, 255, "HLS_TABLE"),
    factory("vk", 83, 1, NUMBER, 255, "HLS_TABLE"),
    factory("max_velocity_limit", 84, 1, NUMBER, 255, "HLS_TABLE"),
    factory("max_acceleration", 85, 1, NUMBER, 255, "HLS_TABLE"),
    factory("acceleration_multiplier", 86, 1, NUMBER, 255, "HLS_TABLE", note="used when acceleration is 0"),
    without=(
        *("return_delay", "protective_torque", "overload_time", "overload_torque", "goal_time"),
        *("velocity_unit", "hts"),
    ),
    title="HLS servos, firmware 3.40 to 3.59, little-endian",
)
# fmt: on
