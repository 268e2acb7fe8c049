"""Rows L3, L4 and L7: damage and lateness by chance, 10^6 times, and what no fault touched is right at its first try.

FEETECH replies have an 8-bit sum, so a few wrong values are arithmetic (`chance.py`), and the test fails beyond what
chance exceeds once in a thousand. What is confirmed, and what late replies bring, is never wrong.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import pytest

from motorbus.errors import MotorbusError
from motorbus.families.feetech import Servo, wire
from motorbus.simulation.faults import FaultyLine
from tests.conftest import Figures, Rounds
from tests.faults.chance import expected_of_bits, expected_of_bytes, poisson_line
from tests.support.catalogue.kst import KstRig
from tests.support.rigs.feetech import Rig, read_word
from tests.support.single_faults import tried_again

WORD = 2
SHARE = 0.01
LONGEST = 0.6
"""s: three tries, their quiet times and probes; held up once by a late reply."""
KEPT = 100
"""Of the faults that have happened, the line keeps so many to show."""


class Ledger:
    """Calls one after the other on a line with faults: what became of each, and of those that none struck."""

    def __init__(self, rig: Rig | KstRig, script: str) -> None:
        self.rig = rig
        self.line = FaultyLine(script, most=KEPT)
        rig.put(self.line)
        self.calls = self.good = self.wrong = self.failed = 0
        self.untouched = self.untouched_again = 0
        self.longest = 0.0

    def call(self, act: Callable[[], object]) -> None:
        """`act` raises AssertionError for what is wrong, MotorbusError when it fails honestly."""
        link, faults, again = self.rig.link, self.line.count, tried_again(self.rig.bus)
        began = link.now()
        # what is late strikes the call in which it arrives
        held = any(at > began for at, *_ in link._under_way)
        self.calls += 1
        try:
            act()
            self.good += 1
        except AssertionError:
            self.wrong += 1
            assert held or self.line.count > faults, "it was wrong, and nothing had struck it"
        except MotorbusError:
            self.failed += 1
            assert held or self.line.count > faults, "it failed, and nothing had struck it"
        self.longest = max(self.longest, link.now() - began)
        if not held and self.line.count == faults:
            self.untouched += 1
            self.untouched_again += tried_again(self.rig.bus) > again

    def told(self) -> dict[str, int | float | str]:
        """For the table of figures."""
        return {
            "faults": self.line.count,
            "wrong": self.wrong,
            "failed": self.failed,
            "untouched": self.untouched,
            "untouched_again": self.untouched_again,
            "longest_s": round(self.longest, 3),
        }


def mean(model: Callable[[bytes], float]) -> float:
    """Of this, over many positions, and both lengths that the replies to a read of one word take turns with."""
    raws = [17 + number * 7919 % 4000 for number in range(500)]
    words = [raw.to_bytes(2, "little") for raw in raws]
    replies = [wire.encode_status(1, 0, word + more) for word in words for more in (b"", b"\0")]
    return sum(map(model, replies)) / len(replies)


def damaged(what: str, total: int, expected: float) -> Ledger:
    """So many reads on a line that does this to 1 % of all bytes toward the host."""
    rig = Rig(ids=(1,))
    ledger = Ledger(rig, f"seed 11; 1% of bytes to host: {what}")
    for _ in range(total):
        ledger.call(lambda: read_word(rig))
    tries = total + tried_again(rig.bus)
    assert ledger.line.count > 0.05 * total
    assert ledger.wrong <= poisson_line(expected * tries)
    assert ledger.untouched > 0.85 * total
    assert ledger.untouched_again == 0, "what no fault struck needed a second try"
    assert ledger.longest < LONGEST
    return ledger


@pytest.mark.timeout(7200)
def test_l3_one_byte_in_a_hundred_is_another_one(rounds: Rounds, figures: Figures) -> None:
    """Expected are 2.2 wrong positions in 10^6 reads."""
    total = rounds(1_000_000)
    expected = mean(lambda reply: expected_of_bytes(len(reply), WORD, SHARE))
    assert 2.1 < expected * 1e6 < 2.3
    ledger = damaged("corrupt", total, expected)
    assert ledger.wrong <= 8
    figures(
        "L3 two-byte reads, 1 % of bytes changed, unconfirmed",
        family="feetech", seed=11, reads=total, expected=round(expected * total, 2), **ledger.told(),
    )  # fmt: skip


@pytest.mark.timeout(7200)
def test_l4_one_bit_in_eight_hundred_is_turned(rounds: Rounds, figures: Figures) -> None:
    """Expected are about 37 wrong positions in 10^6 reads."""
    total = rounds(1_000_000)
    expected = mean(lambda reply: expected_of_bits(reply, WORD, SHARE))
    ledger = damaged("flip", total, expected)
    assert ledger.wrong <= 57
    figures(
        "L4 two-byte reads, bits turned at a rate of 0.125 %, unconfirmed",
        family="feetech", seed=11, reads=total, expected=round(expected * total, 2), **ledger.told(),
    )  # fmt: skip


@pytest.mark.timeout(7200)
@pytest.mark.parametrize(("row", "what"), [("L3", "corrupt"), ("L4", "flip")])
def test_l3_l4_confirmed_nothing_is_wrong(row: str, what: str, rounds: Rounds, figures: Figures) -> None:
    """Read until two readings in a row agree: 10^6 readings and more."""
    total = rounds(500_000, 1_000)
    rig = Rig(ids=(1,))
    servo = Servo(rig.bus, 1)
    servo.prepare()
    assert servo.table is not None
    to_raw = servo.table["present_position"].to_raw
    ledger = Ledger(rig, f"seed 12; 1% of bytes to host: {what}")
    before = rig.bus.statistics.of(1).sent

    def confirmed() -> None:
        raw = rig.stir()
        assert to_raw(servo.position(confirmed=True)) == raw

    for _ in range(total):
        ledger.call(confirmed)
    sent = rig.bus.statistics.of(1).sent - before
    figures(
        f"{row} positions confirmed by two readings, 1 % of bytes struck ({what})",
        family="feetech", seed=12, positions=total, exchanges=sent, **ledger.told(),
    )  # fmt: skip
    assert ledger.line.count > 0.1 * total
    assert sent >= 2 * total
    assert (ledger.wrong, ledger.untouched_again) == (0, 0)
    assert ledger.failed < 0.03 * total, "of so bad a line a few reads get no answer in three tries"


def test_the_line_between_chance_and_a_fault_is_that_of_poisson() -> None:
    """For 2.2 and 37 expected, the figures that tables of that distribution have for 99.9 %."""
    assert (poisson_line(2.2), poisson_line(37.0)) == (8, 57)
    assert abs(poisson_line(11_274.3) - (11_274.3 + 3.09 * 11_274.3**0.5)) < 3, (
        "many are spread as a normal curve"
    )
    lines = [poisson_line(0.5 * number) for number in range(1, 60)]
    assert all(one <= two for one, two in pairwise(lines))
