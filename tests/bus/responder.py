"""The least that answers like FEETECH servos: enough to exercise the bus, with a lock to leave open."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from motorbus.bus.blocking import Bus
from motorbus.core.family import SimulatedNode
from motorbus.core.request import Data, Effect, Expected, Request, Response
from motorbus.families.feetech import FAMILY, protocol
from motorbus.link.base import Line
from motorbus.link.memory import MemoryLink
from tests.bus.script import ADMIT_ALL

LOCK = 55
DELAY = 0.0001


class Responder:
    """Servos 1 to 20, each 128 bytes of memory in which register 5 is the id and everything may be written."""

    def __init__(self, ids: range = range(1, 21)) -> None:
        self.memory = {node: bytearray(128) for node in ids}
        for node, memory in self.memory.items():
            memory[5], memory[LOCK], memory[56] = node, 1, node
        self.dead: set[int] = set()
        self.heard: list[protocol.Packet] = []
        self._parser = protocol.parser()
        self._out: list[tuple[float, Data]] = []
        self.rate = 0

    @property
    def nodes(self) -> Mapping[int, SimulatedNode]:
        return {}

    def receive(self, data: Data, at: float) -> None:
        assert isinstance(data, bytes)
        for frame, fault in self._parser.feed(data):
            if not fault:
                self.heard.append(protocol.decode(frame))
                self._carry_out(self.heard[-1], at)

    def _carry_out(self, packet: protocol.Packet, at: float) -> None:
        parameters = packet.parameters
        if packet.code == protocol.Instruction.SYNC_READ:
            for node in parameters[2:]:
                self._answer(node, at, self._read(node, parameters[0], parameters[1]))
        elif packet.code == protocol.Instruction.READ:
            self._answer(packet.id, at, self._read(packet.id, parameters[0], parameters[1]))
        elif packet.code == protocol.Instruction.WRITE and packet.id in self.memory:
            if packet.id not in self.dead:
                self.memory[packet.id][parameters[0] : parameters[0] + len(parameters) - 1] = parameters[1:]
            self._answer(packet.id, at)
        elif packet.code == protocol.Instruction.PING:
            self._answer(packet.id, at)

    def _read(self, node: int, address: int, count: int) -> bytes:
        return bytes(self.memory[node][address : address + count]) if node in self.memory else b""

    def _answer(self, node: int, at: float, data: bytes = b"") -> None:
        if node in self.memory and node not in self.dead:
            self._out.append((at + DELAY, protocol.frame(node, 0, data)))

    def advance(self, to: float) -> list[tuple[float, Data]]:
        ready = [item for item in self._out if item[0] <= to]
        self._out = [item for item in self._out if item[0] > to]
        return ready

    def due(self) -> float | None:
        return min((at for at, _ in self._out), default=None)

    def tune(self, rate: int) -> None:
        self.rate = rate


def first_byte(answer: Response) -> int:
    return answer.replies[0].data[5]


def position(node: int) -> Request[int]:
    """The low byte of register 56, which is the id."""
    return Request(protocol.read(node, 56, 2), (Expected(node, node, 8),), first_byte, repeatable=True)


def write(node: int, address: int, value: int, effect: Effect = Effect.NONE) -> Request[Response]:
    return Request(
        protocol.write(node, address, bytes([value])),
        (Expected(node, node, 6),),
        effect=effect,
        repeatable=True,
    )


def memory_bus(line: Line | None = None, **options: Any) -> tuple[Bus, Responder]:
    responder = Responder()
    link = MemoryLink(responder, line=line, **options)
    return Bus(link, FAMILY.open(), interlock=ADMIT_ALL), responder
