"""`motorbus safety`: what is guaranteed of a machine, and what is not. Opens no port and sends nothing."""

from __future__ import annotations

from contextlib import nullcontext
from textwrap import fill
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import App, Parameter

from motorbus.cli.exits import Exit
from motorbus.cli.machine import asked_of_the_file, is_address, machine, machine_file, shown, using
from motorbus.cli.output import Output
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from motorbus.core.guarantees import Guarantee
    from motorbus.motion.machine import Machine
    from motorbus.motion.safety.assurance import Assured, Bounded

app = App(
    name="safety",
    usage="Usage: motorbus safety [FILE] [OPTIONS]",
    help_epilogue="""Reads the machine file and what is known of its devices. Opens no port and
sends nothing. First the bounds of each axis: what the gate lets pass, how far
it may still go when the host dies while it is led, and what ends it otherwise.
Then what its devices give by themselves, bus by bus, and what holds for the
machine as a whole. `given` says how far one may rely on it.

How far an axis goes on is counted for 100 goals per second, the usual rate; at
a lower rate it goes on for longer.

motorbus is not a safety function in the sense of ISO 13849 or IEC 61508. A
hard-wired power cut is required wherever motion can hurt.

Examples:

    motorbus safety
    motorbus safety motorbus.toml
    motorbus safety machine.toml --json""",
)

WIDTH: Final = 78
COLUMNS: Final = {
    "name": "axis",
    "limits": "limits",
    "step": "max step",
    "velocity": "velocity",
    "left": "host dies",
    "exit": "exit",
    "estop": "e-stop",
}
"""What is shown of an axis, and above it."""
NONE: Final = "none"


@app.default
def safety(
    file: Annotated[str, Parameter(name="FILE")] = "",
    /,
    *,
    output: Annotated[Output, Parameter(parse=False)],
) -> Exit:
    """Say what is guaranteed of a machine, and what is not; nothing is opened.

    Parameters
    ----------
    file
        A machine file; the one that other commands would take when left out.
    """
    if is_address(file):
        raise RequestError(
            f"{file!r} is an address, and what a machine may rely on is said of a machine file",
            expected="FILE, as motorbus.toml",
            advice="`motorbus init BUS` writes one; nothing was opened",
        )
    from motorbus.session.plan import Plan

    with using(file, "the command itself") if file else nullcontext():
        with asked_of_the_file():
            Plan.of(machine())  # as whoever opens it would refuse it
        known, path = machine(), machine_file().path
    assert path is not None
    _show(shown(path), known, output)
    return Exit.OK


def _show(path: str, known: Machine, output: Output) -> None:
    from motorbus.motion.safety.assurance import SCOPE, assured, unbounded
    from motorbus.session import prepare

    families = {name: prepare(bus.address, {}).family for name, bus in known.buses.items()}
    found = assured(known, families)
    advice = unbounded(found)
    output.document("motorbus.safety/1", {"file": path, "scope": SCOPE, **_facts(found), "advice": advice})
    if output.json:
        return
    output.text(fill(SCOPE, WIDTH) + "\n")
    _axes(found.axes, output)
    for bus in found.buses:
        output.text("")
        output.text(f"{bus.name}, {bus.family} ({', '.join(bus.axes)})")
        if bus.points:
            _points(bus.points, output)
        else:
            output.text("its family does not say what its devices give: rely on nothing")
    output.text("")
    output.text(f"{known.name or path}, as a whole")
    _points(found.machine, output)
    for one in advice:
        output.note(f"note: {one}")


def _facts(found: Assured) -> dict[str, object]:
    return {
        "axes": {axis.name: axis._asdict() for axis in found.axes},
        "buses": {
            bus.name: {
                "address": bus.address,
                "family": bus.family,
                "axes": list(bus.axes),
                "points": _given(bus.points),
            }
            for bus in found.buses
        },
        "machine": _given(found.machine),
    }


def _given(points: Mapping[str, Guarantee]) -> dict[str, dict[str, str]]:
    return {about: {"given": point.given.value, "text": point.text} for about, point in points.items()}


def _axes(axes: Sequence[Bounded], output: Output) -> None:
    """One row each; a column in which nobody has anything is left out, for a note says so."""
    columns = [name for name in COLUMNS if name != "step" or any(axis.step != NONE for axis in axes)]
    rows = [[getattr(axis, name).replace("_", " ") for name in columns] for axis in axes]
    output.table("", [COLUMNS[name] for name in columns], rows)


def _points(points: Mapping[str, Guarantee], output: Output) -> None:
    rows = [(about.replace("_", " "), point.given.value, point.text) for about, point in points.items()]
    output.table("", ["", "given", ""], rows)
