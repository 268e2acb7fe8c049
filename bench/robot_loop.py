"""`robot.loop` against a line that takes its time: six axes at 1 Mbaud, by the public calls, in rad and seconds.

    python -m bench.robot_loop [--seconds 60]

The other end is the responder in C, on which bytes take as long as at that baud rate. At 80 % of the highest rate
that the budget names there is to be no overrun in a minute, and asked for that highest rate itself the loop is to
achieve 88 % of what the wire carries. Both are measured with goals that are followed and with goals that are sent as
they are. Each axis counts how often it was read, so
a reading that is lost, doubled or stale is found. All of it runs with real-time priority where that is permitted, as a
control loop would; whether it was is said with the result.
"""

from __future__ import annotations

import argparse
import gc
import json
import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, NamedTuple

from bench.bare_loop import bare, told
from bench.places import BUILD, ROOT, surroundings
from bench.responder import build, responder
from bench.workloads import COUNTS, IDS, to_and_fro

BAUD = 1_000_000
SHARE = 0.8
ACHIEVED = 0.88
SECONDS = 60.0
FLAT_OUT = 5.0
LOOKS = 3
"""How often a look at a motor may be sent until it is answered."""
STEP = math.tau / COUNTS
WHY = (
    "Part of what is missing even a loop of bare system calls lacks, as in row 6. The rest a loop that misses spends "
    "between an answer and the next write, after a wait, with cold caches: "
    "it tells what the answer brought, the program that leads sets its goals, and the gate judges them.\n"
)
"""Why it misses where it does; what system calls alone achieve on the same line is in row 6."""
KINDS = ("followed", "direct")
COLUMNS = (
    "",
    "asked for, Hz",
    "cycles/s",
    "of the wire's",
    "overruns",
    "skipped",
    "late, µs",
    "cycle, µs",
    "processor µs",
)


class Sample(NamedTuple):
    """One loop: how goals were sent, Hz that were asked for, that the wire carries and that were achieved, overruns and
    skipped slots; in s how late a cycle began and how long one took on average, and the processor's part of it; and
    whether its process had real-time priority."""

    kind: str
    asked: float
    wire: float
    achieved: float
    cycles: int
    overruns: int
    skipped: int
    lateness: float
    cycle: float
    processor: float
    urgent: bool = False


class Wrong(Exception):
    """A reading or a goal was lost, doubled or stale."""


def described(port: str) -> str:
    """The machine file: six servos, each an axis that may turn a whole turn."""
    axes = "".join(
        f'[axis.a{node}]\ndevice = "arm#{node}"\nzero = "180 deg"\nunit = "deg"\n'
        'max_velocity = "600 deg/s"\nmax_acceleration = "3000 deg/s2"\nexit = "leave"\n'
        for node in IDS
    )
    return f'format = 1\n[bus.arm]\naddress = "feetech:{port},baud={BAUD}"\n{axes}'


# -- in the process that is measured -----------------------------------------------------------------------------


def course(count: int) -> list[dict[str, float]]:
    """Ways from the first position for so many cycles, about as slow as a hand: within what every axis may do."""
    return [
        {f"a{node}": 0.2 - 0.2 * math.cos(number * (5 + node) / 4000) for node in IDS}
        for number in range(count)
    ]


def measured(port: str, kind: str, rate: float, seconds: float) -> dict[str, Any]:
    """Lead six axes for so long; a rate of 0 is the highest that the budget names. Raises Wrong."""
    import motorbus

    file = BUILD / f"robot_loop-{os.getpid()}.toml"
    file.write_text(described(port), encoding="utf-8")
    try:
        with motorbus.Robot.load(file) as robot:
            wire = robot.budget().highest_rate
            return {"wire": wire, **_led(robot, kind, rate or wire, seconds)}
    finally:
        file.unlink()


