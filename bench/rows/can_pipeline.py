"""Row 15: how much of a CAN wire reading the positions of eight KST servos fills, in virtual time.

True bit time and arbitration on one shared wire, an adapter that is a pure delay of 0.5 ms in each direction, servos
that answer after 0.1 ms, all eight read as fast as they answer by one blocking bus. It comes out the same each time, so
there is one sample and no margin.
"""

from __future__ import annotations

from typing import Final

from bench.can_filled import Filled, measured
from bench.row import Row, Say

NUMBERS = ("15",)
NODES: Final = range(1, 9)
READS: Final = 4000
FULL, SLOW = 1_000_000, 500_000


def rows(rounds: int, say: Say) -> list[Row]:
    """Row 15, at 1 Mbit/s; what it is at 500 kbit/s is told. Raises WrongValue."""
    say("KST: eight nodes in virtual time")
    return [share(measured(NODES, FULL, READS), measured(NODES, SLOW, READS))]


def share(found: Filled, slower: Filled) -> Row:
    """The row of what was measured at the two rates."""
    note = (
        f"{found.rate:.0f} of {found.limit:.0f} reads a second; at 500 kbit/s {slower.rate:.0f} of {slower.limit:.0f}, "
        f"{slower.share:.1%}"
    )
    of_all = 100 * found.share
    measure = "KST pipelined reads of 8 nodes at 1 Mbit/s, of the bit-exact limit, virtual time"
    return Row(
        "15", measure, "-", "%", of_all, of_all, of_all, ">= 95", ">= 98", samples=1, note=note, margin=0.0
    )
