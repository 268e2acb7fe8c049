"""Who takes the late reply to an earlier question for the answer to this one, and his own echo for a reply?

    python -m bench.stale_replies [--count 100000] [--ours 1000000] [--seed 7] [--json FILE]

The same fault for everybody: 1 % of the replies come when the reader has given up and has just asked again. After each
request the servo is elsewhere, so what was true for an earlier call only is known. Then the same on a line that echoes,
with calls to a servo that does not exist among them. Others run unmodified, each in a process of its own; the stepper
controller has no other library to compare with. Of a value of N calls ago nobody can tell where places repeat: after
4000 requests, for KST after 1801.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import sysconfig
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from bench.late import ours
from bench.late.device import ECHOES, Tally
from bench.places import PEERS, ROOT

SEED = 7
COUNT = 100_000
OURS = 1_000_000
LATE, ECHO = "late", "echo"
FAMILIES = ("feetech", "kst", "stepper")


class Peer(NamedTuple):
    """Somebody else's library: its family, its module in `bench.late`, and its folders of `.peers`."""

    name: str
    family: str
    module: str
    folders: tuple[str, ...]


OTHERS = (
    Peer("feetech-servo-sdk", "feetech", "sdk", ("feetech-servo-sdk",)),
    Peer("ftservo-python-sdk", "feetech", "sdk", ("ftservo-python-sdk",)),
    Peer("rustypot", "feetech", "rustypot", ("rustypot",)),
    Peer("canopen", "kst", "canopen_client", ("canopen",)),
)


class Result(NamedTuple):
    """What somebody made of one fault: `what` is "late", or "echo: " and the call."""

    what: str
    who: str
    family: str
    tally: Tally

    def figures(self) -> dict[str, int]:
        """By the names that tables of long runs use: `wrong` are the successes that are not true."""
        _, right, stale, errors, late = self.tally
        faults = late if self.what == LATE else self.tally.calls
        return {
            "exchanges": self.tally.calls,
            "faults": faults,
            "wrong": stale,
            "errors": errors,
            "right": right,
        }


class Failed(Exception):
    """A library could not be measured."""


def missing() -> list[str]:
    """Libraries that are not installed."""
    return [one.name for one in OTHERS if not all((PEERS / folder).is_dir() for folder in one.folders)]


def of_peer(peer: Peer, seed: int, count: int) -> list[Result]:
    """What a library makes of both faults. Raises Failed."""
    folders = [ROOT, *(PEERS / folder for folder in peer.folders)]
    if peer.family == "kst":
        folders.append(Path(sysconfig.get_path("purelib")))  # for python-can
    left = {name: value for name, value in os.environ.items() if not name.startswith(("CAN_", "PYTHON"))}
    done = subprocess.run(
        [sys.executable, "-S", "-m", f"bench.late.{peer.module}", str(seed), str(count)],
        cwd=ROOT,
        env={**left, "PYTHONPATH": os.pathsep.join(map(str, folders))},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise Failed(f"{peer.name}: {done.stderr[-2000:]}")
    told = json.loads(done.stdout)
    return list(_results(peer.name, peer.family, Tally(*told[LATE]), told[ECHO]))


def of_ours(family: str, seed: int, count: int, echoes: int = ECHOES) -> list[Result]:
    """What motorbus makes of both faults."""
    return list(_results("motorbus", family, ours.late(family, seed, count), ours.echo(family, seed, echoes)))


def _results(who: str, family: str, late: Tally, echo: dict[str, Any]) -> Iterator[Result]:
    yield Result(LATE, who, family, late)
    for call, told in echo.items():
        yield Result(f"{ECHO}: {call}", who, family, Tally(*told))


def measured(seed: int, count: int, mine: int, progress: Callable[[str], None]) -> list[Result]:
    """Everybody. Raises Failed."""
    found: list[Result] = []
    for family in FAMILIES:
        progress(f"motorbus, {family}: {mine} calls in virtual time")
        found += of_ours(family, seed, mine)
    for peer in OTHERS:
        progress(f"{peer.name}: {count} calls")
        found += of_peer(peer, seed, count)
    return found


def tables(found: Sequence[Result]) -> Iterator[str]:
    """Both, as one reads them."""
    for title, chosen in (
        ("1 % of the replies late", [one for one in found if one.what == LATE]),
        ("a line that echoes", [one for one in found if one.what != LATE]),
    ):
        head = ("library", "family", "call", "calls", "faults", "wrong, as success", "errors", "right")
        rows = [
            (one.who, one.family, one.what.removeprefix(f"{ECHO}: ").replace(LATE, "read"), *_numbers(one))
            for one in chosen
        ]
        widths = [max(len(row[place]) for row in (head, *rows)) for place in range(len(head))]
        lines = [
            "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
            for row in (head, *rows)
        ]
        yield "\n".join([title, *(line.rstrip() for line in lines)])


def _numbers(one: Result) -> tuple[str, ...]:
    return tuple(str(value) for value in one.figures().values())


def as_json(found: Sequence[Result], seed: int) -> str:
    """One record for each, with the figures that long runs tell."""
    records = [
        {"what": one.what, "who": one.who, "family": one.family, "seed": seed, **one.figures()}
        for one in found
    ]
    return json.dumps(records, indent=1) + "\n"


def main() -> int:
    """Exit code 0 when everybody was measured and motorbus believed nothing that was not so."""
    parser = argparse.ArgumentParser(prog="python -m bench.stale_replies")
    parser.add_argument("--count", type=int, default=COUNT, help="calls of each library of others")
    parser.add_argument("--ours", type=int, default=OURS, help="calls of motorbus, for each family")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--json", type=Path, help="file to write the figures to")
    given = parser.parse_args()
    if absent := missing():
        print(f"NOT AVAILABLE: {', '.join(absent)}; `make bench` installs them", file=sys.stderr)
        return 1
    try:
        found = measured(given.seed, given.count, given.ours, lambda text: print(text, file=sys.stderr))
    except Failed as error:
        print(error, file=sys.stderr)
        return 1
    print("\n\n".join(tables(found)))
    if given.json:
        given.json.write_text(as_json(found, given.seed), encoding="utf-8")
    return int(any(one.tally.stale for one in found if one.who == "motorbus"))


if __name__ == "__main__":
    sys.exit(main())