def _led(robot: Any, kind: str, rate: float, seconds: float) -> dict[str, Any]:
    goals = course(int(rate * seconds) + 1)
    positions: list[Any] = []
    with robot.loop(rate, direct=kind == "direct") as loop:
        base = dict(next(loop).position)
        loop.goal.update(base)
        next(loop)  # torque on, in a cycle of its own
        begun = copy(loop.statistics)
        goal = loop.goal
        gc.collect()
        gc.freeze()
        used, began = process_time(), perf_counter()
        for state, wanted in zip(loop, goals, strict=False):
            positions.append((state.position, state.missing | state.doubts.keys()))
            for name, way in wanted.items():
                goal[name] = base[name] + way
            if perf_counter() - began >= seconds:
                break
        lasted, used = perf_counter() - began, process_time() - used
        told = loop.statistics
    judged(positions)
    cycles = told.cycles - begun.cycles
    return {
        "asked": rate,
        "cycles": cycles,
        "achieved": cycles / lasted,
        "overruns": told.overruns - begun.overruns,
        "skipped": told.skipped - begun.skipped,
        "unordered": told.unordered,
        "lateness": told.lateness.mean,
        "cycle": told.cycle.mean,
        "processor": used / cycles,
        "urgent": is_urgent(),
    }


def judged(readings: Sequence[tuple[dict[str, float], frozenset[str]]]) -> None:
    """Each reading shows one count more than the one before, and one for each that was lost and told as lost.

    More stand for a look at how the motor fares, which reads its position too, and is tried again where its answer is
    late. At the end of its range a servo counts down again; at the first reading it counts up. Raises Wrong.
    """
    first, *others = readings
    number = {name: counted(here) for name, here in first[0].items()}
    due = dict.fromkeys(number, 0)
    for cycle, (positions, missing) in enumerate(others, 1):
        for name, here in positions.items():
            due[name] += 1
            if name in missing:
                continue
            since, shown = due[name], counted(here)
            seen = range(since, since + LOOKS + 1)
            came = [more for more in seen if to_and_fro(number[name] + more) == shown]
            if not came:
                raise Wrong(
                    f"cycle {cycle}: {name} shows {shown}, {since} readings after {to_and_fro(number[name])}"
                )
            number[name], due[name] = number[name] + came[0], 0


def counted(here: float) -> int:
    """The count of a servo whose axis is here (rad), by the zero that the machine file gives it."""
    return round((here + math.pi) / STEP)


# -- in the process that conducts --------------------------------------------------------------------------------


def sample(program: Path, kind: str, rate: float, seconds: float) -> Sample:
    """One loop, in a process of its own, against a fresh line. Raises Wrong."""
    BUILD.mkdir(exist_ok=True)
    with responder(program, BAUD) as wire:
        wanted = {"port": wire.port, "kind": kind, "rate": rate, "seconds": seconds}
        done = subprocess.run(
            [
                sys.executable,
                "-m",
                "bench.robot_loop",
                *(f"--{name}={value}" for name, value in wanted.items()),
            ],
            capture_output=True,
            text=True,
            timeout=seconds + 60,
            cwd=ROOT,
            env=dict(surroundings()),
        )
    if done.returncode:
        raise Wrong(f"{kind}, {rate:g} Hz: {done.stderr.strip() or done.returncode}")
    said = json.loads(done.stdout)
    _compare(said, wire.books)
    return Sample(kind, **{name: said[name] for name in Sample._fields if name != "kind"})


def _compare(said: dict[str, Any], books: dict[str, Any]) -> None:
    """Every cycle wrote a goal to each servo, or told that nobody knew where it was. Raises Wrong."""
    written = [books["servos"][str(node)][1] for node in IDS]
    due = [said["cycles"] - said["unordered"][f"a{node}"] for node in IDS]
    few = any(there < wanted for there, wanted in zip(written, due, strict=True))
    if few or books["strays"] or (len(set(written)) > 1 and not any(said["unordered"].values())):
        raise Wrong(f"{said['cycles']} cycles, but goals that arrived: {written}, strays {books['strays']}")


def is_urgent() -> bool:
    """Whether this process has real-time priority."""
    return hasattr(os, "sched_getscheduler") and os.sched_getscheduler(0) == os.SCHED_FIFO


