"""Nine axes of three families in real time: do they start together and end together when nobody holds the clock?

    python -m bench.nine_axes [--moves 6] [--seconds 3]

Three simulated buses (two pseudo-terminals, one slcan) run in processes of their own, and their bytes take as long as
on cables. The machine is that of the demo. Each process keeps what its motors really did, on the clock that all
processes of a system share; afterwards it is asked when each began and ended. With a virtual clock the same is a test
of the suite (tests/motion/test_nine_axes.py), which asserts; this prints what a busy host makes of it.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from bench.places import ROOT, surroundings
from bench.truth import Truth, Went, listened
from motorbus import families
from motorbus.cli.nine import PARTS, machine
from motorbus.motion.moving.moved import Moved
from motorbus.session import parse_ids
from motorbus.session.robot import Robot
from motorbus.simulation.clients import CanClient
from motorbus.simulation.mount import Mount
from motorbus.simulation.pty import PtyMaster
from motorbus.simulation.slcan import SlcanAdapter

START, SHARE = 0.005, 0.02
"""What is asked of it: s between the first start and the last, and of the time of a move between the ends."""


class Spread(NamedTuple):
    """One movement as the motors made it: how long it took, and s between first and last start, and end."""

    duration: float
    starts: float
    ends: float

    @property
    def share(self) -> float:
        """The ends, as a share of the duration."""
        return self.ends / self.duration

    @property
    def good(self) -> bool:
        """Whether it is what is asked of it."""
        return self.starts <= START and self.share <= SHARE


# -- the other side ----------------------------------------------------------------------------------------------------


class Witness:
    """Tells on its standard output what the motors did between two moments that it is asked about."""

    def __init__(self, truths: Mapping[int, Truth]) -> None:
        self._truths = truths

    def descriptors(self) -> list[int]:
        """Its standard input."""
        return [sys.stdin.fileno()]

    def stuck(self) -> list[int]:
        """Nothing: what it tells has room."""
        return []

    def attend(self, descriptor: int) -> None:
        """A line with two moments came; an end of the input ends the process."""
        line = os.read(descriptor, 4096).decode()
        if not line:
            raise SystemExit
        begin, end = map(float, line.split())
        print(json.dumps({node: one.went(begin, end) for node, one in self._truths.items()}), flush=True)


def serve(name: str) -> None:
    """Serve one bus of the machine on a pseudo-terminal, paced, and say where."""
    part = PARTS[name]
    family = families.load(part.family)
    simulator = family.simulator(parse_ids(part.ids))
    truths = listened(simulator)
    with closing(PtyMaster()) as terminal:
        can = family.link.kind == "frames"
        place = CanClient(terminal, SlcanAdapter()) if can else terminal
        mount = Mount(simulator, place, pace=family.link.rate, attendants=[Witness(truths)])
        port = f"can://slcan{terminal.slave_name}" if can else terminal.slave_name
        print(json.dumps(f"{part.family}:{port}"), flush=True)
        while True:
            mount.step()


# -- this side ---------------------------------------------------------------------------------------------------------


@contextmanager
def served() -> Iterator[dict[str, subprocess.Popen[str]]]:
    """A process for each bus, by its name."""
    with ExitStack() as stack:
        children = {}
        for name in PARTS:
            child = subprocess.Popen(
                [sys.executable, "-m", "bench.nine_axes", "--serve", name],
                cwd=ROOT,
                env=dict(surroundings()),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
            stack.callback(_ended, child)
            children[name] = child
        yield children


def _ended(child: subprocess.Popen[str]) -> None:
    """Nothing more will be asked; it ends by itself."""
    assert child.stdin is not None
    assert child.stdout is not None
    child.stdin.close()
    child.stdout.close()
    child.wait(10)


def asked(child: subprocess.Popen[str], begin: float, end: float) -> dict[int, Went]:
    """What the motors of a bus did between two moments."""
    assert child.stdin is not None
    child.stdin.write(f"{begin!r} {end!r}\n")
    child.stdin.flush()
    return {int(node): Went(*told) for node, told in _told(child).items()}


def _told(child: subprocess.Popen[str]) -> Any:
    assert child.stdout is not None
    return json.loads(child.stdout.readline())


def spread(moved: Moved, found: Mapping[str, Went]) -> Spread:
    """How far apart those that moved began and ended."""
    starts, ends = [one.first for one in found.values()], [one.last for one in found.values()]
    return Spread(moved.duration, max(starts) - min(starts), max(ends) - min(ends))


def measured(moves: int, seconds: float) -> Iterator[tuple[Moved, dict[str, Went]]]:
    """Move there and back, so many times; what the host says of it, and what the motors did."""
    with TemporaryDirectory() as folder, served() as children:
        file = Path(folder) / "motorbus.toml"
        file.write_text(machine({name: _told(child) for name, child in children.items()}).text())
        with Robot.load(file) as robot:
            robot["slide"].declare(0.0)
            for number in range(moves):
                begin = time.monotonic()
                moved = robot.pose("rest" if number % 2 else "reach", duration=seconds)
                end = time.monotonic()
                went = {name: asked(child, begin, end) for name, child in children.items()}
                axes = robot.machine.axes.items()
                yield moved, {name: went[spec.bus][spec.node] for name, spec in axes}


def main(words: Sequence[str] | None = None) -> int:
    """Measure, and print a table for each movement; 1 when one of them is not what is asked of it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--moves", type=int, default=6, help="how often")
    parser.add_argument("--seconds", type=float, default=3.0, help="how long each movement takes")
    parser.add_argument("--serve", choices=PARTS, help=argparse.SUPPRESS)
    given = parser.parse_args(words)
    if given.serve:
        serve(given.serve)
    spreads = []
    for moved, found in measured(given.moves, given.seconds):
        spreads.append(spread(moved, found))
        print("\n".join(table(moved, found)), flush=True)
    print(summary(spreads))
    return 0 if all(one.good for one in spreads) else 1


def table(moved: Moved, found: Mapping[str, Went]) -> Iterator[str]:
    """A line for each axis, in ms from the first start of all."""
    origin = min(one.first for one in found.values())
    yield str(moved)
    yield "axis       first ms    1 % ms   99 % ms   last ms  mean error"
    for name, one in found.items():
        times = "".join(f"{1000 * (at - origin):10.2f}" for at in (one.first, one.one, one.most, one.last))
        yield f"{name:9}{times}  {moved.tracks[name].error:.5f}"
    this = spread(moved, found)
    yield f"starts {1000 * this.starts:.2f} ms apart, ends {1000 * this.ends:.2f} ms, {this.share:.2%} of the move\n"


def summary(spreads: Sequence[Spread]) -> str:
    """All movements in one line."""
    starts = sorted(1000 * one.starts for one in spreads)
    shares = sorted(100 * one.share for one in spreads)
    good = sum(one.good for one in spreads)
    return (
        f"{len(spreads)} movements: starts apart median {starts[len(starts) // 2]:.2f} ms, most {starts[-1]:.2f} ms; "
        f"ends apart median {shares[len(shares) // 2]:.2f} %, most {shares[-1]:.2f} % of the move; "
        f"{good} within {1000 * START:g} ms and {SHARE:.0%}"
    )


if __name__ == "__main__":
    sys.exit(main())
