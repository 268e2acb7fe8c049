"""What leaves the device, one thing after the other, as faults let it.

A serial line has one sender at this end: a notice that is due while a dump is on its way comes behind it. How long a
byte takes is the affair of the link or the port, as of every simulated device: on one without pace it takes no time.
"""

from __future__ import annotations

from heapq import heappop, heappush
from itertools import count

from motorbus.families.stepper import wire
from motorbus.families.stepper.simulator.harm import Harm
from motorbus.families.stepper.simulator.switches import Switches


class Line:
    """Everything that is to be said, in the order of its moments."""

    def __init__(self, switches: Switches, harm: Harm) -> None:
        self._harm = harm
        self._voices: list[tuple[float, int, bytes]] = []
        self._order = count()
        self._held = 0
        self.change(switches)

    def change(self, switches: Switches) -> None:
        """From now on as these say; a notice that is held back comes with the next reply then, if not with a dump."""
        self._delay = switches.fault_time
        self._for_dumps = switches.notice_fault == "inside_dump"

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
        """The host has sent this: some of it may come back, and not from the device."""
        if back := self._harm.echoed(data, at):
            self._push(at, back)

    def notice(self, at: float) -> None:
        """A project has ended."""
        fault = self._harm.of_notice()
        if fault in ("early", "inside_dump"):
            self._held += 1
        elif fault != "lost":
            for _ in range(2 if fault == "doubled" else 1):
                self._say(at + self._delay if fault == "late" else at, wire.NOTICE)

    def spurious(self, at: float) -> None:
        """A notice that nothing has caused; no fault of notices meets it."""
        self._say(at, wire.NOTICE)

    def reply(self, data: bytes, at: float) -> None:
        """A reply, or a dump, is ready."""
        dump = len(data) == wire.DUMP_LENGTH
        held, self._held = self._held, self._held if self._for_dumps and not dump else 0
        if dump:
            data = self._harm.of_dump(data)
        for _ in range(held - self._held):
            if self._for_dumps:
                data = self._harm.with_notice(data)
            else:
                self._say(at, wire.NOTICE)
        for late, piece in self._harm.of_reply(data):
            self._say(at + late, piece)

    def _say(self, when: float, data: bytes) -> None:
        self._push(when, self._harm.spoken(data))

    def _push(self, when: float, data: bytes) -> None:
        heappush(self._voices, (when, next(self._order), data))
