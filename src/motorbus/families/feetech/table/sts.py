"""The STS register map: firmware 3.0 to 3.39, little-endian (STS3215, STS3032, STS3250, HTS, STS..BL).

Where sources disagree, `conflict` says who says what, and what was chosen. The effect of a write is the worst it can
do:

- MOTION: a new goal, and also what gives the present goal another meaning (operating mode, homing offset,
  angular resolution, the direction bits of the phase). A servo that holds may move when one of those is
  written, even with the lock closed, for a locked write changes the live value; only a limp one does not.
- TORQUE: the torque limit as much as the torque switch, for raising it from 0 lets a servo go for its goal.
  In maps without a torque limit, max_torque is what bounds the present torque, and has this effect.
- IDENTITY: afterwards the servo no longer answers as it did. PERSISTENT: kept in EEPROM, when unlocked.
- The lock is PERSISTENT although it lies in RAM and moves nothing: opening it makes every later write to
  EEPROM survive, so whoever promises to change nothing for good may not touch it.

Defaults are those of an STS3215 as shipped, 7.4 V.
"""

from __future__ import annotations

from functools import partial
from math import tau
from typing import Final

from motorbus.core.register import Access, Coding, Register, RegisterMap, Storage
from motorbus.core.request import Effect
from motorbus.families.feetech.table.codes import ALARM_BITS, rates
from motorbus.families.feetech.table.phase import PHASE_BITS
from motorbus.families.feetech.table.sources import (
    CLI,
    FD,
    HLS_TABLE,
    LEROBOT,
    MANUAL,
    SDK,
    SERVOLAB,
    SMS_PAGE,
    SPECIAL,
    V36,
)

COUNT: Final = tau / 4096
"""One count of the encoder, in rad."""
AMPERE: Final = 0.0065
"""One count of a current register, in A."""

_COMMON = f"{FD}; {SDK}"
_BOTH = f"{FD}; {V36}"

_ANGLE = "V3.6: bit 4 is the angle limit; newer pages leave it unused. Chosen: V3.6"
_PERCENTAGE = "FD: 0 to 254; but it is a percentage. Chosen: 0 to 100"

_identity = partial(
    Register, size=1, access=Access.READ, storage=Storage.EEPROM, high=255, protected=True, source=_COMMON
)
_setting = partial(
    Register, size=1, access=Access.READ_WRITE, storage=Storage.EEPROM, effect=Effect.PERSISTENT, source=_BOTH
)
_command = partial(Register, access=Access.READ_WRITE, storage=Storage.RAM)
_feedback = partial(Register, access=Access.READ, storage=Storage.RAM, source=_COMMON)
_factory = partial(
    Register, size=1, access=Access.READ, storage=Storage.FACTORY, high=255, protected=True, source=LEROBOT
)

_IDENTITY_ROWS = (
    _identity(name="firmware_major", address=0, default=3, source=FD),
    _identity(
        name="firmware_minor", address=1, default=10, source=FD,
        note="3.9 and 3.10 are both common; the default is the one most was measured on",
    ),
    _identity(
        name="byte_order", address=2, high=1, default=0, choices={0: "little", 1: "big"},
        source=f"{HLS_TABLE}; {SMS_PAGE}",
        note="called END by the vendor; 0 is documented for STS, SMS and HLS, 1 on SCS is an assumption",
    ),
    _identity(name="model_major", address=3, default=9),
    _identity(name="model_minor", address=4, default=3),
    _setting(
        name="id", address=5, high=253, default=1, effect=Effect.IDENTITY, protected=True,
        source=f"{MANUAL}, example 3; {_COMMON}",
        note="the reply to the write may come from the new id; closing the lock must address the new one",
    ),
    _setting(
        name="baud_rate", address=6, high=7, default=0, effect=Effect.IDENTITY, protected=True,
        source=_COMMON, choices=rates("sts"),
        conflict="FD: 0 to 7, public headers: 0 to 11; lerobot and rustypot name other rates for 5 to 7 than FD and "
        "the SDK, and are wrong there. Chosen: FD and the SDK",
    ),
)  # fmt: skip

