"""python-can, unmodified, driven by lines on standard input.

    python -S tests/interop/python_can_client.py CHANNEL BITRATE

Nothing of this project is in the process; CHANNEL is a port with slcan. Each line is a request in JSON, each answer
one line, `{"value": …}` or `{"error": …}`. Frames are written as candump does, `625#4002600000000000`. The requests:

    ["ask", FRAME, COUNT]      send; returns so many frames that arrive, and more that follow at once
    ["listen", SECONDS]        what arrives in that time
    ["poll", FRAME, REPLY]     send until this reply arrives; returns it, and what follows at once
"""

from __future__ import annotations

import json
import sys
import time
from importlib import import_module
from typing import Any

can: Any = import_module("can")  # so that types are checked alike whether it is installed or not
TIMEOUT = 20.0  # s for what has to arrive
BEHIND = 0.02  # s in which one frame too many would arrive
AGAIN = 0.1  # s after which an unanswered request is sent once more


class Client:
    """One bus of python-can."""

    def __init__(self, channel: str, bitrate: str) -> None:
        self.bus = can.Bus(interface="slcan", channel=channel, bitrate=int(bitrate), sleep_after_open=0)

    def ask(self, frame: str, count: int) -> list[str]:
        self._send(frame)
        end = time.monotonic() + TIMEOUT
        frames: list[str] = []
        while len(frames) < count and time.monotonic() < end:
            frames += self._receive(end - time.monotonic())
        return frames + self.listen(BEHIND)

    def listen(self, seconds: float) -> list[str]:
        end = time.monotonic() + seconds
        frames: list[str] = []
        while (left := end - time.monotonic()) > 0:
            frames += self._receive(left)
        return frames

    def poll(self, frame: str, reply: str) -> list[str]:
        end = time.monotonic() + TIMEOUT
        while time.monotonic() < end:
            self._send(frame)
            if reply in self._receive(AGAIN):
                return [reply, *self.listen(BEHIND)]
        return []

    def close(self) -> None:
        self.bus.shutdown()

    def _send(self, text: str) -> None:
        id, _, data = text.partition("#")
        message = can.Message(
            arbitration_id=int(id, 16), is_extended_id=len(id) == 8, data=bytes.fromhex(data), check=True
        )
        self.bus.send(message)

    def _receive(self, seconds: float) -> list[str]:
        message = self.bus.recv(seconds)
        if message is None:
            return []
        id = f"{message.arbitration_id:0{8 if message.is_extended_id else 3}X}"
        return [f"{id}#{message.data.hex().upper()}"]


def main() -> None:
    client = Client(*sys.argv[1:])
    try:
        for line in sys.stdin:
            name, *arguments = json.loads(line)
            try:
                answer = {"value": getattr(client, name)(*arguments)}
            except Exception as error:
                answer = {"error": repr(error)}
            print(json.dumps(answer), flush=True)
    finally:
        client.close()


if __name__ == "__main__":
    main()
