"""How servos of one map are commanded: their modes, which register takes what, what bits of the phase byte mean.

One address is a time in one map, a current in another and a duty in a third, so a register is found by
its role. Source: FEETECH SDK headers SMS_STS.h, SCSCL.h and hls.py; FD 1.9.8.5 register configuration; STS3215 memory
table V3.6; HLS memory table; FEETECH notes on special bytes; lerobot and rustypot for servos without SYNC READ.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Final

from motorbus.core.register import Coding, Register, RegisterMap, changed

UNIT_BIT: Final = 1 << 2  # of the phase byte: velocities count in 1 count/s, else in 50
ZERO_BIT: Final = 1 << 3  # velocity 0 means maximum, else standstill
TURNS_BIT: Final = 1 << 4  # the present position counts over many turns
BRIDGE_BIT: Final = 1 << 5  # integrated bridge: no current feedback


class Mode(Enum):
    """What a servo follows: a goal position, a velocity, a duty, a relative distance or a current."""

    POSITION = "position"
    VELOCITY = "velocity"
    PWM = "pwm"
    STEP = "step"
    CURRENT = "current"


@dataclass(frozen=True, slots=True, kw_only=True)
class Traits:
    """The roles of the registers of one map; "" where no register has the role.

    `modes`       value of `operating_mode` -> mode; empty where the limits decide: both 0 make a motor (PWM) of it
    `duty`        row that takes the duty in PWM mode; on HLS it is not published. See `duty_row`
    `current`     row that bounds the current in position and velocity mode, where 0 leaves it limp, and is the goal in
                  current mode
    `limit`       row of RAM that bounds the torque; SMCL and SCS have none, there `max_torque` of the EEPROM does
    `time`        row that takes the time of a move in position mode, in ms
    `turn`        counts of all positions within one turn, or within the arc of an SCS
    `many_turns`  both limits 0 mean many turns
    `calibrates`  how the present pose gets another position: "instruction" 0x0B, "offset" register, or ""
    `sync_read`   SYNC READ is answered
    `broadcast_ping`    a broadcast PING is answered
    `clear_turns`       some servos of this map obey 0x0A
    `goal_switches_on`  writing the goal position is known to switch torque on
    `phase_bits`  the bits of the phase byte with the meaning of the constants above
    `measures_current`  the present current has a unit
    """

    modes: Mapping[int, Mode] = field(default_factory=dict)
    duty: str = ""
    current: str = ""
    limit: str = ""
    time: str = ""
    acceleration: str = ""
    turn: int = 4096
    many_turns: bool = False
    calibrates: str = ""
    sync_read: bool = True
    broadcast_ping: bool = True
    clear_turns: bool = False
    goal_switches_on: bool = False
    phase_bits: int = 0
    measures_current: bool = True

    @property
    def has(self) -> tuple[Mode, ...]:
        """The modes that servos of this map have, without those whose order has no published register."""
        modes = tuple(self.modes.values()) or (Mode.POSITION, Mode.PWM)
        return tuple(mode for mode in modes if self.duty or mode is not Mode.PWM)

    def code(self, mode: Mode) -> int | None:
        """The value of `operating_mode` for this mode; None where the map has no such value."""
        return next((code for code, one in self.modes.items() if one is mode), None)

    def mode_of(self, code: int | None, limits: tuple[int, int]) -> Mode | None:
        """The mode of these raw values: of `operating_mode` (None: no such row), of both position limits.

        None for a number that no source explains.
        """
        if self.modes:
            return self.modes.get(code) if code is not None else None
        return Mode.PWM if limits == (0, 0) else Mode.POSITION

    def duty_row(self, table: RegisterMap) -> Register:
        """The row of `duty` as PWM mode codes it, in 0.1 %, sign at bit 10. On SCS it is an unsigned time otherwise."""
        row = table[self.duty]
        return changed(row, coding=Coding.SIGN_MAGNITUDE, sign_bit=10, low=-1000, high=1000)

    def velocity_scale(self, phase: int) -> int:
        """What the rows say of a velocity, times this."""
        return 50 if self.phase_bits & UNIT_BIT and not phase & UNIT_BIT else 1

    def zero_is_maximum(self, phase: int) -> bool:
        """Whether a goal velocity of 0 means the maximum; else standstill."""
        return bool(phase & self.phase_bits & ZERO_BIT)

    def tells_turns(self, phase: int) -> bool:
        """Whether the present position counts over many turns; else it lies within one."""
        return bool(phase & self.phase_bits & TURNS_BIT)

    def tells_current(self, phase: int) -> bool:
        """Whether the present current means anything."""
        return self.measures_current and not phase & self.phase_bits & BRIDGE_BIT


NO_TRAITS: Final = Traits()  # of an unknown map

_SMBL: Final = Traits(
    modes={0: Mode.POSITION, 1: Mode.VELOCITY, 2: Mode.PWM, 3: Mode.STEP},
    duty="goal_time",
    limit="torque_limit",
    time="goal_time",
    acceleration="acceleration",
    many_turns=True,
    calibrates="offset",
    clear_turns=True,  # brushless ones obey it, an STS3215 with firmware 3.10 does not answer (servolab)
    phase_bits=UNIT_BIT | ZERO_BIT | TURNS_BIT | BRIDGE_BIT,
)
_SCS: Final = Traits(
    duty="goal_time",
    time="goal_time",
    turn=1024,
    sync_read=False,
    broadcast_ping=False,
    phase_bits=ZERO_BIT,
    measures_current=False,
)
TRAITS: Final[Mapping[str, Traits]] = {
    "sts": replace(_SMBL, goal_switches_on=True),  # feetech-cli, measured on STS3215
    "smbl": _SMBL,
    "smcl": Traits(
        modes={0: Mode.POSITION, 1: Mode.VELOCITY, 2: Mode.PWM},
        duty="goal_time",
        time="goal_time",
        acceleration="acceleration",
        calibrates="offset",
    ),
    "scs": _SCS,
    # assumption: the second kind lacks SYNC READ as an SCS0009 does
    "scs2": replace(_SCS, calibrates="offset", measures_current=True),
    "hls": Traits(
        modes={0: Mode.POSITION, 1: Mode.VELOCITY, 2: Mode.CURRENT, 3: Mode.PWM},
        current="goal_torque",
        limit="torque_limit",
        acceleration="acceleration",
        many_turns=True,
        calibrates="instruction",
        clear_turns=True,
        phase_bits=TURNS_BIT,
    ),
}
"""Map -> how its servos are commanded."""
