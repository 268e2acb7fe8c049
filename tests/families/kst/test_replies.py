"""KST replies that are late, lost, or answer another request never become a value; reports disturb no read."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from motorbus.errors import DeviceError
from tests.families.kst.rig import Mischief, Rig

NODES = (0x25, 0x26, 0x27, 0x28)
WRONG = ("index instead", "index before", "sub instead", "sub before", "kind instead", "kind before")
ABORTS = ("abort instead", "swapped instead")
ALL = ("lost", "late", *WRONG, *ABORTS)


@pytest.mark.timeout(900)
@pytest.mark.parametrize(("nodes", "interval"), [(NODES[:1], 2.0), (NODES, 10.0)])
def test_reports_on_the_reply_identifier_fail_no_read(
    nodes: tuple[int, ...], interval: float, rounds: Callable[[int], int]
) -> None:
    total = rounds(100_000)
    rig = Rig(nodes, reports_ms=interval)
    rig.read_all(total // len(nodes))
    assert (rig.good, rig.failed, rig.wrong) == (total, 0, 0)
    assert rig.bus.statistics.other["notices"] > 0
    assert all(rig.bus.statistics.of(node).retries == 0 for node in nodes)


@pytest.mark.parametrize("kind", ALL)
def test_a_fault_of_each_kind_gives_no_wrong_value(kind: str) -> None:
    """And where the true reply can still be had, the read succeeds."""
    line = Mischief(3, 0.5, kind, rest=10)
    rig = Rig(line=line)
    rig.read_all(1000)
    assert line.fired[kind] > 50
    assert rig.wrong == 0
    if kind in ABORTS:
        assert all(isinstance(error, DeviceError) for error in rig.errors)
        assert rig.failed >= 0.9 * line.count
    else:
        assert rig.failed == 0 or kind == "late"


@pytest.mark.timeout(900)
@pytest.mark.parametrize(("nodes", "interval"), [(NODES[:1], 2.0), (NODES, 10.0)])
def test_all_faults_together_give_no_wrong_value(
    nodes: tuple[int, ...], interval: float, rounds: Callable[[int], int]
) -> None:
    total = rounds(100_000)
    line = Mischief(7, 0.02, *ALL)
    rig = Rig(nodes, line, reports_ms=interval)
    rig.read_all(total // len(nodes))
    print(f"\n{total} reads, {line.count} faults, {rig.wrong} wrong, {rig.good / total:.3%} succeeded")
    assert line.count > total / 100
    assert rig.wrong == 0
    assert rig.good > 0.9 * total
