"""`motorbus move`: one device, or several in the same instant, to positions that are checked beforehand.

Of devices that do not know where they are, by an angle from where they stand.
"""

from __future__ import annotations

import inspect
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from cyclopts import App, Parameter

from motorbus.cli import dry, faces
from motorbus.cli.acting import acted
from motorbus.cli.consent import FAR, consent_to_ways
from motorbus.cli.exits import Exit
from motorbus.cli.fenced import pace
from motorbus.cli.machine import axes_named, machine
from motorbus.cli.moving import How, Known, go, goals_of, how_of, names_axes, positions_of
from motorbus.cli.output import Output
from motorbus.cli.parameters import Assume, DryRun, Duration, First, Flag, Shape, Speed
from motorbus.cli.plain import plain
from motorbus.cli.quantity import as_typed
from motorbus.cli.robot import robot
from motorbus.cli.target import Target, able, device, face, offers, opened, takes, target
from motorbus.core import units
from motorbus.errors import LimitExceeded, RequestError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from motorbus.bus.blocking import Bus
    from motorbus.cli.dry import DryBus
    from motorbus.core.family import Family

app = App(
    name="move",
    usage="Usage: motorbus move BUS#ID=POSITION... | AXIS=POSITION... [OPTIONS]",
    help_epilogue="""Positions are in rad, or with a unit: 90deg, 0.25turn. Torque goes on by
itself where devices do that, as FEETECH servos do, or is never off, as in KST
servos; `motorbus torque on` first elsewhere. A way of more than 180 degrees
needs --yes. The goal must lie inside the limits of the device. Several devices
of one bus begin in the same instant where their family can do that. Ctrl-C
and SIGTERM stop them, and the message says where they hold. When one of
several no longer answers, the others stop. With --no-wait they keep moving.

+= and -= go by an angle from where the device stands: all that devices can do
which do not know their position, as a stepper controller. One device at a
time, and it is stopped at the end. What is shown then is reckoned, not read.

Axes of a machine file start together and arrive together, on whatever buses
they are, within the limits of the file; += and -= go by a way from where each
stands. A way of more than 180 degrees, or 100 mm, needs --yes. Ctrl-C stops
them all, and so does SIGTERM from another shell; `motorbus stop` cannot while
this command has their bus, `motorbus estop` can. --dry-run shows the plan:
frames are made on the way, from what is read then, and cannot be shown before.

An axis without feedback knows its place only while one command lasts: say
where it stands (--assume lift=0mm) or let it look (--home).

When they have arrived they stay there with their torque on, whatever `exit` of
the file says, for a command is one step of your work and not its end:
`motorbus park` and `motorbus torque off` end it. After an error or Ctrl-C,
`exit` decides.

Examples:

    motorbus move shoulder=30deg elbow=-10deg lift+=5mm --assume lift=0mm
    motorbus move left=0 --duration 3s --kind minimum_jerk
    motorbus move feetech:/dev/ttyACM0#3=90deg
    motorbus move feetech:/dev/ttyACM0#3=-0.5 --velocity 1.5
    motorbus move feetech:COM7#1+2=0 feetech:COM7#3=0.3 --no-wait
    motorbus move feetech:/dev/ttyACM0#3=90deg --dry-run
    motorbus move stepper:/dev/ttyUSB0#1+=90deg --velocity 60rpm
    motorbus move stepper:/dev/ttyUSB0#1-=0.5turn""",
)


Goals = dict[int, float]


@app.default
def move(
    *goals: Annotated[str, Parameter(name="GOAL")],
    velocity: str = "",
    acceleration: str = "",
    duration: Duration = "",
    kind: Shape = "trapezoid",
    speed: Speed = "",
    assume: Assume = (),
    home: First = False,
    wait: bool = True,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Annotated[Output, Parameter(parse=False)],
    **options: str,
) -> Exit:
    """Move devices to positions, several of them together.

    Parameters
    ----------
    goals
        Devices, or axes, and where they shall go.
    velocity
        At most so fast, in rad/s or as 90deg/s; the maximum when left out: of the machine
        file, else of the device.
    acceleration
        At most so steep, in rad/s² or as 500deg/s2; the maximum when left out.
    wait
        Return when all are in position, or at once.
    yes
        Do not ask before a way of more than 180 degrees.
    options
        Any option of the bus string, as a flag.
    """
    bounds = _bounds(velocity, acceleration)
    if _for_axes(goals, [*bounds, *([] if wait else ["no-wait"])], [duration, speed, *assume], home):
        how = how_of(duration, kind, speed)
        return _axes(goals, how, assume, options, output, home=home, yes=yes, dry_run=dry_run)
    asked = _Asked(bounds, wait, yes, dry_run)
    if any(_is_relative(text) for text in goals):
        return _moved_by(goals, asked, options, output)
    return _moved_to(goals, asked, options, output)


