"""A host of the stepper controller that imports nothing of motorbus: it has example frames, offsets and a serial port.

It writes a project field by field, reads it back, saves it, starts it, waits for its end, and prints a line of JSON.
"""

from __future__ import annotations

import json
import os
import select
import sys
import time
import tty

# command: {offset in its request: (offset in the dump, size)}
BASE = {
    "select_project": {4: (7, 1)},
    "set_microstep_and_angle": {4: (12, 2), 6: (14, 1)},
    "set_turn_distance": {4: (15, 3)},
    "set_segment_loop": {3: (8, 1), 4: (9, 1), 5: (10, 1)},
    "set_project_loop": {3: (11, 1)},
    "set_stop_mode": {4: (20, 1)},
    "set_mode4": {3: (21, 1)},
    "set_power_on_home": {3: (22, 1)},
}
STEP = {
    "set_step_distance": {4: (0, 3)},
    "set_step_direction_start": {4: (3, 1), 5: (4, 2)},
    "set_step_accel_speed": {4: (6, 2), 6: (8, 2)},
    "set_step_output": {4: (10, 1)},
    "set_step_delay": {4: (11, 3)},
    "set_step_start_input": {4: (14, 1)},
    "set_step_stop_input": {4: (15, 1)},
}


def frame(example: bytes, changes: dict[int, bytes]) -> bytes:
    """An example frame with other bytes in it, and the sum of them."""
    data = bytearray(example[:10])
    for at, value in changes.items():
        data[at : at + len(value)] = value
    return bytes(data) + bytes([sum(data) & 255])


def ask(port: int, request: bytes, count: int, patience: float = 10.0) -> bytes:
    """Send a request and read so many bytes."""
    os.write(port, request)
    data, end = b"", time.monotonic() + patience
    while len(data) < count and select.select([port], [], [], max(0.0, end - time.monotonic()))[0]:
        data += os.read(port, count - len(data))
    return data


def main(name: str, manual: str, dumps: str) -> None:
    """Write, read, save, start, wait."""
    with open(manual, encoding="utf-8") as one, open(dumps, encoding="utf-8") as other:
        rows = [(row["expected"]["command"], bytes.fromhex(row["hex"])) for row in json.load(one)]
        examples = {name: data for name, data in rows if len(data) == 11}
        replies = {name: data for name, data in rows if len(data) == 6}
        wanted = bytes.fromhex(json.load(other)[0]["hex"])  # a project of one step
    tty.setraw(port := os.open(name, os.O_RDWR | os.O_NOCTTY))
    acknowledged = 0
    for commands, start, last in ((BASE, 0, {}), (STEP, 26, {9: b"\1"})):
        for command, places in commands.items():
            values = {at: wanted[start + where :][:size] for at, (where, size) in places.items()}
            selected = {3: b"\2"} if command == "select_project" else {}
            due = bytearray(replies[command])
            due[3] *= 2 if due[2] > 3 else 1  # of project 2, the manual has 1
            acknowledged += ask(port, frame(examples[command], values | last | selected), 6) == due
    dump = ask(port, frame(examples["read_project"], {3: b"\2"}), 226)
    said = [
        ask(port, frame(examples[f"{verb}_project"], {3: b"\2"}), n).hex()
        for verb, n in (("save", 6), ("start", 8))
    ]
    same = dump[7:] == wanted[7:] and dump[3:4] == dump[6:7] == b"\2"
    print(json.dumps({"acknowledged": acknowledged, "same": same, "saved": said[0], "started": said[1]}))


main(*sys.argv[1:])
