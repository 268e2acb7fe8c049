"""python-can, unmodified and alone, told what to send by lines on standard input.

    python -S tests/interop/python_can_client.py INTERFACE CHANNEL KWARGS

INTERFACE and CHANNEL are python-can's, KWARGS a JSON object of further arguments of its bus. Nothing of ours is in
this process. Each line is a request in JSON, each answer one line, `{"value": …}` or `{"error": …}`. Frames are
written as candump does, `625#4002600000000000`, with eight digits before the hash for 29 bits. The requests:

    ["ask", FRAME, COUNT]      send, and give the frames that come back: so many, and whatever comes right behind them
    ["listen", SECONDS]        what comes in that time
    ["await", FRAME, REPLY]    send again and again until the reply is this one; gives every different one there was
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from importlib import import_module
from typing import Any

can: Any = import_module("can")  # so that types are checked alike whether it is installed or not
PATIENCE = 20.0  # s for what has to come
BEHIND = 0.02  # s in which one frame too many would come
AGAIN = 0.1  # s after which an unanswered request is sent once more


class Client:
    """One bus of python-can."""

    def __init__(self, interface: str, channel: str, kwargs: str) -> None:
        self.bus = can.Bus(interface=interface, channel=channel, **json.loads(kwargs))

    def ask(self, frame: str, count: int) -> list[str]:
        self._send(frame)
        end = time.monotonic() + PATIENCE
        heard: list[str] = []
        while len(heard) < count and time.monotonic() < end:
            heard += self._receive(end - time.monotonic())
        return heard + self.listen(BEHIND)

    def listen(self, seconds: float) -> list[str]:
        end = time.monotonic() + seconds
        heard: list[str] = []
        while (left := end - time.monotonic()) > 0:
            heard += self._receive(left)
        return heard

    def await_(self, frame: str, reply: str) -> list[str]:
        end = time.monotonic() + PATIENCE
        heard: list[str] = []
        while time.monotonic() < end:
            self._send(frame)
            for one in self._receive(AGAIN):
                if one not in heard:
                    heard.append(one)
                if one == reply:
                    return heard + self.listen(BEHIND)
        return heard

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
    """Carry out one request a line until standard input ends."""
    client = Client(*sys.argv[1:])
    calls: dict[str, Callable[..., list[str]]] = {
        "ask": client.ask,
        "listen": client.listen,
        "await": client.await_,
    }
    try:
        print(json.dumps({"value": sorted(name for name in sys.modules if "motorbus" in name)}), flush=True)
        for line in sys.stdin:
            name, *arguments = json.loads(line)
            try:
                answer: dict[str, Any] = {"value": calls[name](*arguments)}
            except Exception as error:  # told to the test as it is
                answer = {"error": repr(error)}
            print(json.dumps(answer), flush=True)
    finally:
        client.close()


if __name__ == "__main__":
    main()