@contextmanager
def urgent() -> Iterator[bool]:
    """With the priority of a control loop, for this process and those it starts; False where that is not permitted."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
    except (AttributeError, OSError):
        yield False
        return
    try:
        yield True
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def samples(seconds: float, progress: Callable[[str], None], times: int = 1) -> list[Sample]:
    """Each kind at 80 % for so long, and flat out, so many times. Raises Wrong, NoCompiler."""
    program = build()
    found: list[Sample] = []
    with urgent():
        for number in range(times):
            for kind in KINDS:
                progress(f"robot.loop, {kind}, flat out, round {number + 1} of {times}")
                fastest = sample(program, kind, 0.0, min(FLAT_OUT, seconds))
                progress(
                    f"robot.loop, {kind}, at {SHARE:.0%} for {seconds:g} s, round {number + 1} of {times}"
                )
                found += [fastest, sample(program, kind, SHARE * fastest.wire, seconds)]
    return found


def verdict(found: Iterable[Sample]) -> str:
    """Whether both were reached, in words."""
    every = list(found)
    overruns, cycles, least = _worst(every)
    return (
        f"Overruns and skipped slots at {SHARE:.0%} of the budget's highest rate: {overruns} in "
        f"{cycles} cycles. None: {_word(not overruns)}.\n"
        f"Achieved of what the wire carries: {least:.1%}. At least {ACHIEVED:.0%}: {_word(least >= ACHIEVED)}.\n"
        f"Real-time priority: {_priority(every)}.\n" + ("" if not overruns and least >= ACHIEVED else WHY)
    ).rstrip()


def _worst(found: Sequence[Sample]) -> tuple[int, int, float]:
    """At the lower rate the overruns and skipped slots, and in how many cycles; flat out the least share."""
    steady = [one for one in found if one.asked < one.wire * (SHARE + ACHIEVED) / 2]
    flat = [one.achieved / one.wire for one in found if one not in steady]
    overruns = sum(one.overruns + one.skipped for one in steady)
    return overruns, sum(one.cycles for one in steady), min(flat, default=0.0)


def _priority(every: Sequence[Sample]) -> str:
    if all(one.urgent for one in every):
        return "granted"
    return "not permitted here, so whatever else this machine did held the loop up too"


def _word(reached: bool) -> str:
    return "reached" if reached else "MISSED"


def rows(found: Sequence[Sample]) -> list[tuple[str, ...]]:
    """One for each."""
    return [
        (
            one.kind,
            f"{one.asked:.1f}",
            f"{one.achieved:.1f}",
            f"{one.achieved / one.wire:.1%}",
            f"{one.overruns}",
            f"{one.skipped}",
            f"{one.lateness * 1e6:.0f}",
            f"{one.cycle * 1e6:.0f}",
            f"{one.processor * 1e6:.0f}",
        )
        for one in found
    ]


def main() -> int:
    """Measure, or be measured."""
    parser = argparse.ArgumentParser(prog="python -m bench.robot_loop", description=__doc__)
    parser.add_argument("--seconds", type=float, default=SECONDS)
    parser.add_argument("--times", type=int, default=1)
    parser.add_argument("--port", help="be measured on this port")
    parser.add_argument("--kind", choices=KINDS, default=KINDS[0])
    parser.add_argument("--rate", type=float, default=0.0)
    given = parser.parse_args()
    if given.port:
        print(json.dumps(measured(given.port, given.kind, given.rate, given.seconds)))
        return 0
    found = samples(given.seconds, lambda text: print(text, file=sys.stderr), given.times)
    for row in (COLUMNS, *rows(found)):
        print("  ".join(row))
    wire = found[0].wire
    with urgent():
        system = [bare(rate, min(given.seconds, FLAT_OUT)) for rate in (0.0, SHARE * wire)]
    print("\n".join(told(one, wire) for one in system))
    share = min(one.achieved for one in found if one.asked >= wire)
    share /= system[0].achieved
    print(f"Of what bare system calls achieve flat out: {share:.1%}.")
    print(f"{verdict(found)}\nLoad of this machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores.")
    return 0


if __name__ == "__main__":
    sys.exit(main())