class _Asked(NamedTuple):
    """How devices shall move: within these bounds, waited for, without a question, only shown."""

    bounds: dict[str, float]
    wait: bool
    yes: bool
    dry_run: bool


def _moved_to(texts: tuple[str, ...], asked: _Asked, options: Mapping[str, str], output: Output) -> Exit:
    """Devices to positions, those of one bus in the same instant where their family can do that."""
    _, wait, yes, dry_run = asked
    results = []
    for bus, wanted in _wanted(texts).items():
        with opened(bus, options, output) as opening, as_typed(_typed(texts, bus)):
            bounds = _paced(opening, wanted, asked.bounds)
            ways, rehearsal = _ways(opening, wanted, bounds), dry.DryBus(opening)
            rehearse = partial(_move, rehearsal, wanted, {**bounds, "wait": False})
            consent_to_ways(ways, output, yes=yes or dry_run, rehearse=rehearse)
            if dry_run:
                rehearse()
                dry.show(rehearsal, output)
                continue
            _move(opening, wanted, {**bounds, "wait": wait})
            results += [_result(opening, bus, node, goal) for node, goal in wanted.items()]
    if results:
        output.document("motorbus.move/1", {"devices": results})
        shown = [
            (f"{r['bus']}#{r['id']}", *(units.show(r[key], "position") for key in ("goal", "present")))
            for r in results
        ]
        output.table("", ["device", "goal", "present"], shown)
    return Exit.OK


def _paced(bus: Bus, goals: Goals, bounds: dict[str, float]) -> dict[str, float]:
    """The same bounds; where no velocity was said and the machine file bounds that of these, its bound."""
    slowest = pace(bus, goals)
    verb = type(face(bus, next(iter(goals)))).move
    if slowest is None or "velocity" not in inspect.signature(verb.function).parameters:
        return bounds
    return {"velocity": slowest, **bounds}


def _for_axes(texts: tuple[str, ...], for_devices: list[str], for_axes: list[str], home: bool) -> bool:
    """Whether these are goals of axes. Raises RequestError for both forms at once, and for options of the other."""
    named = [names_axes(text) for text in texts]
    if any(named) and not all(named):
        raise RequestError(
            "some goals are for axes of the machine file and some for devices",
            expected="AXIS=POSITION... alone, or BUS#ID=POSITION... alone",
            advice="say it in two commands; nothing was sent",
        )
    axes = bool(named) and all(named)
    if axes and for_devices:
        raise RequestError(
            f"--{for_devices[0]} is for devices; axes go within the limits of the machine file, and are waited for",
            expected="--speed 50%, or --duration 3s",
            advice="nothing was sent",
        )
    if not axes and (any(for_axes) or home):
        raise RequestError(
            "--duration, --speed, --assume and --home are for axes of a machine file",
            expected="--velocity and --acceleration, for devices",
            advice="nothing was sent",
        )
    return axes


def _axes(
    texts: tuple[str, ...],
    how: How,
    assume: tuple[str, ...],
    options: Mapping[str, str],
    output: Output,
    *,
    home: bool,
    yes: bool,
    dry_run: bool,
) -> Exit:
    goals, known = goals_of(texts), Known(positions_of(assume), home)
    axes = list(dict.fromkeys([*goals, *known.stands]))
    with robot(axes, options, output) as hand:
        try:
            go(hand, "move", goals, how, known, yes=yes, dry_run=dry_run)
        except LimitExceeded as error:
            _hint_at_units(error, texts)
            raise
    return Exit.OK


def _hint_at_units(error: LimitExceeded, texts: tuple[str, ...]) -> None:
    """Who types 10 for an axis that is shown in degrees may mean degrees."""
    for text in texts:
        head, _, said = text.rpartition("=")
        for axis in axes_named((head.removesuffix("+").removesuffix("-"),)):
            spec = machine().axes[axis]
            own = "m" if spec.linear else "rad"
            bare = said.lstrip("+-").replace(".", "", 1).isdigit()
            if bare and spec.unit != own and error.summary.startswith(f"{axis}: "):
                error.advice += f"; {said} without a unit is in {own}: did you mean {said}{spec.unit}?"


