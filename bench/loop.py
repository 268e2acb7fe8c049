"""The measured loop: it runs inside the process of one contender and prints one line of JSON.

Readings are kept while the clock runs and judged afterwards, so that checking costs nobody anything.

A library that asks again when an answer does not come in time leaves a reading out, for the servo counts both. One that
tells how often it did so (`late`) is believed, but no more is left out than that, and nothing comes twice or back: then
the measurement is spoiled, not wrong.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from itertools import pairwise
from resource import RUSAGE_SELF, getrusage
from statistics import median
from time import perf_counter
from typing import Any, Protocol

from bench.workloads import EXPECTED, POSITION, WARM_UP, Workload, goals, named

STRETCHES = 9
"""Parts of a sample. Its processor time is the median of theirs: on a machine that is shared the same work takes twice
as long for some hundredths of a second now and then."""


class Contender(Protocol):
    """One library, used as its own documentation shows. Its values stay in its own unit.

    It is made with the port and the workload, and has the method that the workload names besides `read`. `read`,
    `sync_read`, `fields`, `blocks`, `many` and `cycle` return what they read; `sync_write` and `cycle` take prepared
    goals. A library that asks again by itself may have a method `late`: how many requests had to be asked again.
    """

    def read(self, prepared: Any) -> Any: ...

    def prepare(self, counts: list[int]) -> Any:
        """Goals of the servos in the unit that this library takes."""

    def counts(self, values: Any) -> Sequence[Any]:
        """What was read, one for each servo: counts; or `Fields` or bytes where the workload reads those."""

    def close(self) -> None: ...


WRONG = "wrong value: "
"""How what a process says begins when a value was wrong."""


class WrongValue(Exception):
    """A contender returned something else than what the responder sent."""


class Late(Exception):
    """No value is wrong, but an answer was late: a reading is missing, or was asked for again and left one out."""


def check(
    readings: Sequence[Sequence[Any]], nodes: tuple[int, ...], what: str = POSITION, late: int = 0
) -> None:
    """Every reading against the rule.

    Raises WrongValue for the first that differs; where answers to so many requests were `late`, Late instead if all
    that differs is that up to so many readings are left out, or told as missing.
    """
    rule = EXPECTED[what]
    left_out, missing = dict.fromkeys(nodes, 0), 0
    for index, values in enumerate(readings):
        expected = [rule(node, index + left_out[node]) for node in nodes]
        if list(values) == expected:
            continue
        for node, value in zip(nodes, values, strict=False):
            if value is None and late:  # told as missing
                missing += 1
                continue
            more = range(left_out[node], late + 1)
            left_out[node] = next((some for some in more if rule(node, index + some) == value), late + 1)
        if len(values) != len(nodes) or max(left_out.values()) > late:
            raise WrongValue(f"reading {index}: {list(values)}, expected {expected}")
    most = max(left_out.values())
    if most or missing:
        raise Late(
            f"{late} answers were late: {most} readings of a servo left out, {missing} told as missing"
        )


class Course:
    """One contender doing one workload: readings and goals so far, and the time the measured part took."""

    def __init__(self, contender: Contender, workload: Workload) -> None:
        self.contender = contender
        self.workload = workload
        self.exchange: Callable[[Any], Any] = getattr(contender, workload.method)
        self.readings: list[Any] = []
        self.barriers: list[Any] = []
        self.written: list[list[int]] = []
        self.processor = 0.0
        self.wall = 0.0

    def run(self, count: int) -> None:
        """This many exchanges, cut where a barrier is due."""
        stride = self.workload.stride or count
        for start in range(0, count, stride):
            self._stretch(min(stride, count - start))
            if self.workload.stride:
                self.barriers.append(self.contender.read(None))

    def _stretch(self, count: int) -> None:
        inputs: list[Any] = [None] * count
        if self.workload.writes:
            nodes = self.workload.writes
            chosen = [goals(len(self.written) + index, nodes) for index in range(count)]
            self.written += chosen
            inputs = [self.contender.prepare(counts) for counts in chosen]
        exchange, keep = self.exchange, self.readings.append
        before, began = getrusage(RUSAGE_SELF), perf_counter()
        for prepared in inputs:
            keep(exchange(prepared))
        ended, after = perf_counter(), getrusage(RUSAGE_SELF)
        self.wall += ended - began
        self.processor += after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime

    def judge(self) -> None:
        """Raises WrongValue unless every reading is what the responder must have sent, Late where it came late."""
        counts = self.contender.counts
        late = self.late()
        if self.workload.reads:
            found = [counts(values) for values in self.readings]
            check(found, self.workload.reads, self.workload.what, late)
        check([counts(value) for value in self.barriers], (1,), late=late)

    def late(self) -> int:
        """How many readings may have been asked for once more, by what the contender says of itself."""
        said: int = getattr(self.contender, "late", int)()
        return said

    def books(self) -> dict[str, list[int]]:
        """Readings, writings and the sum of the goals by node, as the responder must have them too."""
        nodes = sorted({1, *self.workload.reads, *self.workload.writes})
        return {
            str(node): [
                len(self.readings) * (node in self.workload.reads) + len(self.barriers) * (node == 1),
                len(self.written) * (node in self.workload.writes),
                sum(goals[node - 1] for goals in self.written) if node in self.workload.writes else 0,
            ]
            for node in nodes
        }


def measure(contender: Contender, workload: Workload, count: int) -> dict[str, Any]:
    """Warm up, measure `count` exchanges, judge; seconds per exchange and the books.

    Processor time is that of the stretch in the middle, wall time that of all of them.
    """
    course = Course(contender, workload)
    course.run(WARM_UP)
    course.wall, costs = 0.0, []
    for size in shares(count, workload.stride or 1):
        course.processor = 0.0
        course.run(size)
        costs.append(course.processor / size)
    course.judge()
    return {
        "processor": median(costs),
        "wall": course.wall / count,
        "books": course.books(),
        "late": course.late(),
    }


def shares(count: int, stride: int) -> list[int]:
    """So many exchanges in about equal stretches that end where a stride does."""
    strides = -(-count // stride)
    stretches = min(STRETCHES, strides)
    ends = [min(count, stride * (strides * number // stretches)) for number in range(stretches + 1)]
    return [end - start for start, end in pairwise(ends)]


def main(contender: Callable[[str, Workload], Contender]) -> None:
    """The whole program of a contender's process: `PORT WORKLOAD COUNT`."""
    parser = argparse.ArgumentParser()
    parser.add_argument("port")
    parser.add_argument("workload", type=named)
    parser.add_argument("count", type=int)
    given = parser.parse_args()
    opened = contender(given.port, given.workload)
    try:
        print(json.dumps(measure(opened, given.workload, given.count)))
    except WrongValue as error:
        sys.exit(f"{WRONG}{error}")
    except Late as error:
        sys.exit(str(error))
    finally:
        opened.close()
