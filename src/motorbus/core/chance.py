"""Chance that can be had again: the same seed gives the same numbers on every machine and in every Python.

Families know no random numbers of their own; a simulated device that is late or misheard by chance needs some, and
they must belong to its bus alone. So this is a generator of the plainest kind, good for jitter and for nothing that
must be secret.
"""

from __future__ import annotations

from typing import Final

_WORD: Final = (1 << 64) - 1


class Chance:
    """A stream of numbers that `seed` decides: SplitMix64 (Steele, Lea and Flood, 2014)."""

    def __init__(self, seed: int) -> None:
        self._state = seed & _WORD

    def draw(self) -> float:
        """The next number, at least 0 and less than 1."""
        self._state = self._state + 0x9E3779B97F4A7C15 & _WORD
        mixed = (self._state ^ self._state >> 30) * 0xBF58476D1CE4E5B9 & _WORD
        mixed = (mixed ^ mixed >> 27) * 0x94D049BB133111EB & _WORD
        return ((mixed ^ mixed >> 31) >> 11) / (1 << 53)
