"""From samples to what people and programs read: one table on the terminal, the same in docs, all of it as JSON."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from operator import attrgetter
from typing import Any, NamedTuple

from bench import can_report, estimates, estop, robot_loop, stepper_line
from bench.figures import Spread, cost, ratio
from bench.rounds import Sample
from bench.startup import Cost
from bench.workloads import WORKLOADS

OURS = "motorbus"
MICRO = 1e6
MOST_CALLS = 4
processor = attrgetter("processor")
wall = attrgetter("wall")


class Results(NamedTuple):
    """Everything one run of the bench found. `calls` is None where strace could not be had."""

    machine: dict[str, str]
    exchanges: int
    rounds: int
    wire: list[Sample]
    memory: list[Sample]
    calls: dict[tuple[str, str], dict[str, float]] | None
    starts: list[Cost]
    missing: list[str]
    can: Sequence[Sample] = ()
    forecasts: Sequence[estimates.Cost] = ()
    stepper: Sequence[stepper_line.Sample] = ()
    loop: Sequence[robot_loop.Sample] = ()
    stops: Sequence[estop.Sample] = ()


class Table(NamedTuple):
    """A heading, column names, and rows of text."""

    title: str
    columns: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]


def _micro(value: Spread, digits: int = 1) -> tuple[str, str]:
    median, low, high = (part * MICRO for part in value)
    return f"{median:.{digits}f}", f"{low:.{digits}f} – {high:.{digits}f}"


def _ratio(samples: list[Sample], theirs: str, workload: str) -> str:
    names = {sample.contender for sample in samples}
    if theirs == OURS or OURS not in names:
        return ""
    found = ratio(samples, OURS, theirs, workload, processor)
    return f"{found.median:.2f} ({found.low:.2f} – {found.high:.2f})"


def _contenders(samples: list[Sample]) -> list[str]:
    return sorted({sample.contender for sample in samples}, key=lambda name: (name != OURS, name))


def _calls(results: Results, contender: str, workload: str) -> str:
    if results.calls is None:
        return "not measured"
    return f"{sum(results.calls[contender, workload].values()):.1f}"


def wire_tables(results: Results) -> Iterator[Table]:
    """One table per workload on the pseudo-terminal."""
    for workload in WORKLOADS.values():
        rows = []
        for name in _contenders(results.wire):
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
        for name in _contenders(results.memory):
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
    found = list(wire_tables(results))
    if results.memory:
        found.append(memory_table(results))
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
    exchanges = {name: 1 + bool(load.reads and load.writes) for name, load in WORKLOADS.items()}
    found = {name: sum(results.calls[OURS, name].values()) / exchanges[name] for name in WORKLOADS}
    reached = "reached" if all(round(calls, 1) <= MOST_CALLS for calls in found.values()) else "MISSED"
    shown = ", ".join(f"{name} {calls:.1f}" for name, calls in found.items())
    return f"System calls of {OURS} per exchange: {shown} (a cycle is two). At most {MOST_CALLS}: {reached}."


def spoiled(results: Results) -> str:
    """Who had to be measured again because an answer came too late, or was not the one expected."""
    counts: Counter[str] = Counter()
    for sample in results.wire + results.memory:
        counts[sample.contender] += sample.repeats
    shown = ", ".join(f"{name} {count} times" for name, count in counts.items() if count)
    return f"Measured again after an answer that was late or lost: {shown or 'nobody'}."


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
        "format": 1,
        "machine": results.machine,
        "exchanges": results.exchanges,
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
        "missing": results.missing,
    }
    return json.dumps(document, indent=1) + "\n"


_PAGE = """# Performance

This page is written by `make bench`, which runs every contender side by side on one machine, in processes of
their own and in shuffled rounds, and checks every value that was read and every goal that arrived. The numbers are
of one run, on {machine}.

{rounds} rounds of {exchanges} exchanges each. *{ours} needs of it* is our processor time divided by theirs, taken
within each round: the median, and in brackets the least and the greatest. Below 1 is cheaper.

## On a pseudo-terminal

