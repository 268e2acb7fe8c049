"""The HLS register map: firmware 3.40 to 3.59, little-endian (HLS36.., HLS39..), which has current control.

It looks like the STS map, and three of its differences bite. Register 7 is a second id, where others have the return
delay. Register 44 is the goal torque: in position mode it bounds the current, so the usual burst of seven bytes from 41
on, with zeros where STS has a time, makes a servo that never moves. And a velocity counts in steps of 50 counts/s,
whatever the phase byte says.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.register import Access, Coding, Register, Storage, changed
from motorbus.core.request import Effect
from motorbus.families.feetech.table.borrowed import borrowed
from motorbus.families.feetech.table.codes import ALARM_BITS_OF, rates
from motorbus.families.feetech.table.phase import PHASE_BITS
from motorbus.families.feetech.table.sources import FD, HEADERS, HLS_TABLE, MANUAL, SDK_HLS, SPECIAL_HLS
from motorbus.families.feetech.table.sts import AMPERE, COUNT, STS

_BOTH = f"{FD}; {HLS_TABLE}"
_ALL = f"{_BOTH}; {SDK_HLS}"
_VELOCITY = 50 * COUNT
_ROWS = borrowed(STS, source=_BOTH, defaults={"baud_rate": 0, "max_torque": 980, "torque_limit": 980})


def _row(name: str, **differences: object) -> Register:
    return changed(_ROWS[name], **differences)


def _setting(name: str, address: int, **facts: object) -> Register:
    return changed(_ROWS["position_p"], name=name, address=address, **facts)


def _live(name: str, address: int, loaded: str) -> Register:
    return Register(
        name=name, address=address, size=1, access=Access.READ_WRITE, storage=Storage.RAM, high=254,
        source=_BOTH, note=f"loaded from {loaded} at power-up",
    )  # fmt: skip


def _factory(name: str, address: int, note: str = "") -> Register:
    return Register(
        name=name, address=address, size=1, access=Access.READ, storage=Storage.FACTORY, high=255,
        protected=True, source=HLS_TABLE, note=note,
    )  # fmt: skip


_SETTINGS = (
    _row("firmware_major", default=3),
    _row("firmware_minor", default=43, note="3.43 and 3.45 were met"),
    _row("byte_order", source=HLS_TABLE, note=STS["byte_order"].note),
    _row("model_major", default=10),
    _row("id", source=f"{MANUAL}, example 3; {_BOTH}", note=f"the main id; {STS['id'].note}"),
    _row("baud_rate", choices=rates("hls"), source=_ALL, conflict=HEADERS),
    Register(
        name="second_id", address=7, size=1, access=Access.READ_WRITE, storage=Storage.EEPROM, high=253,
        effect=Effect.IDENTITY, protected=True, source=_BOTH,
        note="obeyed for writes only; in other maps this is the return delay, and a 0 meant for that gives a servo the "
        "second id 0",
    ),
    _row("min_position_limit", note="both limits 0 mean many turns"),
    _row("max_position_limit", note="both limits 0 mean many turns"),
    _row("max_torque", source=HLS_TABLE, note="of the stall torque; copied to torque_limit at power-up"),
    _row(
        "phase", bits=PHASE_BITS["hls"], source=f"{SPECIAL_HLS}; {_BOTH}",
        note=f"other bits than on STS: bit 2 is no unit of velocity here; {STS['phase'].note}",
    ),
    _row("unload_mask", bits=ALARM_BITS_OF["hls"]),
    _row("led_mask", bits=ALARM_BITS_OF["hls"]),
    _row("integral_limit", note="the greatest integral is 4 times this, 0 is none"),
    *(
        _row(name, high=16, conflict="HLS table: 0 to 16; FD: 0 to 32. Chosen: 0 to 16")
        for name in ("dead_band_cw", "dead_band_ccw")
    ),
    _row(
        "protection_current", high=2047,
        conflict="HLS table: 0 to 2047; FD: 0 to 1023. Chosen: 0 to 2047",
        note="loaded into goal_torque at power-up",
    ),
    _row("angular_resolution", high=128, note="multiplies the angle of a count"),
    _row("homing_offset", sign_bit=15, low=-4095, high=4095, note="sign at bit 15, where STS and SMS have bit 11"),
    _row(
        "operating_mode", high=4,
        choices={0: "position", 1: "velocity", 2: "constant current", 3: "PWM", 4: "not documented"},
        conflict="FD: 0 to 4; the HLS table: 0 to 3. Chosen: 4 may be written, and nobody knows what it does",
        note="other numbers than on STS",
    ),
    _setting("current_p", 34, note="current loop; on STS this address is the protective torque"),
    _setting("current_i", 35, note="current loop; on STS this address is the overload time"),
    _row("velocity_p", note="velocity mode"),
    _row("velocity_i", note="velocity mode"),
)  # fmt: skip

_COMMANDS = (
    _row(
        "torque_enable", high=2, choices={0: "off", 1: "on", 2: "damped"}, source=_ALL,
        conflict="FD: 0 to 254; the HLS table: 0 to 2. Chosen: 0 to 2",
        note="the position is set by the instruction 0x0B and not by 128",
    ),
    _row("acceleration", note="0 means the maximum; HLS table: 8.7 °/s² for each unit, which is 100 counts/s²"),
    _row(
        "goal_position", source=f"{MANUAL}, example 4; {_ALL}",
        note="whether it turns torque on by itself has not been measured",
    ),
    Register(
        name="goal_torque", address=44, size=2, access=Access.READ_WRITE, storage=Storage.RAM,
        coding=Coding.SIGN_MAGNITUDE, sign_bit=15, low=-2047, high=2047, unit="A", scale=AMPERE,
        effect=Effect.MOTION, source=_ALL,
        conflict="FD: -2048 to 2047; the HLS table: -2047 to 2047. Chosen: -2047 to 2047",
        note="in position and velocity mode the greatest current, so never 0 there; in constant current mode the "
        "goal; loaded from protection_current at power-up",
    ),
    _row(
        "goal_velocity", scale=_VELOCITY, source=f"{MANUAL}, example 4; {_ALL}",
        note="50 counts/s (0.732 rpm) for each unit whatever phase says; 0 means standstill",
    ),
    _row(
        "torque_limit", conflict="FD: a sign bit, and no negative range; the HLS table: none. Chosen: none",
        note="loaded from max_torque at power-up",
    ),
    _live("live_p", 50, "position_p"),
    _live("live_d", 51, "position_d"),
    _live("live_i", 52, "position_i"),
    Register(
        name="control_loop", address=53, size=1, access=Access.READ_WRITE, storage=Storage.RAM, high=1,
        choices={0: "dual loop", 1: "position only"}, effect=Effect.MOTION, source=_BOTH,
        note="Km; gone in later firmware",
    ),
    _row("lock", source=_ALL, note="on SCS and SMCL the lock is at 48"),
)  # fmt: skip

_FEEDBACK = (
    _row("present_position", source=f"{MANUAL}, example 2; {_ALL}", note="beyond 0 to 4095 when bit 4 of phase is set"),
    _row("present_velocity", scale=_VELOCITY, source=_ALL, note="50 counts/s for each unit whatever phase says"),
    _row("hardware_error", bits=ALARM_BITS_OF["hls"]),
    _row("moving", high=3, bits={0: "moving", 1: "goal not reached"}, note="bit 1 is of HLS only"),
    _row("goal_position_echo", source=HLS_TABLE),
    _row("present_current", source=_ALL, note="of the motor's phase; that of the supply is about this times the duty"),
    Register(
        name="current_zero_offset", address=73, size=2, access=Access.READ, storage=Storage.RAM,
        coding=Coding.SIGN_MAGNITUDE, sign_bit=15, low=-32767, high=32767, source=_BOTH,
        note="FD calls it Eofs; no unit is published",
    ),
)  # fmt: skip

_FACTORY = (
    _factory("vfk", 77),
    _factory("vkgi", 78),
    _factory("pfk", 79),
    _factory("moving_threshold", 80, "in units of velocity"),
    _factory("dts", 81, "ms"),
    _factory("efk", 82),
    _factory("vk", 83),
    _factory("max_velocity_limit", 84),
    _factory("max_acceleration", 85),
    _factory("acceleration_multiplier", 86, "used when acceleration is 0"),
)

HLS: Final = _ROWS.derive(
    "hls",
    *_SETTINGS,
    *_COMMANDS,
    *_FEEDBACK,
    *_FACTORY,
    without=(
        *("return_delay", "protective_torque", "overload_time", "overload_torque", "goal_time"),
        *("velocity_unit", "hts"),
    ),
    title="HLS servos, firmware 3.40 to 3.59, little-endian",
)
