"""KST replies that are late, doubled, or answer something else: never a value; and reports disturb nobody."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from motorbus.errors import DeviceError
from tests.support.rigs.kst import Mischief, Rig

NODES = (0x25, 0x26, 0x27, 0x28)
WRONG = ("index instead", "index before", "sub instead", "sub before", "kind instead", "kind before")
ABORTS = ("abort instead", "swapped instead")
ALL = ("lost", "late", *WRONG, *ABORTS)


@pytest.mark.timeout(900)
def test_reports_500_times_a_second_on_the_reply_identifier_fail_no_read(
    rounds: Callable[[int], int],
) -> None:
    total = rounds(100_000)
    rig = Rig(reports_ms=2.0)
    for _ in range(total):
        rig.read(0x25)
    reports = rig.bus.statistics.other["notices"]
    print(f"\n{total} reads, {reports} reports between them, {rig.failed} failed, {rig.wrong} wrong")
    assert (rig.good, rig.failed, rig.wrong) == (total, 0, 0)
    assert reports >= 500 * (rig.link.now() - 0.01)
    ledger = rig.bus.statistics.of(0x25)
    assert (ledger.ok, ledger.retries) == (ledger.sent, 0)
    assert ledger.sent == total


@pytest.mark.timeout(900)
def test_reports_of_many_nodes_with_many_reads_in_flight_fail_none(rounds: Callable[[int], int]) -> None:
    total = rounds(100_000)
    rig = Rig(NODES, reports_ms=10.0)
    rig.read_all(total // len(NODES))
    assert (rig.good, rig.failed, rig.wrong) == (total, 0, 0)
    assert rig.bus.statistics.other["notices"] > 0


@pytest.mark.parametrize("kind", ALL)
def test_a_fault_of_each_kind_gives_no_wrong_value(kind: str) -> None:
    """And where it leaves an answer to be had, that is had."""
    line = Mischief(3, 0.5, kind, rest=10)
    rig = Rig(line=line)
    for _ in range(1000):
        rig.read(0x25)
    assert line.fired[kind] > 50
    assert rig.wrong == 0
    if kind.partition(" ")[0] in ("abort", "swapped"):
        assert all(isinstance(error, DeviceError) for error in rig.errors), "a refusal is told as one"
        assert rig.failed >= 0.9 * line.count
    else:
        assert rig.failed == 0 or kind == "late", "asked again, the answer comes"


@pytest.mark.timeout(900)
def test_all_of_them_at_once_give_no_wrong_value(rounds: Callable[[int], int]) -> None:
    total = rounds(100_000)
    line = Mischief(7, 0.02, *ALL)
    rig = Rig(line=line, reports_ms=2.0)
    for _ in range(total):
        faults, outstanding = line.count, rig.link._under_way
        undisturbed = not any(at > rig.link.now() + 0.001 for at, *_ in outstanding)
        succeeded = rig.read(0x25)
        assert succeeded or line.count > faults or not undisturbed, "an exchange without a fault succeeds"
    shown = ", ".join(f"{name} {count}" for name, count in line.fired.items())
    print(
        f"\n{total} reads, {line.count} faults ({shown}), {rig.wrong} wrong, {rig.good / total:.3%} succeeded"
    )
    assert line.count > total / 100
    assert rig.wrong == 0


@pytest.mark.timeout(900)
def test_all_of_them_with_four_nodes_in_flight_give_no_wrong_value(rounds: Callable[[int], int]) -> None:
    total = rounds(100_000)
    line = Mischief(8, 0.02, *ALL)
    rig = Rig(NODES, line, reports_ms=10.0)
    rig.read_all(total // len(NODES))
    print(f"\n{total} reads, {line.count} faults, {rig.wrong} wrong, {rig.good / total:.3%} succeeded")
    assert line.count > total / 100
    assert rig.wrong == 0
    assert rig.good > 0.9 * total
