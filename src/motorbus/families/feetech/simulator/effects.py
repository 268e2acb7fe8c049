"""What a servo does when it is written to, and by order: keep it, calibrate, turn on, change its mode, restore, clear.

Each function takes the servo and the moment. Who observed it is said with each; what nobody knows is a switch.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final, NamedTuple

from motorbus.families.feetech.simulator.servo import Servo
from motorbus.families.feetech.simulator.settings import DECIDES_MOTION
from motorbus.families.feetech.table import Middle, Mode

_CALIBRATE: Final = 128
_COUNTS: Final = frozenset({"operating_mode", "homing_offset"})
_FACES: Final = frozenset({"phase", "angular_resolution"})
_TO_A_GOAL: Final = (Mode.POSITION, Mode.STEP)
_LIMITS: Final = frozenset({"min_position_limit", "max_position_limit"})


class Concerned(NamedTuple):
    """What a write of some rows has to do with: these are looked at in this order, whatever was written."""

    identity: bool
    torque: bool
    faces: bool
    counts: bool
    limits: bool
    goal: bool
    motion: bool


@lru_cache(maxsize=1024)
def concerned(names: frozenset[str]) -> Concerned:
    """What a write of these rows concerns; hosts write the same ones again and again."""
    return Concerned(
        identity="id" in names or "second_id" in names,
        torque="torque_enable" in names,
        faces=bool(names & _FACES),
        counts=bool(names & _COUNTS),
        limits=bool(names & _LIMITS),
        goal="goal_position" in names,
        motion=bool(names & DECIDES_MOTION),
    )


def write(servo: Servo, address: int, data: bytes, at: float) -> float:
    """Obey a WRITE; gives how much later (s) it is acknowledged because the EEPROM took its time."""
    torque, strict = servo.memory["torque_enable"], servo.switches.out_of_range == "drop"
    done = servo.memory.write(address, data, locked=servo.locked, strict=strict)
    if done.names:
        _react(servo, done.names, torque, at)
    if done.stored:
        servo.stores()
    return servo.storing(at) if servo.memory.flash.works else 0.0


def reg_write(servo: Servo, address: int, data: bytes) -> None:
    """Keep a write for `action`. A second one replaces the first; a power cycle forgets it."""
    servo.pending = address, data


def action(servo: Servo, at: float) -> float:
    """Carry out what REG WRITE left; nothing when there is nothing. Gives the delay as `write` does."""
    if servo.pending is None:
        return 0.0
    (address, data), servo.pending = servo.pending, None
    return write(servo, address, data, at)


def _react(servo: Servo, names: frozenset[str], torque: int, at: float) -> None:
    """Do what a write of these rows orders; `torque` is the torque switch before it."""
    memory, control, about = servo.memory, servo.model.control, concerned(names)
    if about.identity:
        servo.renamed()
    if (
        about.torque
        and memory["torque_enable"] == _CALIBRATE
        and control.middle is Middle.SWITCH  # elsewhere 128 is a number that means nothing
    ):
        memory["torque_enable"] = torque  # an order and no state; what 40 reads afterwards is not known
        calibrate(servo, control.turn // 2, at)
        return
    if about.torque and not memory["torque_enable"]:
        servo.protection.torque_off()
    if about.faces:
        servo.face(at)
    if about.counts or (about.limits and not control.modes):  # there the limits decide about the mode
        servo.count_anew(at)
    asked = servo.asked
    mode = asked.mode if about.goal else None
    if mode in _TO_A_GOAL and not asked.on and _goal_enables(servo):
        memory["torque_enable"] = 1
    if mode is Mode.STEP:
        servo.step(at)
    elif about.motion:
        servo.move(at)


def _goal_enables(servo: Servo) -> bool:
    wish = servo.switches.goal_enables_torque
    return servo.model.personality.goal_enables if wish == "by_map" else wish == "yes"


def calibrate(servo: Servo, counts: int, at: float) -> None:
    """Make the present pose read `counts` by way of the homing offset.

    The old offset is taken out first: the encoder counts, not the reading. An STS can only say ±2047, so the one pose
    that would need 2048 reads one count beside (overflows on a real one: lerobot#3370). It then holds.
    """
    memory, turn, row = servo.memory, servo.model.turn, servo.model.table["homing_offset"]
    counted = round(servo.encoder(at)) - counts * servo.fold
    offset = round(((counted + turn // 2) % turn - turn // 2) / servo.fold)
    memory["homing_offset"] = max(row.low, min(row.high, offset))
    if not servo.locked or servo.switches.calibration_store == "always":
        memory.store("homing_offset")
        servo.stores()
    servo.count_anew(at)
    memory["goal_position"] = servo.position(at)
    servo.move(at)


def clear_turns(servo: Servo, at: float) -> None:
    """0x0A: the position begins anew within one turn (FTServo_Python, hls/reset.py). It then holds where it is."""
    servo.forget_turns(at)
    servo.memory["goal_position"] = servo.position(at)
    servo.move(at)


def restore_factory(servo: Servo, at: float) -> None:
    """0x06: as shipped, offset 0, the id kept (servolab, STS3215 firmware 3.10); then it starts again."""
    kept = {"id", "second_id"} if servo.switches.restore_id == "keep" else set()
    servo.memory.restore_factory(frozenset(kept), servo.switches.restore_time)
    servo.stores()
    servo.power_up(at, cut=False)
    servo.deaf_until = at + servo.switches.restore_time


def enter_bootloader(servo: Servo, at: float) -> None:
    """0x08: deaf, and back as after power-up (every reset of that controller enters the bootloader).

    What the motor does meanwhile is not known; here it is limp from the beginning.
    """
    servo.power_up(at, cut=False)
    servo.deaf_until = at + servo.switches.bootloader_time
