"""Two bytes of one reply changed at once: an 8-bit sum lets pass what arithmetic says, and two readings nothing.

The bound is worked out in `chance.py` from the form of a reply. The line of the test is what chance exceeds one time in
a thousand; that many pass at all shows that the faults are real.
"""

from __future__ import annotations

from random import Random

import pytest

from motorbus.core.operation import Data
from motorbus.errors import MotorbusError
from motorbus.families.feetech import Servo
from motorbus.link.base import Delivery, PerfectLine, Side
from tests.conftest import Figures, Rounds
from tests.faults.chance import expected_of_bits, poisson_line, share_of_pairs
from tests.faults.rig import Rig, read_word

WORD = 2
SHORT, LONG = 8, 9
"""Bytes of the two forms of the reply to a read of one word, which take turns."""


class Pairs(PerfectLine):
    """Changes two bytes of the next reply that is `due`, by lot; `bits` only one bit of each. `fired` counts them."""

    def __init__(self, seed: int, *, bits: bool = False) -> None:
        self.random = Random(seed)
        self.bits = bits
        self.due = False
        self.fired = 0
        self.lengths = {SHORT: 0, LONG: 0}
        self.expected = 0.0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if self.due and sender is Side.DEVICE:
            self.due = False
            data = self._struck(bytes(data))  # type: ignore[arg-type]  # never a frame
        return super().carry(sender, data, at)

    def _struck(self, reply: bytes) -> bytes:
        self.fired += 1
        self.lengths[len(reply)] += 1
        if self.bits:
            share = 2 / len(reply) / (len(reply) - 1)
            self.expected += expected_of_bits(reply, WORD, 1e-9) / 1e-18 * share
        harmed = bytearray(reply)
        for place in self.random.sample(range(len(reply)), 2):
            harmed[place] ^= 1 << self.random.randrange(8) if self.bits else self.random.randrange(1, 256)
        return bytes(harmed)


def suffered(line: Pairs, total: int) -> int:
    """How many of so many reads, each with its first reply struck, told a wrong position. Each one behind is right."""
    rig = Rig(line, ids=(1,))
    wrong = 0
    for _ in range(total):
        line.due = True
        try:
            read_word(rig)
        except AssertionError:
            wrong += 1
            rig.link.advance(0.05)
        assert not line.due, "it did not happen"
        read_word(rig)
    assert line.fired == total
    return wrong


@pytest.mark.timeout(3600)
def test_l3_two_changed_bytes_pass_as_often_as_arithmetic_says(rounds: Rounds, figures: Figures) -> None:
    line = Pairs(21)
    total = rounds(1_000_000, 1_200)
    wrong = suffered(line, total)
    expected = sum(share_of_pairs(length, WORD) * number for length, number in line.lengths.items())
    figures(
        "L3 two changed bytes in one reply, unconfirmed",
        family="feetech", seed=21, pairs=total, expected=round(expected, 1), wrong=wrong, line=poisson_line(expected),
    )  # fmt: skip
    assert wrong <= poisson_line(expected)
    assert wrong >= expected - 4 * expected**0.5, "so few that the faults are none"


@pytest.mark.timeout(3600)
def test_l4_two_turned_bits_pass_as_often_as_arithmetic_says(rounds: Rounds, figures: Figures) -> None:
    line = Pairs(22, bits=True)
    total = rounds(1_000_000, 2_000)
    wrong = suffered(line, total)
    figures(
        "L4 two turned bits in one reply, unconfirmed",
        family="feetech", seed=22, pairs=total, expected=round(line.expected, 1), wrong=wrong,
        line=poisson_line(line.expected),
    )  # fmt: skip
    assert wrong <= poisson_line(line.expected)
    assert wrong >= line.expected - 4 * line.expected**0.5 > 0, "so few that the faults are none"


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("bits", [False, True])
def test_l3_l4_confirmed_no_double_fault_passes(bits: bool, rounds: Rounds, figures: Figures) -> None:
    """Each first reply of two that are to agree is struck."""
    line = Pairs(23, bits=bits)
    rig = Rig(line, ids=(1,))
    servo = Servo(rig.bus, 1)
    servo.prepare()
    total = rounds(500_000, 500)
    failed = wrong = 0
    for _ in range(total):
        raw = rig.stir()
        line.due = True
        try:
            told = servo.position(confirmed=True)
        except MotorbusError:
            failed += 1
            continue
        assert servo.table is not None
        wrong += servo.table["present_position"].to_raw(told) != raw
    assert line.fired == total
    figures(
        f"L3 L4 two {'turned bits' if bits else 'changed bytes'} in one reply, confirmed",
        family="feetech", seed=23, pairs=line.fired, wrong=wrong, failed=failed,
    )  # fmt: skip
    assert (wrong, failed) == (0, 0)
