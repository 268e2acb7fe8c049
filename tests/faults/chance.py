"""How many damaged replies an 8-bit sum lets pass, worked out and not tuned; and the line between chance and a fault.

A FEETECH reply is FF FF, id, length, error, data, sum. Header, id and length are compared whole, so damage can only
pass in what is behind them: where the changes of two bytes add up to nothing. It makes a wrong value where one of the
two is a byte of that value.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, count
from math import exp, lgamma, log

FREE = 4
"""Bytes in front that are compared whole."""
ERROR = 4
"""The place of the error byte; the value begins behind it."""


def passing(length: int, size: int) -> list[tuple[int, int]]:
    """The pairs of bytes in a reply of so many bytes whose damage may make a wrong value of so many bytes."""
    value = range(ERROR + 1, ERROR + 1 + size)
    return [pair for pair in combinations(range(FREE, length), 2) if pair[0] in value or pair[1] in value]


def share_of_pairs(length: int, size: int) -> float:
    """Of two changed bytes anywhere in it, the share that makes a wrong value.

    Whatever the change of the one, of the 255 of the other exactly one makes up for it.
    """
    pairs = len(list(combinations(range(length), 2)))
    return len(passing(length, size)) / pairs / 255


def expected_of_bytes(length: int, size: int, probability: float) -> float:
    """Wrong values in one reply each byte of which becomes another one with this probability; three are left out."""
    return len(passing(length, size)) / 255 * probability**2 * (1 - probability) ** (length - 2)


def expected_of_bits(reply: bytes, size: int, probability: float) -> float:
    """The same where one bit of each byte turns over with this probability: it depends on what the bits are."""
    cancel = 0
    for one, other in passing(len(reply), size):
        cancel += sum((a + b) % 256 == 0 for a in turned(reply[one]) for b in turned(reply[other]))
    return cancel / 64 * probability**2 * (1 - probability) ** (len(reply) - 2)


def turned(byte: int) -> Iterator[int]:
    """By how much each of its bits changes it."""
    return ((byte ^ 1 << bit) - byte for bit in range(8))


def poisson_line(expected: float, certainty: float = 0.999) -> int:
    """So many are chance where so many are expected; more is a fault of ours, but for one time in a thousand."""
    if not expected:
        return 0
    reached = 0.0
    for (
        number
    ) in count():  # each by itself: where many are expected exp(-expected) cannot be told from nothing
        reached += exp(number * log(expected) - expected - lgamma(number + 1))
        if reached >= certainty:
            return number
    raise AssertionError
