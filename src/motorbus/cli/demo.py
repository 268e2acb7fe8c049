"""`motorbus demo`: nine simulated axes of three families move together, and are drawn."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated, Final

from cyclopts import Parameter
from msgspec import Struct

from motorbus import Robot, plot
from motorbus.cli.common import Common
from motorbus.cli.output import emit, note
from motorbus.core import units
from motorbus.errors import RequestError
from motorbus.motion.commands import AxisResult
from motorbus.motion.machine import AxisConfig
from motorbus.motion.state import RobotState

DURATION: Final = 3.0  # s of each move
DEPTH: Final = 100_000  # states


class AxisEnd(Struct, frozen=True):
    """Goal and final position of an axis in its display unit."""

    goal: str
    position: str


class Demo(Struct, frozen=True, tag="demo"):
    """The axes after the moves, the duration of each move (s), the picture."""

    axes: dict[str, AxisEnd]
    durations: tuple[float, ...]
    picture: str


def demo(
    *,
    output: Annotated[Path, Parameter(help="Picture: .png, .svg or .pdf.")] = Path("demo.png"),
    common: Common = Common(),
) -> None:
    """Move nine simulated axes of three families together, and draw them.

    Examples:

        motorbus demo
        motorbus demo --output demo.svg
        motorbus demo --json

    Six FEETECH servos, two KST servos and the linear axis of a stepper controller are
    one machine on three simulated buses, in virtual time. No hardware is touched.
    """
    if output.suffix.lower() not in plot.KINDS:
        raise RequestError(
            f"{output}: not a picture", expected=f"a name that ends in {', '.join(plot.KINDS)}"
        )
    if not common.json:
        note("simulated", once=True)
    states: list[RobotState] = []
    with as_file(files("motorbus.cli") / "demo.toml") as file, Robot.load(file) as robot:
        robot.set_position("slide", 0.0)
        subscription = robot.subscribe(depth=DEPTH)
        results = [robot.pose(pose, duration=DURATION) for pose in ("reach", "rest")]
        while (state := subscription.get()) is not None:
            states.append(state)
        config = robot.config
    tracks = {name: _track(states, name, config.axes[name].display_unit) for name in config.axes}
    plot.tracks(
        output,
        (),
        tracks,
        title=f"{len(tracks)} axes on {len(config.buses)} buses",
        remark="simulated",
    )
    axes = {name: _end(config.axes[name], one) for name, one in results[-1].axes.items()}
    emit(Demo(axes, tuple(one.duration for one in results), str(output)), common)


def _end(config: AxisConfig, result: AxisResult) -> AxisEnd:
    position = "unknown" if result.position is None else config.show(result.position)
    return AxisEnd(config.show(result.goal), position)


def _track(states: Sequence[RobotState], name: str, unit: str) -> plot.Track:
    """An axis over time in its display unit."""
    quantity = "length" if unit in units.SCALES["length"] else "position"
    scale = units.SCALES[quantity][unit]
    known = [(state.at, state.axes[name]) for state in states if state.axes[name].position is not None]
    begin = states[0].at if states else 0.0
    return plot.Track(
        [((one.position or 0.0) if one.target is None else one.target) / scale for _, one in known],
        [None if one.position is None else one.position / scale for _, one in known],
        unit,
        any(one.estimated for _, one in known),
        [at - begin for at, _ in known],
    )
