"""How servos of one map are commanded: which modes they have, which register takes what, how a middle is set.

The rows say what a register is; this says which of them plays which part. The same address is a time in one map, a
current in the next, and a duty in a third, so neither driver nor simulator may find its part by an address.
Source: FEETECH SDK headers SMS_STS.h, SCSCL.h and hls.py; FD 1.9.8.5 register configuration; STS3215 memory table
V3.6; HLS memory table; lerobot and rustypot for who lacks SYNC READ.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from types import MappingProxyType
from typing import Final


class Mode(Enum):
    """What a servo heeds: a goal position, a velocity, a duty, a way to go, or a current."""

    POSITION = "position"
    VELOCITY = "velocity"
    PWM = "pwm"
    STEP = "step"
    CURRENT = "current"


class Middle(Enum):
    """How the present pose is given another name.

    SWITCH: 128 written to the torque switch calls it the middle of the turn (STS, SMS). INSTRUCTION: 0x0B with any
    position (HLS). OFFSET: whoever asks works out the homing offset and writes it. NONE: the map has no offset.
    """

    SWITCH = "switch"
    INSTRUCTION = "instruction"
    OFFSET = "offset"
    NONE = "none"


@dataclass(frozen=True, slots=True, kw_only=True)
class Control:
    """The parts that registers of one map play; "" where no register plays it.

    `modes`       value of `operating_mode` -> mode; empty where the limits decide: both 0 make a motor (PWM) of it
    `duty`        row that takes the duty in PWM mode; on HLS nobody has published which one does
    `current`     row that bounds the current in position and velocity mode, and is the goal in current mode
    `limit`       row of RAM that bounds the torque; SMCL and SCS have none, there `max_torque` of the EEPROM does
    `time`        row that takes the time of a way in position mode, in ms
    `turn`        counts after which a single-turn position begins anew
    `many_turns`  whether both limits 0 mean many turns
    `sync_read`   whether SYNC READ is answered, and `broadcast_ping` a broadcast PING
    `clear_turns` whether any servo of this map is known to obey 0x0A
    `goal_switches_on`  whether a write of the goal position is known to switch torque on
    """

    modes: Mapping[int, Mode] = field(default_factory=dict)
    duty: str = ""
    current: str = ""
    limit: str = ""
    time: str = ""
    acceleration: str = ""
    middle: Middle = Middle.NONE
    turn: int = 4096
    many_turns: bool = False
    sync_read: bool = True
    broadcast_ping: bool = True
    clear_turns: bool = False
    goal_switches_on: bool = False

    @property
    def has(self) -> tuple[Mode, ...]:
        """The modes that servos of this map have."""
        return tuple(self.modes.values()) or (Mode.POSITION, Mode.PWM)

    def code(self, mode: Mode) -> int | None:
        """The value of `operating_mode` for this mode, or None where the map has no such value."""
        return next((code for code, one in self.modes.items() if one is mode), None)


_FOUR: Final = MappingProxyType({0: Mode.POSITION, 1: Mode.VELOCITY, 2: Mode.PWM, 3: Mode.STEP})
_SMBL: Final = Control(
    modes=_FOUR,
    duty="goal_time",
    limit="torque_limit",
    time="goal_time",
    acceleration="acceleration",
    middle=Middle.SWITCH,
    many_turns=True,
    clear_turns=True,  # brushless ones of this map obey it, an STS3215 with firmware 3.10 is silent (servolab)
)
_STS: Final = replace(
    _SMBL, goal_switches_on=True
)  # feetech-cli, measured on STS3215; of other maps nobody has said
_SCS: Final = Control(duty="goal_time", time="goal_time", turn=1024, sync_read=False, broadcast_ping=False)

CONTROL: Final[Mapping[str, Control]] = MappingProxyType(
    {
        "sts": _STS,
        "smbl": _SMBL,
        "smcl": Control(
            modes=MappingProxyType({0: Mode.POSITION, 1: Mode.VELOCITY, 2: Mode.PWM}),
            duty="goal_time",
            time="goal_time",
            acceleration="acceleration",
            middle=Middle.SWITCH,
        ),
        "scs": _SCS,
        "scs2": Control(
            duty="goal_time",
            time="goal_time",
            turn=1024,
            middle=Middle.OFFSET,
            sync_read=False,  # that an SCS0009 lacks it is known; of the second kind nobody has said
            broadcast_ping=False,
        ),
        "hls": Control(
            modes=MappingProxyType({0: Mode.POSITION, 1: Mode.VELOCITY, 2: Mode.CURRENT, 3: Mode.PWM}),
            current="goal_torque",
            limit="torque_limit",
            acceleration="acceleration",
            middle=Middle.INSTRUCTION,
            many_turns=True,
            clear_turns=True,
        ),
    }
)
"""Map -> how its servos are commanded."""


def mode_of(register_map: str, code: int | None, limits: tuple[int, int]) -> Mode | None:
    """The mode that these raw values mean: of `operating_mode` (None where the map has no such row), and of both
    position limits. None for a number that no source explains."""
    modes = CONTROL[register_map].modes
    if modes:
        return modes.get(code) if code is not None else None
    return Mode.PWM if limits == (0, 0) else Mode.POSITION
