"""What the registers of one servo ask of its motor, in counts, seconds and shares, whatever its map calls them.

Which register plays which part comes from `table.control`, what a bit of the phase register means from `table.phase`,
and what only some servos do from `personality`. So nothing here asks for a map by its name.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motorbus.families.feetech.simulator.motor import Settings
from motorbus.families.feetech.table import AMPERE, Mode, mode_of, zero_is_maximum
from motorbus.families.feetech.table.phase import many_turns_are_told

if TYPE_CHECKING:
    from motorbus.families.feetech.simulator.model import Model
    from motorbus.families.feetech.simulator.servo import Servo

DECIDES_MOTION: Final = frozenset(
    {
        *("torque_enable", "acceleration", "goal_position", "goal_time", "goal_velocity", "goal_torque"),
        *("torque_limit", "max_torque", "operating_mode", "phase", "homing_offset", "unload_mask"),
        *("min_position_limit", "max_position_limit", "max_voltage", "min_voltage", "max_temperature"),
        "angular_resolution",
        *("overload_torque", "overload_time", "protective_torque", "protection_current", "overcurrent_time"),
    }
)
"""A write of one of these makes the servo think again about where it goes."""


def mode_now(servo: Servo) -> Mode | None:
    """What it heeds at present; None for a number that no source explains."""
    control = servo.model.control
    if not control.modes:
        return mode_of(servo.model.table.name, None, _limits(servo))
    found = control.modes.get(servo.memory["operating_mode"])
    return Mode.POSITION if found is None and servo.switches.unknown_mode == "position" else found


def velocity_steps(model: Model) -> int:
    """Counts/s for one unit of the velocity registers, as the rows have it: 1, and 50 on HLS."""
    return round(model.table["goal_velocity"].scale / model.table["goal_position"].scale)


def facing_of(servo: Servo) -> int:
    """-1 when its feedback counts the other way than its shaft turns, else 1 (bit 7 of phase on STS)."""
    bits = servo.model.personality.reversed_by
    return -1 if bits and servo.memory["phase"] >> bits[1] & 1 else 1


def blind(servo: Servo) -> bool:
    """Whether its phase register tells of another board than it has, as after copying that of another servo."""
    bit, model = servo.model.personality.bridge_bit, servo.model
    shipped = model.defaults.get("phase", model.table["phase"].default) or 0
    return bit is not None and bool((servo.memory["phase"] ^ shipped) >> bit & 1)


def fold_of(servo: Servo) -> int:
    """Counts of the encoder for one count of its positions: its angular resolution (STS3215 memory table V3.6)."""
    if "angular_resolution" not in servo.model.table or servo.switches.angular_resolution == "ignore":
        return 1
    return servo.memory["angular_resolution"] or 1


def torque_limit(servo: Servo) -> float:
    """The share of the stall torque that its registers allow: torque limit, and where there is one the current cap.

    A map without a torque limit has `max_torque` of its EEPROM for it. An HLS with 0 as its goal torque never moves in
    position and velocity mode (seen on hardware, where the burst of seven bytes that suits an STS had written it).
    """
    memory, control = servo.memory, servo.model.control
    share = memory[control.limit or "max_torque"] / 1000
    if control.current and servo.mode in (Mode.POSITION, Mode.VELOCITY):
        share = min(share, abs(_current(servo)))
    return share


def settings(servo: Servo, at: float) -> Settings:
    """Everything that decides about movement at this moment."""
    memory, switches = servo.memory, servo.switches
    low, high = _limits(servo)
    endless = low == high == 0
    velocity = memory["goal_velocity"] * servo.velocity_unit
    phase = memory["phase"]
    mode = servo.mode
    return Settings(
        torque=servo.available,
        burden=servo.facing * servo.burden,
        mode=mode,
        goal=memory["goal_position"],
        low=low,
        high=high,
        endless=endless,
        turns=endless and servo.model.control.many_turns,
        duty=_duty(servo) if mode is Mode.PWM else 0.0,
        current=_current(servo) if mode is Mode.CURRENT else 0.0,
        velocity=velocity,
        fastest=not velocity
        and (switches.zero_velocity == "maximum" or zero_is_maximum(phase, servo.model.table.name)),
        time=0.0 if velocity else _time(servo),
        acceleration=_acceleration(servo),
        runs_away=switches.half_reversed == "runaway" and _drive(servo) != servo.facing,
        told=many_turns_are_told(phase, servo.model.table.name),
        zero=servo.zero,
        turn=servo.model.turn,
        fold=servo.fold,
    )


def _limits(servo: Servo) -> tuple[int, int]:
    return servo.memory["min_position_limit"], servo.memory["max_position_limit"]


def _drive(servo: Servo) -> int:
    """-1 when the motor drives the other way (bit 0 of phase on STS and SCS), else 1."""
    bits = servo.model.personality.reversed_by
    return -1 if bits and servo.memory["phase"] >> bits[0] & 1 else 1


def _acceleration(servo: Servo) -> float:
    """Counts/s²; 0 in the register, or no register, means the greatest."""
    row, switches = servo.model.control.acceleration, servo.switches
    return (servo.memory[row] * switches.acceleration_unit if row else 0.0) or switches.full_acceleration


def _duty(servo: Servo) -> float:
    """Share of the supply in PWM mode, positive towards greater readings."""
    switches, personality = servo.switches, servo.model.personality
    wish = switches.positive_duty
    smaller = personality.smaller if wish == "by_map" else wish == "smaller"
    row = servo.model.control.duty or switches.hls_duty
    sense = (-1 if smaller else 1) * _drive(servo) * servo.facing
    return max(-1.0, min(1.0, servo.memory[row] / 1000)) * sense


def _current(servo: Servo) -> float:
    """The goal or cap of the current as a share of that at stall."""
    return servo.memory[servo.model.control.current] * AMPERE / servo.model.drive.stall_current


def _time(servo: Servo) -> float:
    """s that a way takes when the velocity is 0; 0 where the register is not heeded.

    The whole word is the time: the sign at bit 10 belongs to the duty alone (SCS memory table).
    """
    control, wish = servo.model.control, servo.switches.goal_time
    heeded = servo.model.personality.heeds_time if wish == "by_map" else wish == "heed"
    if not heeded or not control.time:
        return 0.0
    row = servo.model.table[control.time]
    word = bytes(servo.memory.live[row.address : row.address + row.size])
    return int.from_bytes(word, "little" if row.order == "little" else "big") / 1000
