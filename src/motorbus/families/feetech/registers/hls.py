"""The HLS register map: firmware 3.40 to 3.59, little-endian (HLS36.., HLS39..), with current control.

Three differences from STS do harm when they are missed. Register 7 is a second id, where others have the return delay.
Register 44 is the goal torque: in position mode it bounds the current, so the usual seven bytes from 41 on, with zeros
where STS has a time, make a servo that never moves. A velocity counts in steps of 50 counts/s, whatever the phase says.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.request import Effect
from motorbus.families.feetech.registers.rows import COUNT, command, derived, factory, feedback, row, setting
from motorbus.families.feetech.registers.sts import STS

_FACTORY = (
    "vfk vkgi pfk moving_threshold dts efk vk max_velocity_limit max_acceleration acceleration_multiplier"
)

# fmt: off
HLS: Final = derived(
    STS, "hls", "HLS servos, firmware 3.40 to 3.59, little-endian", "FD HLS_TABLE",
    row("baud_rate torque_enable lock present_velocity present_current", source="FD HLS_TABLE SDK_HLS"),
    row("byte_order max_torque goal_position_echo", source="HLS_TABLE"),
    row("firmware_minor", note="3.43 and 3.45 were met"),
    row("id", source="EX3 FD HLS_TABLE", note=f"the main id; {STS['id'].note}"),
    row("baud_rate", conflict="FD: 0 to 7; public headers: 0 to 11. Chosen: 0 to 7"),
    setting("second_id", 7, 1, "number", 253, "FD HLS_TABLE", effect=Effect.IDENTITY, protected=True,
        note="obeyed for writes only; in other maps this is the return delay, and a 0 meant for that gives a servo the "
        "second id 0"),
    row("max_position_limit", conflict=""),
    row("phase", source="BYTES_HLS FD HLS_TABLE",
        note=f"other bits than on STS: bit 2 is no unit of velocity here; {STS['phase'].note}"),
    row("dead_band_cw dead_band_ccw", high=16, conflict="HLS table: 0 to 16; FD: 0 to 32. Chosen: 0 to 16"),
    row("protection_current", high=2047, note="loaded into goal_torque at power-up",
        conflict="HLS table: 0 to 2047; FD: 0 to 1023. Chosen: 0 to 2047"),
    row("angular_resolution", high=128),
    row("homing_offset", sign_bit=15, low=-4095, high=4095,
        note="sign at bit 15, where STS and SMS have bit 11"),
    row("operating_mode", high=4,
        choices={0: "position", 1: "velocity", 2: "constant current", 3: "PWM", 4: "not documented"},
        conflict="FD: 0 to 4; the HLS table: 0 to 3. Chosen: 4 may be written; its effect is not known",
        note="other numbers than on STS"),
    setting("current_p", 34, 1, "number", 254, "FD HLS_TABLE",
        note="current loop; on STS this address is the protective torque"),
    setting("current_i", 35, 1, "number", 254, "FD HLS_TABLE",
        note="current loop; on STS this address is the overload time"),
    row("velocity_p velocity_i", note="velocity mode"),

    row("torque_enable", high=2, choices={0: "off", 1: "on", 2: "damped"},
        conflict="FD: 0 to 254; the HLS table: 0 to 2. Chosen: 0 to 2",
        note="the position is set by the instruction 0x0B and not by 128"),
    row("acceleration",
        note="0 means the maximum; HLS table: 8.7 °/s² for each unit, which is 100 counts/s²"),
    row("goal_position goal_velocity", source="EX4 FD HLS_TABLE SDK_HLS"),
    row("goal_position", note="whether it turns torque on by itself has not been measured"),
    command("goal_torque", 44, 2, "current", (-2047, 2047), "FD HLS_TABLE SDK_HLS", sign_bit=15, effect=Effect.MOTION,
        conflict="FD: -2048 to 2047; the HLS table: -2047 to 2047. Chosen: -2047 to 2047",
        note="in position and velocity mode the maximum current, so never 0 there; in constant current mode the goal; "
        "loaded from protection_current at power-up"),
    row("goal_velocity present_velocity", scale=50 * COUNT),
    row("goal_velocity",
        note="50 counts/s (0.732 rpm) for each unit whatever phase says; 0 means standstill"),
    row("torque_limit", note="loaded from max_torque at power-up",
        conflict="FD: a sign bit, and no negative range; the HLS table: none. Chosen: none"),
    command("live_p", 50, 1, "number", 254, "FD HLS_TABLE", note="loaded from position_p at power-up"),
    command("live_d", 51, 1, "number", 254, "FD HLS_TABLE", note="loaded from position_d at power-up"),
    command("live_i", 52, 1, "number", 254, "FD HLS_TABLE", note="loaded from position_i at power-up"),
    command("control_loop", 53, 1, "number", 1, "FD HLS_TABLE", effect=Effect.MOTION,
        choices={0: "dual loop", 1: "position only"}, note="Km; gone in later firmware"),
    row("lock", note="on SCS and SMCL the lock is at 48"),

    row("present_position", source="EX2 FD HLS_TABLE SDK_HLS",
        note="beyond 0 to 4095 when bit 4 of phase is set"),
    row("present_velocity", note="50 counts/s for each unit whatever phase says"),
    row("moving", high=3, bits={0: "moving", 1: "goal not reached"}, note="bit 1 is of HLS only"),
    row("present_current", note="of the motor's phase; that of the supply is about this times the duty"),
    feedback("current_zero_offset", 73, 2, "number", (-32767, 32767), "FD HLS_TABLE", sign_bit=15,
        note="FD calls it Eofs; no unit is published"),
    *(factory(name, address, 1, "number", 255, "HLS_TABLE") for address, name in enumerate(_FACTORY.split(), 77)),
    row("moving_threshold", note="in units of velocity"),
    row("dts", note="ms"),
    row("acceleration_multiplier", note="used when acceleration is 0"),
    shipped={
        "firmware_major": 3, "firmware_minor": 43, "model_major": 10, "baud_rate": 0, "max_torque": 980,
        "torque_limit": 980,
    },
    without="return_delay protective_torque overload_time overload_torque goal_time velocity_unit hts",
)
# fmt: on
