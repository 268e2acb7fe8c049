"""Simulated Metronomes, byte-exact on the wire. They have no clock: time (s) is an argument."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from motorbus.core import plant
from motorbus.core.register import Storage
from motorbus.core.simulated import PoweredDevice, SerialLine
from motorbus.errors import RequestError

from . import protocol
from .protocol import Command
from .registers import COUNT, END, TABLE

RATE: Final = 500_000
REPLY_DELAY: Final = 0.0003
"""s from the end of a request to the start of its reply. # assumption"""
STORE_TIME: Final = 0.004
"""s longer for a setting. # assumption"""
SPEED: Final = 6.0 / COUNT
"""counts/s. # assumption"""
ACCELERATION: Final = 40.0 / COUNT
"""counts/s². # assumption"""
HOT: Final = 80
"""°C above which the alarm is set. # assumption"""


class Servo(PoweredDevice):
    """One servo. `memory[name]` is the raw value of a register at this moment; a test may set `temperature` (°C)."""

    def __init__(self, bus: Metronomes, id: int) -> None:
        self.temperature = 25.0
        self.id = id
        self._bus = bus
        self._values = {row.name: row.default or 0 for row in TABLE.values()} | {"node_id": id}
        self._motion = plant.rest(0.0, 0.0)

    @property
    def memory(self) -> Mapping[str, int]:
        now = self._bus.now
        return self._values | {
            "present_position": round(self._motion.position(now)),
            "moving": int(self._motion.moving(now)),
            "temperature": round(self.temperature),
        }

    def power_off(self) -> None:
        self._release(self._bus.now)

    def power_on(self) -> None:
        self._values |= {row.name: row.default or 0 for row in TABLE.values() if row.storage is Storage.RAM}
        self.id = self._values["node_id"]

    def status(self) -> dict[str, object]:
        return {"plugged": self.plugged, **self.memory}

    def reply(self, command: int, operands: bytes, at: float) -> tuple[float, bytes]:
        """Carry out a request; return the delay (s) and the reply."""
        status, data, delay = 5, b"", REPLY_DELAY
        if command == Command.STOP:
            status = 0
            self._move(at, 0.0)
        elif command == Command.READ and len(operands) == 2:
            start, end = operands[0], operands[0] + operands[1]
            status, data = (0, self._image()[start:end]) if start < end <= END else (1, b"")
        elif command == Command.WRITE and operands:
            status = self._write(operands[0], operands[1:], at)
            row = TABLE.at(operands[0])
            if row is not None and row.storage is Storage.EEPROM and not status:
                delay += STORE_TIME
        alarm = 1 << 4 if self.temperature > HOT else 0
        return delay, protocol.encode_reply(self.id, alarm | status, data)

    def _image(self) -> bytes:
        image, memory = bytearray(END), self.memory
        for row in TABLE.values():
            image[row.address : row.address + row.size] = row.encode(memory[row.name])
        return bytes(image)

    def _write(self, address: int, data: bytes, at: float) -> int:
        row, values = TABLE.at(address), self._values
        if row is None or row.size != len(data):
            return 1
        if not row.writable:
            return 2
        raw, low, high = row.decode(data), row.low, row.high
        if row.name == "goal_position":
            low, high = values["min_position"], values["max_position"]
        if not low <= raw <= high:
            return 3
        if row.storage is Storage.EEPROM and values["lock"]:
            return 4
        values[row.name] = raw
        if row.name == "torque_enable" and not raw:
            self._release(at)
        elif row.name in ("goal_position", "torque_enable") and values["torque_enable"]:
            self._move(at, SPEED)
        return 0

    def _release(self, at: float) -> None:
        """Friction holds the shaft at once."""
        self._motion = plant.rest(at, self._motion.position(at))

    def _move(self, at: float, speed: float) -> None:
        """Move to the goal; with speed 0 brake."""
        here, velocity = self._motion.position(at), self._motion.velocity(at)
        if not speed and not velocity:
            self._release(at)
            return
        goal = float(self._values["goal_position"])
        self._motion = plant.move(at, here, goal, velocity=velocity, speed=speed, acceleration=ACCELERATION)


class Metronomes(SerialLine[Servo]):
    """A simulated bus with these servos. Raises RequestError for impossible ids or another model."""

    def __init__(self, ids: tuple[int, ...], model: str = "") -> None:
        if model not in ("", "metronome"):
            raise RequestError(f"there is no simulated {model!r}", expected="metronome")
        if not ids or not set(ids) <= set(protocol.IDS):
            raise RequestError(f"ids {ids} cannot be simulated", expected="one or more of 1 to 63")
        servos = {id: Servo(self, id) for id in ids}
        super().__init__(servos, RATE, protocol.parser(protocol.REQUEST))

    def carry_out(self, frame: bytes, at: float) -> None:
        for servo in self.nodes.values():
            if servo.plugged and frame[2] in (servo.id, protocol.BROADCAST):
                delay, reply = servo.reply(frame[4], frame[5:-2], at)
                if frame[2] != protocol.BROADCAST:
                    self.send(at + delay, reply)
