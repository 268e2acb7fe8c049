"""The vendor's Python SDK, unmodified, told what to do by lines on standard input.

Runs in a process of its own with nothing of ours in it. Each line is a request in JSON, `["read", 1, 56, 2]`; each
answer is one line `{"value": …}`, or `{"error": …}` with what the SDK said. Bytes travel as lists of numbers.

The SDK gives up after 34 ms, which a busy machine may need to wake the simulator, and it would then take a late
answer for the next one. So its user has to do what is done here: let the line fall quiet, empty the input, ask again.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from typing import Any

import scservo_sdk as sdk  # type: ignore[import-not-found]

TRIES = 12
QUIET = 0.1  # s


class Client:
    """The calls of the SDK under names that both clients share."""

    def __init__(self, port: str) -> None:
        self.port = sdk.PortHandler(port)
        self.packets = sdk.PacketHandler(0)
        if not self.port.openPort() or not self.port.setBaudRate(1_000_000):
            raise OSError(f"cannot open {port}")

    def ping(self, node: int) -> int:
        """The model number: this SDK's ping asks for it too."""
        return int(self._good(lambda: self.packets.ping(self.port, node)))

    def read(self, node: int, address: int, count: int) -> list[int]:
        return list(self._good(lambda: self.packets.readTxRx(self.port, node, address, count)))

    def read_word(self, node: int, address: int) -> int:
        return int(self._good(lambda: self.packets.read2ByteTxRx(self.port, node, address)))

    def write(self, node: int, address: int, data: list[int]) -> None:
        self._good(lambda: (None, *self.packets.writeTxRx(self.port, node, address, len(data), data)))

    def write_once(self, node: int, address: int, data: list[int]) -> None:
        """As lerobot's `_write`: one try; the SDK drops a reply from another id. It waits 2 s, for a busy machine."""
        self.port.setPacketTimeout = lambda count: self.port.setPacketTimeoutMillis(2000)
        result, error = self.packets.writeTxRx(self.port, node, address, len(data), data)
        if result != sdk.COMM_SUCCESS or error:
            raise OSError(f"write to {node}: {self.packets.getTxRxResult(result)} alarm byte {error}")

    def sync_read(self, nodes: list[int], address: int, count: int) -> list[list[int]]:
        group = sdk.GroupSyncRead(self.port, self.packets, address, count)
        for node in nodes:
            group.addParam(node)
        self._good(lambda: (None, group.txRxPacket(), 0))
        return [[group.getData(node, address + i, 1) for i in range(count)] for node in nodes]

    def sync_write(self, nodes: list[int], address: int, data: list[list[int]]) -> None:
        group = sdk.GroupSyncWrite(self.port, self.packets, address, len(data[0]))
        for node, share in zip(nodes, data, strict=True):
            group.addParam(node, share)
        self._good(lambda: (None, group.txPacket(), 0))

    def _good(self, call: Callable[[], tuple[Any, int, int]]) -> Any:
        for _ in range(TRIES):
            self.port.ser.reset_input_buffer()
            value, result, error = call()
            if result == sdk.COMM_SUCCESS and not error:
                return value
            time.sleep(QUIET)
        raise OSError(f"{self.packets.getTxRxResult(result)} alarm byte {error}")


def main() -> None:
    """Carry out one request a line until standard input ends."""
    client = Client(sys.argv[1])
    for line in sys.stdin:
        name, *arguments = json.loads(line)
        try:
            answer = {"value": getattr(client, name)(*arguments)}
        except Exception as error:
            answer = {"error": repr(error)}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
