"""`motorbus loop-stats`: how well a control loop keeps its rate on this host, with these buses. Nothing moves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from motorbus.cli.ending import asked_to_end
from motorbus.cli.exits import Exit, Partial
from motorbus.cli.machine import axes_named
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.rates import check_rate, time_of
from motorbus.cli.robot import rehearse, robot
from motorbus.core.steps import Progress
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from motorbus.cli.output import Output
    from motorbus.cli.robot import InHand
    from motorbus.motion.loop.grid import Statistics, Took

app = App(
    name="loop-stats",
    usage="Usage: motorbus loop-stats [NAME...] [OPTIONS]",
    help_epilogue="""Runs a loop over axes of the machine file and says how it kept to its grid. It
only reads positions: nothing moves, and no torque is switched. With --hold it
gives torque and sends each axis its own position as a goal in every cycle, as
a loop that controls does: so they stay where they are.

An overrun is a cycle that was not over when the next one was due; a slot of
the grid that went by as a whole is skipped. Neither is ever made up for. Late
is a cycle by the time from its slot to its first byte. Ends with exit code 6
when readings were lost.

Examples:

    motorbus loop-stats
    motorbus loop-stats arm --rate 200 --seconds 10
    motorbus loop-stats shoulder elbow --rate 100 --hold
    motorbus loop-stats arm --rate 200 --json""",
)


@app.default
def loop_stats(
    *names: Annotated[str, Parameter(name="NAME")],
    rate: float = 100.0,
    seconds: str = "5",
    hold: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: str,
) -> Exit:
    """Measure how well a loop over axes keeps its rate.

    Parameters
    ----------
    names
        Axes, groups or buses of the machine file; all axes when left out.
    rate
        Cycles per second.
    seconds
        For how long, in s or as 500ms; Enter or Ctrl-C end it earlier.
    hold
        Give torque, and send each axis its own position as a goal in every cycle.
    options
        Any option of the buses, as a flag.
    """
    axes, span = axes_named(names), time_of(seconds, advice="leave it out for 5 s")
    check_rate(rate)
    if dry_run and not hold:
        raise RequestError(
            "without --hold it changes nothing, so there is nothing to rehearse",
            expected="--hold with --dry-run",
            advice="leave it out; nothing was sent",
        )
    with robot(axes, options, output) as hand:
        if dry_run:
            rehearse(hand, axes, lambda axis: axis.hold())
            return Exit.OK
        took, without, found = _run(hand, axes, rate, span, hold=hold)
        specs = hand.robot.machine.axes
    there = {bus: [name for name in found.lost if specs[name].bus == bus] for bus in found.buses}
    _tell(took, without, found, there, output)
    return Exit.OK


def _run(
    hand: InHand, axes: list[str], rate: float, span: float, *, hold: bool
) -> tuple[float, tuple[str, ...], Statistics]:
    """How long the loop went on from its first cycle to its last (s), whom it left out, and what became of it."""
    with (
        hand.working("looping"),
        asked_to_end() as ended,
        hand.robot.loop(rate, axes) as loop,
    ):
        first = last = None
        for state in loop:
            if hold and first is None:
                loop.goal.update(state.position)
            first, last = state.at if first is None else first, state.at
            if loop.statistics.cycles % max(1, round(rate / 10)) == 0:
                hand.heard(Progress(round(1000 * (last - first)), round(1000 * span), "looping"))
            if last - first >= span or ended():
                break
    return (last or 0.0) - (first or 0.0), loop.without, loop.statistics


def _tell(
    took: float, without: Sequence[str], found: Statistics, axes: Mapping[str, list[str]], output: Output
) -> None:
    achieved = (found.cycles - 1) / took if took > 0 else 0.0
    lost = {name: count for name, count in found.lost.items() if count}
    buses = {name: {"axes": axes[name], "cycle": _took(one)} for name, one in found.buses.items()}
    facts: dict[str, object] = {"rate": found.rate, "achieved_rate": achieved, "seconds": took}
    facts |= {"cycles": found.cycles, "overruns": found.overruns, "skipped": found.skipped}
    facts |= {"lateness": _took(found.lateness), "cycle": _took(found.cycle), "buses": buses}
    output.document("motorbus.loop-stats/1", {**facts, "lost": lost, "without": list(without)})
    rows = [(name, len(axes[name]), _ms(one.mean), _ms(one.most)) for name, one in found.buses.items()]
    columns = ["bus", ">axes", ">cycle ms", ">longest ms"]
    output.table("", columns, rows)
    output.text(
        f"{achieved:.1f} of {found.rate:g} cycles per second, {found.cycles} in {took:.2f} s: "
        f"{found.overruns} overruns, {found.skipped} slots skipped"
    )
    output.text(
        f"began late by {_ms(found.lateness.mean)} ms in the mean, {_ms(found.lateness.most)} ms at most"
    )
    if without:
        output.note(f"note: {', '.join(without)}: not in a loop, for nobody can lead such a device")
    if lost:
        raise Partial(
            f"readings lost: {', '.join(f'{name} {count}' for name, count in lost.items())}",
            advice="see to power and cables; a lower --rate shows whether it is the wire",
        )
    output.text("readings lost: none")


def _took(found: Took) -> dict[str, float]:
    return {"mean": found.mean, "most": found.most}


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.3f}"
