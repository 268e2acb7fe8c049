"""The load of each bus of a machine by a loop, or of one bus by its address: who is meant, and the table of it."""

from __future__ import annotations

from contextlib import nullcontext
from typing import TYPE_CHECKING

from motorbus.cli.exits import Exit
from motorbus.cli.machine import axes_named, is_address, machine, using
from motorbus.cli.target import Target, said, target
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from motorbus.cli.output import Output
    from motorbus.diagnose.loops import Counted, Wanted
    from motorbus.motion.budget import RobotBudget


# -- who is meant ------------------------------------------------------------------------------------------------------


def wanted(targets: Sequence[str], ids: str, model: str, options: Mapping[str, str]) -> dict[str, Wanted]:
    """One bus by its address, or what names of the machine file stand for. Raises RequestError for neither."""
    if any(map(is_address, targets)):
        if len(targets) != 1:
            raise RequestError(
                "one bus at a time, where it is named by its address", expected="BUS --ids IDS, or names"
            )
        return {targets[0]: _bus(target(targets[0]), ids, model, options)}
    if ids or model or options:
        given = ["--ids"] * bool(ids) + ["--model"] * bool(model) + [f"--{name}" for name in options]
        raise RequestError(
            f"{given[0]} goes with the address of a bus", advice="leave it out; nothing was sent"
        )
    of_file = bool(targets) and targets[0].endswith(".toml")
    with using(targets[0], "the command itself") if of_file else nullcontext():
        return _machine(tuple(targets[of_file:]))


def nodes(found: Target, ids: str) -> tuple[int, ...]:
    """Whose loop it is. Raises RequestError when nobody says so, or for what is no id."""
    from motorbus import session

    named = session.parse_ids(ids) if ids else found.nodes
    if not named:
        raise RequestError("whose loop is it?", expected="--ids 1-6, or BUS#1-6")
    for node in named:
        found.family.devices.blocking(None, node)  # raises when it is no id
    return named


def _bus(found: Target, ids: str, model: str, options: Mapping[str, str]) -> Wanted:
    from motorbus.diagnose.loops import Wanted
    from motorbus.session import parse_address

    spot = parse_address(found.bus)
    address = spot._replace(options={**spot.options, **said(options)}).bus
    return Wanted(address, {node: str(node) for node in nodes(found, ids)}, model)


def _machine(names: tuple[str, ...]) -> dict[str, Wanted]:
    from motorbus.diagnose.loops import Wanted

    known = machine()
    there: dict[str, dict[int, str]] = {}
    for name in axes_named(names):
        spec = known.axes[name]
        there.setdefault(spec.bus, {})[spec.node] = name
    return {bus: Wanted(known.buses[bus].address, axes) for bus, axes in there.items()}


# -- what it costs -----------------------------------------------------------------------------------------------------


def shown(buses: Mapping[str, Wanted], rate: float, turnaround: float, output: Output) -> Exit:
    """Count and print it; the exit code says whether it fits. Raises RequestError for figures that cannot be."""
    from motorbus.diagnose.loops import count
    from motorbus.motion.budget import RobotBudget, check_figures

    check_figures(rate, turnaround)
    counts = {name: count(one, turnaround=turnaround) for name, one in buses.items()}
    found = {name: one for name, one in counts.items() if one is not None}
    without = tuple(axis for name in counts if name not in found for axis in buses[name].axes.values())
    if not found:
        raise RequestError(
            f"{', '.join(buses)}: not in a loop, for such devices move by a profile of their own",
            expected="devices that can be led by small goals",
            advice="nothing was sent",
        )
    whole = RobotBudget(rate, {name: one.budget for name, one in found.items()}, without)
    facts = [_facts(name, one, rate) for name, one in found.items()]
    output.document(
        "motorbus.budget.loop/1",
        {"loop_rate": rate, "buses": facts, "without": list(without)}
        | {"highest_rate": whole.highest_rate, "slowest": whole.slowest, "fits": whole.fits()},
    )
    load = [f">load at {rate:g} Hz, %"] if rate else []
    output.table(
        "",
        ["bus", ">axes", ">bit/s", ">goals, ms", ">readings, ms", *load, ">highest rate, Hz"],
        (_row(name, one, rate) for name, one in found.items()),
    )
    _sum_up(whole, output)
    return Exit.OK if whole.fits() else Exit.FAILURE


def _sum_up(whole: RobotBudget, output: Output) -> None:
    more = f": {whole.slowest} is the slowest bus" if len(whole.buses) > 1 else ""
    output.text(f"at most {whole.highest_rate:.1f} cycles per second{more}")
    thinks = whole.buses[whole.slowest]
    if thinks.waits:
        share = thinks.waits / (thinks.wire + thinks.waits)
        output.text(
            f"{100 * share:.0f}% of each cycle is time in which devices think and {whole.slowest} stands still"
        )
    if whole.without:
        output.note(f"note: {', '.join(whole.without)}: not in a loop, for nobody can lead such a device")
    if not whole.fits():
        over = [name for name, one in whole.buses.items() if one.highest_rate < whole.rate]
        output.note(f"a loop of {whole.rate:g} Hz does not fit: {', '.join(over)} cannot carry it")


def _facts(name: str, one: Counted, rate: float) -> dict[str, object]:
    found = one.budget
    facts: dict[str, object] = {"bus": name, "axes": list(found.axes), "rate": found.bit_rate}
    facts |= {
        "exchanges": found.requests,
        "replies": found.replies,
        "wire": found.wire,
        "waits": found.waits,
    }
    facts |= {"goals": one.goals, "readings": one.readings, "highest_rate": found.highest_rate}
    return {**facts, "load": found.load(rate)}


def _row(name: str, one: Counted, rate: float) -> Sequence[object]:
    found = one.budget
    load = [f"{100 * found.load(rate):.1f}"] if rate else []
    times = (f"{1e3 * one.goals:.3f}", f"{1e3 * one.readings:.3f}")
    return (name, len(found.axes), found.bit_rate, *times, *load, f"{found.highest_rate:.1f}")
