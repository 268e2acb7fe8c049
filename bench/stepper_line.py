"""What work on a stepper controller takes at 9600 baud, beside what was said beforehand and what the bytes alone take.

    python -m bench.stepper_line

A simulated controller in a process of its own, on a pseudo-terminal on which bytes take their time. A job whose cost is
shown beforehand must take that within 15 %, and so must a backup the time of its bytes.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import motorbus
from bench.figures import Spread, spread
from motorbus.families.stepper import Controller, Program
from motorbus.families.stepper.table import Project, Step, with_steps
from tests.support.processes import Simulated

WITHIN = 0.15
LATENCY = "1s"
"""What an answer may take longer when the machine has other work; no answer comes later because of it."""
BYTE = 10 / 9600
COMMAND, DUMP = 17, 237
"""Bytes of a command and its acknowledgement, and of a dump and the request for it."""
TEN_STEPS, ONE_NUMBER, BACKUP = "a project of ten steps", "one number of it", "backup of four projects"
COLUMNS = ("", "took", "min – max", "said beforehand", "took by said", "bytes alone", "took by bytes alone")


class Sample(NamedTuple):
    """One job: seconds that it took, that were said beforehand, and that its bytes take."""

    job: str
    took: float
    said: float
    bytes_alone: float


class Wrong(Exception):
    """The controller does not hold what was written."""


def program(delay: int) -> Program:
    """Ten steps; the pause after the last one is to choose, in ms."""
    rows = [Step(distance=n, start_frequency=100, acceleration=50, speed=60, delay=n) for n in range(1, 11)]
    rows[-1] = replace(rows[-1], delay=delay)
    base = Project(number=2, microsteps=8, step_angle=180, turn_distance=1600)
    return Program(project=with_steps(base, tuple(rows)))


def samples(times: int, progress: Callable[[str], None]) -> list[Sample]:
    """So many of each job. Raises Wrong, and MotorbusError."""
    found: list[Sample] = []
    for number in range(times):
        progress(f"stepper at 9600 baud, round {number + 1} of {times}")
        with (
            tempfile.TemporaryDirectory() as folder,
            Simulated("stepper", link=Path(folder) / "bus", pace=True) as simulated,
            motorbus.open(f"{simulated.bus},latency={LATENCY}") as bus,
        ):
            one = Controller(bus)
            found += [_written(one, TEN_STEPS, 10), _written(one, ONE_NUMBER, 11), _copied(one)]
    return found


def _written(one: Controller, job: str, delay: int) -> Sample:
    """What `difference` says before, and what writing takes; bytes are counted, not believed."""
    wanted = program(delay)
    said = one.difference(wanted).cost.seconds
    began = time.monotonic()
    done = one.write_project(wanted)
    took = time.monotonic() - began
    if one.difference(wanted):
        raise Wrong(f"{job}: something differs still")
    return Sample(job, took, said, (done.commands * COMMAND + done.dumps * DUMP) * BYTE)


def _copied(one: Controller) -> Sample:
    """Each project is read twice, as a dump has no checksum; that time is what is said beforehand."""
    began = time.monotonic()
    copy = one.backup()
    took = time.monotonic() - began
    if copy.project(2) != program(11).project:
        raise Wrong("the backup is not what was written")
    alone = 2 * len(copy.projects) * DUMP * BYTE
    return Sample(BACKUP, took, alone, alone)


def verdict(found: Iterable[Sample]) -> str:
    """Whether every single one was within what was said, in words."""
    off = max(abs(one.said / one.took - 1) for one in found)
    reached = "reached" if off <= WITHIN else "MISSED"
    return f"The farthest that one was from what was said beforehand: {off:.1%}. At most {WITHIN:.0%}: {reached}."


def rows(found: Sequence[Sample]) -> list[tuple[str, ...]]:
    """One for each job."""
    return [
        _row(job, [one for one in found if one.job == job]) for job in dict.fromkeys(s.job for s in found)
    ]


def _row(job: str, found: Sequence[Sample]) -> tuple[str, ...]:
    took = spread(one.took for one in found)
    said = spread(one.said for one in found)
    alone = spread(one.bytes_alone for one in found)
    by_said = spread(one.took / one.said for one in found)
    by_bytes = spread(one.took / one.bytes_alone for one in found)
    return (
        job,
        f"{took.median:.3f} s",
        f"{took.low:.3f} – {took.high:.3f}",
        f"{said.median:.3f} s",
        _ratio(by_said),
        f"{alone.median:.3f} s",
        _ratio(by_bytes),
    )


def _ratio(found: Spread) -> str:
    return f"{found.median:.3f} ({found.low:.3f} – {found.high:.3f})"


if __name__ == "__main__":
    measured = samples(5, print)
    for row in (COLUMNS, *rows(measured)):
        print("  ".join(row))
    print(verdict(measured))
