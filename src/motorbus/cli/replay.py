"""`motorbus replay`: the movement in a file, carried out by the axes that it names; judged before anything moves."""

from __future__ import annotations

from bisect import bisect_right
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

from cyclopts import App, Parameter

from motorbus.cli.exits import Exit
from motorbus.cli.machine import machine, machine_file
from motorbus.cli.moving import Goal, absolute, consent_to_far, tell
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.rates import check_smooth
from motorbus.cli.robot import place, robot
from motorbus.cli.wording import in_words_of_the_shell
from motorbus.core import units
from motorbus.errors import LimitExceeded, RequestError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from motorbus.cli.robot import InHand
    from motorbus.motion.machine import AxisSpec
    from motorbus.motion.moving.along import Paced
    from motorbus.motion.moving.moved import Moved
    from motorbus.motion.trajectory import Trajectory

Interpolation = Literal["linear", "spline"]
FASTEST: Final = 1000.0
"""How many times as fast as in the file, or as slow, at most; beyond that its samples would fall together."""
NEAR: Final = 1e-9
"""s; moments that are no farther apart are one: the speed is multiplied, and rounding makes as much of it."""

app = App(
    name="replay",
    usage="Usage: motorbus replay FILE.csv [OPTIONS]",
    help_epilogue="""The file is CSV, as `motorbus teach` writes it: a column time, then one for
each axis of the machine file, units in the header. Its rows are joined, and
the goals that leave on the way are judged by the limits of their axes before
anything moves: it is refused with exit code 8 where one goes beyond them, with
the rows between which it does; row 1 is the first below the header. The axes
go to its first point together, then along it. A way there of more than
180 degrees needs --yes. Ctrl-C stops them.

Rows are joined by a spline, without a jump of velocity; where an axis turns
back it goes a little beyond the outermost row. linear goes straight: its
corners are hard.

What was taught by hand comes in steps, which are hard: --smooth 5 takes out
what is quicker than 5 Hz. A stepper controller cannot be led along a file.

Examples:

    motorbus replay wave.csv
    motorbus replay wave.csv --dry-run
    motorbus replay wave.csv --smooth 5 --speed 0.5
    motorbus replay wave.csv --repeat 3 --json""",
)


@app.default
def replay(
    file: Annotated[Path, Parameter(name="FILE.csv")],
    /,
    *,
    speed: str = "",
    repeat: int = 1,
    smooth: float = 0.0,
    interpolation: Interpolation = "spline",
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: str,
) -> Exit:
    """Let axes carry out the movement in a file.

    Parameters
    ----------
    file
        The movement, as wave.csv
    speed
        How fast, as 0.5 or 50% for half as fast; as in the file when left out.
    repeat
        How many times.
    smooth
        Leave out what is quicker than this, in Hz, as 5; nothing is left out at 0.
    interpolation
        What is between two rows of the file.
    yes
        Do not ask before a long way to the first point.
    options
        Any option of the buses, as a flag.
    """
    share = _share(speed)
    _check_repeat(repeat)
    wanted = _read(file, smooth)
    with _told_of(file, wanted, share):
        course = _course(wanted, share, interpolation)
    with robot(list(wanted.axes), options, output) as hand, _told_of(file, wanted, share):
        _led(hand, wanted)
        first = wanted.positions(0.0)
        present, _ = absolute(hand, {name: Goal(at, way=False) for name, at in first.items()})
        if dry_run:
            return _plan(hand, course, present)
        consent_to_far(hand, present, first, yes=yes)
        for number in range(repeat):
            with hand.working(f"replaying {number + 1} of {repeat}" if repeat > 1 else "replaying"):
                moved = hand.robot.replay(wanted, speed=share, interpolation=interpolation)
        tell(hand, "replay", moved)
        output.text(f"furthest from the file on the way: {_worst(hand, moved)}")
    return Exit.OK


def _check_repeat(repeat: int) -> None:
    if repeat < 1:
        raise RequestError(
            f"--repeat {repeat}: not at least 1",
            expected="how many times, 1 or more",
            advice="leave it out for once; nothing was sent",
        )


