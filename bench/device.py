"""Simulated servos on a pseudo-terminal, with exact books: `python -m bench.device FAMILY BOOKS`.

FEETECH servos, or KST servos behind an slcan adapter. Each read finds a servo at another position, so a value of an
earlier read is recognised. A late reply comes when the next request arrives, before that one's own.
Prints the path of the terminal; ends when standard input does.
"""

from __future__ import annotations

import os
import select
import struct
import sys
import tty
from pathlib import Path
from random import Random
from time import sleep

from bench.workloads import LATE_SHARE, NODES, Books, packet, position

BROADCAST, GOAL, PRESENT = 254, 42, 56
PING, READ, WRITE, SYNC_READ, SYNC_WRITE = 1, 2, 3, 0x82, 0x83
DELAY = 0.0005  # s until a reply, where some are late
STS3215 = bytes((3, 10, 0, 9, 3, 0, 0, 0, 1, 0, 0, 0xFF, 0x0F, 0, 0, 0, 0, 0, 12))  # registers 0 to 18


class Device:
    """The part that both families share: books, and replies that are held back."""

    def __init__(self, family: str, books: Books) -> None:
        self.family = family
        self.books = books
        self.held = b""
        self.overdue = b""
        self.random = Random(7)
        self.pending = b""

    def answer(self, data: bytes) -> bytes:
        """Replies to the requests that these bytes complete."""
        self.pending += data
        replies = bytearray()
        while (end := self.find_end()) is not None:
            request, self.pending = self.pending[:end], self.pending[end:]
            self.overdue, self.held = self.overdue + self.held, b""
            replies += self.reply(request)
        return bytes(replies)

    def find_end(self) -> int | None:
        """Length of the first request in `pending`; None while it is not complete."""
        raise NotImplementedError

    def reply(self, request: bytes) -> bytes:
        raise NotImplementedError

    def next_position(self, node: int) -> int:
        """Count a read; the position that it finds."""
        self.books.received[node] += 1
        return position(self.family, node, self.books.received[node])

    def or_late(self, reply: bytes) -> bytes:
        """This reply, or nothing where it is late: then it is overdue when the next request arrives."""
        if self.books.late[0] and self.random.random() < LATE_SHARE:
            self.held = reply
            return b""
        return reply


class Feetech(Device):
    """STS3215 servos: PING, READ, WRITE, SYNC READ, SYNC WRITE."""

    def __init__(self, books: Books) -> None:
        super().__init__("feetech", books)
        self.memory = {node: bytearray(STS3215) + bytearray(256 - len(STS3215)) for node in NODES}
        for node, memory in self.memory.items():
            memory[5] = node

    def find_end(self) -> int | None:
        if len(self.pending) < 4 or len(self.pending) < self.pending[3] + 4:
            return None
        return self.pending[3] + 4

    def reply(self, request: bytes) -> bytes:
        node, code, body = request[2], request[4], request[5:-1]
        if code == SYNC_READ:
            return b"".join(self.read(one, body[0], body[1]) for one in body[2:])
        if code == SYNC_WRITE:
            size = body[1]
            for at in range(2, len(body), size + 1):
                self.write(body[at], body[0], body[at + 1 : at + 1 + size])
            return b""
        if node not in self.memory:
            return b""
        if code == READ:
            return self.read(node, body[0], body[1])
        if code == WRITE:
            self.write(node, body[0], body[1:])
        return packet(node, 0) if code in (PING, WRITE) else b""

    def read(self, node: int, address: int, size: int) -> bytes:
        memory = self.memory[node]
        if address != PRESENT:
            return packet(node, 0, memory[address : address + size])
        struct.pack_into("<H", memory, PRESENT, self.next_position(node))
        return self.or_late(packet(node, 0, memory[address : address + size]))

    def write(self, node: int, address: int, data: bytes) -> None:
        self.memory[node][address : address + len(data)] = data
        if address == GOAL:
            self.books.goals[node] += int.from_bytes(data[:2], "little")


class Kst(Device):
    """SDO upload of the position (object 0x6002), the only object there is, as text of an slcan adapter."""

    def __init__(self, books: Books) -> None:
        super().__init__("kst", books)

    def find_end(self) -> int | None:
        return self.pending.find(b"\r") + 1 or None

    def reply(self, request: bytes) -> bytes:
        if request[:1] != b"t":
            return b"\r"
        node = int(request[1:4], 16) - 0x600
        if node not in NODES:
            return b""
        if request[5:13] != b"40026000":  # no such object
            return b"t%03X880%b00000206\r" % (0x580 + node, request[7:13])
        value = struct.pack("<h", self.next_position(node)).hex().upper()
        return self.or_late(f"t{0x580 + node:03X}84B026000{value}0000\r".encode())


def main() -> None:
    """Answer until standard input ends."""
    books = Books(Path(sys.argv[2]))
    device = Kst(books) if sys.argv[1] == "kst" else Feetech(books)
    master, slave = os.openpty()
    tty.setraw(slave)
    print(os.ttyname(slave), flush=True)
    while True:
        ready = select.select([master, sys.stdin], [], [])[0]
        if sys.stdin in ready:
            return
        reply = device.answer(os.read(master, 4096))
        if books.late[0]:
            os.write(master, device.overdue)
            device.overdue = b""
            sleep(DELAY)
        os.write(master, reply)


if __name__ == "__main__":
    main()
