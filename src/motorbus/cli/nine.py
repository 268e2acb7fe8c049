"""The machine of `motorbus demo`: six servos on a serial line, two on CAN and a stepper axis, which move as one.

Each bus is simulated in a process of its own and its bytes take their time, so all is as it would be with cables. The
machine is written to a file and loaded from it, as a person's own would be.
"""

from __future__ import annotations

from contextlib import ExitStack, contextmanager
from math import pi, radians
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from motorbus import plot
from motorbus.cli import scan
from motorbus.cli.files import usable
from motorbus.cli.machine import using
from motorbus.cli.robot import robot
from motorbus.cli.simulated import Simulated
from motorbus.core import units
from motorbus.errors import MotorbusError, RequestError
from motorbus.motion.machine import NAME, AxisSpec, BusSpec, GroupSpec, Machine
from motorbus.motion.machine.model import POSITION

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from motorbus.cli.output import Output
    from motorbus.cli.robot import InHand
    from motorbus.core.family import Found
    from motorbus.motion.moving.moved import Moved
    from motorbus.session.robot import Robot


class Part(NamedTuple):
    """What hangs on one bus of the machine: whose devices, and their ids."""

    family: str
    ids: str


PARTS: Final = {
    "arm": Part("feetech", "1-6"),
    "gimbal": Part("kst", "0x25-0x26"),
    "stage": Part("stepper", "1"),
}
ARM: Final = ("base", "shoulder", "elbow", "wrist", "roll", "gripper")
GIMBAL: Final = ("pan", "tilt")
REACH: Final = {
    **{name: radians(angle) for name, angle in zip(ARM, (70, -55, 80, 40, -90, 30), strict=True)},
    "pan": radians(35),
    "tilt": radians(-25),
    "slide": 0.09,
}
"""Where they all go, from 0 and back: rad, m."""


def machine(addresses: Mapping[str, str]) -> Machine:
    """The nine axes on buses at these addresses, by the names of `PARTS`."""
    servo: dict[str, Any] = {"unit": "deg", "max_velocity": radians(120), "max_acceleration": radians(480)}
    middle = {**servo, "zero": pi, "low": radians(-150), "high": radians(150), "exit": "torque_off"}
    axes = {name: AxisSpec(device=f"arm#{number}", **middle) for number, name in enumerate(ARM, 1)}
    for node, name in enumerate(GIMBAL, 0x25):
        axes[name] = AxisSpec(device=f"gimbal#{node:#x}", low=radians(-50), high=radians(50), **servo)
    slide: dict[str, Any] = {"travel": 0.04, "low": 0.0, "high": 0.3, "unit": "mm"}
    axes["slide"] = AxisSpec(device="stage#1", max_velocity=0.1, max_acceleration=0.4, **slide)
    return Machine(
        name="demo",
        buses={name: BusSpec(address=address) for name, address in addresses.items()},
        axes=axes,
        groups={"all": GroupSpec(axes=tuple(axes))},
        poses={"rest": dict.fromkeys(axes, 0.0), "reach": REACH},
    )


AXES: Final = (*ARM, *GIMBAL, "slide")
LEAST: Final = 4.0
"""s for both ways; the slide needs 3.6, as quick as its controller moves it."""
PATIENCE: Final = 0.2
"""s that a simulator may be late: it is a process, and a busy host lets processes wait as no device does."""
GAP: Final = 0.5
"""s that are drawn for the time between two movements."""


class Movement(NamedTuple):
    """One movement of the machine, and when it began: s after the beginning of the first."""

    began: float
    moved: Moved


def nine(duration: float, picture: Path, output: Output) -> None:
    """Serve the machine, find its devices, move all axes there and back in so many s, and draw it."""
    with served(output) as (file, children), using(str(file)), robot(AXES, {}, output, late=PATIENCE) as hand:
        found = found_on(hand.robot, output)
        movements = there_and_back(hand, duration)
    known = hand.robot.machine
    drawn = draw(picture, known, movements, output)
    sum_up(known, found, children, movements, drawn, output)


@contextmanager
def served(output: Output) -> Iterator[tuple[Path, dict[str, Simulated]]]:
    """The machine file of three simulated buses, and the process of each by the name of its bus."""
    with TemporaryDirectory(prefix="motorbus-demo-") as folder, ExitStack() as stack:
        children = {}
        for name, (family, ids) in PARTS.items():
            child = Simulated(family, ids=ids, link=Path(folder) / name, pace=True)
            children[name] = stack.enter_context(child)
            output.note(f"simulated: {name}, {family} devices {ids}, in process {child.process.pid}")
        file = Path(folder) / NAME
        text = machine({name: child.bus for name, child in children.items()}).text()
        file.write_text(text, encoding="utf-8")
        yield file, children


def found_on(robot: Robot, output: Output) -> dict[str, Found]:
    """Look for the devices of each bus, and for some that are not there, as a real scan does; by the names of axes."""
    found: dict[str, Found] = {}
    buses: Mapping[str, Any] = robot.buses
    for name, bus in buses.items():
        axes = {axis.spec.node: axis.name for axis in robot.axes.values() if axis.spec.bus == name}
        asked = () if bus.family.link.only else tuple(range(min(axes), max(axes) + 5))
        with output.progress(f"scanning {name}") as bar:
            told = bus.run(bus.driver.scan(asked), report=lambda event, bar=bar: scan.listen(event, [], bar))
        found |= {axes[one.node]: one for one in told if one.node in axes}
    rows = [(name, robot.axes[name].spec.device, *scan.row(one)[1:4]) for name, one in found.items()]
    output.table("Found", ["axis", "device", ">bit/s", "model", "firmware"], rows)
    return found


