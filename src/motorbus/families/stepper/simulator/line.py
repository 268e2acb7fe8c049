"""What leaves the device, one thing after the other, and what faults make of it.

A serial line has one sender at this end: a notice that is due while a dump is on its way comes behind it. How long a
byte takes is the affair of the link or the port, as of every simulated device: on one without pace it takes no time.
Faults are not by chance. The so-many-th reply is hit, always in the same way, so a test that fails fails again.
"""

from __future__ import annotations

from heapq import heappop, heappush
from itertools import count
from typing import Final

from motorbus.families.stepper import wire
from motorbus.families.stepper.simulator.switches import Switches

NOISE: Final = b"\x00\x55\xff"
"""What comes before a reply with reply_fault=noise; its end might begin a header."""
OTHER: Final = bytes.fromhex("FFAA030D0000")
"""The reply that stands for one to another command."""


class Line:
    """Everything that is to be said, in the order of its moments."""

    def __init__(self, switches: Switches) -> None:
        self._switches = switches
        self._voices: list[tuple[float, int, bytes]] = []
        self._order = count()
        self._replies = 0
        self._held = 0

    def due(self) -> float:
        """When the next thing begins; infinity when there is none."""
        return self._voices[0][0] if self._voices else float("inf")

    def speak(self, to: float) -> list[tuple[float, bytes]]:
        """Everything that begins up to this moment, with its own."""
        said = []
        while self.due() <= to:
            begin = self.due()
            said.append((begin, heappop(self._voices)[2]))
        return said

    def hush(self) -> None:
        """The supply is gone, and what was to be said with it."""
        self._voices.clear()
        self._held = 0

    def echo(self, data: bytes, at: float) -> None:
        """What the host has sent comes back."""
        self._say(at, data)

    def notice(self, at: float) -> None:
        """A project has ended."""
        fault = self._switches.notice_fault
        if fault == "early":
            self._held += 1
        elif fault != "lost":
            for _ in range(2 if fault == "doubled" else 1):
                self._say(at, wire.NOTICE)

    def reply(self, data: bytes, at: float) -> None:
        """A reply, or a dump, is ready."""
        for _ in range(self._held):
            self._say(at, wire.NOTICE)
        self._held = 0
        self._replies += 1
        fault = self._switches.reply_fault if self._replies % self._switches.fault_every == 0 else "none"
        data = self._cut(data)
        late = at + self._switches.fault_time
        if fault == "split":
            self._say(at, data[:3])
            self._say(late, data[3:])
        elif fault != "lost":
            self._say(late if fault == "late" else at, self._spoilt(data, fault))

    def _cut(self, data: bytes) -> bytes:
        if len(data) == wire.DUMP_LENGTH:
            if self._switches.dump_fault == "short":
                return data[:113]
            if self._switches.dump_fault == "byte":
                return data[:60] + data[61:]
        return data

    def _spoilt(self, data: bytes, fault: str) -> bytes:
        if fault == "noise":
            return NOISE + data
        if fault == "other":
            return OTHER if data[:4] != OTHER[:4] else OTHER[:3] + b"\x0c" + OTHER[4:]
        if fault == "bit":
            at = self._replies % wire.REPLY_LENGTH
            return data[:at] + bytes((data[at] ^ 1 << self._replies % 8,)) + data[at + 1 :]
        return data

    def _say(self, when: float, data: bytes) -> None:
        heappush(self._voices, (when, next(self._order), data))
