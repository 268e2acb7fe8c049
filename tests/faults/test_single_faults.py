"""Rows L1 and L2: one byte of a reply changed, lost, doubled or too many gives no wrong value, ever.

And every exchange after the fault is right at its first try.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from itertools import count

import pytest

from motorbus.errors import MotorbusError
from motorbus.link.base import PerfectLine, Side
from motorbus.simulation.faults import Fault, ScriptedLine
from tests.faults.rig import KINDS, Bytewise, Rig


def every_fault(length: int, values: range) -> Iterator[Fault]:
    for byte in range(length):
        yield Fault(1, byte, "drop")
        yield Fault(1, byte, "duplicate")
        for value in values:
            if value:
                yield Fault(1, byte, "corrupt", value=value)
    for byte in range(length + 1):
        for value in values:
            yield Fault(1, byte, "insert", value=value)


def suffer(kind: str, faults: Iterator[Fault], *, bytewise: bool = False) -> tuple[int, int]:
    """Every fault in turn; returns how many, and how many exchanges succeeded in spite of it."""
    exchange, _ = KINDS[kind]
    rig = Rig()
    succeeded = 0
    total = 0
    for fault in faults:
        total += 1
        line = ScriptedLine([fault])
        rig.put(Bytewise(line) if bytewise else line)
        try:
            exchange(rig)
            succeeded += 1
        except MotorbusError:
            pass
        assert len(line.fired) == 1, f"{fault} did not happen"
        rig.put(PerfectLine())
        errors_before = retries(rig)
        exchange(rig)
        exchange(rig)
        assert retries(rig) == errors_before, f"{fault}: not right at the first try"
    return total, succeeded


def retries(rig: Rig) -> int:
    return sum(ledger.retries for ledger in rig.bus.statistics.nodes.values())


EDGES = [0x00, 0x01, 0x02, 0x04, 0x08, 0x10, 0x20, 0x40, 0x80, 0x55, 0xAA, 0xFE, 0xFF]


@pytest.mark.parametrize("bytewise", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_single_byte_faults_with_telling_values(kind: str, bytewise: bool) -> None:
    values = list(EDGES)
    faults = (fault for fault in every_fault(KINDS[kind][1], range(256)) if fault.value in values)
    total, succeeded = suffer(kind, faults, bytewise=bytewise)
    assert total > 100
    assert succeeded == total, "a repeatable exchange gets over any single fault"


@pytest.mark.parametrize("bytewise", [False, True])
@pytest.mark.parametrize("kind", ["ping", "read 2 bytes"])
def test_every_single_byte_fault(kind: str, bytewise: bool) -> None:
    total, succeeded = suffer(kind, every_fault(KINDS[kind][1], range(256)), bytewise=bytewise)
    length = KINDS[kind][1]
    assert total == length * (2 + 255) + (length + 1) * 256
    assert succeeded == total


@pytest.mark.soak
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("bytewise", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_every_single_byte_fault_of_every_kind(kind: str, bytewise: bool) -> None:
    total, succeeded = suffer(kind, every_fault(KINDS[kind][1], range(256)), bytewise=bytewise)
    how = "byte by byte" if bytewise else "in one piece"
    print(f"\n{kind}, {how}: {total} single-byte faults, 0 wrong values, {succeeded / total:.2%} succeeded")
    assert succeeded == total


def test_a_request_that_is_damaged_gives_no_wrong_value_either() -> None:
    for kind, (exchange, _) in KINDS.items():
        rig = Rig()
        for byte in count():
            line = ScriptedLine([Fault(1, byte, "corrupt", Side.DEVICE, value=0x20)])
            rig.put(line)
            with contextlib.suppress(MotorbusError):
                exchange(rig)
            if not line.fired:
                assert byte > 5, kind
                break
            rig.put(PerfectLine())
            exchange(rig)
            exchange(rig)