def _wanted(texts: tuple[str, ...]) -> dict[str, Goals]:
    """Goals in rad by bus and node. Raises RequestError for what is no device or no finite position."""
    found: dict[str, Goals] = {}
    for text in texts:
        devices, _, position = text.rpartition("=")
        bus, family, nodes = _named(devices, text)
        _knows_where_it_is(family, text)
        goals = found.setdefault(bus, {})
        if not goals.keys().isdisjoint(nodes):
            raise RequestError(f"{text}: a device is named twice", advice="nothing was sent")
        goals.update(dict.fromkeys(nodes, units.parse(position, "position")))
    if not found:
        raise RequestError(
            "which axis or device, and where to?",
            expected="AXIS=POSITION, as shoulder=30deg, or BUS#ID=POSITION, as feetech:/dev/ttyACM0#3=90deg",
        )
    return found


def _typed(texts: tuple[str, ...], bus: str) -> dict[int, str]:
    """What was typed for each device of this bus."""
    parts = [(_named(text.rpartition("=")[0], text), text.rpartition("=")[2]) for text in texts]
    return {node: position for found, position in parts if found.bus == bus for node in found.nodes}


def _is_relative(text: str) -> bool:
    return text.rpartition("=")[0].endswith(("+", "-"))


def _knows_where_it_is(family: Family, text: str) -> None:
    """Raises RequestError for devices that do not, with the form by which they move."""
    devices, _, position = text.rpartition("=")
    if hasattr(family.devices.blocking, "move_by") and not hasattr(family.devices.blocking, "move"):
        raise RequestError(
            f"{family.name} devices do not know where they are, so they cannot go to a position",
            expected=f"by an angle from where it stands: {devices}+={position} or {devices}-={position}",
            advice="nothing was sent",
        )
    offers(family, "move")


def _moved_by(texts: tuple[str, ...], asked: _Asked, options: Mapping[str, str], output: Output) -> Exit:
    """One device by an angle from where it stands. Raises RequestError for several, or where that is not possible."""
    bounds, wait, yes, dry_run = asked
    if len(texts) != 1 or "acceleration" in bounds:
        raise RequestError(
            "by an angle one device goes at a time, with the acceleration that it is set to",
            expected="BUS#ID+=ANGLE alone, without --acceleration",
            advice="nothing was sent",
        )
    devices, _, angle = texts[0].rpartition("=")
    bus, family, (node,) = device(devices[:-1])
    if not hasattr(family.devices.blocking, "move_by"):
        raise RequestError(
            f"{family.name} devices are not moved by an angle from where they stand",
            expected=f"a position: {devices[:-1]}=POSITION",
            advice="nothing was sent",
        )
    way = units.parse(angle, "position") * (-1 if devices.endswith("-") else 1)
    question = f"move #{node} by {units.show(way, 'position')}" if abs(way) > FAR and not yes else ""
    how: dict[str, Any] = {**bounds, "wait": wait}
    with opened(bus, options, output) as opening, as_typed({node: angle}):
        told = acted(opening, node, "move_by", way, question=question, dry_run=dry_run, output=output, **how)
    if not dry_run:
        facts = {"bus": bus, "id": node, "by": way, "result": plain(told)}
        output.document("motorbus.move-by/1", facts)
        output.text(f"{bus}#{node}: {told}")
    return Exit.OK


def _named(devices: str, text: str) -> Target:
    """The devices that a goal is for. Raises RequestError when it names none, or no position."""
    if "#" in devices:
        return target(devices)
    with suppress(RequestError):  # what is before the last = may be a bus that was cut within its options
        found = target(devices)
        if found.nodes:
            return found
    raise RequestError(
        f"{text!r} names no device and position", expected="BUS#ID=POSITION", advice="nothing was sent"
    )


def _bounds(velocity: str, acceleration: str) -> dict[str, float]:
    """Those that were given: a family whose devices know no acceleration must not be told of one."""
    given = {"velocity": velocity, "acceleration": acceleration}
    return {name: units.parse(text, name) for name, text in given.items() if text}


def _ways(bus: Bus, goals: Goals, bounds: Iterable[str]) -> list[tuple[Any, float]]:
    """Devices and their goals. Raises RequestError when one does not move, or not within such bounds."""
    ones = {node: face(bus, node) for node in goals}
    for one in ones.values():
        takes(one, "move", bounds)
    return [(ones[node], goal) for node, goal in goals.items()]


def _move(bus: Bus | DryBus, goals: Goals, how: Mapping[str, Any]) -> None:
    together = faces.offer(bus.family.name, "move_together")
    if together is not None and len(goals) > 1:
        together(bus, goals, **how)
        return
    for node, goal in goals.items():
        able(face(bus, node), "move")(goal, **{**how, "wait": how["wait"] and len(goals) == 1})
    if how["wait"] and len(goals) > 1:
        for node, goal in goals.items():
            able(face(bus, node), "move")(goal, **how)


def _result(opening: Bus, bus: str, node: int, goal: float) -> dict[str, Any]:
    return {"bus": bus, "id": node, "goal": goal, "present": face(opening, node).position()}
