"""The processes of `bench.estop`: whoever listens on a wire, the program that is stopped, and what keeps it busy.

python -m bench.estop_parts wire BUS FAR FOLDER
python -m bench.estop_parts program STOPS FOLDER
python -m bench.estop_parts load
"""

from __future__ import annotations

import os
import select
import sys
import time
from contextlib import suppress
from pathlib import Path
from threading import Event, Thread
from typing import Any

from motorbus.errors import MotorbusError

STOP_FRAMES = (bytes.fromhex("fffffe04032800d2"), bytes.fromhex("ffaa5e"))
"""Torque off for everyone on a FEETECH bus; the end of a stepper's project."""
PIECE = b"\xff\xff\x02\x99" * 25
EVERY = 0.001  # s: 100 bytes are what 1 Mbaud carries in it
NODES = tuple(range(1, 7))
TRIES = 20
REST = 0.05  # s between two stops, so that nothing of one is taken for the next


def wire(bus: str, far: str, folder: str) -> None:
    """Be the wire of a bus: carry what is said both ways, and write down when a stop comes by.

    Without a far end there is nobody to answer, and somebody who talks without a pause.
    """
    import tty

    master, slave = os.openpty()
    tty.setraw(slave)
    (Path(folder) / bus).symlink_to(os.ttyname(slave))
    other = -1 if far == "-" else os.open(far, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    os.set_blocking(master, False)
    with (Path(folder) / f"{bus}.heard").open("w", encoding="ascii", buffering=1) as heard:
        print("ready", flush=True)
        while True:
            ready, _, _ = select.select([end for end in (master, other) if end >= 0], [], [], EVERY)
            now = time.monotonic()
            if master in ready:
                said = os.read(master, 65536)
                if any(frame in said for frame in STOP_FRAMES):
                    heard.write(f"{now}\n")
                _pass_on(other, said)
            if other in ready:
                _pass_on(master, os.read(other, 65536))
            if other < 0:
                _pass_on(master, PIECE)


def _pass_on(end: int, data: bytes) -> None:
    with suppress(OSError):  # as on a wire, what nobody takes is lost
        if end >= 0:
            os.write(end, data)


def program(stops: int, folder: str) -> None:
    """Stop all buses at once so many times, and say when each was asked for."""
    import motorbus
    from motorbus.motion.body import Body
    from motorbus.motion.machine import Machine
    from motorbus.session.stopping import estop, reset

    blocked, slave = os.openpty()
    os.set_blocking(slave, False)
    with suppress(BlockingIOError):
        while os.write(slave, bytes(4096)):
            pass
    places = {"arm": f"feetech:{folder}/arm", "stage": f"stepper:{folder}/stage"}
    places |= {"noisy": f"feetech:{folder}/noisy", "blocked": f"feetech:{os.ttyname(slave)}"}
    buses: dict[str, Any] = {name: motorbus.open(place) for name, place in places.items()}
    for name, nodes in (("arm", NODES), ("stage", (1,))):
        for node in nodes:
            _met(buses[name], node)
    over = Event()
    for name in ("arm", "noisy"):
        Thread(target=_polls, args=(buses[name], over), daemon=True).start()
    print("ready", flush=True)
    body = Body(Machine(), buses, {})
    for _ in range(stops):
        time.sleep(REST)
        asked = time.monotonic()
        estop(body)
        print(asked, flush=True)
        reset(body)
    over.set()
    os.close(blocked)


def _first() -> None:
    """With the priority of what moves a machine, where that is permitted; whoever listens must not be late either."""
    with suppress(AttributeError, OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))


def _met(bus: Any, node: int) -> None:
    """It has answered once, so that the stop knows it; where nothing runs in time it is asked again."""
    for _ in range(TRIES):
        with suppress(MotorbusError):
            bus.run(bus.driver.identify(node))
            return


def _polls(bus: Any, over: Event) -> None:
    servo = bus.family.devices.blocking(bus, 1)
    while not over.is_set():
        with suppress(MotorbusError):
            servo.position()


def load() -> None:
    """Compute without end."""
    print("ready", flush=True)
    while True:
        sum(range(100_000))


if __name__ == "__main__":
    what, *words = sys.argv[1:]
    if what != "load":
        _first()
    if what == "wire":
        wire(*words)
    elif what == "program":
        program(int(words[0]), words[1])
    else:
        load()
