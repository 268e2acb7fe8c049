"""A FEETECH SDK between a port of memory and a clock that only moves while it waits; prints what it believed, as JSON.

    python -S -m bench.late.sdk SEED COUNT

Which SDK is a matter of the path for modules. The SDK itself is unmodified: the module `serial` and `time.time` are
given to it from outside, and its own time-out counts.
"""

from __future__ import annotations

import json
import sys
import time
import types
from importlib import import_module
from typing import Any

from bench.late.device import DELAY, ECHOES, ID, NOBODY, POSITION, SOON, TORQUE, Servo, forged, tally

STEP = 0.001
"""s that pass at each look at a line on which nothing is under way."""


class Clock:
    """What `time.time` is to the SDK."""

    now = 1e9

    def time(self) -> float:
        return self.now


class Port:
    """What `serial.Serial` is to the SDK: the servo is at its other end."""

    servo: Servo
    clock: Clock

    def __init__(self, **settings: Any) -> None:
        self.arrived = b""
        self.under_way: list[tuple[float, bytes]] = []

    def write(self, data: Any) -> int:
        soon, then = self.servo.hear(bytes(data))
        for later, answer in ((SOON, soon), (DELAY, then)):
            if answer:  # nothing overtakes what is under way
                before = self.under_way[-1][0] if self.under_way else 0.0
                self.under_way.append((max(self.clock.now + later, before), answer))
        return len(data)

    def read(self, count: int) -> bytes:
        self._take()
        if not self.arrived:
            self.clock.now = min([self.clock.now + STEP, *(at for at, _ in self.under_way[:1])])
            self._take()
        taken, self.arrived = self.arrived[: max(count, 0)], self.arrived[max(count, 0) :]
        return taken

    def _take(self) -> None:
        while self.under_way and self.under_way[0][0] <= self.clock.now:
            self.arrived += self.under_way.pop(0)[1]

    def flush(self) -> None:
        """All is sent at once."""

    def reset_input_buffer(self) -> None:
        self._take()
        self.arrived = b""

    def close(self) -> None:
        """Nothing is open."""


class Reader:
    """The calls of either SDK, made ready anew with a servo of its own."""

    def __init__(self, sdk: Any, servo: Servo) -> None:
        Port.servo = servo
        self.port = sdk.PortHandler("memory")
        if not self.port.setBaudRate(1_000_000):
            raise OSError("the SDK has not opened its port")
        old = hasattr(sdk, "PacketHandler")
        self.handler = sdk.PacketHandler(0) if old else sdk.protocol_packet_handler(self.port, 0)
        self.first = (self.port,) if old else ()

    def read(self, node: int) -> int | None:
        value, result, _alarm = self.handler.read2ByteTxRx(*self.first, node, POSITION)
        return None if result else int(value)

    def write(self, node: int) -> bool:
        result, _alarm = self.handler.write1ByteTxRx(*self.first, node, TORQUE, 0)
        return not result


def measured(seed: int, count: int) -> dict[str, Any]:
    """Late replies first, then the line that echoes."""
    clock = Clock()
    Port.clock = clock
    sys.modules["serial"] = types.SimpleNamespace(Serial=Port, EIGHTBITS=8)  # type: ignore[assignment]
    time.time = clock.time
    sdk = import_module("scservo_sdk")
    servo = Servo(seed)
    reader = Reader(sdk, servo)
    late = tally(lambda: reader.read(ID), lambda: servo.heard, count)
    echoing = Servo(seed, share=0.0, echo=True)
    heard = Reader(sdk, echoing)
    return {
        "late": late._replace(late=servo.lateness.late),
        "echo": {
            "read": tally(lambda: heard.read(ID), lambda: echoing.heard, ECHOES),
            "read nobody": forged(lambda: heard.read(NOBODY) is not None, ECHOES),
            "write nobody": forged(lambda: heard.write(NOBODY), ECHOES),
        },
    }


if __name__ == "__main__":
    print(json.dumps(measured(int(sys.argv[1]), int(sys.argv[2]))))
