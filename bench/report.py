"""From samples to what people and programs read: tables for a terminal and for the page, and all of it as JSON."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from operator import attrgetter
from typing import Any, NamedTuple

from bench import can_report, estimates, estop, goals, robot_loop, stepper_line
from bench.figures import Spread, cost, ratio
from bench.growth import Point
from bench.rounds import Sample
from bench.row import Row, met
from bench.startup import Cost
from bench.workloads import WORKLOADS

OURS = "motorbus"
MICRO = 1e6
MOST_CALLS = 4
processor = attrgetter("processor")
wall = attrgetter("wall")


class Results(NamedTuple):
    """Everything one run of the bench found.

    `calls` is None where strace could not be had; `repeated` tells how often a process of a row was run once more.
    """

    machine: dict[str, str]
    rounds: int
    wire: list[Sample]
    memory: list[Sample]
    calls: dict[tuple[str, str], dict[str, float]] | None
    starts: list[Cost]
    missing: list[str]
    rows: Sequence[Row] = ()
    failures: Sequence[str] = ()
    growth: Sequence[Point] = ()
    can: Sequence[Sample] = ()
    forecasts: Sequence[estimates.Cost] = ()
    stepper: Sequence[stepper_line.Sample] = ()
    loop: Sequence[robot_loop.Sample] = ()
    stops: Sequence[estop.Sample] = ()
    repeated: Mapping[str, int] = {}


class Table(NamedTuple):
    """A heading, column names, and rows of text."""

    title: str
    columns: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]


def _micro(value: Spread, digits: int = 1) -> tuple[str, str]:
    median, low, high = (part * MICRO for part in value)
    return f"{median:.{digits}f}", f"{low:.{digits}f} – {high:.{digits}f}"


def _ratio(samples: list[Sample], theirs: str, workload: str) -> str:
    names = {sample.contender for sample in samples if sample.workload == workload}
    if theirs == OURS or OURS not in names:
        return ""
    found = ratio(samples, OURS, theirs, workload, processor)
    return f"{found.median:.2f} ({found.low:.2f} – {found.high:.2f})"


def _contenders(samples: list[Sample]) -> list[str]:
    return sorted({sample.contender for sample in samples}, key=lambda name: (name != OURS, name))


def _calls(results: Results, contender: str, workload: str) -> str:
    if results.calls is None:
        return "not measured"
    counted = results.calls.get((contender, workload))
    return "" if counted is None else f"{sum(counted.values()):.1f}"


def goal_table(rows: Sequence[Row]) -> Table:
    """Every row beside its goal."""
    return Table("Goals", goals.COLUMNS, [goals.cells(row) for row in rows])


def growth_table(points: Sequence[Point]) -> Table:
    """What the positions of more and more servos cost."""
    rows = [(point.place, point.contender, str(point.servos), *_micro(point.seconds)) for point in points]
    return Table("Growth", ("", "", "servos", "processor µs", "min – max"), rows)


def wire_tables(results: Results) -> Iterator[Table]:
    """One table per workload on the pseudo-terminal."""
    for workload in WORKLOADS.values():
        rows = []
        for name in _contenders([one for one in results.wire if one.workload == workload.name]):
            median, extent = _micro(cost(results.wire, name, workload.name, processor))
            slow, _ = _micro(cost(results.wire, name, workload.name, wall))
            calls = _calls(results, name, workload.name)
            rows.append((name, median, extent, calls, slow, _ratio(results.wire, name, workload.name)))
        yield Table(
            f"{workload.name}: {workload.meaning}",
            ("", "processor µs", "min – max", "system calls", "wall µs", f"{OURS} needs of it"),
            rows,
        )


def memory_table(results: Results) -> Table:
    """What the libraries themselves cost, without kernel and port."""
    rows = []
    for workload in WORKLOADS:
        for name in _contenders([one for one in results.memory if one.workload == workload]):
            median, extent = _micro(cost(results.memory, name, workload, processor), 2)
            rows.append((workload, name, median, extent, _ratio(results.memory, name, workload)))
    return Table("In process", ("", "", "processor µs", "min – max", f"{OURS} needs of it"), rows)


def start_table(results: Results) -> Table:
    """What starting costs over an empty process."""
    rows = [
        (
            start.name,
            f"{start.seconds.median * 1e3:.1f}",
            f"{start.seconds.low * 1e3:.1f} – {start.seconds.high * 1e3:.1f}",
            str(start.modules),
            ", ".join(start.heavy) or "none",
        )
        for start in results.starts
    ]
    return Table("Start-up", ("", "ms", "min – max", "modules", "heavy ones loaded"), rows)


def can_table(results: Results) -> Table:
    """Positions over slcan."""
    return Table("CAN, over slcan", can_report.COLUMNS, can_report.rows(list(results.can)))


def forecast_table(results: Results) -> Table:
    """What estimating a program costs."""
    return Table("Estimates", ("", "ms", "min – max"), estimates.rows(results.forecasts))


def stepper_table(results: Results) -> Table:
    """What jobs on a stepper controller take."""
    return Table("Stepper, at 9600 baud", stepper_line.COLUMNS, stepper_line.rows(results.stepper))


def loop_table(results: Results) -> Table:
    """What a loop of a robot achieves on a line that takes its time."""
    return Table("robot.loop, six axes at 1 Mbaud", robot_loop.COLUMNS, robot_loop.rows(results.loop))


def stop_table(results: Results) -> Table:
    """How soon the first byte of an emergency stop arrives."""
    return Table("Emergency stop", estop.COLUMNS, estop.rows(results.stops))


def tables(results: Results) -> list[Table]:
    """All of them, in reading order."""
    found = [goal_table(results.rows)] if results.rows else []
    found += wire_tables(results)
    if results.memory:
        found.append(memory_table(results))
    if results.growth:
        found.append(growth_table(results.growth))
    if results.starts:
        found.append(start_table(results))
    if results.can:
        found.append(can_table(results))
    if results.forecasts:
        found.append(forecast_table(results))
    if results.stepper:
        found.append(stepper_table(results))
    if results.loop:
        found.append(loop_table(results))
    if results.stops:
        found.append(stop_table(results))
    return found


def verdict(results: Results) -> str:
    """Our system calls against what they may be: a writing, a look at what has come, a wait, a reading."""
    if results.calls is None or not any(who == OURS for who, _ in results.calls):
        return f"System calls of {OURS} were not measured."
    found = {
        name: sum(counted.values()) / (1 + bool(WORKLOADS[name].reads and WORKLOADS[name].writes))
        for (who, name), counted in results.calls.items()
        if who == OURS
    }
    reached = "reached" if all(calls <= MOST_CALLS for calls in found.values()) else "MISSED"
    shown = ", ".join(f"{name} {calls:.2f}" for name, calls in found.items())
    return f"System calls of {OURS} per exchange: {shown} (a cycle is two). At most {MOST_CALLS}: {reached}."


def spoiled(results: Results) -> str:
    """Who was measured again because an answer came too late or, of another's library, was not the one expected."""
    counts: Counter[str] = Counter(results.repeated)
    for sample in results.wire + results.memory:
        counts[sample.contender] += sample.repeats
    shown = ", ".join(f"{name} {count} times" for name, count in counts.items() if count)
    return (
        "Of what these tables, those in process and the rows 8 to 14 show, measured again after an answer that was "
        f"late or lost, or of others wrong: {shown or 'nobody'}. "
        f"A wrong value of {OURS} is not measured again."
    )


