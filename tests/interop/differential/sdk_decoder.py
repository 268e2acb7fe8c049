"""One of the two FEETECH SDKs, unmodified, between a port that is a list of bytes and a clock that is a number.

    python -S -P tests/interop/differential/sdk_decoder.py old|new

Nothing of ours is in this process. The module `serial` and `time.time` are given to the SDK from outside: a write is
answered at once by the stream that is due, and time passes as it is asked for, so no call ever waits. Each line of
standard input is a request and a stream; each line of the answer is what the SDK sent and what its call gave:

    {"kind": "read", "node": 1, "address": 56, "count": 2, "data": "", "nodes": [], "stream": "FFFF…"}
    {"sent": "FFFF…", "ok": [[0, 8], 0]}      or {"sent": …, "no": "corrupt"}, or "IndexError" and the like, or "hangs"
"""

from __future__ import annotations

import json
import sys
import time
import types
from importlib import import_module
from typing import Any

TICK = 0.001  # s that pass whenever the time is asked for
PATIENCE = 5_000  # looks at an empty line; more is a call that never ends
KINDS = {-6: "timeout", -7: "corrupt", -4: "refuses to send"}


class Hangs(BaseException):
    """The call would never return."""


class Port:
    """What `serial.Serial` is to the SDK."""

    stream = b""

    def __init__(self, **settings: Any) -> None:
        self.sent = b""
        self.arrived = b""
        self.looks = 0

    def write(self, data: Any) -> int:
        self.sent += bytes(data)
        self.arrived += Port.stream
        return len(data)

    def read(self, count: int) -> bytes:
        self.looks += 1
        if self.looks > PATIENCE:
            raise Hangs
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
    """The time that passes by being asked for."""

    def __init__(self) -> None:
        self.now = 1e9

    def time(self) -> float:
        self.now += TICK
        return self.now


class Decoder:
    """A fresh port for each stream, so that nothing is left of the one before."""

    def __init__(self, old: bool) -> None:
        self.old = old
        sys.modules["serial"] = types.SimpleNamespace(Serial=Port, EIGHTBITS=8)  # type: ignore[assignment]
        time.time = Clock().time
        self.sdk: Any = import_module("scservo_sdk")

    def decode(self, case: dict[str, Any]) -> dict[str, Any]:
        Port.stream = bytes.fromhex(case["stream"])
        port = self.sdk.PortHandler("port")
        port.setBaudRate(1_000_000)
        try:
            gives = getattr(self, case["kind"])(port, case)
        except Hangs:
            gives = {"no": "hangs"}
        except Exception as error:
            gives = {"no": type(error).__name__}
        return {"sent": port.ser.sent.hex(), **gives}

    def ping(self, port: Any, case: dict[str, Any]) -> dict[str, Any]:
        """By its packet alone, for its own ping goes on to read the model."""
        return self._acknowledged(self._call(port, "txRxPacket", [0, 0, case["node"], 2, 1, 0])[1:])

    def read(self, port: Any, case: dict[str, Any]) -> dict[str, Any]:
        data, result, alarm = self._call(port, "readTxRx", case["node"], case["address"], case["count"])
        return {"ok": [list(data), alarm]} if result == 0 else _no(result)

    def write(self, port: Any, case: dict[str, Any]) -> dict[str, Any]:
        data = list(bytes.fromhex(case["data"]))
        return self._acknowledged(
            self._call(port, "writeTxRx", case["node"], case["address"], len(data), data)
        )

    def reg_write(self, port: Any, case: dict[str, Any]) -> dict[str, Any]:
        data = list(bytes.fromhex(case["data"]))
        return self._acknowledged(
            self._call(port, "regWriteTxRx", case["node"], case["address"], len(data), data)
        )

    def sync_read(self, port: Any, case: dict[str, Any]) -> dict[str, Any]:
        """What it holds ready for each servo afterwards, whatever the call as a whole gave."""
        address, count = case["address"], case["count"]
        handler = self._handler(port)
        group = self.sdk.GroupSyncRead(*((port, handler) if self.old else (handler,)), address, count)
        for node in case["nodes"]:
            group.addParam(node)
        result = group.txRxPacket()
        if result == -4:
            return _no(result)
        ready = {}
        for node in case["nodes"]:
            there = group.isAvailable(node, address, count)
            if there if self.old else there[0]:
                ready[str(node)] = [group.getData(node, address + at, 1) for at in range(count)]
        return {"ok": ready, "result": result} if ready else _no(result)

    def sync_write(self, port: Any, case: dict[str, Any]) -> dict[str, Any]:
        data, nodes = bytes.fromhex(case["data"]), case["nodes"]
        size = len(data) // len(nodes)
        handler = self._handler(port)
        group = self.sdk.GroupSyncWrite(*((port, handler) if self.old else (handler,)), case["address"], size)
        for place, node in enumerate(nodes):
            group.addParam(node, list(data[place * size : (place + 1) * size]))
        result = group.txPacket()
        return {"ok": None} if result == 0 else _no(result)

    def action(self, port: Any, case: dict[str, Any]) -> dict[str, Any]:
        result = self._call(port, "action", case["node"])
        return {"ok": None} if result == 0 else _no(result)

    def _handler(self, port: Any) -> Any:
        return self.sdk.PacketHandler(0) if self.old else self.sdk.protocol_packet_handler(port, 0)

    def _call(self, port: Any, name: str, *arguments: Any) -> Any:
        return getattr(self._handler(port), name)(*((port,) if self.old else ()), *arguments)

    def _acknowledged(self, gave: Any) -> dict[str, Any]:
        result, alarm = gave
        return {"ok": alarm} if result == 0 else _no(result)


def _no(result: int) -> dict[str, Any]:
    return {"no": KINDS.get(result, str(result))}


def main() -> None:
    """Answer every line."""
    decoder = Decoder(sys.argv[1] == "old")
    for line in sys.stdin:
        print(json.dumps(decoder.decode(json.loads(line))))


if __name__ == "__main__":
    main()
