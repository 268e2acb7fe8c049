"""Simulated Metronomes, byte-exact on the wire. They have no clock: time (s) is an argument."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from motorbus.core import plant
from motorbus.core.register import Storage
from motorbus.core.simulated import PoweredDevice, SerialLine
from motorbus.errors import RequestError

from . import protocol
from .registers import COUNT, TABLE

REPLY_DELAY: Final = 0.0003  # s from the end of a request to the start of its reply # assumption
SPEED: Final = 6.0 / COUNT  # counts/s # assumption
ACCELERATION: Final = 40.0 / COUNT  # counts/s² # assumption


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
        self._move(self._bus.now, 0.0)

    def power_on(self) -> None:
        self._values |= {row.name: row.default or 0 for row in TABLE.values() if row.storage is Storage.RAM}
        self.id = self._values["node_id"]

    def status(self) -> dict[str, object]:
        return {"plugged": self.plugged, **self.memory}

    def reply(self, command: int, operands: bytes, at: float) -> bytes:
        """Carry out a request; return the reply."""
        status, data = 5, b""
        if command == protocol.Command.STOP:
            status = 0
            self._move(at, 0.0)
        elif command == protocol.Command.READ and len(operands) == 2:
            memory = self.memory
            image = b"".join(row.encode(memory[row.name]) for row in TABLE.values())  # they have no gaps
            start, end = operands[0], operands[0] + operands[1]
            status, data = (0, image[start:end]) if start < end <= len(image) else (1, b"")
        elif command == protocol.Command.WRITE and operands:
            status = self._write(operands[0], operands[1:], at)
        alarm = protocol.HOT if self.temperature > 80 else 0
        return protocol.encode(protocol.REPLY, self.id, alarm | status, data)

    def _write(self, address: int, data: bytes, at: float) -> int:
        """Write one register; return the status."""
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
        if row.name in ("goal_position", "torque_enable"):
            self._move(at, SPEED if values["torque_enable"] else 0.0)  # without torque it brakes # assumption
        return 0

    def _move(self, at: float, speed: float) -> None:
        """Move to the goal; with speed 0 brake."""
        here, velocity, _ = self._motion.state(at)
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
        super().__init__(servos, protocol.RATE, protocol.parser(protocol.REQUEST))

    def carry_out(self, frame: bytes, at: float) -> None:
        for servo in self.nodes.values():
            if servo.plugged and frame[2] in (servo.id, protocol.BROADCAST):
                reply = servo.reply(frame[4], frame[5:-2], at)
                if frame[2] != protocol.BROADCAST:
                    self.send(at + REPLY_DELAY, reply)


simulate: Final = Metronomes
