"""The vendor's Python SDK from the package index, feetech-servo-sdk 1.0.0, used as its examples use it."""

from __future__ import annotations

from typing import Any

import scservo_sdk as sdk  # type: ignore[import-not-found]

from bench import memory
from bench.loop import main
from bench.workloads import IDS

GOAL, POSITION = 42, 56
SPEED = 1000


class MemoryPort:
    """Those members of its PortHandler that its packet handler uses, over answers in memory."""

    def __init__(self) -> None:
        self.is_using = False
        self.wire = memory.Wire()
        self.arrived = b""

    def clearPort(self) -> None:  # noqa: N802 - the SDK's name
        """There is nothing to wait for."""

    def writePort(self, packet: list[int]) -> int:  # noqa: N802
        self.arrived += self.wire.answer(bytes(packet))
        return len(packet)

    def readPort(self, length: int) -> bytes:  # noqa: N802
        taken, self.arrived = self.arrived[:length], self.arrived[length:]
        return taken

    def setPacketTimeout(self, length: int) -> None:  # noqa: N802
        """Everything is here already."""

    def isPacketTimeout(self) -> bool:  # noqa: N802
        return True

    def closePort(self) -> None:  # noqa: N802
        """Nothing was opened."""


class FeetechServoSdk:
    """Raw counts in and out; a result code per call, which is looked at as the examples do."""

    def __init__(self, port: str) -> None:
        self.port = MemoryPort() if port == memory.PORT else _opened(port)
        self.packets = sdk.PacketHandler(0)
        self.positions = sdk.GroupSyncRead(self.port, self.packets, POSITION, 2)
        for node in IDS:
            self.positions.addParam(node)
        self.six_bytes = sdk.GroupSyncWrite(self.port, self.packets, GOAL, 6)
        self.two_bytes = sdk.GroupSyncWrite(self.port, self.packets, GOAL, 2)

    def read(self, prepared: Any) -> int:
        value, result, _error = self.packets.read2ByteTxRx(self.port, 1, POSITION)
        _demand(result)
        return int(value)

    def sync_read(self, prepared: Any) -> list[int]:
        _demand(self.positions.txRxPacket())
        return [self.positions.getData(node, POSITION, 2) for node in IDS]

    def sync_write(self, prepared: list[int]) -> None:
        group = self.six_bytes
        for node, goal in zip(IDS, prepared, strict=True):
            low, high = sdk.SCS_LOBYTE(goal), sdk.SCS_HIBYTE(goal)
            group.addParam(node, [low, high, 0, 0, sdk.SCS_LOBYTE(SPEED), sdk.SCS_HIBYTE(SPEED)])
        _demand(group.txPacket())
        group.clearParam()

    def cycle(self, prepared: list[int]) -> list[int]:
        group = self.two_bytes
        for node, goal in zip(IDS, prepared, strict=True):
            group.addParam(node, [sdk.SCS_LOBYTE(goal), sdk.SCS_HIBYTE(goal)])
        _demand(group.txPacket())
        group.clearParam()
        return self.sync_read(None)

    def prepare(self, counts: list[int]) -> list[int]:
        return counts

    def counts(self, values: int | list[int]) -> list[int]:
        return [values] if isinstance(values, int) else values

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
