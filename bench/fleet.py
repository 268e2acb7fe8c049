"""A fleet in memory: simulated buses full of FEETECH servos in one process, against the time that they simulate.

    python -m bench.fleet --buses 40 --goals 2 --reads 5 --seconds 4

Each bus is `motorbus.simulate` with ids 0 to 250 and an open memory link; all their virtual clocks go on together. So
many times a second every axis is given a goal anywhere in its turn (SYNC WRITE), which it never reaches before the next
one, and its position is read (SYNC READ): nobody ever rests. The requests are made beforehand and the answers counted
by their bytes, so what is measured is the simulation and its links, without a driver: a fleet that is driven by
ordinary buses needs more, and `examples/fleet.py` says how much. In the end all goals are the same again, and every
axis must have come to its own.

It is a process of its own, for its memory is measured, too: what it has more of when the fleet stands, by axis. What
lives as long as the program is taken out of the garbage collector's sight (`gc.freeze`) when the fleet stands, as
`motorbus simulate` does.
"""

from __future__ import annotations

import argparse
import gc
import json
import resource
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from random import Random
from typing import NamedTuple

import motorbus
from bench.places import ROOT
from bench.rounds import Failed
from motorbus.families.feetech import wire
from motorbus.link.memory import MemoryLink

IDS = tuple(range(251))
"""As many as one SYNC READ has room for."""
ANSWER = 8
"""Bytes of a status packet that tells a position."""
BUSES, GOALS, READS, SECONDS = 40, 2.0, 5.0, 4.0
_GOAL, _TORQUE, _POSITION = 42, 40, 56
_ALL_IN = 0.05
"""s after which every answer to a request has come: they take 0.023 s."""
_SETTLED = 4.0
"""s after which the slowest of them is there."""
_VARIANTS = 8


class Wrong(Failed):
    """A servo did not answer, or is not where it was sent."""


class Fleet(NamedTuple):
    """What a fleet cost.

    `axes`       how many
    `goals`, `reads`  of each axis in a second of its own time
    `simulated`  s that passed for them, `processor` s that it took
    `built`      s of processor time until all were there; `memory` bytes of each
    """

    axes: int
    goals: float
    reads: float
    simulated: float
    processor: float
    built: float
    memory: float

    @property
    def speed(self) -> float:
        """Simulated time by processor time: above 1 is faster than real time."""
        return self.simulated / self.processor


def measured(buses: int, goals: float, reads: float, seconds: float) -> Fleet:
    """Build a fleet and let it work for so long (s of its own time). Raises Wrong."""
    with ExitStack() as stack:
        before, began = _resident(), _processor()
        links = [_link(stack) for _ in range(buses)]
        built, memory = _processor() - began, _resident() - before
        gc.collect()
        gc.freeze()
        for link in links:
            link.write(_written(_TORQUE, [b"\1"] * len(IDS)))
        random = Random(1)
        wanted = [_goals(random) for _ in range(_VARIANTS)]
        began = _processor()
        _work(links, [_written(_GOAL, one) for one in wanted], goals, reads, seconds)
        processor = _processor() - began
        _check(links, wanted[0])
        gc.unfreeze()
        axes = buses * len(IDS)
        return Fleet(axes, goals, reads, seconds, processor, built, memory / axes)


def _work(
    links: list[MemoryLink], goals: list[bytes], goal_rate: float, read_rate: float, seconds: float
) -> None:
    """All clocks go from one moment to the next together."""
    request, answer = _asked(), ANSWER * len(IDS)
    began = links[0].now() + _ALL_IN
    for moment, kind, number in course(goal_rate, read_rate, seconds):
        for link in links:
            link.advance(began + moment - link.now())
            if kind == "goal":
                link.write(goals[number % len(goals)])
                link.advance(0.0)  # it is heard
                continue
            link.write(request)
            link.rest(link.now() + _ALL_IN)
            if sum(map(len, link.read(0.0))) != answer:
                raise Wrong("a servo did not answer")


