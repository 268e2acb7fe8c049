"""What `motorbus demo --family F` shows: devices of one bus in a loop that is as fast as the bus allows.

The devices live in a process of their own on a port of their own, so that everything between here and them is as it
would be with a cable. Bytes take their time on the wire, so the loop rate is one that a real bus could reach.
"""

from __future__ import annotations

import math
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from motorbus.cli import scan
from motorbus.cli.files import usable
from motorbus.cli.simulated import Simulated
from motorbus.cli.target import face, nobody, opened
from motorbus.core import units
from motorbus.core.steps import gather
from motorbus.errors import MotorbusError, RequestError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from motorbus.bus.blocking import Bus
    from motorbus.cli.output import Bar, Output
    from motorbus.core.family import Found, Positions, PositionStream
    from motorbus.core.request import Request

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


def waved(family: str, ids: str, duration: float, picture: Path, output: Output) -> None:
    """Find these devices, let a wave run through them for so many s, and draw it.

    Raises RequestError for devices that cannot be led.
    """
    from motorbus import session

    nodes = session.parse_ids(ids)
    with served(family, ids, output) as bus, opened(bus, {}, output) as opening:
        found = _found(bus, opening, nodes, output)
        train = _led(opening, found)
        _introduce(opening, found, output)
        course = _moved(opening, train, duration, output)
    drawn = _drawn(picture, course, found, output)
    _sum_up(bus, course, found, drawn, output)


@contextmanager
def served(family: str, ids: str, output: Output) -> Iterator[str]:
    """The simulated bus, in a process of its own."""
    with TemporaryDirectory(prefix="motorbus-demo-") as folder:
        output.note(f"simulated: {family} devices {ids} in a process of their own, on a pseudo-terminal")
        with Simulated(family, ids=ids, link=Path(folder) / "bus", pace=True) as simulated:
            yield simulated.bus


def _found(bus: str, opening: Bus, nodes: Sequence[int], output: Output) -> list[Found]:
    """Ask the ids that are there, and some that are not, as a real scan would."""
    alone = opening.family.link.only is not None
    asked = () if alone else tuple(range(min(1, *nodes), max(nodes) + 10))
    with output.progress("scanning") as bar:
        found = opening.run(opening.driver.scan(asked), report=lambda event: scan.listen(event, [], bar))
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


def _led(opening: Bus, found: Sequence[Found]) -> PositionStream:
    """These devices, to be asked and told in a loop. Raises RequestError when they are of a kind that cannot be."""
    models = [one.identity.model if one.identity else "" for one in found]
    able = opening.driver.axis(models[0])
    if "stream" not in able:
        raise RequestError(
            f"{opening.family.name}: there is no loop to show of {models[0] or 'these devices'}",
            advice="nothing was sent",
        )
    devices = [face(opening, one.node) for one in found]
    train: PositionStream = opening.run(able.stream(devices, rate=opening.rate))
    return train


def _moved(opening: Bus, train: PositionStream, duration: float, output: Output) -> Course:
    limp = [one for one in (face(opening, node) for node in train.nodes) if hasattr(one, "disable_torque")]
    try:
        opening.run(train.start({}))
        with output.progress("moving") as bar:
            return _loop(opening, train, duration, bar)
    finally:
        for device in limp:
            device.disable_torque()


def _loop(opening: Bus, train: PositionStream, duration: float, bar: Bar) -> Course:
    """As fast as the bus allows: all goals out, all positions in."""
    first = _told(opening, train.positions)
    nodes = list(first)
    air = sum(opening.driver.air_time(one, opening.rate) for one in (*train.goals(first), *train.positions))
    course = Course([], [[] for _ in nodes], [[] for _ in nodes], air)
    _note(course, 0.0, list(first.values()), list(first.values()))
    began = opening.link.now()
    while (now := opening.link.now() - began) < duration:
        goals = {
            node: start + wave(now, duration, index / len(nodes))
            for index, (node, start) in enumerate(first.items())
        }
        _all(opening, train.goals(goals))
        presents = _told(opening, train.positions)
        _note(
            course, opening.link.now() - began, list(goals.values()), [presents.get(node) for node in nodes]
        )
        if len(course.times) % 20 == 0:
            bar.advance(now, duration, f"moving  {course.rate:.0f} cycles/s")
    return course


def _all(opening: Bus, requests: Sequence[Request[Any]]) -> list[Any]:
    """What each told; those on lanes of their own are in flight at once."""
    return [opening.run(requests[0])] if len(requests) == 1 else opening.run(_together(requests))


async def _together(requests: Sequence[Request[Any]]) -> list[Any]:
    return list(await gather(*requests))


def _told(opening: Bus, reads: Sequence[Request[Positions]]) -> dict[int, float]:
    """Positions (rad) of all who answered."""
    return {node: position for one in _all(opening, reads) for node, position in one.values.items()}


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

    models = {one.identity.model.partition(",")[0] for one in found if one.identity}
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
        f"{len(course.times)} cycles of all goals out and all positions in: {course.rate:.0f} per second; "
        f"the wire allows {limit:.0f} ({course.air_time * 1e3:.2f} ms of air each)"
    )
    output.text(f"furthest from its goal: {units.show(apart, 'position')}; readings lost: {lost}")
    if picture:
        output.text(f"picture: {picture} (simulated)")
