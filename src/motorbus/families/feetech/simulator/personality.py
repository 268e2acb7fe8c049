"""What the servos of one map are beyond their registers: supply, motor, shipped values, what was measured of whom.

The table says what a register is and `Control` which part it plays. Left over is what a simulated servo must have and
no table tells: a number in every register as it comes out of the box, how fast its motor is, and the habits that
somebody has seen in one kind of servo only. A value that no source gives is assumed; each group below says so. The
figures are those of one servo of its map and hold for the others by assumption.

Source of the figures of the STS3215: its memory table V3.6 (no-load speed 50 rpm = 3400 counts/s, no-load current
150 mA); the current register of an STS ends at about 500 units = 3.25 A, which is taken for the stall.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

from motorbus.core.plant import Drive


@dataclass(frozen=True, slots=True, kw_only=True)
class Personality:
    """The servos of one map, as far as its table does not say.

    `firmware`        the version they tell: one that was met, or one from the middle of the map's range
    `voltage`         the supply they are made for, in V
    `drive`           their motor, in counts of their own map
    `shipped`         raw values out of the box of rows whose default nobody has published: assumed, all of them
    `least_delay`     no reply begins earlier than this, in s
    `smaller`         whether a positive duty turns towards smaller counts
    `goal_enables`    whether writing the goal position switches torque on
    `heeds_time`      whether the time of the way counts when the velocity is 0
    `calibrates`      whether 0x0B is known to be obeyed
    `turns_cleared`   whether every model obeys 0x0A; else only those whose name ends in BL, if the map knows it at all
    `reversed_by`     phase bits that reverse drive and feedback; where both are one bit, it reverses the two together
    """

    firmware: tuple[int, int]
    voltage: float
    drive: Drive
    shipped: Mapping[str, int] = field(default_factory=dict)
    least_delay: float = 0.0
    smaller: bool = False
    goal_enables: bool = False
    heeds_time: bool = False
    calibrates: bool = False
    turns_cleared: bool = False
    reversed_by: tuple[int, int] | None = None


_STS: Final = Drive(top_speed=3400.0, idle_current=0.15, stall_current=3.25)

# An SMS or HLS ships with something like the values of an STS3215, for want of better: limits over the whole turn,
# 70 °C, the masks and gains of memory table V3.6. A supply of 12 V and limits around it are assumed as well.
_LIKE_STS: Final = {
    "min_position_limit": 0, "max_position_limit": 4095, "max_temperature": 70,
    "unload_mask": 44, "led_mask": 47, "position_p": 32, "position_d": 32, "position_i": 0, "min_start_force": 16,
    "integral_limit": 0, "dead_band_cw": 1, "dead_band_ccw": 1, "protection_current": 500,
    "overcurrent_time": 200, "velocity_p": 10, "velocity_i": 10,
}  # fmt: skip
_PROTECTION: Final = {"protective_torque": 20, "overload_time": 200, "overload_torque": 80}
_SMS: Final = {**_LIKE_STS, **_PROTECTION, "max_torque": 1000, "max_voltage": 140, "min_voltage": 90}
_OLD_SMS: Final = {
    row: raw for row, raw in _SMS.items() if row not in ("integral_limit", "velocity_p", "velocity_i")
}
# SCS2 ships with what the SCS memory table 1902 gives for SCS, and with STS figures where only those exist.
_LIKE_SCS: Final = {
    "return_delay": 0, "min_position_limit": 20, "max_position_limit": 1003, "max_temperature": 80, "max_voltage": 90,
    "min_voltage": 45, "max_torque": 1000, "phase": 0, "unload_mask": 36, "led_mask": 37, "position_p": 15,
    "position_d": 15, "min_start_force": 30, "dead_band_cw": 1, "dead_band_ccw": 1, "hysteresis": 1,
    "overcurrent_time": 50, "protection_current": 500, "protective_torque": 20, "overload_time": 100,
    "overload_torque": 80,
}  # fmt: skip
# Assumed: 60 degrees in 0.1 s, which are 2048 counts/s, and currents of a small servo.
_SCS_DRIVE: Final = Drive(top_speed=2048.0, idle_current=0.1, stall_current=1.0)
# assumption: what lerobot (configure_motors) writes to servos of these maps
_LEROBOT: Final = {"max_acceleration": 254}
_LEAST_SMS: Final = 100e-6  # FEETECH page on SMS servos: values of register 7 below 50 act as 50

PERSONALITIES: Final[Mapping[str, Personality]] = MappingProxyType(
    {
        "sts": Personality(
            firmware=(3, 10),
            voltage=7.4,
            drive=_STS,
            shipped=_LEROBOT,
            smaller=True,  # servolab, measured on STS3215: a positive duty goes the other way than a positive velocity
            goal_enables=True,  # feetech-cli, measured on STS3215
            calibrates=True,  # 0x0B is in the dispatcher of firmware 3.10 (kuterd/feetech-fw-util)
            reversed_by=(0, 7),
        ),
        "smbl": Personality(
            firmware=(2, 45),
            voltage=12.0,
            drive=_STS,
            # phase as an STS ships: velocity in counts/s
            shipped={**_SMS, **_LEROBOT, "phase": 12, "torque_limit": 1000},
            least_delay=_LEAST_SMS,
            reversed_by=(0, 7),
        ),
        "smcl": Personality(
            firmware=(1, 10), voltage=12.0, drive=_STS, shipped={**_OLD_SMS, "phase": 0}, least_delay=_LEAST_SMS
        ),
        "scs": Personality(
            firmware=(0, 10),
            voltage=6.0,
            drive=_SCS_DRIVE,
            shipped={"baud_rate": 0},  # 1000000 or 500000 by model
            heeds_time=True,
            reversed_by=(0, 0),
        ),
        "scs2": Personality(
            firmware=(3, 25),
            voltage=6.0,
            drive=_SCS_DRIVE,
            shipped={**_LIKE_SCS, "baud_rate": 0},
            heeds_time=True,  # taken from SCS
            reversed_by=(0, 0),
        ),
        "hls": Personality(
            firmware=(3, 43),  # met on HLS3955 and HLS3915
            voltage=12.0,
            drive=_STS,
            shipped={
                **_LIKE_STS, "second_id": 1, "max_voltage": 140, "min_voltage": 40, "phase": 0, "current_p": 50,
                "current_i": 50,
            },
            calibrates=True,  # FTServo_Python, reOfsCal
            turns_cleared=True,  # FTServo_Python, hls/reset.py
            # Bit 0 is ignored from firmware 3.42 on, so bit 7 is taken to reverse drive and feedback together.
            reversed_by=(7, 7),
        ),
    }
)  # fmt: skip
"""Map -> what its servos are like."""

MOTORS: Final[Mapping[str, Drive]] = MappingProxyType(
    {
        # FEETECH data sheet of the STS3250 (A/0): 60 degrees in 0.133 s at 12 V; its currents are assumed.
        "sts3250": Drive(top_speed=5133.0, idle_current=0.15, stall_current=3.25),
        # FEETECH data sheet of the SCS15: 55 rpm at 6 V, 1.5 A at stall (7.4 V); its idle current is assumed.
        "scs15": Drive(top_speed=1126.0, idle_current=0.1, stall_current=1.5),
    }
)
"""Models whose data sheets say more of the motor than its map does."""

HIGH_VOLTAGE: Final = 24.0
"""V, what models with HV in their name are made for."""
HIGH_LIMITS: Final[Mapping[str, int]] = MappingProxyType({"max_voltage": 250, "min_voltage": 180})
"""Raw voltage limits around it, assumed."""
