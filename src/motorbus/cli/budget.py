"""`motorbus budget`: what a control loop would cost on the buses of a machine. Opens no port and sends nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, Parameter

from motorbus.cli import bus_loads, faces
from motorbus.cli.exits import Exit
from motorbus.cli.machine import is_address
from motorbus.cli.output import Output
from motorbus.cli.rates import check_rate
from motorbus.cli.target import said, target
from motorbus.core import units
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from motorbus.core.family import BusDriver, Family
    from motorbus.diagnose.budget import Budget, Span, Traffic, Transfer

app = App(
    name="budget",
    usage="Usage: motorbus budget [BUS --ids IDS | NAME... | FILE.toml] [OPTIONS]",
    help_epilogue="""Counts what a loop sends in each cycle: to each device its goal, and the
question where it is. Opens no port and sends nothing: simulated devices of the
same ids are asked how they would be spoken to, the usual model of their family
unless --model says another. Ends with exit code 1 when a bus cannot carry the
loop.

Of a machine file, or of axes, groups and buses by their names, it counts every
bus: how much of it a loop takes, and how fast that could be. Axes that move by
a profile of their own are not in a loop.

A CAN bus that is named by its address is counted to the bit, stuff bits and
the gap between frames included, over all positions: least, mean, most.
--latency is what adapter and host need for one exchange, --turnaround what a
device needs before it answers. On CAN they do not load the bus, but decide how
many exchanges must be under way at once to fill it; on a serial line nothing
else is sent while a device thinks, so there --turnaround counts.

