"""Those members of the vendor SDK's port that its packet handlers use, over answers in memory.

The SDK in its older and newer form, st3215, servolab and LeRobot's bus all talk to a port of this shape.
"""

from __future__ import annotations

from bench import memory
from bench.workloads import Workload


class MemoryPort:
    """A port without a kernel: what is written is answered at once."""

    def __init__(self, workload: Workload) -> None:
        self.is_using = False
        self.is_open = True
        self.baudrate = 1_000_000
        self.wire = memory.Wire(workload)
        self.arrived = b""

    def openPort(self) -> bool:  # noqa: N802 - the SDK's name
        return True

    def clearPort(self) -> None:  # noqa: N802
        """There is nothing to wait for."""

    def writePort(self, packet: list[int]) -> int:  # noqa: N802
        self.arrived += self.wire.answer(bytes(packet))
        return len(packet)

    def readPort(self, length: int) -> bytes:  # noqa: N802
        taken, self.arrived = self.arrived[:length], self.arrived[length:]
        return taken

    def setPacketTimeout(self, length: int) -> None:  # noqa: N802
        """Everything is here already."""

    def setPacketTimeoutMillis(self, milliseconds: float) -> None:  # noqa: N802
        """Everything is here already."""

    def isPacketTimeout(self) -> bool:  # noqa: N802
        return True

    def closePort(self) -> None:  # noqa: N802
        """Nothing was opened."""