def as_text(table: Table) -> str:
    """For a terminal."""
    lines = [table.columns, *table.rows]
    widths = [max(len(line[i]) for line in lines) for i in range(len(table.columns))]
    shown = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) for line in lines]
    return "\n".join([table.title, *(f"  {line.rstrip()}" for line in shown)])


def as_markdown(table: Table) -> str:
    """For a page."""
    lines = [table.columns, tuple("---" for _ in table.columns), *table.rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def as_json(results: Results) -> str:
    """All samples and figures, for programs."""
    calls = results.calls
    document: dict[str, Any] = {
        "format": 2,
        "machine": results.machine,
        "rounds": results.rounds,
        "wire": [sample._asdict() for sample in results.wire],
        "memory": [sample._asdict() for sample in results.memory],
        "system_calls": None
        if calls is None
        else [{"contender": who, "workload": what, "calls": each} for (who, what), each in calls.items()],
        "can": [sample._asdict() for sample in results.can],
        "start_up": [{**start._asdict(), "seconds": start.seconds._asdict()} for start in results.starts],
        "estimates": [{**one._asdict(), "seconds": one.seconds._asdict()} for one in results.forecasts],
        "stepper": [sample._asdict() for sample in results.stepper],
        "loop": [sample._asdict() for sample in results.loop],
        "stops": [sample._asdict() for sample in results.stops],
        "rows": [{**row._asdict(), "met": met(row) if row.goal else None} for row in results.rows],
        "growth": [{**point._asdict(), "seconds": point.seconds._asdict()} for point in results.growth],
        "repeated": dict(results.repeated),
        "not_measured": list(results.failures),
        "missing": results.missing,
    }
    return json.dumps(document, indent=1) + "\n"