Examples:

    motorbus budget
    motorbus budget arm --rate 200
    motorbus budget machine.toml --rate 100 --json
    motorbus budget feetech:/dev/ttyACM0 --ids 1-6 --rate 500
    motorbus budget feetech:sim,baud=115200 --ids 1-6 --turnaround 0.1ms
    motorbus budget kst:can://slcan/dev/ttyACM0 --ids 1-16 --rate 50
    motorbus budget kst:can://socketcan/can0,bitrate=1000000 --ids 1-8
    motorbus budget kst:sim --ids 1-4 --rate 200 --latency 1ms --json
    motorbus budget kst:sim --ids 1-4 --loop read --reports 10ms""",
)

Loop = Literal["write-read", "write", "read"]


@app.default
def budget(
    *targets: Annotated[str, Parameter(name="BUS")],
    ids: str = "",
    rate: float | None = None,
    loop: Loop = "write-read",
    model: str = "",
    latency: str = "0",
    turnaround: str = "0",
    reports: str = "",
    output: Annotated[Output, Parameter(parse=False)],
    **options: str,
) -> Exit:
    """Say what a control loop would load a bus with, and how fast it can be.

    Parameters
    ----------
    targets
        FAMILY:PORT, as kst:can://slcan/dev/ttyACM0,bitrate=1000000, or BUS#IDS; or names of the machine file, or such a
        file; the whole machine when left out.
    ids
        Whose loop it is, as 1-16 or 1,4,7.
    rate
        Cycles per second that are wanted; only the limit is told when left out.
    loop
        What one cycle does with each device; on CAN.
    model
        What the devices are, where they are not the usual ones of their family.
    latency
        What adapter and host need for one exchange, both ways together, as 1ms; on CAN.
    turnaround
        What a device needs before it answers, as 0.1ms.
    reports
        Every device also reports its position by itself, so often, as 10ms; on CAN.
    options
        Any option of the bus string, as a flag.
    """
    if rate is not None:
        check_rate(rate)
    asked, thinks = rate or 0.0, units.parse(turnaround, "time")
    if len(targets) == 1 and is_address(targets[0]) and target(targets[0]).family.link.kind == "frames":
        if model:
            raise RequestError("--model: frames on CAN are the same for all of them", advice="leave it out")
        times = {"latency": units.parse(latency, "time"), "turnaround": thinks}
        return _to_the_bit(targets[0], ids, asked, loop, times, reports, options, output)
    for name, given in (("loop", loop != "write-read"), ("latency", latency != "0"), ("reports", reports)):
        if given:
            raise RequestError(f"--{name} is for a CAN bus, named by its address", advice="leave it out")
    wanted = bus_loads.wanted(targets, ids, model, options)
    return bus_loads.shown(wanted, asked, thinks, output)


def _to_the_bit(
    bus: str,
    ids: str,
    rate: float,
    loop: Loop,
    times: Mapping[str, float],
    reports: str,
    options: Mapping[str, str],
    output: Output,
) -> Exit:
    from motorbus import session
    from motorbus.diagnose.budget import budget as count

    wanted = target(bus)
    nodes = bus_loads.nodes(wanted, ids)
    opening = session.prepare(wanted.bus, {**said(options)})
    bitrate = opening.rate or opening.family.link.rate
    besides = _reports(opening.driver, nodes, units.parse(reports, "time")) if reports else []
    cycle = _cycle(opening.driver, nodes, loop)
    found = count(cycle, bitrate, loop_rate=rate, besides=besides, **times)
    _show(wanted.bus, nodes, found, output)
    return Exit.OK if found.fits() else Exit.FAILURE


def _offered(family: Family, what: str) -> Any:
    found = faces.offer(family.name, what)
    if found is None:
        raise RequestError(
            f"what a loop sends to {family.name} devices is not known", advice="nothing was sent"
        )
    return found


def _cycle(driver: BusDriver, nodes: Sequence[int], loop: Loop) -> list[Transfer]:
    from motorbus.diagnose.budget import Transfer

    frames = _offered(driver.family, "budget_frames")
    names = loop.split("-")
    return [
        Transfer(node, found, f"{name} position")
        for node in nodes
        for name, found in frames(driver, node).items()
        if name in names
    ]


def _reports(driver: BusDriver, nodes: Sequence[int], interval: float) -> list[Traffic]:
    from motorbus.diagnose.budget import Traffic

    if not interval > 0:
        raise RequestError("--reports must be a time above 0", expected="as 10ms")
    frames = _offered(driver.family, "report_frames")
    return [Traffic(frames(driver, node), 1 / interval, f"reports of {node}") for node in nodes]


def _span(span: Span) -> dict[str, float]:
    return {"least": span.least, "mean": span.mean, "most": span.most}


def _facts(found: Budget) -> dict[str, Any]:
    spans = {
        name: _span(getattr(found, name)) for name in ("bits", "time", "besides", "load", "highest_rate")
    }
    names = ("bitrate", "unstuffed", "loop_rate", "sequential_rate", "in_flight", "latency", "turnaround")
    costs = [{"id": one.node, "name": one.name, "bits": _span(one.bits)} for one in found.transfers]
    return {
        **{name: getattr(found, name) for name in names},
        **spans,
        "fits": found.fits(),
        "transfers": costs,
    }


def _show(bus: str, nodes: Sequence[int], found: Budget, output: Output) -> None:
    output.document("motorbus.budget/1", {"bus": bus, "ids": list(nodes), **_facts(found)})
    rows = [_exchange(name, spans) for name, spans in _by_name(found).items()]
    rows += [
        ("one loop, bits", *_three(found.bits, "{:.0f}")),
        ("one loop, ms", *_three(found.time, "{:.3f}", 1e3)),
    ]
    if found.besides.most:
        rows.append(("reports, % of the bus", *_three(found.besides, "{:.1f}", 100)))
    if found.loop_rate:
        rows.append((f"load at {found.loop_rate:g} Hz, %", *_three(found.load, "{:.1f}", 100)))
    highest = found.highest_rate
    rows.append(("highest rate, Hz", f"{highest.most:.1f}", f"{highest.mean:.1f}", f"{highest.least:.1f}"))
    title = f"{len(nodes)} devices at {found.bitrate} bit/s"
    output.table(title, ["", ">least bits", ">mean", ">most bits"], rows)
    output.text(
        f"one exchange at a time: {found.sequential_rate:.1f} Hz; "
        f"{found.in_flight:.1f} exchanges must be under way at once to fill the bus"
    )
    if not found.fits():
        output.note(
            f"the bus cannot carry {found.loop_rate:g} Hz; at most {highest.least:.1f} Hz can be promised"
        )


def _by_name(found: Budget) -> Mapping[str, list[Span]]:
    spans: dict[str, list[Span]] = {}
    for cost in found.transfers:
        spans.setdefault(cost.name, []).append(cost.bits)
    return spans


def _exchange(name: str, spans: Sequence[Span]) -> tuple[str, ...]:
    """One exchange of this name, over all devices: ids differ in their stuff bits."""
    mean = sum(span.mean for span in spans) / len(spans)
    least, most = min(span.least for span in spans), max(span.most for span in spans)
    return (f"{name}, bits", f"{least:.0f}", f"{mean:.1f}", f"{most:.0f}")


def _three(span: Span, form: str, factor: float = 1.0) -> tuple[str, str, str]:
    least, mean, most = (form.format(factor * value) for value in (span.least, span.mean, span.most))
    return least, mean, most
