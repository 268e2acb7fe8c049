"""Reproducible random numbers: a seed gives the same numbers on every machine and Python version.

Families use no other random numbers. A simulated bus has a generator of its own for random delays and faults. It suits
jitter, not secrets.
"""

from __future__ import annotations

from typing import Final

_WORD: Final = (1 << 64) - 1


class Chance:
    """A stream of numbers determined by `seed`: SplitMix64 (Steele, Lea and Flood, 2014)."""

    def __init__(self, seed: int) -> None:
        self._state = seed & _WORD

    def draw(self) -> float:
        """Return the next number, 0 <= number < 1."""
        self._state = self._state + 0x9E3779B97F4A7C15 & _WORD
        mixed = (self._state ^ self._state >> 30) * 0xBF58476D1CE4E5B9 & _WORD
        mixed = (mixed ^ mixed >> 27) * 0x94D049BB133111EB & _WORD
        return ((mixed ^ mixed >> 31) >> 11) / (1 << 53)
