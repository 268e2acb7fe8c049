"""python-canopen on python-can's virtual bus, in real time; prints what it believed, as JSON.

    python -S -m bench.late.canopen_client SEED COUNT

The servo is a thread with a bus of its own on the same channel. The client waits for 0.3 s, as it does by itself. On
CAN a request and its reply have different identifiers, so an echo can forge nothing; it is tried nevertheless.
"""

from __future__ import annotations

import json
import logging
import sys
import time
from importlib import import_module
from threading import Thread
from typing import Any

from bench.late.device import DELAY, ECHOES, SHARE, Lateness, forged, tally

can: Any = import_module("can")  # in folders of their own, where no type checker looks
canopen: Any = import_module("canopen")
NODE, NOBODY, POSITION = 1, 9, 0x6002
CHANNEL = "late"
SILENT = 20
"""Calls to a node that is not there: each takes the whole 0.3 s."""


def place(heard: int) -> int:
    """Where the servo stands after so many requests, in counts."""
    return heard % 1801 - 900


class Device(Thread):
    """An SDO server that knows one object; the client's aborts are not answered."""

    def __init__(self, seed: int, share: float) -> None:
        super().__init__(daemon=True)
        self.bus = can.Bus(interface="virtual", channel=CHANNEL)
        self.lateness = Lateness(seed, share)
        self.heard = 0
        self.ended = False

    def run(self) -> None:
        while not self.ended:
            message = self.bus.recv(0.1)
            if message is not None and message.arbitration_id == 0x600 + NODE and message.data[0] == 0x40:
                self._answer(bytes(message.data))

    def _answer(self, request: bytes) -> None:
        self.heard += 1
        for kept in self.lateness.kept_back():
            self._say(kept)
        value = place(self.heard).to_bytes(2, "little", signed=True)
        reply = b"\x4b" + request[1:4] + value + bytes(2)
        if not self.lateness.is_late(reply):
            time.sleep(DELAY)
            self._say(reply)

    def _say(self, data: object) -> None:
        self.bus.send(can.Message(arbitration_id=0x580 + NODE, data=data, is_extended_id=False))

    def close(self) -> None:
        self.ended = True
        self.join()
        self.bus.shutdown()


def position(node: Any) -> int | None:
    """As it is read without a dictionary of objects."""
    try:
        return int.from_bytes(node.sdo.upload(POSITION, 0), "little", signed=True)
    except Exception:  # whatever it raises is a reading that failed
        return None


def network(echo: bool) -> Any:
    """A client on the channel."""
    made = canopen.Network()
    made.connect(interface="virtual", channel=CHANNEL, receive_own_messages=echo)
    return made


def measured(seed: int, count: int) -> dict[str, Any]:
    """Late replies first, then the line that echoes."""
    logging.disable()
    device, client = Device(seed, SHARE), network(False)
    device.start()
    node = client.add_node(NODE, canopen.ObjectDictionary())
    late = tally(lambda: position(node), lambda: device.heard, count, place)
    late = late._replace(late=device.lateness.late)
    client.disconnect()
    device.close()
    device, client = Device(seed, 0.0), network(True)
    device.start()
    here, nobody = (client.add_node(one, canopen.ObjectDictionary()) for one in (NODE, NOBODY))
    echo = {
        "read": tally(lambda: position(here), lambda: device.heard, ECHOES, place),
        "read nobody": forged(lambda: position(nobody) is not None, SILENT),
    }
    client.disconnect()
    device.close()
    return {"late": late, "echo": echo}


if __name__ == "__main__":
    print(json.dumps(measured(int(sys.argv[1]), int(sys.argv[2]))))
