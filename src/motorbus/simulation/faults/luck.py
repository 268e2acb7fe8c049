"""Chance, one number for each strike and not one for each byte: how much passes before the next one is drawn instead.

So a line on which one byte in a thousand suffers costs hardly more than a perfect one, and a fault that is taken out of
a script leaves the chance of all others as it was.
"""

from __future__ import annotations

from math import floor, log, log1p
from random import Random
from typing import Final

from motorbus.simulation.faults.fault import Fault


def chance(fault: Fault, seed: int, twin: int = 0) -> Random:
    """What decides what a fault leaves open: another stream for each fault, and for the `twin`th of equal ones."""
    return Random(f"{seed} {fault} {twin}")


_LEAST: Final = 1e-300
"""A chance below this is never: what passes until then would be more than a number can say."""


class Luck:
    """When a fault by chance strikes, and what it is then.

    `index` is its place in the script, `twin` how many equal ones stand before it. `random` decides the rest of it.
    """

    def __init__(self, fault: Fault, seed: int, *, index: int, twin: int = 0) -> None:
        self.fault = fault
        self.index = index
        self.random = chance(fault, seed, twin)
        self._chance = max(fault.percent / 100, _LEAST)
        self._left = self._gap()

    def strikes(self, size: int) -> list[int]:
        """At which of the next so many (bytes, or one packet) it strikes."""
        found: list[int] = []
        while self._left < size:
            found.append(self._left)
            self._left += 1 + self._gap()
        self._left -= size
        return found

    def _gap(self) -> int:
        """How many pass unharmed before the next one."""
        if self._chance >= 1:
            return 0
        return floor(log(1 - self.random.random()) / log1p(-self._chance))
