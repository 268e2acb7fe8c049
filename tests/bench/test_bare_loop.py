"""The loop without a library exchanges what the measured one does, and counts what is late."""

from __future__ import annotations

import pytest

from bench.bare_loop import Bare, bare, told

WIRE = 1e6 / 880


@pytest.mark.parametrize("rate", [0.0, 100.0])
def test_no_cycle_is_shorter_than_its_bytes_take(rate: float) -> None:
    found = bare(rate, 0.2)
    assert found.cycles >= 1
    assert 880e-6 <= found.median <= found.most
    assert found.achieved < WIRE
    assert found.overruns <= found.cycles if rate else found.overruns == 0


def test_who_asks_for_more_than_the_wire_carries_is_always_late() -> None:
    found = bare(2 * WIRE, 0.1)
    assert found.overruns == found.cycles >= 1


def test_it_is_told_in_one_line() -> None:
    assert told(Bare(0.0, WIRE * 0.9, 100, 0, 930e-6, 1200e-6), WIRE) == (
        "bare system calls, flat out: 1022.7 cycles/s, 90.0% of the wire's, 0 overruns in 100; a cycle took 930 µs, "
        "99 % of them at most 1200 µs"
    )
    assert " at 909.0 Hz: " in told(Bare(909.0, 900.0, 100, 3, 930e-6, 1200e-6), WIRE)
