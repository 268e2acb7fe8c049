"""`motorbus demo`: the whole of it without hardware. Six simulated devices are found, identified and moved.

The devices live in a process of their own on a pseudo-terminal, so that everything between here and them is as it
would be with a cable. Bytes take their time on the wire, so the loop rate is one that a real bus could reach. Of a
family whose devices no loop controls, its face shows what they do.
"""

from __future__ import annotations

import math
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple

from cyclopts import App, Parameter

from motorbus.cli import faces, scan
from motorbus.cli.exits import Exit
from motorbus.cli.files import usable
from motorbus.cli.output import Output
from motorbus.cli.simulated import Simulated
from motorbus.cli.target import face, nobody, opened
from motorbus.core import units
from motorbus.errors import MotorbusError, RequestError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from motorbus.bus.pump import Bus
    from motorbus.cli.output import Bar
    from motorbus.core.family import Found

app = App(
    name="demo",
    help_epilogue="""No hardware is needed or touched: everything is simulated, and says so.

Examples:

    motorbus demo
    motorbus demo --output demo.png --duration 4
    motorbus demo --family stepper --output run.png
    motorbus demo --json""",
)

AMPLITUDE: Final = 0.8
"""rad; how far the wave goes to either side."""
FREQUENCY: Final = 0.4
"""Hz of the wave; its fastest is 2 rad/s."""
RAMP: Final = 1.0
"""s in which the wave grows at the beginning and dies at the end, so that it starts and ends at rest."""


class Course(NamedTuple):
    """What the devices were told and what they did: rad, one row per device; times in s from the start."""

    times: list[float]
    goals: list[list[float]]
    presents: list[list[float | None]]
    air_time: float

    @property
    def rate(self) -> float:
        """Cycles per second."""
        return (len(self.times) - 1) / self.times[-1] if len(self.times) > 1 else 0.0


@app.default
def demo(
    *,
    output_: Annotated[Path, Parameter(name="--output")] = Path("demo.png"),
    ids: str = "1-6",
    duration: float = 6.0,
    family: str = "",
    output: Annotated[Output, Parameter(parse=False)],
) -> Exit:
    """Find, identify and move six simulated devices, and draw what they did.

    Parameters
    ----------
    output_
        Where the picture goes; .png or .svg.
    ids
        The ids of the simulated devices.
    duration
        Seconds of motion.
    family
        Of which family; of a stepper controller a project is written and run.
    """
    from motorbus import session

    if not 1.0 <= duration <= 60.0:
        raise RequestError(f"--duration {duration}: too short or too long", expected="1 to 60 seconds")
    nodes = session.parse_ids(ids)
    family = family or next((name for name in faces.names() if faces.offer(name, "Train")), "")
    output.simulated = True
    if (own := faces.offer(family, "demo")) is not None:
        with _served(family, "1", output) as bus, opened(bus, {}, output) as opening:
            own(opening, duration, output_, output)
        return Exit.OK
    if faces.offer(family, "Train") is None:
        shown = [name for name in faces.names() if faces.offer(name, "Train") or faces.offer(name, "demo")]
        raise RequestError(f"--family {family}: there is nothing to show", expected=", ".join(shown))
    with _served(family, ids, output) as bus, opened(bus, {}, output) as opening:
        found = _found(bus, opening, nodes, output)
        _introduce(opening, found, output)
        course = _moved(opening, nodes, duration, output)
    picture = _drawn(output_, course, found, output)
    _sum_up(bus, course, found, picture, output)
    return Exit.OK


@contextmanager
def _served(family: str, ids: str, output: Output) -> Iterator[str]:
    """The simulated bus, in a process of its own."""
    with TemporaryDirectory(prefix="motorbus-demo-") as folder:
        output.note(f"simulated: {family} devices {ids} in a process of their own, on a pseudo-terminal")
        with Simulated(family, ids=ids, link=Path(folder) / "bus", pace=True) as simulated:
            yield simulated.bus


def _found(bus: str, opening: Bus, nodes: Sequence[int], output: Output) -> list[Found]:
    """Ask the ids that are there, and some that are not, as a real scan would."""
    asked = tuple(range(max(nodes) + 10))
    with output.progress("scanning") as bar:
        found = opening.run(opening.family.scan(asked), report=lambda event: scan.listen(event, [], bar))
    if not found:
        raise nobody(bus)
    return found


