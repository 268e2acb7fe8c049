"""Simulated buses whose line is full: what they take of a core, and how late their answers come.

Each is `motorbus simulate --pace` in a process of its own on a pseudo-terminal, with as many devices as its protocol
has ids, all of them moving; a client in this process leaves no gap on the line. The serial line carries, in turn:
goals for all 253 servos and the positions of 251 in one exchange, the positions of 30 by 30, 15 bytes of 30, single
reads. The CAN bus carries 16 requests at once, of all 127 nodes in turn, four reads for each goal.

An answer is late by what it comes after the moment at which its last bit would have passed a real wire, if the
simulator had heard the request at the very moment at which the client wrote it: the client's own wake-ups are in it,
too, and whatever else the machine does.
"""

from __future__ import annotations

import os
import tempfile
import time
import tty
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from heapq import heappop, heappush
from itertools import cycle
from pathlib import Path
from random import Random
from select import select
from typing import NamedTuple

from bench.rounds import Failed
from motorbus.core.can_bits import bits
from motorbus.core.can_frame import CanFrame
from motorbus.families.feetech import wire as feetech
from motorbus.families.kst import sdo as kst
from tests.support.processes import Simulated

RATE = 1_000_000
BYTE = 10 / RATE
WINDOW = 16
TURNAROUND = 100e-6
"""s after which a simulated KST servo answers, as its switch `turnaround` says."""
SERVOS, NODES = range(1, 254), range(1, 128)
_GOAL, _POSITION = 42, 56
_READ, _TARGET = 0x6002, 0x6003
_PATIENCE = 10.0


class Filled(NamedTuple):
    """What a simulator took while its line was full.

    `core`  s of processor time for each s; `wire` the share of the time that something was on the wire
    `late`  s by which each answer was late, in order of size
    """

    core: float
    wire: float
    late: tuple[float, ...]


class Lost(Failed):
    """An answer did not come, or another one."""


class Exchange(NamedTuple):
    """What is written at once, and how many bytes each packet of the answer has."""

    request: bytes
    answers: tuple[int, ...]


def share(ordered: Sequence[float], part: float) -> float:
    """The figure that this part of them does not exceed. Raises ValueError when there are none."""
    if not ordered:
        raise ValueError("there are no figures")
    return ordered[round(part * (len(ordered) - 1))]


def exchanges(random: Random) -> list[Exchange]:
    """What a serial line carries in turn; the goals lie anywhere, so that nobody ever rests."""
    ids = list(SERVOS)
    groups = [ids[begin : begin + 35] for begin in range(0, len(ids), 35)]
    goals = b"".join(_goals(group, random) for group in groups)
    found = [Exchange(goals + _sync_read(ids[:251], 2), (8,) * 251)]
    found += [Exchange(_sync_read(ids[begin : begin + 30], 2), (8,) * 30) for begin in range(0, 240, 30)]
    found += [Exchange(_sync_read(ids[begin : begin + 30], 15), (21,) * 30) for begin in range(0, 90, 30)]
    single = [feetech.frame(id, feetech.Instruction.READ, bytes((_POSITION, 2))) for id in ids[::25]]
    return found + [Exchange(request, (8,)) for request in single]


def serial(seconds: float, seed: int = 1) -> Filled:
    """253 FEETECH servos at 1 Mbit/s for so long, and until 251 of them have told their position.

    Raises Lost, and MotorbusError when they do not start.
    """
    random = Random(seed)
    turns = cycle([one for _ in range(10) for one in exchanges(random)])
    with _simulated("feetech", "1-253", {}) as (port, pid):
        late: list[float] = []
        used, began, carried = processor_time(pid), time.monotonic(), 0
        while not late or time.monotonic() < began + seconds:
            one = next(turns)
            late += _late(port, one)
            carried += len(one.request) + sum(one.answers)
        took = time.monotonic() - began
        return Filled((processor_time(pid) - used) / took, carried * BYTE / took, tuple(sorted(late)))


def _late(port: int, one: Exchange) -> list[float]:
    due = time.monotonic() + len(one.request) * BYTE
    os.write(port, one.request)
    late: list[float] = []
    have = passed = 0
    for size in one.answers:
        passed += size
        while have < passed:
            have += len(_read(port))
            now = time.monotonic()
        late.append(now - due - passed * BYTE)
    if have != passed:
        raise Lost(f"{have} bytes came instead of {passed}")
    return late


def frames(random: Random) -> Iterator[CanFrame]:
    """Requests to all nodes in turn, without end."""
    while True:
        for node in NODES:
            goal = random.randrange(-900, 900).to_bytes(2, "little", signed=True)
            yield kst.encode_download(node, _TARGET, 0, goal + bytes(2))
        for _ in range(4):
            yield from (kst.encode_upload(node, _READ) for node in NODES)


