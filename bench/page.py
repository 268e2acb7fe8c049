"""docs/performance.md: the table of goals and its pictures, then the details of each workload and of all else."""

from __future__ import annotations

from collections.abc import Sequence

from bench import can_report, estimates, estop, goals, growth, robot_loop, stepper_line
from bench.report import (
    OURS,
    Results,
    as_markdown,
    can_table,
    forecast_table,
    goal_table,
    growth_table,
    loop_table,
    memory_table,
    spoiled,
    start_table,
    stepper_table,
    stop_table,
    verdict,
    wire_tables,
)

_PAGE = """# Performance

This page is written by `make bench`, which runs every contender side by side on one machine, in processes of
their own and in shuffled rounds, and checks every value that was read, and every goal where the other end keeps books
of what arrived: on the pseudo-terminal, not in process. The numbers are of one run, on {machine}.

{goals}## On a pseudo-terminal

{rounds} rounds. *{ours} needs of it* is our processor time divided by theirs, taken within each round: the median, and
in brackets the least and the greatest. Below 1 is cheaper. Of each round nine stretches are timed one after the other,
and the one in the middle counts, for a machine that is shared is slow now and then. A contender that has no call for a
workload is not in its table.

The other end is a responder in C that answers at once and in one burst, so what differs is the library. Wall time here
is mostly the kernel waking two processes and does not separate good libraries; on a real line the wire sets it. The
*bare loop* is `os.write`, `poll`, `os.read` with no checks at all: the floor, not a library. System calls are counted
by `strace`. Of the writes, which nobody answers, one in 32 (of thirty servos one in 8) is followed by a reading that
waits for the responder; its time is not counted, its system calls are.

*lerobot* is LeRobot's FEETECH bus, lerobot 0.4.4, the newest for Python 3.11. The package asks for torch, 539 MB alone,
and for much besides before that bus can be imported, though the bus uses next to none of it; small modules stand in for
what it imports. It has no call for 15 bytes or for six. servolab's states are 15 bytes of each servo, so its sync reads
are measured with those.

{verdict}
{spoiled}

{wire}## In process

The same exchanges with the answers handed over in memory: what the library itself costs. Only libraries in Python
can be measured so.

{memory}

{growth}{can}## Start-up

Wall time of a whole process less that of an empty one, the best of four of each, with compiled modules at hand.

{start}
{forecasts}{stepper}{loop}{stops}"""

_GOALS = """## Goals

{summary} A ratio is the median of those taken within each round, ours by theirs where it is to be at most so much,
theirs by ours where it is to be at least so much. What is measured in one thread may miss its goal by 15 % and what
takes two processes by 25 %, for the machine is shared; a share of the wire limit, a cycle rate, a count, a time in ms
and real time may not. Of the rows 4 to 7 and 12 one that misses is measured once more, and the second time counts. The
*best* other library of a workload is the one in Python that needs least in the same run, and in row 10 in the same
round. A row that misses says why, below the table; one without a goal is told beside the one that is judged. *In one
burst* and *in pieces* say how an adapter hands over the answers of several servos: all at once when the last byte has
passed, or each packet as it has.

![Every figure beside its goal](images/performance-goals.png)

{table}

{reasons}{notes}{failures}"""

_GROWTH = """## Growth with the number of servos

Positions by SYNC READ, the middle of {grown} rounds. Above 240 servos it takes two packets. So long a train of answers
is asked for on purpose here, by `air=`; unless told so, motorbus reads more than about fifty servos by several
requests, so that a stop need not wait for one that long.

![Processor time against the number of servos](images/performance-growth.png)

{table}

"""

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
        ours=OURS,
        verdict=verdict(results),
        spoiled=spoiled(results),
        goals=_goals(results),
        growth=_growth(results),
        wire=wire,
        memory=as_markdown(memory_table(results)),
        can=can_report.TEXT + as_markdown(can_table(results)) + "\n\n" if results.can else "",
        start=as_markdown(start_table(results)),
        forecasts=_estimated(results),
        stepper=_on_the_line(results),
        loop=in_a_loop(results),
        stops=in_an_emergency(results),
    )


def _goals(results: Results) -> str:
    failures = "".join(f"Not measured: {one}.\n\n" for one in results.failures)
    if not results.rows:
        return failures
    table = as_markdown(goal_table(results.rows))
    said = {
        "reasons": _list("Why rows miss", goals.reasons(results.rows)),
        "notes": _list("Measured besides", goals.notes(results.rows)),
    }
    return _GOALS.format(summary=goals.summary(results.rows), table=table, failures=failures, **said)


def _list(head: str, texts: Sequence[str]) -> str:
    return f"### {head}\n\n" + "".join(f"- {text}\n" for text in texts) + "\n" if texts else ""


def _growth(results: Results) -> str:
    if not results.growth:
        return ""
    return _GROWTH.format(grown=growth.TIMES, table=as_markdown(growth_table(results.growth)))


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