def _introduce(opening: Bus, found: Sequence[Found], output: Output) -> None:
    rows = []
    for one in found:
        state = face(opening, one.node).telemetry()
        measured = (
            ("position", state.position),
            ("voltage", state.voltage),
            ("temperature", state.temperature),
        )
        rows.append(
            (*scan.row(one), *("" if value is None else units.show(value, name) for name, value in measured))
        )
    output.table("Found", [*scan.COLUMNS, ">position", ">voltage", ">temperature"], rows)


def _moved(opening: Bus, nodes: Sequence[int], duration: float, output: Output) -> Course:
    train = faces.offer(opening.family.name, "Train")(opening, nodes)
    devices = [face(opening, node) for node in nodes]
    try:
        for device in devices:
            device.enable_torque()
        with output.progress("moving") as bar:
            return _loop(opening, train, duration, bar)
    finally:
        for device in devices:
            device.disable_torque()


def _loop(opening: Bus, train: Any, duration: float, bar: Bar) -> Course:
    """As fast as the bus allows: all goals out, all positions in."""
    first = opening.run(train.positions).values
    nodes = list(first)
    course = Course([], [[] for _ in nodes], [[] for _ in nodes], train.air_time(list(first.values())))
    _note(course, 0.0, list(first.values()), list(first.values()))
    began = opening.link.now()
    while (now := opening.link.now() - began) < duration:
        goals = [
            start + wave(now, duration, index / len(nodes)) for index, start in enumerate(first.values())
        ]
        opening.run(train.goals(goals))
        presents = opening.run(train.positions).values
        _note(course, opening.link.now() - began, goals, [presents.get(node) for node in nodes])
        if len(course.times) % 20 == 0:
            bar.advance(now, duration, f"moving  {course.rate:.0f} cycles/s")
    return course


def wave(now: float, duration: float, phase: float) -> float:
    """A sine that grows from rest and dies to rest; every device a part of a turn later than the one before."""
    return (
        AMPLITUDE * _grown(now) * _grown(duration - now) * math.sin(math.tau * (FREQUENCY * now - phase / 2))
    )


def _grown(since: float) -> float:
    part = min(max(since / RAMP, 0.0), 1.0)
    return part * part * (3 - 2 * part)


def _note(course: Course, now: float, goals: Sequence[float], presents: Sequence[float | None]) -> None:
    course.times.append(now)
    for row, goal in zip(course.goals, goals, strict=True):
        row.append(goal)
    for row_, present in zip(course.presents, presents, strict=True):
        row_.append(present)


def _drawn(path: Path, course: Course, found: Sequence[Found], output: Output) -> Path | None:
    from motorbus import plot

    models = {one.identity.model for one in found if one.identity}
    title = f"{len(found)} × {', '.join(sorted(models))} on one bus, {course.rate:.0f} cycles per second"
    names = [f"#{one.node}" for one in found]
    try:
        with usable(path, "written"):
            plot.trajectory(
                path, course.times, course.goals, course.presents, names, title=title, simulated=True
            )
    except RequestError:
        raise
    except MotorbusError as missing:
        output.note(str(missing))
        return None
    return path


def _sum_up(bus: str, course: Course, found: Sequence[Found], picture: Path | None, output: Output) -> None:
    limit = 1 / course.air_time
    lost = sum(value is None for row in course.presents for value in row)
    apart = max(
        abs(was - goal)
        for goals, presents in zip(course.goals, course.presents, strict=True)
        for goal, was in zip(goals, presents, strict=True)
        if was is not None
    )
    facts = {
        "bus": bus,
        "devices": [scan.facts(one) for one in found],
        "cycles": len(course.times),
        "cycles_per_second": course.rate,
        "wire_limit": limit,
        "readings_lost": lost,
        "furthest_apart": apart,
        "picture": str(picture) if picture else None,
    }
    output.document("motorbus.demo/1", facts)
    output.text(
        f"{len(course.times)} cycles of one sync write and one sync read: {course.rate:.0f} per second; "
        f"the wire allows {limit:.0f} ({course.air_time * 1e3:.2f} ms of air each)"
    )
    output.text(f"furthest from its goal: {units.show(apart, 'position')}; readings lost: {lost}")
    if picture:
        output.text(f"picture: {picture} (simulated)")
