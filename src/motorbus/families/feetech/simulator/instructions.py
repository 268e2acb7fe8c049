"""What each instruction does to one servo, and what it has to say to that; None is silence.

What all real ones have in common, so no switch: a length that the instruction does not have and an unknown instruction
are met with silence, for no error code for them exists (FEETECH serial bus servo protocol manual V1.01, 1.1 and 1.3).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

from motorbus.families.feetech.simulator import effects, feedback
from motorbus.families.feetech.simulator.servo import Servo
from motorbus.families.feetech.table import Middle
from motorbus.families.feetech.wire import Instruction

_made: Final = tuple.__new__
"""Makes a named tuple in half the time of its own call."""
MOST: Final = 253
"""More bytes than this do not fit into one status packet."""


class Answer(NamedTuple):
    """What one servo has to say to one packet: its parameters, from which id, and how much later than usual (s)."""

    parameters: bytes = b""
    id: int | None = None
    later: float = 0.0


def _busy(servo: Servo, at: float) -> float:
    """How much later (s) it answers because its EEPROM is at work (feetech-cli: a burst follows)."""
    return servo.storing(at) if servo.switches.while_storing == "buffer" else 0.0


def _ping(servo: Servo, parameters: bytes, at: float) -> Answer | None:
    return None if parameters else Answer(later=_busy(servo, at))


def told(servo: Servo, address: int, count: int, at: float) -> Answer:
    """What it says when so many bytes from this address on are read, at most `MOST`."""
    later = _busy(servo, at) if servo.memory.flash.works else 0.0
    return _made(Answer, (feedback.read(servo, address, count, at), None, later))


def _read(servo: Servo, parameters: bytes, at: float) -> Answer | None:
    if len(parameters) != 2 or parameters[1] > MOST:
        return None
    return told(servo, parameters[0], parameters[1], at)


def _write(servo: Servo, parameters: bytes, at: float) -> Answer | None:
    if len(parameters) < 2:
        return _empty(servo, parameters)
    return Answer(later=effects.write(servo, parameters[0], parameters[1:], at))


def _reg_write(servo: Servo, parameters: bytes, at: float) -> Answer | None:
    if len(parameters) < 2:
        return _empty(servo, parameters)
    effects.reg_write(servo, parameters[0], parameters[1:])
    return Answer(later=_busy(servo, at))


def _empty(servo: Servo, parameters: bytes) -> Answer | None:
    return Answer() if parameters else None


def _action(servo: Servo, parameters: bytes, at: float) -> Answer | None:
    return None if parameters else Answer(later=effects.action(servo, at))


def _restore_factory(servo: Servo, parameters: bytes, at: float) -> Answer | None:
    if parameters or not servo.switches.factory_restore:
        return None
    effects.restore_factory(servo, at)
    return Answer()


def _enter_bootloader(servo: Servo, parameters: bytes, at: float) -> Answer | None:
    if parameters:
        return None
    effects.enter_bootloader(servo, at)
    return Answer() if servo.switches.bootloader == "ack" else None


def _clear_turns(servo: Servo, parameters: bytes, at: float) -> Answer | None:
    """HLS and brushless ST models obey; an STS3215 with firmware 3.10 is silent (servolab)."""
    wish = servo.switches.clear_turns
    if parameters or not (servo.model.clears_turns if wish == "by_model" else wish == "accept"):
        return None
    effects.clear_turns(servo, at)
    return Answer()


def _calibrate(servo: Servo, parameters: bytes, at: float) -> Answer | None:
    """Two bytes of position in the servo's byte order, or nothing: the middle (FTServo_Python, reOfsCal)."""
    wish, model = servo.switches.calibrate, servo.model
    obeys = model.personality.calibrates if wish == "by_map" else wish == "accept"
    if len(parameters) not in (0, 2) or not obeys or model.control.middle is Middle.NONE:
        return None
    order = model.table["goal_position"].order
    counts = int.from_bytes(parameters, "little" if order == "little" else "big") if parameters else None
    effects.calibrate(servo, model.turn // 2 if counts is None else counts, at)
    return Answer(later=servo.storing(at))


# 0x09 is in the dispatcher of firmware 3.10 and nobody knows what it does; 0x0D is for other devices. Both are left
# out here, which is silence.
OBEY: Final[Mapping[int, Callable[[Servo, bytes, float], Answer | None]]] = MappingProxyType(
    {
        Instruction.PING: _ping,
        Instruction.READ: _read,
        Instruction.WRITE: _write,
        Instruction.REG_WRITE: _reg_write,
        Instruction.ACTION: _action,
        Instruction.RESET: _restore_factory,
        Instruction.BOOTLOADER: _enter_bootloader,
        Instruction.CLEAR_TURNS: _clear_turns,
        Instruction.CALIBRATE: _calibrate,
    }
)
"""What each instruction to one servo does. SYNC READ and SYNC WRITE are the business of the bus."""