def there_and_back(hand: InHand, duration: float) -> list[Movement]:
    """There and back; what comes between is the time in which a stepper controller is told its next movement."""
    for axis in hand.robot.axes.values():
        if hasattr(axis, "declare"):
            axis.declare(0.0)  # it tells no position: somebody has to say where it stands
    movements: list[Movement] = []
    for pose in ("reach", "rest"):
        with hand.working(f"moving to {pose}"):
            moved = hand.robot.pose(pose, duration=duration / 2)
        movements.append(Movement(_now(hand.robot) - moved.duration, moved))
    first = movements[0].began
    return [Movement(one.began - first, one.moved) for one in movements]


def _now(robot: Robot) -> float:
    """Robot time (s), by the latest clock of its buses."""
    return max(bus.link.now() - robot.origins[name] for name, bus in robot.buses.items())


# -- what is drawn and said of it --------------------------------------------------------------------------------------


def draw(path: Path, machine: Machine, movements: Sequence[Movement], output: Output) -> Path | None:
    """The picture; None where matplotlib is missing, which is told. Raises RequestError for a path that cannot be."""
    starts = _ms(max(moved.started_apart for _, moved in movements))
    ends = _ms(max(moved.ended_apart for _, moved in movements))
    title = f"{len(machine.axes)} axes on {len(machine.buses)} buses move as one"
    title += f": orders left within {starts}, ended within {ends}"
    close, pauses = drawn_together(movements)
    try:
        with usable(path, "written"):
            plot.tracks(path, (), joined(machine, close), spans=pauses, title=title, remark="simulated")
    except RequestError:
        raise
    except MotorbusError as missing:
        output.note(str(missing))
        return None
    return path


def drawn_together(movements: Sequence[Movement]) -> tuple[list[Movement], list[plot.Span]]:
    """The movements one soon after the other, for nothing happens between them; and a span where that was left out."""
    close: list[Movement] = []
    pauses: list[plot.Span] = []
    end = before = 0.0
    for began, moved in movements:
        if close:
            pauses.append(
                plot.Span(end, end + GAP, f"{began - before:.1f} s in which nothing moves, not drawn")
            )
            end += GAP
        close.append(Movement(end, moved))
        last = max(track.times[-1] for track in moved.tracks.values())
        end, before = end + last, began + last
    return close, pauses


def joined(machine: Machine, movements: Sequence[Movement]) -> dict[str, plot.Track]:
    """Each axis over all movements, in the unit in which people see it; what is between them has no reading."""
    axes = {}
    for name, spec in machine.axes.items():
        scale = units.SCALES[POSITION.of(spec.linear)][spec.unit]
        goals: list[float] = []
        presents: list[float | None] = []
        times: list[float] = []
        for began, moved in movements:
            track = moved.tracks[name]
            times += [began + at for at in track.times] + [began + track.times[-1]]
            goals += [goal / scale for goal in (*track.goals, track.goals[-1])]
            presents += [*(present / scale for present in track.presents), None]
        axes[name] = plot.Track(goals, presents, spec.unit, track.estimated, times)
    return axes


def sum_up(
    machine: Machine,
    found: Mapping[str, Found],
    children: Mapping[str, Simulated],
    movements: Sequence[Movement],
    picture: Path | None,
    output: Output,
) -> None:
    """Print which devices there were, and what came of each axis in each movement."""
    buses = {name: {"address": one.bus, "pid": one.process.pid} for name, one in children.items()}
    axes = {
        name: {"device": spec.device, **scan.facts(found[name])}
        for name, spec in machine.axes.items()
        if name in found
    }
    facts: dict[str, object] = {"machine": machine.name, "buses": buses, "axes": axes}
    facts |= {"movements": [_facts(one) for one in movements], "picture": str(picture) if picture else None}
    output.document("motorbus.demo/2", facts)
    for _, moved in movements:
        output.table("", COLUMNS, [_row(name, machine.axes[name], moved) for name in moved.axes])
        output.text(str(moved))
    if picture:
        output.text(f"picture: {picture} (simulated)")


COLUMNS: Final = ("axis", ">goal", ">present", "", ">order left", ">ended", ">furthest from goal")


def _row(name: str, spec: AxisSpec, moved: Moved) -> tuple[object, ...]:
    one = moved.axes[name]
    return (
        name,
        spec.show(one.goal),
        spec.show(one.present),
        "estimated" if one.estimated else "",
        _ms(one.started),
        f"{one.ended:.3f} s",
        spec.show(moved.tracks[name].worst),
    )


def _facts(movement: Movement) -> dict[str, object]:
    began, moved = movement
    axes = {
        name: {
            **one._asdict(),
            "samples": len(moved.tracks[name].times),
            "mean_error": moved.tracks[name].error,
            "worst_error": moved.tracks[name].worst,
        }
        for name, one in moved.axes.items()
    }
    apart = {"started_apart": moved.started_apart, "ended_apart": moved.ended_apart}
    return {"began": began, "duration": moved.duration, **apart, "axes": axes}


def _ms(seconds: float) -> str:
    return f"{seconds * 1e3:.1f} ms"
