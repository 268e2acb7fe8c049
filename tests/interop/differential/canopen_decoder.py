"""python-canopen's SDO client, unmodified, on a bus that is a list of frames.

    python -S -P tests/interop/differential/canopen_decoder.py

Nothing of ours is in this process. Its network is given a bus object instead of an adapter; each request that is sent
is answered at once by the frames that are due, handed to `Network.notify` as its manual says. Each line of standard
input is a request and, for every frame that the client may send, the frames that come back; each line of the answer is
what was sent and what the call gave:

    {"kind": "upload", "node": 1, "index": 24578, "subindex": 0, "data": "", "steps": [[[1409, "4B02…"]]]}
    {"sent": [[1537, "4002…"]], "ok": "F401"}      or {"sent": …, "no": "SdoAbortedError 100794368"}
"""

from __future__ import annotations

import json
import logging
import sys
from importlib import import_module
from typing import Any

canopen: Any = import_module("canopen")
PATIENCE = 0.0005  # s; what comes is there before the client waits


class Frames:
    """What `can.Bus` is to the library: `send` is all that a client calls."""

    channel_info = "frames"

    def __init__(self) -> None:
        self.network: Any = None
        self.sent: list[tuple[int, str]] = []
        self.steps: list[list[tuple[int, str]]] = []

    def send(self, message: Any, timeout: float | None = None) -> None:
        self.sent.append((message.arbitration_id, bytes(message.data).hex()))
        for identifier, data in self.steps.pop(0) if self.steps else ():
            self.network.notify(identifier, bytearray.fromhex(data), 0.0)


def decode(case: dict[str, Any]) -> dict[str, Any]:
    """One call on a network of its own."""
    bus = Frames()
    bus.network = network = canopen.Network(bus)
    client = network.add_node(case["node"], canopen.ObjectDictionary()).sdo
    client.RESPONSE_TIMEOUT = PATIENCE
    bus.steps = list(case["steps"])
    try:
        if case["kind"] == "upload":
            gives: dict[str, Any] = {"ok": bytes(client.upload(case["index"], case["subindex"])).hex()}
        else:
            client.download(case["index"], case["subindex"], bytes.fromhex(case["data"]))
            gives = {"ok": ""}
    except canopen.SdoAbortedError as error:
        gives = {"no": f"abort {error.code:08X}"}
    except Exception as error:
        gives = {"no": type(error).__name__}
    return {"sent": bus.sent, **gives}


def main() -> None:
    """Answer every line."""
    logging.disable()
    for line in sys.stdin:
        print(json.dumps(decode(json.loads(line))))


if __name__ == "__main__":
    main()
