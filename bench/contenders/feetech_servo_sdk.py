"""feetech-servo-sdk, the vendor's SDK, used as its examples use it."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from bench.measure import Contender, main
from bench.workloads import NODES

sdk: Any = import_module("scservo_sdk")  # in a folder of its own, which type checkers do not see


class FeetechServoSdk(Contender):
    """Raw counts; the result code of each call is checked."""

    def __init__(self, port: str) -> None:
        self.port = open_port(port)
        self.packets = sdk.PacketHandler(0)
        self.positions = sdk.GroupSyncRead(self.port, self.packets, 56, 2)
        self.goals = sdk.GroupSyncWrite(self.port, self.packets, 42, 2)
        for node in NODES:
            self.positions.addParam(node)

    def read(self) -> int:
        value, result, _ = self.packets.read2ByteTxRx(self.port, 1, 56)
        check(result)
        return int(value)

    def read_group(self) -> list[int]:
        check(self.positions.txRxPacket())
        return [self.positions.getData(node, 56, 2) for node in NODES]

    def write_group(self, goals: list[int]) -> None:
        for node, goal in zip(NODES, goals, strict=True):
            self.goals.addParam(node, [goal & 255, goal >> 8])
        check(self.goals.txPacket())
        self.goals.clearParam()


def open_port(port: str) -> Any:
    """A port handler of either SDK."""
    opened = sdk.PortHandler(port)
    if not opened.openPort() or not opened.setBaudRate(1_000_000):
        raise OSError(f"cannot open {port}")
    return opened


def check(result: int) -> None:
    """Raise OSError for a result code other than success."""
    if result:
        raise OSError(f"result {result}")


if __name__ == "__main__":
    main(FeetechServoSdk)
