"""What faults at bytes leave of a packet, and how much later."""

from __future__ import annotations

import pytest

from motorbus.simulation.faults import Fault
from motorbus.simulation.faults.harm import GAP, INSTANT, Harmed, Strike, changed, harmed


def hurt(*faults: Fault, later: float = 0.0, lost: bool = False) -> tuple[Harmed, list[tuple[str, float]]]:
    happened: list[tuple[str, float]] = []
    strikes = [Strike(fault.byte or 0, rank, fault) for rank, fault in enumerate(faults)]
    found = harmed(b"abcdef", strikes, later, lost, lambda fault, at: happened.append((fault.action, at)))
    return found, happened


def test_nothing_is_everything() -> None:
    assert hurt(later=0.5)[0] == Harmed([(0.5, b"abcdef")], 0.5, False, 0.0)


def test_what_is_lost_stays_lost() -> None:
    assert hurt(Fault(1, 2, "insert", value=0x41), lost=True)[0].pieces == []
    assert hurt(Fault(1, 2, "truncate"))[0] == Harmed([(0.0, b"ab")], 0.0, True, 0.0)


def test_delays_add_up_and_last_and_cuts_do_not() -> None:
    found, _ = hurt(
        Fault(1, 1, "delay", seconds=0.1), Fault(1, 3, "split"), Fault(1, 4, "delay", seconds=0.2)
    )
    assert [piece for _, piece in found.pieces] == [b"a", b"bc", b"d", b"ef"]
    assert [when for when, _ in found.pieces] == pytest.approx([0.0, 0.1, 0.1 + GAP, 0.3 + GAP])
    assert found.later == pytest.approx(0.3)


def test_a_stall_says_how_long_nothing_passes() -> None:
    found, _ = hurt(Fault(1, 3, "stall", seconds=0.4))
    assert found == Harmed([(0.0, b"abc"), (0.4, b"def")], 0.0, False, 0.4)


def test_what_happens_to_the_bus_happens_between_the_pieces() -> None:
    found, happened = hurt(Fault(1, 3, "power-cycle", node=1))
    assert found.pieces == [(0.0, b"abc"), (2 * INSTANT, b"def")]
    assert happened == [("power-cycle", INSTANT)]


@pytest.mark.parametrize(
    ("fault", "left"),
    [
        (Fault(1, 0, "drop"), b""),
        (Fault(1, 0, "duplicate"), b"aa"),
        (Fault(1, 0, "corrupt", value=0x20), b"A"),
        (Fault(1, 0, "flip", value=5), b"A"),
        (Fault(1, 0, "insert", value=0x5A), b"Za"),
    ],
)
def test_what_becomes_of_a_byte(fault: Fault, left: bytes) -> None:
    assert changed(fault, b"a") == left
    assert changed(fault, b"") == (b"Z" if fault.action == "insert" else b"")