_SETTING_ROWS = (
    _setting(
        name="return_delay", address=7, high=254, default=0, unit="s", scale=2e-6, source=V36,
        conflict="V3.6: in 2 µs, shipped 0; FD and newer pages: reserved; lerobot: many servos ship with 250 (500 µs). "
        "Chosen: V3.6",
    ),
    _setting(
        name="status_return_level", address=8, high=1, default=1, source=_COMMON,
        choices={0: "answer PING and READ only", 1: "answer everything"},
        note="at level 0 a write that worked is silent and can only be confirmed by reading",
    ),
    _setting(
        name="min_position_limit", address=9, size=2, coding=Coding.SIGN_MAGNITUDE, sign_bit=15, high=4094,
        default=0, unit="rad", scale=COUNT, note="both limits 0 mean many turns",
    ),
    _setting(
        name="max_position_limit", address=11, size=2, coding=Coding.SIGN_MAGNITUDE, sign_bit=15, high=4095,
        default=4095, unit="rad", scale=COUNT,
        conflict="FD and V3.6: 1 to 4095; V3.6 too: both limits 0 mean many turns. Chosen: 0 to 4095",
        note="both limits 0 mean many turns",
    ),
    _setting(name="max_temperature", address=13, high=100, default=70, unit="°C"),
    _setting(
        name="max_voltage", address=14, high=254, default=80, unit="V", scale=0.1,
        conflict="V3.6: shipped 80, of 7.4 V servos; 140 was seen on a 12 V one, which nothing confirms. Chosen: 80",
    ),
    _setting(name="min_voltage", address=15, high=254, default=40, unit="V", scale=0.1),
    _setting(
        name="max_torque", address=16, size=2, high=1000, default=1000, unit="fraction", scale=0.001,
        note="of the stall torque; copied to torque_limit at power-up",
    ),
    _setting(
        name="phase", address=18, high=255, default=12, bits=PHASE_BITS["sts"], effect=Effect.MOTION,
        protected=True, source=f"{SPECIAL}; {V36}",
        note="never copy it from another servo: a wrong value can leave a permanent voltage alarm",
    ),
    _setting(
        name="unload_mask", address=19, high=255, default=44, bits=ALARM_BITS, conflict=_ANGLE,
        note="which alarms let the torque drop",
    ),
    _setting(name="led_mask", address=20, high=255, default=47, bits=ALARM_BITS, conflict=_ANGLE),
    _setting(name="position_p", address=21, high=254, default=32),
    _setting(name="position_d", address=22, high=254, default=32, note="the order is P, D, I"),
    _setting(name="position_i", address=23, high=254, default=0),
    _setting(
        name="min_start_force", address=24, high=254, default=16, unit="fraction", scale=0.001,
        conflict="FD: one byte, 0 to 254; V3.6 and lerobot: two bytes, 0 to 1000. Chosen: one byte",
    ),
    _setting(
        name="integral_limit", address=25, high=254, default=0, source=f"{FD}; {HLS_TABLE}",
        conflict="FD and the HLS table: the integral limit; V3.6 and lerobot: the high byte of min_start_force. "
        "Chosen: FD",
        note="the greatest integral is 4 times this, 0 is none",
    ),
    _setting(name="dead_band_cw", address=26, high=32, default=1, unit="rad", scale=COUNT),
    _setting(name="dead_band_ccw", address=27, high=32, default=1, unit="rad", scale=COUNT),
    _setting(
        name="protection_current", address=28, size=2, high=1023, default=500, unit="A", scale=AMPERE,
        conflict="FD: 0 to 1023; V3.6: 0 to 511. Chosen: 0 to 1023",
    ),
    _setting(
        name="angular_resolution", address=30, low=1, high=4, default=1, effect=Effect.MOTION,
        conflict="FD: 1 to 4; other pages: 1 to 3, or 1 to 100. Chosen: 1 to 4",
        note="multiplies the angle of a count",
    ),
    _setting(
        name="homing_offset", address=31, size=2, coding=Coding.SIGN_MAGNITUDE, sign_bit=11, low=-2047,
        high=2047, default=0, unit="rad", scale=COUNT, effect=Effect.MOTION, protected=True,
        source=f"{V36}; {LEROBOT}; {CLI}",
        conflict="V3.6 and lerobot: -2047 to 2047, sign at bit 11, and so it was measured; newest FD: 0 to 8191 "
        "unsigned. Chosen: bit 11",
        note="present = (encoder - offset) mod 4096, in position mode only",
    ),
    _setting(
        name="operating_mode", address=33, high=3, default=0, effect=Effect.MOTION,
        choices={0: "position", 1: "velocity", 2: "PWM", 3: "step"}, source=f"{_COMMON}; {V36}; {CLI}",
        note="takes effect at once, even when locked; locked it is lost at power-off",
    ),
    _setting(
        name="protective_torque", address=34, high=100, default=20, unit="fraction", scale=0.01,
        conflict=_PERCENTAGE, note="what is left of the torque after an overload",
    ),
    _setting(name="overload_time", address=35, high=254, default=200, unit="s", scale=0.01),
    _setting(
        name="overload_torque", address=36, high=100, default=80, unit="fraction", scale=0.01,
        conflict=_PERCENTAGE,
    ),
    _setting(name="velocity_p", address=37, high=254, default=10, note="velocity mode"),
    _setting(name="overcurrent_time", address=38, high=254, default=200, unit="s", scale=0.01),
    _setting(
        name="velocity_i", address=39, high=254, default=10,
        note="velocity mode; in tenths from table V3.6 on",
    ),
)  # fmt: skip

