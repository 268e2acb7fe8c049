"""`python -m bench`: measure, print, and write build/bench.json, docs/performance.md and its pictures.

`--rows 4 5` measures these rows of the table of goals only, prints them, and leaves the page as it is.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TypeVar

from bench import (
    apart,
    can_rounds,
    estimates,
    estop,
    goals,
    growth,
    machine,
    page,
    plots,
    report,
    responder,
    robot_loop,
    rounds,
    samples,
    startup,
    stepper_line,
)
from bench.places import BUILD, ROOT
from bench.rounds import Sample
from bench.row import SAMPLES, Row, Say
from motorbus.errors import MotorbusError

T = TypeVar("T")

DOCUMENT = ROOT / "docs" / "performance.md"
IMAGES = DOCUMENT.parent / "images"
CAN_COUNT = 3000
"""Readings of one measurement on CAN."""
ERRORS = (
    responder.NoCompiler,
    rounds.Failed,
    stepper_line.Wrong,
    robot_loop.Wrong,
    estop.Wrong,
    MotorbusError,
    OSError,
)


def say(text: str) -> None:
    """Progress, on standard error; one line that is written over where that is a terminal."""
    if sys.stderr.isatty():
        print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)
    else:
        print(text, file=sys.stderr, flush=True)


def parsed() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m bench", description=__doc__)
    parser.add_argument("--rounds", type=int, default=SAMPLES, help="shuffled rounds (default %(default)s)")
    parser.add_argument(
        "--rows", nargs="+", default=[], metavar="N", help="only these rows of the table of goals"
    )
    parser.add_argument("--output", type=Path, default=DOCUMENT, help="page to write")
    return parser.parse_args()


def had(name: str, measure: Callable[[], T], failures: list[str], otherwise: T) -> T:
    """What was measured; where that failed it is told, for all else is worth having."""
    try:
        return measure()
    except ERRORS as error:
        failures.append(f"{name}: {(str(error).splitlines() or [type(error).__name__])[0]}")
        return otherwise


def of_each(
    name: str,
    measure: Callable[[tuple[str, ...], int, Say], Sequence[Sample]],
    times: int,
    failures: list[str],
) -> list[Sample]:
    """The samples of every group of workloads."""
    nothing: Sequence[Sample] = ()
    found = [had(name, partial(measure, group, times, say), failures, nothing) for group in samples.GROUPS]
    return [one for group in found for one in group]


def measured(times: int) -> report.Results:
    """The whole run."""
    found, failures = goals.measured(times, say)
    return report.Results(
        machine=machine.description(),
        rounds=times,
        rows=found,
        failures=failures,
        growth=had("growth", lambda: growth.points(growth.TIMES, say), failures, []),
        wire=of_each("on a pseudo-terminal", samples.on_wire, times, failures),
        memory=of_each("in process", samples.in_process, times, failures),
        calls=had("system calls", lambda: samples.all_calls(say), failures, None),
        starts=had("start-up", lambda: startup.costs(times, say), failures, []),
        missing=samples.missing() + can_rounds.missing(),
        can=had("CAN", lambda: can_rounds.rounds(CAN_COUNT, times, say), failures, []),
        forecasts=had("estimates", lambda: estimates.costs(times, say), failures, []),
        stepper=had("stepper", lambda: stepper_line.samples(times, say), failures, []),
        loop=had("robot.loop", lambda: robot_loop.samples(robot_loop.SECONDS, say), failures, []),
        stops=had("emergency stop", lambda: estop.samples(estop.STOPS, say), failures, []),
        repeated=dict(apart.repeated),
    )


def printed(found: list[Row], failures: list[str]) -> int:
    """Some rows on the terminal; exit code 1 when one could not be measured."""
    print(report.as_text(report.goal_table(found)))
    for said in (*goals.reasons(found), *goals.notes(found)):
        print(said.replace("**", ""))
    print(goals.summary(found))
    for name, times in apart.repeated.items():
        print(f"run once more {times} times: {name}", file=sys.stderr)
    for failure in failures:
        print(f"NOT MEASURED: {failure}", file=sys.stderr)
    return 1 if failures else 0


def written(results: report.Results, output: Path) -> None:
    """The page and its pictures."""
    output.parent.mkdir(exist_ok=True)
    IMAGES.mkdir(exist_ok=True)
    output.write_text(page.page(results), encoding="utf-8")
    plots.growth(IMAGES / "performance-growth.png", results.growth)
    plots.goals(IMAGES / "performance-goals.png", results.rows)


def main() -> int:
    """Exit code 0 when everything was measured and every value was right."""
    given = parsed()
    if given.rows:
        return printed(*goals.measured(given.rounds, say, given.rows))
    results = measured(given.rounds)
    say("")
    shown = [report.as_text(table) for table in report.tables(results)]
    print("\n\n".join([*shown, report.verdict(results), report.spoiled(results)]))
    BUILD.mkdir(exist_ok=True)
    (BUILD / "bench.json").write_text(report.as_json(results), encoding="utf-8")
    for name in results.missing:
        print(f"NOT AVAILABLE: {name}; `make bench` installs it", file=sys.stderr)
    if results.missing:
        print("not everyone was measured, so the page is left as it is", file=sys.stderr)
        return 1
    written(results, given.output)
    return printed(list(results.rows), list(results.failures))


if __name__ == "__main__":
    sys.exit(main())
