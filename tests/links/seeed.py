"""Nodes 1 and 3 behind a USB-CAN-A adapter, which python-can calls `seeedstudio`, on a pseudo-terminal.

    python -m tests.links.seeed [PERIOD]

Prints the name of the terminal. Node 1 is at 10 deg. Node 2 sends a heartbeat each PERIOD (s), by default 0.05.
"""

from __future__ import annotations

import os
import pty
import select
import struct
import sys
import time
import tty

OBJECTS = {
    0x3000: b"\x4f\x01\0\0",
    0x6002: b"\x4b\x64\0\0",
    0x1009: b"\x43",
    0x100A: b"\x431.00",
}
"""Specifier and value of the replies of node 1, by index."""


def main(period: float) -> None:
    """Serve until the process is ended."""
    master, slave = pty.openpty()
    tty.setraw(master)
    tty.setraw(slave)
    print(os.ttyname(slave), flush=True)
    text, due = b"", time.monotonic()

    def send(identifier: int, data: bytes) -> None:
        os.write(master, bytes((0xAA, 0xC0 | len(data))) + struct.pack("<H", identifier) + data + b"\x55")

    while True:
        if select.select([master], [], [], max(0.0, due - time.monotonic()))[0]:
            text += os.read(master, 4096)
            while len(text) > 1:
                if text[0] != 0xAA:
                    text = text[1:]
                    continue
                size = 20 if text[1] == 0x55 else 5 + (text[1] & 15)
                if len(text) < size:
                    break
                frame, text = text[:size], text[size:]
                index = int.from_bytes(frame[5:7], "little")
                if frame[1] == 0x55 or frame[2:4] != b"\x01\x06" or frame[4] != 0x40:
                    continue
                if index in OBJECTS:
                    found = OBJECTS[index]
                    send(0x581, (found[:1] + frame[5:8] + found[1:]).ljust(8, b"\0"))
                else:
                    send(0x581, b"\x80" + frame[5:8] + b"\0\0\x02\x06")
        if time.monotonic() >= due:
            send(0x702, b"\x05")
            due += period


if __name__ == "__main__":
    main(float(sys.argv[1]) if sys.argv[1:] else 0.05)
