"""feetech-cli 0.1.8, by the controller behind its commands: counts, every packet checked."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from bench import memory
from bench.loop import main
from bench.workloads import SIZES, Workload, parts

feetech_cli: Any = import_module("feetech_cli")  # it is in a folder of its own, where no type checker looks

GOAL, POSITION = 42, 56
SPEED = 1000


class MemorySerial:
    """Those members of a serial port that it uses, over answers in memory."""

    is_open = True
    timeout = 0.05

    def __init__(self, workload: Workload) -> None:
        self.wire = memory.Wire(workload)
        self.arrived = b""

    def reset_input_buffer(self) -> None:
        self.arrived = b""

    def write(self, data: bytes) -> None:
        self.arrived += self.wire.answer(data)

    def flush(self) -> None:
        """Everything has left already."""

    def read(self, count: int) -> bytes:
        taken, self.arrived = self.arrived[:count], self.arrived[count:]
        return taken

    def close(self) -> None:
        """Nothing was opened."""


class FeetechCli:
    """Registers by name where it has a call for that, by address where it has not."""

    def __init__(self, port: str, workload: Workload) -> None:
        controller = feetech_cli.FeetechServoController(port, 1_000_000, min_id=1, max_id=len(workload.nodes))
        self.controller = controller
        if port == memory.PORT:
            controller.serial = MemorySerial(workload)
            controller.packet_handler = feetech_cli.PacketHandler(controller.serial)
        else:
            controller.open()
        self.nodes = list(workload.reads or workload.writes)
        self.parts = [list(part) for part in parts(workload.reads)]
        self.size = SIZES[workload.what]
        self.word = controller.packet_handler.encode_word

    def read(self, prepared: Any) -> int:
        return int(self.controller.read_register(1, "present_position"))

    def sync_read(self, prepared: Any) -> list[int]:
        word = self.controller.packet_handler.decode_word
        answers = self.controller.sync_read(self.nodes, POSITION, 2)
        return [word(data) for _error, data in answers.values()]

    def many(self, prepared: Any) -> list[int]:
        word = self.controller.packet_handler.decode_word
        return [
            word(data)
            for part in self.parts
            for _error, data in self.controller.sync_read(part, POSITION, 2).values()
        ]

    def blocks(self, prepared: Any) -> list[bytes]:
        answers = self.controller.sync_read(self.nodes, POSITION, self.size)
        return [data for _error, data in answers.values()]

    def sync_write(self, prepared: list[int]) -> None:
        word = self.word
        entries = [
            (node, word(goal) + word(0) + word(SPEED))
            for node, goal in zip(self.nodes, prepared, strict=True)
        ]
        self.controller.packet_handler.sync_write(GOAL, entries)

    def cycle(self, prepared: list[int]) -> list[int]:
        word = self.word
        entries = [(node, word(goal)) for node, goal in zip(self.nodes, prepared, strict=True)]
        self.controller.packet_handler.sync_write(GOAL, entries)
        return self.sync_read(None)

    def prepare(self, counts: list[int]) -> list[int]:
        return counts

    def counts(self, values: int | list[Any]) -> list[Any]:
        return [values] if isinstance(values, int) else values

    def close(self) -> None:
        self.controller.close()


if __name__ == "__main__":
    main(FeetechCli)