def can(seconds: float, seed: int = 1) -> Filled:
    """127 KST nodes at 1 Mbit/s for so long, over slcan, and until each was asked.

    Raises Lost, and MotorbusError when they do not start.
    """
    rate = str(RATE)
    with _simulated("kst", "1-127", {"bit-rate": rate, "bitrate": rate}) as (port, pid):
        os.write(port, b"S8\rO\r")
        _await(port, b"\r\r")
        used, began = processor_time(pid), time.monotonic()
        sent, heard = _flooded(port, frames(Random(seed)), began + seconds)
        took = time.monotonic() - began
        carried = sum(bits(frame) for _, frame in [*sent, *heard]) / RATE
        planned = passages([(at, bits(frame)) for at, frame in sent], [bits(frame) for _, frame in heard])
        late = sorted(at - due for (at, _), due in zip(heard, planned, strict=True))
        return Filled((processor_time(pid) - used) / took, carried / took, tuple(late))


Log = list[tuple[float, CanFrame]]


def _flooded(port: int, requests: Iterator[CanFrame], until: float) -> tuple[Log, Log]:
    """So many requests under way at once, and when each of them was sent and each reply came."""
    sent: Log = []
    heard: Log = []
    half = b""
    while (filling := time.monotonic() < until or len(sent) < len(NODES)) or len(heard) < len(sent):
        if filling and len(sent) - len(heard) < WINDOW:
            batch = [next(requests) for _ in range(WINDOW - len(sent) + len(heard))]
            os.write(port, b"".join(b"t%03X8%b\r" % (one.id, one.data.hex().encode()) for one in batch))
            sent += [(time.monotonic(), one) for one in batch]
        *lines, half = (half + _read(port)).split(b"\r")
        now = time.monotonic()
        replies = [line for line in lines if line[:1] == b"t"]
        heard += [(now, CanFrame(int(line[1:4], 16), bytes.fromhex(line[5:].decode()))) for line in replies]
    for (_, request), (_, reply) in zip(sent, heard, strict=True):
        if reply.id - kst.REPLY != request.id - kst.REQUEST or reply.data[0] & 0x80:
            raise Lost(f"{request} was answered by {reply}")
    return sent, heard


def passages(
    requests: list[tuple[float, int]], replies: list[int], turnaround: float = TURNAROUND
) -> list[float]:
    """When the last bit of each reply has passed one wire, if each request has it as soon as it is free.

    `requests` are moment (s) and bits of each, `replies` the bits of each; a reply is ready so long after its request.
    """
    waiting = deque(requests)
    ready: list[tuple[float, int]] = []
    free, passed, number = 0.0, [0.0] * len(replies), 0
    while waiting or ready:
        if not ready or (waiting and waiting[0][0] <= ready[0][0]):
            at, size = waiting.popleft()
            free = max(at, free) + size / RATE
            heappush(ready, (free + turnaround, number))
            number += 1
        else:
            at, which = heappop(ready)
            free = passed[which] = max(at, free) + replies[which] / RATE
    return passed


def processor_time(pid: int) -> float:
    """Seconds that a process has had a processor so far; Linux tells it in ns."""
    return int(Path(f"/proc/{pid}/schedstat").read_text(encoding="ascii").split()[0]) / 1e9


def _goals(group: list[int], random: Random) -> bytes:
    speed = (300).to_bytes(2, "little")
    items = [bytes((id,)) + random.randrange(4096).to_bytes(2, "little") + bytes(2) + speed for id in group]
    parameters = bytes((_GOAL, 6)) + b"".join(items)
    return feetech.frame(feetech.BROADCAST, feetech.Instruction.SYNC_WRITE, parameters)


def _sync_read(ids: list[int], count: int) -> bytes:
    return feetech.frame(feetech.BROADCAST, feetech.Instruction.SYNC_READ, bytes((_POSITION, count, *ids)))


@contextmanager
def _simulated(family: str, ids: str, more: dict[str, str]) -> Iterator[tuple[int, int]]:
    """The open port of a paced simulation, and the process that serves it."""
    with tempfile.TemporaryDirectory() as folder:
        link = Path(folder) / "port"
        with Simulated(family, ids=ids, link=link, pace=True, **more) as simulated:
            port = os.open(link, os.O_RDWR | os.O_NOCTTY)
            try:
                tty.setraw(port)
                yield port, simulated.ready["pid"]
            finally:
                os.close(port)


def _read(port: int) -> bytes:
    if not select([port], [], [], _PATIENCE)[0]:
        raise Lost("an answer did not come")
    return os.read(port, 1 << 14)


def _await(port: int, end: bytes) -> None:
    said = b""
    while not said.endswith(end):
        said += _read(port)


def told(found: Filled) -> str:
    """In a line: core, wire, lateness."""
    late = ", ".join(f"{name} {share(found.late, part) * 1e6:.0f}" for name, part in PARTS)
    return (
        f"{found.core:.1%} of a core, wire {found.wire:.1%} full, {len(found.late)} answers late by {late} µs"
    )


PARTS = (("50 %", 0.5), ("99 %", 0.99), ("99.9 %", 0.999), ("all", 1.0))
"""Which parts of the answers are told of."""
LINES: tuple[tuple[str, Callable[[float], Filled]], ...] = (
    ("253 FEETECH servos at 1 Mbaud", serial),
    ("127 KST nodes at 1 Mbit/s", can),
)
"""What is measured, by the name that the tables give it."""