def course(goals: float, reads: float, seconds: float) -> list[tuple[float, str, int]]:
    """Moment (s), "goal" or "read", and the how manieth it is; goals come first where both are due."""
    given = [(number / goals, "goal", number) for number in range(round(goals * seconds))]
    asked = [(number / reads, "read", number) for number in range(round(reads * seconds))]
    return sorted(given + asked)


def _check(links: list[MemoryLink], goals: list[bytes]) -> None:
    for link in links:
        link.advance(_ALL_IN)
        link.write(_written(_GOAL, goals))
        link.advance(_SETTLED)
        link.write(_asked())
        link.rest(link.now() + _ALL_IN)
        said = b"".join(bytes(one) for one in link.read(0.0) if isinstance(one, bytes))
        found = [said[begin + 5 : begin + 7] for begin in range(0, len(said), ANSWER)]
        if found != goals:
            raise Wrong("a servo is not where it was sent")


def _link(stack: ExitStack) -> MemoryLink:
    simulation = stack.enter_context(motorbus.simulate("feetech", ids=IDS))
    link = simulation.link()
    stack.callback(link.close)
    return link


def _goals(random: Random) -> list[bytes]:
    return [random.randrange(4096).to_bytes(2, "little") for _ in IDS]


def _written(address: int, values: list[bytes]) -> bytes:
    """As many packets as it takes, 80 servos in each."""
    items = [bytes((id,)) + value for id, value in zip(IDS, values, strict=True)]
    heads = bytes((address, len(values[0])))
    parts = [heads + b"".join(items[begin : begin + 80]) for begin in range(0, len(items), 80)]
    return b"".join(wire.frame(wire.BROADCAST, wire.Instruction.SYNC_WRITE, part) for part in parts)


def _asked() -> bytes:
    return wire.frame(wire.BROADCAST, wire.Instruction.SYNC_READ, bytes((_POSITION, 2, *IDS)))


def _processor() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def _resident() -> int:
    """Bytes that this process has in memory."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * resource.getpagesize()


def in_a_process(
    buses: int = BUSES, goals: float = GOALS, reads: float = READS, seconds: float = SECONDS
) -> Fleet:
    """The same in a process of its own. Raises Wrong with what that said."""
    words = [f"--{name}={value}" for name, value in (("buses", buses), ("goals", goals), ("reads", reads))]
    command = [sys.executable, "-m", "bench.fleet", *words, f"--seconds={seconds}", "--json"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        raise Wrong(done.stderr.strip())
    return Fleet(**json.loads(done.stdout))


def told(found: Fleet) -> str:
    """In two lines."""
    each = 1e6 * found.processor / found.simulated / found.axes
    return (
        f"{found.axes} axes, {found.goals:g} goals and {found.reads:g} readings of each a second: "
        f"{found.speed:.2f} times real time, {each:.0f} µs for each axis and second\n"
        f"built in {found.built:.2f} s, {found.memory / 1000:.1f} kB of memory for each axis"
    )


def main() -> None:
    """Measure as the command line says."""
    parser = argparse.ArgumentParser(prog="python -m bench.fleet")
    parser.add_argument("--buses", type=int, default=BUSES, help=f"of {len(IDS)} axes each (default {BUSES})")
    parser.add_argument(
        "--goals", type=float, default=GOALS, help=f"of each axis in a second (default {GOALS:g})"
    )
    parser.add_argument(
        "--reads", type=float, default=READS, help=f"of each axis in a second (default {READS:g})"
    )
    parser.add_argument(
        "--seconds", type=float, default=SECONDS, help=f"to be simulated (default {SECONDS:g})"
    )
    parser.add_argument("--json", action="store_true", help="for programs")
    given = parser.parse_args()
    began = time.monotonic()
    found = measured(given.buses, given.goals, given.reads, given.seconds)
    print(
        json.dumps(found._asdict())
        if given.json
        else f"{told(found)}\n{time.monotonic() - began:.1f} s in all"
    )


if __name__ == "__main__":
    main()