_COMMAND_ROWS = (
    _command(
        name="torque_enable", address=40, size=1, high=128, default=0, effect=Effect.TORQUE,
        choices={0: "off", 1: "on", 2: "damped (not every firmware)", 128: "call the present position 2048"},
        source=f"{_COMMON}; {V36}; {CLI}",
        conflict="V3.6: off after power-up; users report servos that hold. Chosen: off as the default, and always read",
        note="128 writes homing_offset; writing goal_position turns it on by itself; its state after "
        "power-up varies",
    ),
    _command(
        name="acceleration", address=41, size=1, high=254, default=0, unit="rad/s²", scale=100 * COUNT,
        source=f"{_COMMON}; {V36}; {SERVOLAB}",
        conflict="V3.6: 100 counts/s² for each unit; servolab measured 104 to 105 on firmware 3.10. Chosen: 100",
        note="0 means the maximum",
    ),
    _command(
        name="goal_position", address=42, size=2, coding=Coding.SIGN_MAGNITUDE, sign_bit=15, low=-32766,
        high=32766, unit="rad", scale=COUNT, effect=Effect.MOTION,
        source=f"{MANUAL}, example 4; {_COMMON}; {V36}; {CLI}",
        note="turns torque on by itself; useful to ±30719 over many turns; relative in step mode, where "
        "writing it again moves again",
    ),
    _command(
        name="goal_time", address=44, size=2, coding=Coding.SIGN_MAGNITUDE, sign_bit=10, low=-1000, high=1000,
        default=0, effect=Effect.MOTION, source=f"{MANUAL}, example 4; {FD}; {SERVOLAB}",
        conflict="FD, and servolab by measuring: sign at bit 10; V3.6 and lerobot: at bit 11. Chosen: bit 10",
        note="position mode: ms, and only some firmware heeds it; PWM mode: duty in 0.1 %, positive turns "
        "towards smaller angles",
    ),
    _command(
        name="goal_velocity", address=46, size=2, coding=Coding.SIGN_MAGNITUDE, sign_bit=15, low=-32766,
        high=32766, default=0, unit="rad/s", scale=COUNT, effect=Effect.MOTION,
        source=f"{MANUAL}, example 4; {_COMMON}; {V36}",
        note="1 count/s when bit 2 of phase is set, else 50; ±3400 is typical. In position mode the greatest "
        "velocity, where 0 means what bit 3 of phase says",
    ),
    _command(
        name="torque_limit", address=48, size=2, high=1000, default=1000, unit="fraction", scale=0.001,
        effect=Effect.TORQUE, source=f"{_COMMON}; {V36}",
        note="loaded from max_torque at power-up; on SCS and old SMS this address is the lock",
    ),
    _command(
        name="lock", address=55, size=1, high=1, default=1, effect=Effect.PERSISTENT,
        choices={0: "open: writes to EEPROM persist", 1: "closed: they are lost at power-off"},
        source=f"{_COMMON}; {V36}; {CLI}",
        conflict="V3.6: shipped 0; FD, and current servos: 1. Chosen: 1",
        note="a locked write still changes the live value",
    ),
)  # fmt: skip