The other end is a responder in C that answers at once, so what differs is the library. Wall time here is mostly the
kernel waking two processes and does not separate good libraries; on a real line the wire sets it. The *bare loop* is
`os.write`, `poll`, `os.read` with no checks at all: the floor, not a library. System calls are counted by `strace`.
In sync-write one exchange in 32 is followed by a reading that waits for the responder; its time is not counted, its
system calls are.

{verdict}
{spoiled}

{wire}## In process

The same exchanges with the answers handed over in memory: what the library itself costs. Only libraries in Python
can be measured so.

{memory}

{can}## Start-up

Wall time of a whole process less that of an empty one, the best of four of each, with compiled modules at hand.

{start}
{forecasts}{stepper}{loop}{stops}"""

_FORECASTS = """
## Estimates

A program of ten steps for the stepper controller, estimated in this process. The longest that ten steps can be has
645 160 executions, and with carried pulses each of them is reckoned.

"""


def page(results: Results) -> str:
    """docs/performance.md."""
    machine = results.machine
    wire = "".join(f"### {table.title}\n\n{as_markdown(table)}\n\n" for table in wire_tables(results))
    return _PAGE.format(
        machine=f"{machine['processor']} with {machine['cores']} cores, {machine['system']}, {machine['python']}",
        rounds=results.rounds,
        exchanges=results.exchanges,
        ours=OURS,
        verdict=verdict(results),
        spoiled=spoiled(results),
        wire=wire,
        memory=as_markdown(memory_table(results)),
        can=can_report.TEXT + as_markdown(can_table(results)) + "\n\n" if results.can else "",
        start=as_markdown(start_table(results)),
        forecasts=_estimated(results),
        stepper=_on_the_line(results),
        loop=in_a_loop(results),
        stops=in_an_emergency(results),
    )


def _estimated(results: Results) -> str:
    if not results.forecasts:
        return ""
    return f"{_FORECASTS}{as_markdown(forecast_table(results))}\n\n{estimates.verdict(results.forecasts)}\n"


_STEPPER = """
## Stepper, at 9600 baud

A simulated controller in a process of its own, on a pseudo-terminal on which bytes take their time. *Said beforehand*
is the cost that motorbus shows before it writes, and of a backup the time of its bytes: each project is read twice.

"""


def _on_the_line(results: Results) -> str:
    if not results.stepper:
        return ""
    return f"{_STEPPER}{as_markdown(stepper_table(results))}\n\n{stepper_line.verdict(results.stepper)}\n"


_LOOP = """
## robot.loop, six axes at 1 Mbaud

The responder again, on which bytes now take their time as on a half-duplex line: 88 of them a cycle, for six goals and
six positions. Asked for the highest rate that `robot.budget()` names, which is that of the wire, a loop shows what it
achieves; at 80 % of it no cycle is to be late. Loop and responder run with real-time priority where that is permitted,
as a control loop would; whatever else the machine does meanwhile shows all the same. *Late* is how long after the
beginning of its slot a cycle began on average, *cycle* how long it took from there until all readings were in.

"""


def in_a_loop(results: Results) -> str:
    """The part of the page on the loop; "" where it was not measured."""
    if not results.loop:
        return ""
    return f"{_LOOP}{as_markdown(loop_table(results))}\n\n{robot_loop.verdict(results.loop)}\n"


_STOPS = """
## Emergency stop

From the moment at which a program asks for an emergency stop of a machine to the first byte of it that arrives at the
other end of a pseudo-terminal, by the clock of whoever listens there. Four buses in one program: six servos that a
thread polls, a stepper controller, a line on which somebody talks without a pause, and one from which nobody reads.
Devices and listeners are processes of their own, and for each processor two more processes only compute. Program and
listeners have real-time priority where that is permitted; without it the last thousandth shows how long the system lets
a process wait that others compute beside. On a real line what is being said when the stop is asked for adds the rest of
its time: see [Safety](explanation/safety.md).

"""


def in_an_emergency(results: Results) -> str:
    """The part of the page on emergency stops; "" where they were not measured."""
    if not results.stops:
        return ""
    return f"{_STOPS}{as_markdown(stop_table(results))}\n\n{estop.verdict(results.stops)}\n"
