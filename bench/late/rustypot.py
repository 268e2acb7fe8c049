"""rustypot on a pseudo-terminal, in real time; prints what it believed, as JSON.

    python -S -m bench.late.rustypot SEED COUNT

The servo is a child process, for the library keeps Python to itself while it waits. How long it waits is up to its
user: 20 ms here. An error costs as much, and so do the calls on the line that echoes and where nobody is.
"""

from __future__ import annotations

import json
import mmap
import os
import sys
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from bench.late.device import DELAY, ECHOES, ID, NOBODY, POSITION, SHARE, TORQUE, Servo, forged, tally

PATIENCE = 0.02  # s
WORD = 8


class Counts:
    """Two numbers that both processes see."""

    def __init__(self) -> None:
        self._memory = mmap.mmap(-1, 2 * WORD)

    def put(self, heard: int, late: int) -> None:
        self._memory[:] = heard.to_bytes(WORD, "little") + late.to_bytes(WORD, "little")

    @property
    def heard(self) -> int:
        return int.from_bytes(self._memory[:WORD], "little")

    @property
    def late(self) -> int:
        return int.from_bytes(self._memory[WORD:], "little")


def serve(master: int, servo: Servo, counts: Counts) -> None:
    """The other end, until it is closed."""
    pending = b""
    while True:
        try:
            pending += os.read(master, 4096)
        except OSError:
            return
        while len(pending) > 3 and len(pending) >= pending[3] + 4:
            request, pending = pending[: pending[3] + 4], pending[pending[3] + 4 :]
            soon, then = servo.hear(request)
            counts.put(servo.heard, servo.lateness.late)
            if soon:
                os.write(master, soon)
            if then:
                time.sleep(DELAY)
                os.write(master, then)


@contextmanager
def line(servo: Servo) -> Iterator[tuple[Any, Counts]]:
    """A controller and what its servo has counted."""
    counts = Counts()
    master, slave = os.openpty()
    tty.setraw(slave)
    child = os.fork()
    if not child:
        os.close(slave)
        serve(master, servo, counts)
        os._exit(0)
    os.close(master)
    controller = import_module("rustypot").Sts3215PyController(os.ttyname(slave), 1_000_000, PATIENCE)
    try:
        yield controller, counts
    finally:
        controller.close()
        os.close(slave)
        os.waitpid(child, 0)


def read(controller: Any, node: int) -> int | None:
    """The position, raw."""
    try:
        return int.from_bytes(bytes(controller.read_raw_data(node, POSITION, 2)), "little")
    except Exception:  # whatever it raises is a reading that failed
        return None


def write(controller: Any, node: int) -> bool:
    """Torque off."""
    try:
        controller.write_raw_data(node, TORQUE, [0])
    except Exception:
        return False
    return True


def measured(seed: int, count: int) -> dict[str, Any]:
    """Late replies first, then the line that echoes."""
    with line(Servo(seed, SHARE)) as (one, counts):
        late = tally(lambda: read(one, ID), lambda: counts.heard, count)._replace(late=counts.late)
    with line(Servo(seed, share=0.0, echo=True)) as (one, echoed):
        echo = {
            "read": tally(lambda: read(one, ID), lambda: echoed.heard, ECHOES),
            "read nobody": forged(lambda: read(one, NOBODY) is not None, ECHOES),
            "write nobody": forged(lambda: write(one, NOBODY), ECHOES),
        }
    return {"late": late, "echo": echo}


if __name__ == "__main__":
    print(json.dumps(measured(int(sys.argv[1]), int(sys.argv[2]))))
