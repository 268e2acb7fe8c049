"""The faults of a simulation that is served: set before, changed and looked at while it runs.

The wire suffers at the course of the mount, devices and ports in a `World`.
"""

from __future__ import annotations

import secrets
from collections import deque
from operator import itemgetter
from typing import Any, Final

from motorbus.errors import RequestError
from motorbus.link.base import PerfectLine
from motorbus.simulation.faults import Fault, FaultyLine, Script, World
from motorbus.simulation.faults.script import requested
from motorbus.simulation.faults.struck import on_a_wire
from motorbus.simulation.mount import Mount

SCHEMA: Final = "motorbus.simulator-script/1"
KEPT: Final = 1000
"""So many of the latest that happened are kept, and twice as many at most."""
TOLD: Final = 20
"""So many of them are told at once."""
MOST: Final = 5
"""Lines in a second for whoever watches; what is beyond is counted."""
LONGEST: Final = 64 << 10
"""Bytes of a script that are told as a flag: Linux takes 128 KiB as one argument, and half of that is far from it."""
IN_A_FILE: Final = "--faults FILE, where FILE holds what is told as `script`: it is too long for a flag"
NEWS: Final = 100
"""Lines about scripts that have come and gone that wait for somebody to read them; the latest ones."""


class Faulted:
    """What goes wrong on a mount, whose simulator is this world. `count` tells how much has happened."""

    def __init__(self, mount: Mount, world: World) -> None:
        self._mount = mount
        self._world = world
        self._began = world.now
        self._line = FaultyLine(most=KEPT)
        self._script = Script()
        self._before = self._seen = self._left = 0
        self._since = 0.0
        self._room = MOST
        self._sets = 0
        self._set_at = world.now
        self._news: deque[str] = deque(maxlen=NEWS)
        world.why = mount.fixed
        world.port = None if world.why else mount

    @property
    def count(self) -> int:
        """How many faults have happened, under all scripts."""
        return self._before + self._line.count

    @property
    def script(self) -> Script:
        """What is set, with its seed where chance decides anything."""
        return self._script

    @property
    def used(self) -> bool:
        """Whether there was ever a script."""
        return self._sets > 1 or bool(self._script)

    def set(self, script: Script | str) -> None:
        """Let this happen from now on, in place of what was set; moments count from now.

        A script that leaves anything to chance and says no seed gets one. What came of the one before, and that seed,
        is in `news`. Raises RequestError for a bad script, and for what cannot happen here; what was set goes on then.
        """
        given = requested(script)
        if given.by_chance:
            given = given.seeded(secrets.randbelow(1 << 32))
        if given.faults and self._mount.real:
            raise on_a_wire(self._mount.real)
        ended = self._ended()  # before the world forgets
        line = FaultyLine(given, self._world, most=KEPT)
        self._news += ended
        self._sets, self._set_at = self._sets + 1, self._world.now
        self._left += self.count - self._seen
        self._before = self._seen = self.count
        self._mount.line = line if len(given) else PerfectLine()
        self._line, self._script = line, given
        if given.by_chance:
            self._news.append(f"faults: seed {given.seed}")

    def facts(self) -> dict[str, Any]:
        """What is set, what has happened and what has not, as plain data; times in s from the beginning."""
        fired = self._fired(TOLD)
        pending = [str(fault) for fault in self._line.pending]
        never = [str(fault) for fault in self._line.never]
        return {
            "schema": SCHEMA,
            "simulated": True,
            "script": self._script.line,
            "seed": self._script.seed,
            "exchange": self._line.exchange,
            "count": self.count,
            "fired": [{"at": round(at - self._began, 6), "fault": fault} for at, fault in fired],
            "pending": pending[:TOLD],
            "pending_count": len(pending),
            "never": never[:TOLD],
            "never_count": len(never),
            "again": self._again,
        }

    def news(self) -> list[str]:
        """What is to be said of scripts since the last call: the seed of a new one, what came of the one before."""
        said = list(self._news)
        self._news.clear()
        return said

    def remarks(self, now: float) -> list[str]:
        """What is to be shown of what has happened since the last call, at this moment (s); not too many of them."""
        found: list[str] = []
        if now - self._since >= 1.0:
            found += self.rest()
            self._since, self._room = now, MOST
        fresh = self.count - self._seen
        if fresh:
            self._seen += fresh
            shown = self._fired(fresh)[: self._room]
            found += [f"{at - self._began:9.3f} s  fault: {fault}" for at, fault in shown]
            self._room -= len(shown)
            self._left += fresh - len(shown)
        return found

    def _fired(self, most: int) -> list[tuple[float, str]]:
        """The latest so many, with their moments; those of one moment in the order in which they happened."""
        latest = [(one.at, one.fault) for one in self._line.fired[-most:]]
        return sorted(latest, key=itemgetter(0))

    def rest(self) -> list[str]:
        """How many have not been shown; nothing when none."""
        left, self._left = self._left, 0
        return [f"… and {left} more faults"] if left else []

    def replay(self) -> str:
        """How to have all of it again; "" when nothing happened.

        That is said of chance, which has a seed, and of a script that was set later, which no command line holds.
        """
        if not self.count:
            return ""
        latest = self.count - self._before
        how = f"faults: {self.count} happened"
        if self._before and latest:
            how += f", {latest} of them by the latest script"
        if self._script.by_chance and latest:
            how += f", by the seed {self._script.seed}"
        if latest and (self._script.by_chance or self._sets > 1):
            how += f"; the same again: {self._again}"
        return how

    @property
    def _again(self) -> str:
        """The flag that sets the same script, or how to where that is too long for one; "" for none."""
        line = self._script.line
        if len(line.encode()) > LONGEST:
            return IN_A_FILE
        return f"--faults '{line}'" if self._script else ""

    def _ended(self) -> list[str]:
        """What came of a script that another takes the place of."""
        return [*([self.replay()] if self.count > self._before else []), *self.unhappened()]

    def unhappened(self) -> list[str]:
        """A line for each fault of the latest script that has not happened, and what there was; not too many."""
        found = [
            f"faults: `{fault}` has not happened ({self._why(fault)})"
            for fault in (*self._line.pending, *self._line.never)
        ]
        beyond = len(found) - TOLD
        return [*found[:TOLD], *([f"faults: … and {beyond} more have not happened"] if beyond > 0 else [])]

    def _why(self, fault: Fault) -> str:
        """What there was while it did not happen."""
        passed = self._world.now - self._set_at
        if fault in self._world.armed:
            return "nothing was stored since that could be torn"
        if fault.moment is not None and fault.moment <= passed:
            return "its moment has passed, and nothing came since that it could change"
        if fault.moment is not None:
            return f"{passed:.1f} s have passed"
        if fault.exchange is not None and fault.exchange < self._line.exchange:
            return f"exchange {fault.exchange} has passed, and nothing was in it that this could change"
        seen = self._line.exchange
        return f"{seen} exchange{' was' if seen == 1 else 's were'} seen"


def read_order(faults: Faulted | None, text: str) -> dict[str, Any] | None:
    """Carry out an order of a control socket: a script, `off`, or nothing, which asks for the facts.

    Raises RequestError as `Faulted.set` does, for a script without a fault, and where a simulation takes no faults.
    """
    if faults is None:
        raise RequestError("this simulation takes no faults")
    if not text:
        return faults.facts()
    faults.set("" if text == "off" else text)
    return None
