"""The measured process: `python -m bench.contenders.NAME PORT BOOKS`; orders on standard input, one JSON a line."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from time import monotonic, process_time, sleep
from typing import Any

from bench.workloads import GROUP_READ, GROUP_WRITE, LATE, NODES, READ, Books, position

MAX_PENDING = 8
"""Group writes that may be on their way to the device."""


class Contender:
    """One library, used as its documentation shows. Values stay in its own unit while the clock runs."""

    family = "feetech"

    def read(self) -> Any:
        """Position of node 1."""
        raise NotImplementedError

    def read_group(self) -> Any:
        """Positions of all nodes."""
        raise NotImplementedError

    def write_group(self, goals: Any) -> None:
        """Goals of all nodes, as `prepare` made them."""
        raise NotImplementedError

    def prepare(self, goals: list[int]) -> Any:
        """Goals in the unit of this library."""
        return goals

    def to_counts(self, values: Any) -> Sequence[int]:
        """What a read gave, in raw counts."""
        return [values] if isinstance(values, int) else list(values)


class Course:
    """Orders carried out by one contender."""

    def __init__(self, contender: Contender, books: Books) -> None:
        self.contender = contender
        self.books = books

    def run(self, workload: str, calls: int) -> dict[str, Any]:
        """Processor time of a call (s), wrong values and errors of this order."""
        if workload == LATE:
            return self._read_late(calls)
        if workload == GROUP_WRITE:
            return self._write(calls)
        nodes = NODES if workload == GROUP_READ else NODES[:1]
        call = self.contender.read_group if workload == GROUP_READ else self.contender.read
        before = {node: self.books.received[node] for node in nodes}
        values, errors = [], 0
        begun = process_time()
        for _ in range(calls):
            try:
                values.append(call())
            except Exception:  # each library has its own; a call that fails gives no value
                errors += 1
        used = process_time() - begun
        rows = [self.contender.to_counts(one) for one in values]
        columns = zip(*rows, strict=True) if rows else [()] * len(nodes)
        wrong = sum(
            self._count_wrong(node, column, before[node]) for node, column in zip(nodes, columns, strict=True)
        )
        return {"seconds": used / calls, "wrong": wrong, "errors": errors}

    def _count_wrong(self, node: int, values: Sequence[int], at: int) -> int:
        """Values that the servo did not have at a later read than the value before."""
        wrong, last = 0, self.books.received[node]
        for value in values:
            due = (n for n in range(at + 1, last + 1) if position(self.contender.family, node, n) == value)
            found = next(due, None)
            wrong += found is None
            at = found or at
        return wrong

    def _write(self, calls: int) -> dict[str, Any]:
        """A goal that does not arrive counts as wrong."""
        used, wrong = 0.0, 0
        for start in range(0, calls, MAX_PENDING):
            before = [self.books.goals[node] for node in NODES]
            chosen = [
                [1024 + (7 * number + 311 * node) % 2048 for node in NODES]
                for number in range(start, min(start + MAX_PENDING, calls))
            ]
            prepared = [self.contender.prepare(goals) for goals in chosen]
            begun = process_time()
            for goals in prepared:
                self.contender.write_group(goals)
            used += process_time() - begun
            due = [was + sum(column) for was, column in zip(before, zip(*chosen, strict=True), strict=True)]
            wrong += not self._wait_for(due)
        return {"seconds": used / calls, "wrong": wrong, "errors": 0}

    def _wait_for(self, sums: list[int]) -> bool:
        """Whether the sums of goals become these; group writes have no reply."""
        end = monotonic() + 0.5
        while (arrived := [self.books.goals[node] for node in NODES]) != sums and monotonic() < end:
            sleep(0.0001)
        return arrived == sums

    def _read_late(self, calls: int) -> dict[str, Any]:
        """A value is wrong if the servo did not have it at a read received during the call."""
        self.books.late[0] = 1
        wrong = errors = 0
        for _ in range(calls):
            before = self.books.received[1]
            try:
                (value,) = self.contender.to_counts(self.contender.read())
            except Exception:
                errors += 1
            else:
                wrong += self._count_wrong(1, [value], before)
        return {"seconds": 0.0, "wrong": wrong, "errors": errors}


def main(make: Callable[[str], Contender]) -> None:
    """Answer orders until standard input ends."""
    contender = make(sys.argv[1])
    course = Course(contender, Books(Path(sys.argv[2])))
    course.run(READ, 20)
    print(json.dumps("ready"), flush=True)
    for line in sys.stdin:
        print(json.dumps(course.run(*json.loads(line))), flush=True)
