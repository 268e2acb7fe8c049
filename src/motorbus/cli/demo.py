"""`motorbus demo`: nine simulated axes of three families move together, and are drawn."""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from motorbus import plot
from motorbus.cli.exits import Exit
from motorbus.cli.files import check_writable, usable
from motorbus.cli.output import Output
from motorbus.core import units
from motorbus.motion.machine.model import POSITION

if TYPE_CHECKING:
    from collections.abc import Sequence

    from motorbus.motion.machine import Machine
    from motorbus.motion.moving.moved import Moved

app = App(
    name="demo",
    help_epilogue="""Six FEETECH servos, two KST servos and the linear axis of a stepper controller
are one machine, on three simulated buses in virtual time. All nine axes start
and end together, there and back. The position of the stepper axis is
estimated: its controller tells none. No hardware is needed or touched.

Examples:

    motorbus demo
    motorbus demo --output demo.svg
    motorbus demo --json""",
)


@app.default
def demo(
    *,
    output_: Annotated[Path, Parameter(name="--output")] = Path("demo.png"),
    output: Annotated[Output, Parameter(parse=False)],
) -> Exit:
    """Move nine simulated axes of three families together, and draw them.

    Parameters
    ----------
    output_
        Path of the picture: .png, .svg or .pdf.
    """
    from motorbus import Robot

    check_writable(output_, plot.KINDS)
    output.simulated = True
    with as_file(files("motorbus.cli") / "demo.toml") as file, Robot.load(file) as robot:
        robot["slide"].declare(0.0)
        moves = [robot.pose(pose, duration=3.0) for pose in ("reach", "rest")]
        machine = robot.machine
    title = f"{len(machine.axes)} axes on {len(machine.buses)} buses"
    with usable(output_, "written"):
        plot.tracks(output_, (), _tracks(machine, moves), title=title, remark="simulated")
    movements = [
        {"duration": moved.duration, "axes": {name: one._asdict() for name, one in moved.axes.items()}}
        for moved in moves
    ]
    output.document("motorbus.demo/3", {"movements": movements, "picture": str(output_)})
    for moved in moves:
        rows = [
            (name, machine.axes[name].show(one.goal), machine.axes[name].show(one.present))
            for name, one in moved.axes.items()
        ]
        output.table("", ["axis", ">goal", ">present"], rows)
        output.text(str(moved))
    output.text(f"picture: {output_} (simulated)")
    return Exit.OK


def _tracks(machine: Machine, moves: Sequence[Moved]) -> dict[str, plot.Track]:
    """Each axis over all moves in the unit of its display, one move 0.5 s after the other."""
    tracks = {}
    for name, spec in machine.axes.items():
        scale = units.SCALES[POSITION.of(spec.linear)][spec.unit]
        times: list[float] = []
        goals: list[float] = []
        presents: list[float | None] = []
        begin = 0.0
        for moved in moves:
            track = moved.tracks[name]
            times += [begin + time for time in (*track.times, track.times[-1])]
            goals += [goal / scale for goal in (*track.goals, track.goals[-1])]
            presents += [*(present / scale for present in track.presents), None]
            begin += 0.5 + max(one.times[-1] for one in moved.tracks.values())
        tracks[name] = plot.Track(goals, presents, spec.unit, moves[0].tracks[name].estimated, times)
    return tracks
