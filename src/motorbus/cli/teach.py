"""`motorbus teach`: axes are led by hand, and where they go is written into a file."""

from __future__ import annotations

from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from motorbus.cli.consent import consent_to
from motorbus.cli.ending import END, asked_to_end
from motorbus.cli.exits import Exit
from motorbus.cli.files import check_writable, usable
from motorbus.cli.machine import axes_named, machine
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.rates import check_rate, check_smooth, time_of
from motorbus.cli.robot import place, robot
from motorbus.core.steps import Progress
from motorbus.errors import MotorbusError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from motorbus.cli.output import Output
    from motorbus.cli.robot import InHand
    from motorbus.motion.trajectory import Trajectory

app = App(
    name="teach",
    usage="Usage: motorbus teach [NAME...] --output FILE.csv [OPTIONS]",
    help_epilogue="""Names are those of axes, groups and buses of the machine file. Their torque is
switched off, so that they can be led by hand: AN ARM SAGS, hold it. It stays
off afterwards. An axis without a torque switch cannot be led by hand; with
--no-limp nothing is switched, and whatever moves the axes is written down.

Ends with Enter, with Ctrl-C or after --seconds, and writes the file then; it
is written when the program is told to end (SIGTERM), too. When an axis falls
silent or its port is gone, what was recorded until then is written, and the
exit code is that of the error.

A servo tells its position in steps, and steps are hard: let --smooth take them
out, here or in `motorbus replay`.

Examples:

    motorbus teach arm --output wave.csv
    motorbus teach shoulder elbow --output wave.csv --seconds 10
    motorbus teach arm --output wave.csv --rate 100 --smooth 5
    motorbus teach arm --output wave.csv --no-limp --seconds 3""",
)


@app.default
def teach(
    *names: Annotated[str, Parameter(name="NAME")],
    output_: Annotated[Path, Parameter(name="--output")],
    seconds: str | None = None,
    rate: float = 50.0,
    limp: Annotated[bool, Parameter(negative="--no-limp")] = True,
    smooth: float = 0.0,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: str,
) -> Exit:
    """Lead axes by hand, and write down where they went.

    Parameters
    ----------
    names
        Axes, groups or buses of the machine file; all axes when left out.
    output_
        The file to write, as wave.csv.
    seconds
        How long, in s or as 1500ms; until Enter or Ctrl-C when left out.
    rate
        Samples per second.
    limp
        Switch the torque off before, and leave it off.
    smooth
        Leave out what is quicker than this, in Hz, as 5; nothing is left out at 0.
    yes
        Do not ask before a file is replaced.
    options
        Any option of the buses, as a flag.
    """
    axes, span = axes_named(names), None if seconds is None else time_of(seconds)
    _check(output_, rate, smooth)
    consent_to(f"replace {output_}", output, yes=yes or dry_run or not output_.exists())
    with robot(axes, options, output) as hand:
        if dry_run:
            return _plan(hand, axes, limp=limp)
        _judge(hand, axes, named=bool(names), limp=limp)
        with hand.working("recording"), asked_to_end(also=END) as ended, _rescued(smooth, output_):
            until = counted(hand, "recording", ended, rate, span)
            taught = hand.robot.teach(
                axes if names else None, seconds=span, rate=rate, until=until, limp=limp
            )
    _keep(taught.smoothed(smooth) if smooth else taught, axes, output_, output)
    if ended.told:
        raise KeyboardInterrupt
    return Exit.OK


def _judge(hand: InHand, axes: list[str], *, named: bool, limp: bool) -> None:
    """Say that torque goes off. Raises RequestError before, for who cannot be taught."""
    from motorbus.motion.teach import taught

    taught(hand.robot, axes if named else None, limp=limp)
    if limp:
        hand.output.note("the torque goes off now, and stays off: hold what could sag")


def _check(file: Path, rate: float, smooth: float) -> None:
    """Raise RequestError for what cannot be, before anything is let go."""
    check_rate(rate)
    check_smooth(smooth)
    check_writable(file)


def counted(
    hand: InHand, what: str, ended: Callable[[], bool], rate: float, span: float | None
) -> Callable[[], bool]:
    """The same question, asked once in each cycle, which also shows for how long that has been going on."""
    cycles = 0

    def asked() -> bool:
        nonlocal cycles
        cycles += 1
        if cycles % max(1, round(rate / 10)) == 0:
            seconds = cycles / rate
            done, total = (seconds, span) if span else (0.0, 1.0)
            text = f"{what}  {seconds:.1f} s{'' if span else ', Enter ends it'}"
            hand.heard(Progress(round(1000 * done), round(1000 * total), text))
        return ended()

    return asked


def _plan(hand: InHand, axes: list[str], *, limp: bool) -> Exit:
    """Who would be let go, and where they stand now."""
    places = hand.robot.positions(axes)
    lets_go = {name: limp and hasattr(hand.robot[name], "disable_torque") for name in axes}
    facts = [{"name": name, "present": places[name], "lets_go": lets_go[name]} for name in axes]
    hand.output.document("motorbus.teach.plan/1", {"axes": facts})
    rows = [
        (
            name,
            place(hand.robot, name, places[name]),
            "would be let go" if lets_go[name] else "stays as it is",
        )
        for name in axes
    ]
    hand.output.table("", ["axis", ">present", "torque"], rows)
    return Exit.OK


@contextmanager
def _rescued(smooth: float, file: Path) -> Iterator[None]:
    """When it ends by an error, what was recorded until then is written all the same."""
    try:
        yield
    except MotorbusError as error:
        _rescue(error, smooth, file)
        raise


def _rescue(error: MotorbusError, smooth: float, file: Path) -> None:
    """Write what was recorded before this error, and add to it what is kept."""
    from motorbus.motion.trajectory import Trajectory

    taught = error.so_far
    if not isinstance(taught, Trajectory):
        return
    with suppress(MotorbusError):  # what cannot be smoothed is kept as it is
        taught = taught.smoothed(smooth) if smooth else taught
    try:
        _write(taught, file)
    except MotorbusError as failure:
        error.add_note(f"what was recorded is lost: {failure.summary}")
    else:
        samples = len(taught.times)
        error.add_note(f"kept {taught.duration:.2f} s, {samples} samples until then, in {file}")


def _write(taught: Trajectory, file: Path) -> None:
    with usable(file, "written"):
        file.write_text(taught.text(machine().axes), encoding="utf-8")


def _keep(taught: Trajectory, wanted: list[str], file: Path, output: Output) -> None:
    """Write it into its file, and say how far each axis went, and who of those wanted is not in it."""
    if left := [name for name in wanted if name not in taught.axes]:
        output.note(f"note: not taught, for nobody can lead them by hand: {', '.join(left)}")
    _write(taught, file)
    axes = machine().axes
    reach = {name: (min(places), max(places)) for name, places in taught.axes.items()}
    facts = [{"name": name, "low": low, "high": high} for name, (low, high) in reach.items()]
    samples = len(taught.times)
    output.document(
        "motorbus.teach/1",
        {"file": str(file), "seconds": taught.duration, "samples": samples, "axes": facts},
    )
    rows = [(name, axes[name].show(low), axes[name].show(high)) for name, (low, high) in reach.items()]
    output.table("", ["axis", ">lowest", ">highest"], rows)
    output.text(f"{taught.duration:.2f} s, {samples} samples in {file}")