def _share(speed: str) -> float:
    """How fast, as a share of what the file says. Raises RequestError for a figure at which nothing can be judged."""
    share = units.parse(speed, "load") if speed else 1.0
    if not 1 / FASTEST <= share <= FASTEST:
        raise RequestError(
            f"--speed {speed}: no movement is carried out like that",
            expected=f"{1 / FASTEST:g} to {FASTEST:g} times as fast as in the file",
            advice="nothing was sent",
        )
    return share


def _read(file: Path, smooth: float) -> Trajectory:
    from motorbus.motion.trajectory import Trajectory

    check_smooth(smooth)
    try:
        wanted = Trajectory.load(file, machine().axes)
    except RequestError as error:
        if "there is no axis" in error.summary:
            machine_file().told_of(error)
        raise
    return wanted.smoothed(smooth) if smooth else wanted


def _course(wanted: Trajectory, share: float, interpolation: Interpolation) -> Paced:
    """The way on which the axes shall be led. Raises as `_judge`."""
    from motorbus.motion.moving.along import Paced

    course = Paced(wanted.joined(interpolation), share)
    _judge(course, machine().axes)
    return course


def _judge(course: Paced, axes: Mapping[str, AxisSpec]) -> Trajectory:
    """The goals of these axes as they leave at the usual rate.

    Raises LimitExceeded for a movement that goes beyond their limits.
    """
    from motorbus.motion.moving.along import judged
    from motorbus.motion.moving.stream import USUAL

    there = course.positions(0.0)
    return judged(course, {name: axes[name] for name in there if name in axes}, USUAL)


@contextmanager
def _told_of(file: Path, wanted: Trajectory, share: float) -> Iterator[None]:
    """Within it, a movement that goes beyond limits is told of in words of the shell, with the file and its rows."""
    try:
        yield
    except LimitExceeded as error:
        in_words_of_the_shell(error)
        rows = "" if error.at is None else f", {_rows(wanted.times, error.at * share)}"
        error.summary = f"{file}{rows}: {error.summary}"
        raise


def _rows(times: Sequence[float], at: float) -> str:
    """Where in a file a moment is (s from its first row), in rows below the header, counted from 1."""
    row = bisect_right(times, at + NEAR)
    return f"row {row}" if at - times[row - 1] < NEAR or row == len(times) else f"rows {row} to {row + 1}"


def _led(hand: InHand, wanted: Trajectory) -> None:
    """Raise RequestError for an axis that goes by a profile of its own, so that nobody can lead it along a file."""
    if alone := [name for name in wanted.axes if "stream" not in hand.robot[name].able]:
        raise RequestError(
            f"{', '.join(alone)}: nobody can lead such a device along a file",
            expected="axes that can be led",
            advice="leave its column out, and `motorbus move` it; nothing was sent",
        )


def _worst(hand: InHand, moved: Moved) -> str:
    axes = hand.robot.machine.axes
    return ", ".join(f"{name} {axes[name].show(track.worst)}" for name, track in moved.tracks.items())


def _plan(hand: InHand, course: Paced, present: dict[str, float]) -> Exit:
    """How it would go: no frames, for those are made on the way."""
    axes = hand.robot.machine.axes
    wanted = _judge(course, axes)
    facts = [
        {"name": name, "present": present[name], "first": places[0], "low": min(places), "high": max(places)}
        for name, places in wanted.axes.items()
    ]
    hand.output.document("motorbus.replay.plan/1", {"duration": wanted.duration, "axes": facts})
    rows = [
        (
            name,
            place(hand.robot, name, present[name]),
            *(axes[name].show(at) for at in (places[0], min(places), max(places))),
            _limits(axes[name]),
        )
        for name, places in wanted.axes.items()
    ]
    hand.output.table("", ["axis", ">present", ">first", ">lowest", ">highest", "limits"], rows)
    hand.output.text(
        f"would take {wanted.duration:.3g} s, and the way to its first point; within all limits; nothing was sent. "
        "Its frames are made on the way, from what is read then, so none can be shown."
    )
    return Exit.OK


def _limits(spec: AxisSpec) -> str:
    if spec.low is None or spec.high is None:
        return "those of its device"
    return f"{spec.show(spec.low)} to {spec.show(spec.high)}"
