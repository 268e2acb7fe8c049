"""The STS register map: firmware 3.0 to 3.39, little-endian (STS3215, STS3032, STS3250, HTS, STS..BL).

The effect of a write is the strongest one possible:

- MOTION: a new goal, and what gives the present goal another meaning (operating mode, homing offset, angular
  resolution, the direction bits of the phase). A servo that holds may move then, even with the lock closed, for a
  locked write changes the live value; only a limp one does not.
- TORQUE: the torque switch, and the torque limit: raised from 0 it lets a servo move to its goal. In maps without a
  torque limit, max_torque bounds the torque and has this effect.
- IDENTITY: afterwards the servo answers otherwise. PERSISTENT: kept in EEPROM while the lock is open.
- The lock is PERSISTENT although it lies in RAM: while it is open, each later write to EEPROM survives power-off.

Defaults are those of an STS3215 as shipped, 7.4 V.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.register import RegisterMap
from motorbus.core.request import Effect
from motorbus.families.feetech.registers.codes import ALARM_BITS, BAUD_CODES, BAUD_CODES_OF, PHASE_BITS
from motorbus.families.feetech.registers.rows import command, factory, feedback, identity, setting

IDENTITY, MOTION, PERSISTENT, TORQUE = Effect.IDENTITY, Effect.MOTION, Effect.PERSISTENT, Effect.TORQUE
_ANGLE_BIT = "V3.6: bit 4 is the angle limit; newer pages leave it unused. Chosen: V3.6"
_PERCENTAGE = "FD: 0 to 254; but it is a percentage. Chosen: 0 to 100"
_RATES = {code: f"{BAUD_CODES[code]} bit/s" for code in BAUD_CODES_OF["sts"]}
_TURNS = "both limits 0 mean many turns"

# fmt: off
STS: Final = RegisterMap("sts", (
    identity("firmware_major", 0, 1, "number", 255, "FD", 3),
    identity("firmware_minor", 1, 1, "number", 255, "FD", 10,
        note="3.9 and 3.10 are both common; the default is the one most was measured on"),
    identity("byte_order", 2, 1, "number", 1, "HLS_TABLE SMS_PAGE", 0, choices={0: "little", 1: "big"},
        note="called END by the vendor; 0 is documented for STS, SMS and HLS, 1 on SCS is an assumption"),
    identity("model_major", 3, 1, "number", 255, "FD SDK", 9),
    identity("model_minor", 4, 1, "number", 255, "FD SDK", 3),
    setting("id", 5, 1, "number", 253, "EX3 FD SDK", 1, effect=IDENTITY, protected=True,
        note="the reply to the write may come from the new id; closing the lock must address the new one"),
    setting("baud_rate", 6, 1, "number", 7, "FD SDK", 0, effect=IDENTITY, protected=True, choices=_RATES,
        conflict="FD: 0 to 7, public headers: 0 to 11; lerobot and rustypot name other rates for 5 to 7 than FD and "
        "the SDK, and are wrong there. Chosen: FD and the SDK"),
    setting("return_delay", 7, 1, "2 µs", 254, "V36", 0,
        conflict="V3.6: in 2 µs, shipped 0; FD and newer pages: reserved; lerobot: many servos ship with 250 "
        "(500 µs). Chosen: V3.6"),
    setting("status_return_level", 8, 1, "number", 1, "FD SDK", 1,
        choices={0: "answer PING and READ only", 1: "answer everything"},
        note="at level 0 a write that worked is silent and can only be confirmed by reading"),
    setting("min_position_limit", 9, 2, "angle", 4094, "FD V36", 0, sign_bit=15, note=_TURNS),
    setting("max_position_limit", 11, 2, "angle", 4095, "FD V36", 4095, sign_bit=15, note=_TURNS,
        conflict="FD and V3.6: 1 to 4095; V3.6 too: both limits 0 mean many turns. Chosen: 0 to 4095"),
    setting("max_temperature", 13, 1, "temperature", 100, "FD V36", 70),
    setting("max_voltage", 14, 1, "voltage", 254, "FD V36", 80,
        conflict="V3.6: shipped 80, of 7.4 V servos; 140 was seen on a 12 V one, which nothing confirms. Chosen: 80"),
    setting("min_voltage", 15, 1, "voltage", 254, "FD V36", 40),
    setting("max_torque", 16, 2, "fraction", 1000, "FD V36", 1000,
        note="of the stall torque; copied to torque_limit at power-up"),
    setting("phase", 18, 1, "number", 255, "BYTES V36", 12, bits=PHASE_BITS["sts"], effect=MOTION, protected=True,
        note="never copy it from another servo: a wrong value can leave a permanent voltage alarm"),
    setting("unload_mask", 19, 1, "number", 255, "FD V36", 44, bits=ALARM_BITS["sts"], conflict=_ANGLE_BIT,
        note="which alarms reduce the torque"),
    setting("led_mask", 20, 1, "number", 255, "FD V36", 47, bits=ALARM_BITS["sts"], conflict=_ANGLE_BIT),
    setting("position_p", 21, 1, "number", 254, "FD V36", 32),
    setting("position_d", 22, 1, "number", 254, "FD V36", 32, note="the order is P, D, I"),
    setting("position_i", 23, 1, "number", 254, "FD V36", 0),
    setting("min_start_force", 24, 1, "fraction", 254, "FD V36", 16,
        conflict="FD: one byte, 0 to 254; V3.6 and lerobot: two bytes, 0 to 1000. Chosen: one byte"),
    setting("integral_limit", 25, 1, "number", 254, "FD HLS_TABLE", 0,
        conflict="FD and the HLS table: the integral limit; V3.6 and lerobot: the high byte of min_start_force. "
        "Chosen: FD",
        note="the maximum of the integral is 4 times this, 0 is none"),
    setting("dead_band_cw", 26, 1, "angle", 32, "FD V36", 1),
    setting("dead_band_ccw", 27, 1, "angle", 32, "FD V36", 1),
    setting("protection_current", 28, 2, "current", 1023, "FD V36", 500,
        conflict="FD: 0 to 1023; V3.6: 0 to 511. Chosen: 0 to 1023"),
    setting("angular_resolution", 30, 1, "number", (1, 4), "FD V36", 1, effect=MOTION,
        conflict="FD: 1 to 4; other pages: 1 to 3, or 1 to 100. Chosen: 1 to 4",
        note="multiplies the angle of a count"),
    setting("homing_offset", 31, 2, "angle", (-2047, 2047), "V36 LEROBOT CLI", 0, sign_bit=11, effect=MOTION,
        protected=True,
        conflict="V3.6 and lerobot: -2047 to 2047, sign at bit 11, and so it was measured; newest FD: 0 to 8191 "
        "unsigned. Chosen: bit 11",
        note="present = (encoder - offset) mod 4096, in position mode only"),
    setting("operating_mode", 33, 1, "number", 3, "FD SDK V36 CLI", 0, effect=MOTION,
        choices={0: "position", 1: "velocity", 2: "PWM", 3: "step"},
        note="takes effect at once, even when locked; locked it is lost at power-off"),
    setting("protective_torque", 34, 1, "percent", 100, "FD V36", 20, conflict=_PERCENTAGE,
        note="what is left of the torque after an overload"),
    setting("overload_time", 35, 1, "10 ms", 254, "FD V36", 200),
    setting("overload_torque", 36, 1, "percent", 100, "FD V36", 80, conflict=_PERCENTAGE),
    setting("velocity_p", 37, 1, "number", 254, "FD V36", 10, note="velocity mode"),
    setting("overcurrent_time", 38, 1, "10 ms", 254, "FD V36", 200),
    setting("velocity_i", 39, 1, "number", 254, "FD V36", 10, note="velocity mode; in tenths from table V3.6 on"),

    command("torque_enable", 40, 1, "number", 128, "FD SDK V36 CLI", 0, effect=TORQUE,
        choices={0: "off", 1: "on", 2: "damped (not every firmware)", 128: "call the present position 2048"},
        conflict="V3.6: off after power-up; users report servos that hold. Chosen: off as the default, and always read",
        note="128 writes homing_offset; writing goal_position turns it on by itself; its state after power-up varies"),
    command("acceleration", 41, 1, "acceleration", 254, "FD SDK V36 SERVOLAB", 0,
        conflict="V3.6: 100 counts/s² for each unit; servolab measured 104 to 105 on firmware 3.10. Chosen: 100",
        note="0 means the maximum"),
    command("goal_position", 42, 2, "angle", (-32766, 32766), "EX4 FD SDK V36 CLI", sign_bit=15, effect=MOTION,
        note="turns torque on by itself; useful to ±30719 over many turns; relative in step mode, where writing it "
        "again moves again"),
    command("goal_time", 44, 2, "number", (-1000, 1000), "EX4 FD SERVOLAB", 0, sign_bit=10, effect=MOTION,
        conflict="FD, and servolab by measuring: sign at bit 10; V3.6 and lerobot: at bit 11. Chosen: bit 10",
        note="position mode: ms, which only some firmware uses; PWM mode: duty in 0.1 %, positive turns towards "
        "smaller angles"),
    command("goal_velocity", 46, 2, "velocity", (-32766, 32766), "EX4 FD SDK V36", 0, sign_bit=15, effect=MOTION,
        note="1 count/s when bit 2 of phase is set, else 50; ±3400 is typical. In position mode the maximum velocity, "
        "where 0 means what bit 3 of phase says"),
    command("torque_limit", 48, 2, "fraction", 1000, "FD SDK V36", 1000, effect=TORQUE,
        note="loaded from max_torque at power-up; on SCS and old SMS this address is the lock"),
    command("lock", 55, 1, "number", 1, "FD SDK V36 CLI", 1, effect=PERSISTENT,
        choices={0: "open: writes to EEPROM persist", 1: "closed: they are lost at power-off"},
        conflict="V3.6: shipped 0; FD, and current servos: 1. Chosen: 1",
        note="a locked write still changes the live value"),

    feedback("present_position", 56, 2, "angle", (-32767, 32767), "EX2 FD SDK", sign_bit=15,
        note="homing_offset is applied in position mode only; beyond 0 to 4095 when bit 4 of phase is set"),
    feedback("present_velocity", 58, 2, "velocity", (-32767, 32767), "FD SDK", sign_bit=15,
        note="1 count/s when bit 2 of phase is set, else 50"),
    feedback("present_load", 60, 2, "fraction", (-1000, 1000), "FD SDK", sign_bit=10,
        note="duty of the power stage, not torque"),
    feedback("present_voltage", 62, 1, "voltage", 255, "FD SDK"),
    feedback("present_temperature", 63, 1, "temperature", 255, "FD SDK"),
    feedback("reg_write_pending", 64, 1, "number", 1, "REG_WRITE FD", 0, choices={0: "nothing", 1: "waiting"},
        note="1 from REG WRITE until ACTION"),
    feedback("hardware_error", 65, 1, "number", 255, "FD V36", 0, bits=ALARM_BITS["sts"], conflict=_ANGLE_BIT),
    feedback("moving", 66, 1, "number", 1, "FD SDK", bits={0: "moving"},
        note="0 also when it stands off its goal, stalled or within the dead band"),
    feedback("goal_position_echo", 67, 2, "angle", (-32767, 32767), "HLS_TABLE LEROBOT", sign_bit=15,
        conflict="the HLS table: here, for HLS; lerobot: at 71. Chosen: here, not to be relied on"),
    feedback("present_current", 69, 2, "current", (-32767, 32767), "FD SDK", sign_bit=15,
        note="supply side; always 0 when bit 5 of phase is set"),

    factory("moving_threshold", 80, 1, "number", 255, "LEROBOT", note="in units of velocity"),
    factory("dts", 81, 1, "number", 255, "LEROBOT", note="ms"),
    factory("velocity_unit", 82, 1, "number", 255, "LEROBOT"),
    factory("hts", 83, 1, "number", 255, "LEROBOT", note="ns, firmware 2.54 and later"),
    factory("max_velocity_limit", 84, 1, "number", 255, "LEROBOT"),
    factory("max_acceleration", 85, 1, "number", 255, "LEROBOT", note="lerobot writes 254; offered to be read here"),
    factory("acceleration_multiplier", 86, 1, "number", 255, "LEROBOT", note="used when acceleration is 0"),
), title="STS, HTS and STS..BL servos, firmware 3.0 to 3.39, little-endian")
# fmt: on
