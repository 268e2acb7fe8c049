"""What each instruction does to one servo.

An unknown instruction and a wrong number of parameters are not answered: there is no error code for them
(FEETECH serial bus servo protocol manual V1.01, 1.1 and 1.3).
"""

from __future__ import annotations

from typing import Final

from motorbus.families.feetech.protocol import MAX_PARAMETERS, Instruction, suits
from motorbus.families.feetech.simulator.models import Model
from motorbus.families.feetech.simulator.servo import Servo

BOOTLOADER_TIME: Final = 0.8  # s (kuterd/feetech-fw-util)
RESTORE_TIME: Final = (
    0.5  # s in which it stores and receives nothing; servolab waits at most 1 s # assumption
)
CALIBRATING: Final = ("hls", "sts")
"""Maps with 0x0B: FTServo_Python, reOfsCal; dispatcher of STS3215 firmware 3.10 (kuterd/feetech-fw-util)."""


def carry_out(servo: Servo, code: int, parameters: bytes, at: float) -> bytes | None:
    """Carry out an instruction; returns the parameters of the reply, None: no reply."""
    if code in servo.lacks:
        return None
    if code in (Instruction.WRITE, Instruction.REG_WRITE) and len(parameters) == 1:
        return b""  # a write without data is acknowledged # assumption
    if not suits(code, parameters):
        return None
    match code:
        case Instruction.PING:
            return b""
        case Instruction.READ:
            address, count = parameters
            return servo.read(address, count) if count <= MAX_PARAMETERS else None
        case Instruction.WRITE:
            servo.write(parameters[0], parameters[1:])
            return b""
        case Instruction.REG_WRITE:  # a second REG WRITE replaces the first # assumption
            servo.pending = parameters[0], parameters[1:]
            return b""
        case Instruction.ACTION:
            pending, servo.pending = servo.pending, None
            if pending is not None:
                servo.write(*pending)
            return b""
        case Instruction.RESET:
            return _restore(servo, at) if servo.quirks.factory_restore else None
        case Instruction.BOOTLOADER:  # 0x08 is not answered, and the motor is limp meanwhile # assumption
            servo.restart()
            servo.deaf_until = at + BOOTLOADER_TIME
        case Instruction.CLEAR_TURNS if _clears_turns(servo.model):
            servo.clear_turns()
            return b""
        case Instruction.CALIBRATE if servo.model.table.name in CALIBRATING:
            middle = servo.model.traits.turn // 2
            servo.calibrate(int.from_bytes(parameters, "little") if parameters else middle)
            return b""
    return None


def _restore(servo: Servo, at: float) -> bytes:
    """All as shipped but the id (servolab, STS3215 with firmware 3.10), then a restart."""
    # The second id stays as well. # assumption
    servo.memory.restore_factory(("id", "second_id"), RESTORE_TIME)
    servo.restart()
    servo.deaf_until = at + RESTORE_TIME
    return b""


def _clears_turns(model: Model) -> bool:
    """0x0A: HLS (FTServo_Python, hls/reset.py), and brushless models (a public STS3215 table: "STBL")."""
    return model.table.name == "hls" or (model.traits.clear_turns and model.name.endswith("bl"))
