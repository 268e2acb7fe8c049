"""How much of a CAN wire a bus fills, in virtual time with true bit time: KST servos behind an adapter of 1 ms.

Nothing here depends on the machine: the same figures come out everywhere. `make soak` prints the table.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

from bench.can_filled import counted, measured

READS = 4000
COUNTS = (1, 2, 4, 8, 16)


@pytest.mark.parametrize("bitrate", [500_000, 1_000_000])
def test_the_wire_is_full_from_eight_nodes_on(bitrate: int, rounds: Callable[[int], int]) -> None:
    found = {count: measured(range(1, 1 + count), bitrate, rounds(READS)) for count in COUNTS}
    print(f"\n{bitrate // 1000} kbit/s, adapter 1 ms there and back, servo 0.1 ms")
    for count, filled in found.items():
        print(
            f"| {count} | {filled.rate:.0f} | {filled.limit:.0f} | {filled.share:.1%} "
            f"| {filled.p99 * 1e3:.2f} ms | {filled.p99 / filled.ideal:.2f} |"
        )
    assert all(filled.share >= 0.95 for count, filled in found.items() if count >= 8)
    assert all(filled.share <= 1.02 for filled in found.values()), "no frame is shorter than it is"
    assert all(filled.p99 <= 1.2 * filled.ideal for filled in found.values())


def test_as_many_must_be_in_flight_as_the_budget_says() -> None:
    """Just below that number the wire has gaps, and a little above it is full."""
    needed = counted(range(1, 2), 1_000_000).in_flight
    assert 5 < needed < 6
    below = measured(range(1, 5), 1_000_000, READS)
    above = measured(range(1, 9), 1_000_000, READS)
    full = above.limit
    assert below.rate < 0.8 * full
    assert above.rate > 0.95 * full
