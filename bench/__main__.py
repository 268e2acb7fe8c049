"""`python -m bench`: measure, print, and write build/bench.json and docs/performance.md."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from bench import (
    can_rounds,
    estimates,
    estop,
    machine,
    report,
    responder,
    robot_loop,
    rounds,
    startup,
    stepper_line,
    syscalls,
)
from bench.places import BUILD, ROOT
from bench.rounds import CANDIDATES, Candidate
from bench.workloads import WORKLOADS
from motorbus.errors import MotorbusError

DOCUMENT = ROOT / "docs" / "performance.md"


def say(text: str) -> None:
    """Progress, on standard error; one line that is written over where that is a terminal."""
    if sys.stderr.isatty():
        print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)
    else:
        print(text, file=sys.stderr, flush=True)


def parsed() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m bench", description=__doc__)
    parser.add_argument("--rounds", type=int, default=7, help="shuffled rounds (default 7)")
    parser.add_argument("--count", type=int, default=3000, help="exchanges of one measurement (default 3000)")
    parser.add_argument("--only", action="append", choices=CANDIDATES, help="this contender; may be repeated")
    parser.add_argument("--output", type=Path, default=DOCUMENT, help="page to write")
    return parser.parse_args()


def counted(program: Path, candidates: list[Candidate]) -> dict[tuple[str, str], dict[str, float]] | None:
    """System calls of everyone, or None where they cannot be counted."""
    if not syscalls.available():
        say("strace is absent or may not trace: system calls are not measured\n")
        return None
    found = {}
    for candidate in candidates:
        for workload in WORKLOADS:
            say(f"system calls: {candidate.name}, {workload}")
            found[candidate.name, workload] = syscalls.per_exchange(program, candidate, workload)
    return found


def measured(given: argparse.Namespace) -> report.Results:
    """The whole run. Raises NoCompiler or Failed."""
    program = responder.build()
    wanted = [CANDIDATES[name] for name in given.only or CANDIDATES]
    missing = [candidate.name for candidate in wanted if candidate.missing()]
    there = [candidate for candidate in wanted if not candidate.missing()]
    inside = [candidate for candidate in there if candidate.in_memory]
    return report.Results(
        machine=machine.description(),
        exchanges=given.count,
        rounds=given.rounds,
        wire=rounds.rounds(rounds.on_wire(program), there, given.count, given.rounds, say),
        memory=rounds.rounds(rounds.in_memory, inside, given.count, given.rounds, say),
        calls=counted(program, there),
        starts=startup.costs(given.rounds, say),
        missing=missing + can_rounds.missing(),
        can=() if given.only or can_rounds.missing() else can_rounds.rounds(given.count, given.rounds, say),
        forecasts=() if given.only else estimates.costs(given.rounds, say),
        stepper=() if given.only else stepper_line.samples(given.rounds, say),
        loop=() if given.only else robot_loop.samples(robot_loop.SECONDS, say),
        stops=() if given.only else estop.samples(estop.STOPS, say),
    )


def main() -> int:
    """Exit code 0 when everything was measured and every value was right."""
    given = parsed()
    try:
        results = measured(given)
    except (
        responder.NoCompiler,
        rounds.Failed,
        stepper_line.Wrong,
        robot_loop.Wrong,
        estop.Wrong,
        MotorbusError,
        OSError,
    ) as error:
        print(f"\n{error}", file=sys.stderr)
        return 1
    say("")
    shown = [report.as_text(table) for table in report.tables(results)]
    print("\n\n".join([*shown, report.verdict(results), report.spoiled(results)]))
    BUILD.mkdir(exist_ok=True)
    (BUILD / "bench.json").write_text(report.as_json(results), encoding="utf-8")
    for name in results.missing:
        print(f"NOT AVAILABLE: {name}; `make bench` installs it", file=sys.stderr)
    if given.only or results.missing:
        print("not everyone was measured, so the page is left as it is", file=sys.stderr)
        return 1 if results.missing else 0
    given.output.parent.mkdir(exist_ok=True)
    given.output.write_text(report.page(results), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
