"""st3215 0.4.2: a small interface for one kind of servo; its groups for several are those of the vendor's newer SDK."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from bench import memory
from bench.contenders.newer_sdk import NewerSdk
from bench.contenders.sdk_port import MemoryPort
from bench.loop import main
from bench.workloads import Workload

st3215: Any = import_module("st3215.st3215")  # it is in a folder of its own, where no type checker looks


class St3215(NewerSdk):
    """Its one class is its packet handler too, and opens its port itself."""

    def __init__(self, port: str, workload: Workload) -> None:
        if port == memory.PORT:
            st3215.PortHandler = lambda device: MemoryPort(workload)
        super().__init__(st3215, st3215.ST3215(port), workload)

    def read(self, prepared: object) -> int:
        position = self.packets.ReadPosition(1)
        if position is None:
            raise OSError("it says None")
        return int(position)

    def _word(self, value: int) -> list[int]:
        return [self.packets.sts_lobyte(value), self.packets.sts_hibyte(value)]


if __name__ == "__main__":
    main(St3215)
