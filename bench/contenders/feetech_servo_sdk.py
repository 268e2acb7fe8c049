"""The vendor's Python SDK from the package index, feetech-servo-sdk 1.0.0, used as its examples use it."""

from __future__ import annotations

from typing import Any

import scservo_sdk as sdk  # type: ignore[import-not-found]

from bench import memory
from bench.contenders.sdk_port import MemoryPort
from bench.loop import main
from bench.workloads import SIZES, Workload, parts

GOAL, POSITION = 42, 56
SPEED = 1000


class FeetechServoSdk:
    """Raw counts in and out; a result code per call, which is looked at as the examples do."""

    def __init__(self, port: str, workload: Workload) -> None:
        self.nodes = workload.reads or workload.writes
        self.port = MemoryPort(workload) if port == memory.PORT else _opened(port)
        self.packets = sdk.PacketHandler(0)
        self.size = SIZES[workload.what]
        self.groups = [self._group(part) for part in parts(self.nodes)]
        self.positions = self.groups[0]
        self.six_bytes = sdk.GroupSyncWrite(self.port, self.packets, GOAL, 6)
        self.two_bytes = sdk.GroupSyncWrite(self.port, self.packets, GOAL, 2)

    def _group(self, nodes: tuple[int, ...]) -> Any:
        group = sdk.GroupSyncRead(self.port, self.packets, POSITION, self.size)
        for node in nodes:
            group.addParam(node)
        return group

    def read(self, prepared: Any) -> int:
        value, result, _error = self.packets.read2ByteTxRx(self.port, 1, POSITION)
        _demand(result)
        return int(value)

    def sync_read(self, prepared: Any) -> list[int]:
        _demand(self.positions.txRxPacket())
        return [self.positions.getData(node, POSITION, 2) for node in self.nodes]

    def blocks(self, prepared: Any) -> list[list[int]]:
        _demand(self.positions.txRxPacket())
        return [self.positions.data_dict[node] for node in self.nodes]

    def many(self, prepared: Any) -> list[int]:
        found: list[int] = []
        for group in self.groups:
            _demand(group.txRxPacket())
            found += [group.getData(node, POSITION, 2) for node in group.data_dict]
        return found

    def sync_write(self, prepared: list[int]) -> None:
        group = self.six_bytes
        for node, goal in zip(self.nodes, prepared, strict=True):
            low, high = sdk.SCS_LOBYTE(goal), sdk.SCS_HIBYTE(goal)
            group.addParam(node, [low, high, 0, 0, sdk.SCS_LOBYTE(SPEED), sdk.SCS_HIBYTE(SPEED)])
        _demand(group.txPacket())
        group.clearParam()

    def cycle(self, prepared: list[int]) -> list[int]:
        group = self.two_bytes
        for node, goal in zip(self.nodes, prepared, strict=True):
            group.addParam(node, [sdk.SCS_LOBYTE(goal), sdk.SCS_HIBYTE(goal)])
        _demand(group.txPacket())
        group.clearParam()
        return self.sync_read(None)

    def prepare(self, counts: list[int]) -> list[int]:
        return counts

    def counts(self, values: int | list[Any]) -> list[Any]:
        found = [values] if isinstance(values, int) else values
        return [bytes(value) if isinstance(value, list) else value for value in found]

    def close(self) -> None:
        self.port.closePort()


def _opened(name: str) -> Any:
    port = sdk.PortHandler(name)
    if not port.openPort() or not port.setBaudRate(1_000_000):
        raise OSError(f"cannot open {name}")
    return port


def _demand(result: int) -> None:
    if result != sdk.COMM_SUCCESS:
        raise OSError(f"the SDK says {result}")


if __name__ == "__main__":
    main(FeetechServoSdk)