_FEEDBACK_ROWS = (
    _feedback(
        name="present_position", address=56, size=2, coding=Coding.SIGN_MAGNITUDE, sign_bit=15, low=-32767,
        high=32767, unit="rad", scale=COUNT, source=f"{MANUAL}, example 2; {_COMMON}",
        note="homing_offset is applied in position mode only; beyond 0 to 4095 when bit 4 of phase is set",
    ),
    _feedback(
        name="present_velocity", address=58, size=2, coding=Coding.SIGN_MAGNITUDE, sign_bit=15, low=-32767,
        high=32767, unit="rad/s", scale=COUNT, note="1 count/s when bit 2 of phase is set, else 50",
    ),
    _feedback(
        name="present_load", address=60, size=2, coding=Coding.SIGN_MAGNITUDE, sign_bit=10, low=-1000,
        high=1000, unit="fraction", scale=0.001, note="duty of the power stage, not torque",
    ),
    _feedback(name="present_voltage", address=62, size=1, high=255, unit="V", scale=0.1),
    _feedback(name="present_temperature", address=63, size=1, high=255, unit="°C"),
    _feedback(
        name="reg_write_pending", address=64, size=1, high=1, default=0, choices={0: "nothing", 1: "waiting"},
        source=f"{MANUAL}, REG WRITE; {FD}", note="1 from REG WRITE until ACTION",
    ),
    _feedback(
        name="hardware_error", address=65, size=1, high=255, default=0, bits=ALARM_BITS,
        source=_BOTH, conflict=_ANGLE,
    ),
    _feedback(
        name="moving", address=66, size=1, high=1, bits={0: "moving"},
        note="0 also when it stands off its goal, stalled or within the dead band",
    ),
    _feedback(
        name="goal_position_echo", address=67, size=2, coding=Coding.SIGN_MAGNITUDE, sign_bit=15, low=-32767,
        high=32767, unit="rad", scale=COUNT, source=f"{HLS_TABLE}; {LEROBOT}",
        conflict="the HLS table: here, for HLS; lerobot: at 71. Chosen: here, not to be relied on",
    ),
    _feedback(
        name="present_current", address=69, size=2, coding=Coding.SIGN_MAGNITUDE, sign_bit=15, low=-32767,
        high=32767, unit="A", scale=AMPERE, note="supply side; always 0 when bit 5 of phase is set",
    ),
)  # fmt: skip

_FACTORY_ROWS = (
    _factory(name="moving_threshold", address=80, note="in units of velocity"),
    _factory(name="dts", address=81, note="ms"),
    _factory(name="velocity_unit", address=82),
    _factory(name="hts", address=83, note="ns, firmware 2.54 and later"),
    _factory(name="max_velocity_limit", address=84),
    _factory(name="max_acceleration", address=85, note="lerobot writes 254; offered to be read here"),
    _factory(name="acceleration_multiplier", address=86, note="used when acceleration is 0"),
)

STS: Final = RegisterMap(
    "sts",
    (*_IDENTITY_ROWS, *_SETTING_ROWS, *_COMMAND_ROWS, *_FEEDBACK_ROWS, *_FACTORY_ROWS),
    title="STS, HTS and STS..BL servos, firmware 3.0 to 3.39, little-endian",
)
