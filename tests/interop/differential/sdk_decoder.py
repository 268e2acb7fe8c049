"""One of the two FEETECH SDKs, unmodified, on a simulated port and clock.

    python -S -P tests/interop/differential/sdk_decoder.py old|new

Nothing of this project is in the process. A write is answered at once by the stream of the request, and time passes
when the SDK reads the clock, so no call waits. Input: a request in JSON a line. Output: what the SDK sent, and the
value of each node that it took, a line each.
"""

from __future__ import annotations

import json
import sys
import time
import types
from importlib import import_module
from typing import Any

TICK = 0.001  # s that pass whenever the SDK reads the clock
MAX_READS = 5_000  # of an empty line; more is a call that never ends
SUCCESS = 0


class Endless(BaseException):
    """The call would never return."""


class Port:
    """What `serial.Serial` is to the SDK."""

    stream = b""

    def __init__(self, **settings: Any) -> None:
        self.sent = b""
        self.arrived = b""
        self.reads = 0

    def write(self, data: Any) -> int:
        self.sent += bytes(data)
        self.arrived += Port.stream
        return len(data)

    def read(self, count: int) -> bytes:
        self.reads += 1
        if self.reads > MAX_READS:
            raise Endless
        count = max(count, 0)
        taken, self.arrived = self.arrived[:count], self.arrived[count:]
        return taken

    def flush(self) -> None:
        """All is sent at once."""

    def reset_input_buffer(self) -> None:
        self.arrived = b""

    def close(self) -> None:
        """Nothing is open."""


class Clock:
    now = 1e9

    def time(self) -> float:
        self.now += TICK
        return self.now


class Decoder:
    """A fresh port for each stream."""

    def __init__(self, old: bool) -> None:
        self.old = old
        sys.modules["serial"] = types.SimpleNamespace(Serial=Port, EIGHTBITS=8)  # type: ignore[assignment]
        time.time = Clock().time
        self.sdk: Any = import_module("scservo_sdk")

    def decode(self, case: dict[str, Any]) -> tuple[str, dict[int, Any]]:
        Port.stream = bytes.fromhex(case["stream"])
        port = self.sdk.PortHandler("port")
        port.setBaudRate(1_000_000)
        handler = self.sdk.PacketHandler(0) if self.old else self.sdk.protocol_packet_handler(port, 0)
        self.first = (port,) if self.old else ()
        try:
            values = self._call(port, handler, **case)
        except (Endless, Exception):
            values = {}
        return port.ser.sent.hex(), values

    def _call(
        self, port: Any, handler: Any, kind: str, node: int, address: int, size: int, **more: Any
    ) -> dict[int, Any]:
        data = list(bytes.fromhex(more["data"]))
        if kind.startswith("sync"):
            return self._sync(port, handler, address, size, more["nodes"], data)
        if kind == "action":
            handler.action(*self.first, node)
            return {}
        if kind == "read":
            value, result, _ = handler.readTxRx(*self.first, node, address, size)
            value = list(value)
        elif kind == "ping":  # by its packet alone: its own ping also reads the model
            _, result, value = handler.txRxPacket(*self.first, [0, 0, node, 2, 1, 0])
        else:
            write = handler.writeTxRx if kind == "write" else handler.regWriteTxRx
            result, value = write(*self.first, node, address, len(data), data)
        return {node: value} if result == SUCCESS else {}

    def _sync(
        self, port: Any, handler: Any, address: int, size: int, nodes: list[int], data: list[int]
    ) -> dict[int, Any]:
        owner = (port, handler) if self.old else (handler,)
        if data:
            size = len(data) // len(nodes)
            writer = self.sdk.GroupSyncWrite(*owner, address, size)
            for place, node in enumerate(nodes):
                writer.addParam(node, data[place * size : (place + 1) * size])
            writer.txPacket()
            return {}
        group = self.sdk.GroupSyncRead(*owner, address, size)
        for node in nodes:
            group.addParam(node)
        group.txRxPacket()
        values = {}
        for node in nodes:
            available = group.isAvailable(node, address, size)
            if available if self.old else available[0]:
                values[node] = [group.getData(node, address + at, 1) for at in range(size)]
        return values


def main() -> None:
    decoder = Decoder(sys.argv[1] == "old")
    for line in sys.stdin:
        print(json.dumps(decoder.decode(json.loads(line))))


if __name__ == "__main__":
    main()
