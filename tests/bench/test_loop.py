"""A contender that returns a wrong, stale or missing value is found out, and so is one that cheats in its books."""

from __future__ import annotations

from typing import Any

import pytest

from bench import memory
from bench.loop import WrongValue, measure
from bench.rounds import CANDIDATES, Failed, compare
from bench.workloads import IDS, WARM_UP, WORKLOADS, goals

BARE = CANDIDATES["bare loop"]
READ_ONE = memory.packet(1, memory.READ, bytes((memory.POSITION, 2)))
READ_SIX = memory.packet(254, memory.SYNC_READ, bytes((memory.POSITION, 2, *IDS)))


class Honest:
    """Returns what the wire says, in counts."""

    def __init__(self) -> None:
        self.wire = memory.Wire()
        self.calls = 0

    def read(self, prepared: Any) -> list[int]:
        return self._positions(READ_ONE)

    def sync_read(self, prepared: Any) -> list[int]:
        return self._positions(READ_SIX)

    def sync_write(self, prepared: Any) -> None:
        self.calls += 1

    def cycle(self, prepared: Any) -> list[int]:
        return self.sync_read(None)

    def prepare(self, counts: list[int]) -> list[int]:
        return counts

    def counts(self, values: list[int]) -> list[int]:
        return values

    def close(self) -> None:
        """Nothing is open."""

    def _positions(self, request: bytes) -> list[int]:
        self.calls += 1
        train = self.wire.answer(request)
        return [train[start + 5] | train[start + 6] << 8 for start in range(0, len(train), 8)]


class Stale(Honest):
    """Gives the last answer again, once."""

    def _positions(self, request: bytes) -> list[int]:
        if self.calls == WARM_UP + 50:
            self.wire.answer(request)
        return super()._positions(request)


@pytest.mark.parametrize("workload", WORKLOADS.values(), ids=WORKLOADS)
def test_honest_work_is_accepted_and_counted(workload: Any) -> None:
    found = measure(Honest(), workload, 100)
    done = WARM_UP + 100
    assert found["processor"] > 0
    reads, writes, _ = found["books"]["1"]
    barriers = 11 if workload.stride else 0  # 7 in the warm-up, 4 after it
    assert (reads, writes) == (done * bool(workload.reads) + barriers, done * bool(workload.writes))


def test_the_sum_of_the_goals_is_the_sum_of_the_goals() -> None:
    written = [goals(index) for index in range(WARM_UP + 10)]
    books = measure(Honest(), WORKLOADS["cycle"], 10)["books"]
    assert {node: books[str(node)][2] for node in IDS} == {
        node: sum(each[node - 1] for each in written) for node in IDS
    }


@pytest.mark.parametrize("name", ["read1", "sync-read-6x2", "cycle"])
def test_one_stale_reading_in_hundreds_is_found(name: str) -> None:
    with pytest.raises(WrongValue, match=f"reading {WARM_UP + 50}:"):
        measure(Stale(), WORKLOADS[name], 100)


def test_books_that_agree_pass() -> None:
    compare(BARE, {"1": [5, 0, 0]}, {"servos": {"1": [5, 0, 0]}, "strays": 0})


@pytest.mark.parametrize("kept", [[6, 0, 0], [5, 1, 0], [5, 0, 2048]])
def test_books_that_differ_are_refused(kept: list[int]) -> None:
    with pytest.raises(Failed, match="servo 1"):
        compare(BARE, {"1": [5, 0, 0]}, {"servos": {"1": kept}, "strays": 0})


def test_stray_bytes_on_the_wire_are_refused() -> None:
    with pytest.raises(Failed, match="3 bytes or packets"):
        compare(BARE, {}, {"servos": {}, "strays": 3})
