"""KST replies that are late, doubled, or answer something else: never a value; and reports disturb nobody."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from motorbus.bus.pace import SHOWN, Pace
from motorbus.bus.trust import EQUAL_RUN
from motorbus.core.operation import Data
from motorbus.errors import DeviceError
from motorbus.link.base import Delivery, PerfectLine, Side
from tests.support.rigs.kst import Mischief, Rig

NODES = (0x25, 0x26, 0x27, 0x28)
WRONG = ("index instead", "index before", "sub instead", "sub before", "kind instead", "kind before")
ABORTS = ("abort instead", "swapped instead", "swapped before")
ALL = ("lost", "late", "twice", *WRONG, *ABORTS)


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
    assert ledger.sent - total == (total - 1) // EQUAL_RUN, "a run of equal answers ends in a probe"


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


def test_a_link_that_only_shows_its_bit_time_takes_no_copy_either(rounds: Callable[[int], int]) -> None:
    """No CAN adapter says whether there is a real bus behind it; until enough replies have come, there is no copy."""
    total = rounds(100_000)
    rig = Rig()
    rig.bus.turns.pace = Pace(certain=False)
    for _ in range(SHOWN):
        rig.read(0x25)
    line = rig.link.line = Mischief(10, 0.02, "twice", *WRONG, *ABORTS)
    for _ in range(total):
        rig.read(0x25)
    assert line.count > total / 100
    assert not rig.bus.turns.pace.refuted
    assert rig.wrong == 0


def test_a_copy_that_an_adapter_hands_over_later_is_the_known_limit(rounds: Callable[[int], int]) -> None:
    """Nothing in a reply tells it from an older one to the same question: see docs/explanation/taint.md.

    CAN itself sends a copy at once. This measures what is left where something holds the copy back for a while.
    """
    total = rounds(100_000)
    line = Mischief(9, 0.02, "twice", copy_after=0.0002)
    rig = Rig(line=line)
    for _ in range(total):
        rig.read(0x25)
    print(f"\n{total} reads, {line.count} copies held back by 0.2 ms, {rig.wrong} stale values")
    assert line.count > total / 100
    assert 0 < rig.wrong <= line.count, "a copy is believed once and never shifts the answers behind it"


class OneCopy(PerfectLine):
    """Hands the third answer over twice, the copy when the question after it has long been under way."""

    def __init__(self) -> None:
        self.answers = 0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        whole = super().carry(sender, data, at)
        self.answers += sender is Side.DEVICE
        if sender is Side.DEVICE and self.answers == 3:
            whole += super().carry(sender, data, at + 0.0015)
        return whole


def test_answers_that_are_all_one_question_old_are_found_out() -> None:
    """A servo that thinks for 2 ms leaves room for a copy to be believed, and for every answer behind it to shift."""
    rig = Rig(line=OneCopy(), turnaround=0.002)
    for _ in range(2000):
        rig.read(0x25)
    assert 2 < rig.wrong <= EQUAL_RUN
    assert rig.failed == 0
