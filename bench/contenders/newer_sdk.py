"""What the vendor's newer SDK and its children have in common: packet handlers that own their port.

`ftservo_sdk` and `st3215` say how each of them is opened; their groups are the same.
"""

from __future__ import annotations

from typing import Any

from bench.workloads import SIZES, Workload, parts

GOAL, POSITION = 42, 56
SPEED = 1000


class NewerSdk:
    """Raw counts in and out; a result code per call, which is looked at as the examples do.

    `sdk`      its module, or whatever has its two group classes
    `packets`  its packet handler, on an open port
    """

    def __init__(self, sdk: Any, packets: Any, workload: Workload) -> None:
        self.sdk, self.packets = sdk, packets
        self.nodes = workload.reads or workload.writes
        self.size = SIZES[workload.what]
        self.groups = [self._group(part) for part in parts(self.nodes)]
        self.positions = self.groups[0]
        self.six_bytes = sdk.GroupSyncWrite(packets, GOAL, 6)
        self.two_bytes = sdk.GroupSyncWrite(packets, GOAL, 2)

    def _group(self, nodes: tuple[int, ...]) -> Any:
        group = self.sdk.GroupSyncRead(self.packets, POSITION, self.size)
        for node in nodes:
            group.addParam(node)
        return group

    def read(self, prepared: Any) -> int:
        value, result, _error = self.packets.read2ByteTxRx(1, POSITION)
        demand(result)
        return int(value)

    def sync_read(self, prepared: Any) -> list[int]:
        demand(self.positions.txRxPacket())
        return [self.positions.getData(node, POSITION, 2) for node in self.nodes]

    def blocks(self, prepared: Any) -> list[list[int]]:
        demand(self.positions.txRxPacket())
        return [self.positions.data_dict[node][1:] for node in self.nodes]

    def many(self, prepared: Any) -> list[int]:
        found: list[int] = []
        for group in self.groups:
            demand(group.txRxPacket())
            found += [group.getData(node, POSITION, 2) for node in group.data_dict]
        return found

    def sync_write(self, prepared: list[int]) -> None:
        group = self.six_bytes
        for node, goal in zip(self.nodes, prepared, strict=True):
            group.addParam(node, [*self._word(goal), 0, 0, *self._word(SPEED)])
        demand(group.txPacket())
        group.clearParam()

    def cycle(self, prepared: list[int]) -> list[int]:
        group = self.two_bytes
        for node, goal in zip(self.nodes, prepared, strict=True):
            group.addParam(node, self._word(goal))
        demand(group.txPacket())
        group.clearParam()
        return self.sync_read(None)

    def _word(self, value: int) -> list[int]:
        raise NotImplementedError

    def prepare(self, counts: list[int]) -> list[int]:
        return counts

    def counts(self, values: int | list[Any]) -> list[Any]:
        found = [values] if isinstance(values, int) else values
        return [bytes(value) if isinstance(value, list) else value for value in found]

    def close(self) -> None:
        self.packets.portHandler.closePort()


def demand(result: int) -> None:
    """Its examples look at the result of each call; 0 is success. Raises OSError."""
    if result:
        raise OSError(f"the SDK says {result}")
