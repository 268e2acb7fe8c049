"""`motorbus move jog home pose torque stop`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from inspect import signature
from math import inf, pi
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter
from msgspec import Struct

from motorbus.cli.common import Common, Partial, Target, Writing
from motorbus.cli.dryrun import carry_out
from motorbus.cli.output import confirm, emit, note
from motorbus.cli.target import (
    edit_machine,
    is_address,
    load_machine,
    need_machine,
    open_bus,
    open_devices,
    open_robot,
    parse_quantity,
    parse_time,
)
from motorbus.errors import LinkError, MotorbusError, PortBusy, RequestError, VerificationFailed
from motorbus.motion.commands import DeviceCommand, LoopResult, Move, MoveResult, Pose, StopResult, StopState
from motorbus.motion.moves import check_reach
from motorbus.session.address import parse_address

if TYPE_CHECKING:
    from motorbus.motion.machine import MachineConfig
    from motorbus.motion.robot import Robot

Kind = Literal["trapezoid", "minimum_jerk"]
For = Annotated[str, Parameter(name="--for", help="Time, as 2s; without it until Enter.")]
Speed = Annotated[float, Parameter(help="Share of the velocity, above 0 to 1.")]
FAR = pi  # rad; a longer move needs consent
LEASE = 1.0  # s after which a jog without end is stopped if its loop hangs


class HomeResult(Struct, frozen=True, tag="homed"):
    """The position (rad, m) of each axis at its reference switch."""

    positions: dict[str, float]


class PoseList(Struct, frozen=True, tag="poses"):
    """The poses of a machine file: positions (rad, m) by axis."""

    poses: dict[str, dict[str, float]]


class SavedPose(Struct, frozen=True, tag="pose_saved"):
    """A pose written to the machine file: positions (rad, m) by axis."""

    name: str
    file: str
    positions: dict[str, float]


class TorqueResult(Struct, frozen=True, tag="torque"):
    """The devices whose torque was switched; `broadcast`: the buses that also got torque off for all devices."""

    on: bool
    devices: tuple[str, ...]
    broadcast: tuple[str, ...] = ()


class Planned(Struct, frozen=True, tag="planned"):
    """What a dry run would have done; nothing was sent."""

    would: str


# -- words of the command line ---------------------------------------------------------------------------------


def axes_of(robot: Robot, *words: str) -> tuple[str, ...]:
    """The axes of names and addresses. Raises RequestError."""
    found: list[str] = []
    for word in words:
        if not is_address(word):
            found += robot.config.axes_of(word)
        elif nodes := parse_address(word).nodes:
            found += [f"#{node}" for node in nodes]
        else:
            found += robot.axes
    return tuple(found)


def parse_position(robot: Robot, name: str, text: str) -> float:
    """A position (rad, m); a bare number of an axis of the machine file is in its display unit."""
    config = robot.config.axes[name]
    unit = "" if name.startswith("#") else config.display_unit
    return parse_quantity(text, "length" if config.travel else "position", unit)


def parse_velocity(robot: Robot, name: str, text: str) -> float:
    """A velocity (rad/s, m/s); a bare number of an axis of the machine file is in its display unit per s."""
    config = robot.config.axes[name]
    unit = "" if name.startswith("#") else f"{config.display_unit}/s"
    return parse_quantity(text, "linear velocity" if config.travel else "velocity", unit)


def until_enter() -> Callable[[], bool]:
    """A function that says whether Enter was pressed. Raises RequestError without a terminal, and on Windows."""
    if not sys.stdin.isatty() or sys.platform == "win32":
        raise RequestError("there is no terminal to press Enter", advice="give a time, as --for 2s")
    from select import select

    note("Enter ends it")
    return lambda: bool(select([sys.stdin], [], [], 0)[0] and sys.stdin.readline() is not None)


def agree(action: str, writing: Writing, common: Common, *, ask: bool = True) -> bool:
    """Whether an action is carried out: --dry-run only shows it, else the user is asked."""
    if writing.dry_run:
        emit(Planned(action), common)
    elif ask:
        confirm(action, writing)
    return not writing.dry_run


def far_moves(robot: Robot, ways: Mapping[str, float]) -> str:
    """The axes of these ways (rad, m) that move so far that the user is asked; "" if none does."""
    axes = robot.config.axes
    far = {name: way for name, way in ways.items() if abs(way * axes[name].ratio) > FAR}
    return ", ".join(f"{name} by {axes[name].show(way)}" for name, way in far.items())


def _agree_to_goals(robot: Robot, goals: Mapping[str, float], writing: Writing, common: Common) -> bool:
    """Whether axes move to these positions: --dry-run shows them, far moves need consent."""
    if writing.yes and not writing.dry_run:
        return True
    moves, ways = [], {}
    for name, start in robot.positions(list(goals)).items():
        check_reach(robot.axes[name], goals[name])
        show = robot.config.axes[name].show
        moves.append(f"{name} from {'unknown' if start is None else show(start)} to {show(goals[name])}")
        if start is not None:
            ways[name] = goals[name] - start
    return agree(f"move {', '.join(moves)}", writing, common, ask=bool(far_moves(robot, ways)))


def report(robot: Robot, result: MoveResult | LoopResult, common: Common) -> None:
    """Print the result of a motion: positions in the display units, in JSON in rad (m)."""
    if common.json:
        emit(result, common)
        return
    if isinstance(result, MoveResult):
        places = {name: one.position for name, one in result.axes.items()}
        how = f"limited by {result.limited_by or 'nothing'}"
    else:
        places = dict(result.positions)
        how = f"{result.cycles} cycles"
    _print_positions(robot, places)
    print(f"{result.duration:.2f} s, {how}", flush=True)
    for text in getattr(result, "notes", ()):
        note(f"note: {text}")


def _print_positions(robot: Robot, places: Mapping[str, float | None]) -> None:
    for name, place in places.items():
        shown = "position not known" if place is None else robot.config.axes[name].show(place)
        is_estimated = robot.axes[name].status.position is None and place is not None
        print(f"{name}: {shown}{' (estimated)' if is_estimated else ''}", flush=True)


# -- move, jog, home -------------------------------------------------------------------------------------------


def move(
    *goals: Annotated[str, Parameter(name="AXIS=POSITION")],
    duration: Annotated[str, Parameter(help="Time of the movement, as 2s.")] = "",
    speed: Speed = 1.0,
    velocity: Annotated[str, Parameter(help="Highest velocity, as 30deg/s.")] = "",
    kind: Annotated[Kind, Parameter(help="Profile.", show_default=False)] = "trapezoid",
    no_wait: Annotated[bool, Parameter(help="Send the goal, do not wait; the device moves alone.")] = False,
    writing: Writing = Writing(),
    common: Common = Common(),
) -> None:
    """Move axes together; all start and end at the same time.

    AXIS+=DISTANCE moves by a distance. An axis holds its goal afterwards.

    Examples:

      motorbus move shoulder=30deg elbow=-10deg
      motorbus move lift+=5mm --speed 0.5
      motorbus move feetech:/dev/ttyACM0#3=30deg --velocity 20deg/s
    """
    if not goals:
        raise RequestError("no goal", expected="AXIS=POSITION, as shoulder=30deg")
    pairs = []
    for goal in goals:
        word, _, text = goal.rpartition("=")
        if not (word and text):
            raise RequestError(f"{goal!r} is not a goal", expected="AXIS=POSITION, as shoulder=30deg")
        if word.endswith("+") is not goals[0].rpartition("=")[0].endswith("+"):
            raise RequestError("positions and distances in one command", advice="use two commands")
        pairs.append((word.removesuffix("+"), text))
    relative = "+=" in goals[0]
    if no_wait and (duration or relative):
        raise RequestError("--no-wait goes without --duration and +=")
    seconds = parse_time(duration)
    with open_robot(common, join_addresses([word for word, _ in pairs]), velocity) as robot:
        found: dict[str, float] = {}
        for word, text in pairs:
            for name in axes_of(robot, word):
                if name in found:
                    raise RequestError(f"{name} has two goals")
                found[name] = parse_position(robot, name, text)
        fastest = parse_velocity(robot, next(iter(found)), velocity) if velocity else None
        starts = robot.positions(list(found)) if relative else {}
        places = {name: goal + (starts.get(name) or 0.0) for name, goal in found.items()}
        if not _agree_to_goals(robot, places, writing, common):
            return
        if no_wait:
            _send_goals(robot, found, speed, fastest)
            return
        command = Move(found, seconds, speed, kind, relative, fastest)
        report(robot, robot.execute(command), common)


def join_addresses(words: Sequence[str]) -> list[str]:
    """The words; addresses of one bus as one address."""
    words = list(dict.fromkeys(words))
    buses = {word.partition("#")[0] for word in words}
    if len(words) < 2 or len(buses) != 1 or not all(map(is_address, words)):
        return words
    return [f"{buses.pop()}#{'+'.join(word.partition('#')[2] for word in words)}"]


def _send_goals(robot: Robot, goals: Mapping[str, float], speed: float, fastest: float | None) -> None:
    """Let each device move by itself."""
    for name, goal in goals.items():
        axis = robot.axis(name)
        function = getattr(type(axis.device), "move", None)
        if function is None:
            raise RequestError(f"{name}: its device cannot move by itself to a position")
        arguments: dict[str, Any] = {"to": axis.config.to_device(goal), "wait": False}
        if "velocity" in signature(function.function).parameters:
            highest = min(axis.config.max_velocity * speed, fastest or axis.config.max_velocity)
            arguments["velocity"] = highest * abs(axis.config.ratio)
        robot.execute(DeviceCommand(name, "move", arguments))


def jog(
    axis: Annotated[str, Parameter(name="AXIS")],
    velocity: Annotated[str, Parameter(name="VELOCITY")],
    /,
    *,
    for_: For = "",
    writing: Writing = Writing(),
    common: Common = Common(),
) -> None:
    """Move an axis at a velocity, then brake and hold. The sign is the direction.

    It ends at the limits of the axis, after --for, at Enter, and at Ctrl-C.

    Examples:

      motorbus jog shoulder 10deg/s --for 1s
      motorbus jog lift -5mm/s
      motorbus jog stepper:/dev/ttyUSB0#1 -60rpm --for 500ms
    """
    seconds = parse_time(for_)
    pressed = None if seconds is not None or writing.dry_run else until_enter()
    with open_robot(common, [axis], velocity) as robot:
        name, *others = axes_of(robot, axis)
        if others:
            raise RequestError(f"{axis} is {len(others) + 1} axes", expected="one axis")
        speed = parse_velocity(robot, name, velocity)
        shown = robot.config.axes[name].show(speed)
        action = f"jog {name} at {shown}/s for {for_ or 'the time until Enter'}"
        if not agree(action, writing, common, ask=bool(far_moves(robot, {name: speed * (seconds or 0.0)}))):
            return
        with robot.attended(inf if pressed is None else LEASE) as lease:

            def ended() -> bool:
                lease.beat()
                return pressed is not None and pressed()

            report(robot, robot.jog(name, speed, seconds, ended), common)


def home(
    *axes: Annotated[str, Parameter(name="AXIS")],
    timeout: Annotated[str, Parameter(help="Longest time.")] = "30s",
    velocity: Annotated[str, Parameter(help="Velocity, as 20rpm; by default of the device.")] = "",
    writing: Writing = Writing(),
    common: Common = Common(),
) -> None:
    """Move axes to their reference switches; without AXIS all that have one.

    Each axis moves until its switch is active, at most for --timeout.

    Examples:

      motorbus home
      motorbus home lift --timeout 20s
      motorbus home stepper:/dev/ttyUSB0#1 --velocity 60rpm --yes
    """
    limit = parse_time(timeout) or 30.0
    with open_robot(common, axes, velocity) as robot:
        names = axes_of(robot, *axes) or None
        limits = [one.config.max_velocity for name, one in robot.axes.items() if name.startswith("#")]
        speed: float | None = min(limits, default=None)
        if velocity:
            speed = parse_velocity(robot, next(iter(names or robot.axes)), velocity)
        moved = names or [name for name, one in robot.axes.items() if "home" in one.driver]
        action = f"move {', '.join(moved) or 'no axis'} until the reference switch is active"
        if agree(action, writing, common, ask=bool(moved)):
            with robot.attended():
                positions = robot.home(names, timeout=limit, velocity=speed)
            if common.json:
                emit(HomeResult(positions), common)
            else:
                _print_positions(robot, positions)


# -- pose ------------------------------------------------------------------------------------------------------


def pose(
    name: Annotated[str, Parameter(name="NAME")] = "",
    /,
    *,
    save: Annotated[str, Parameter(help="Keep the present positions under this name.")] = "",
    speed: Speed = 1.0,
    writing: Writing = Writing(),
    common: Common = Common(),
) -> None:
    """Move to a pose of the machine file; without NAME list the poses.

    --save NAME writes the present positions to the machine file; its comments stay.

    Examples:

      motorbus pose
      motorbus pose ready --speed 0.5
      motorbus pose --save ready
    """
    machine = need_machine(common)
    if name and save:
        raise RequestError("NAME and --save NAME in one command", expected="one of them")
    if save:
        _save_pose(machine, save, writing, common)
    elif name:
        if name not in machine.poses:
            known = ", ".join(machine.poses) or "none; `motorbus pose --save NAME` adds one"
            raise RequestError(f"no pose {name!r}", expected=f"one of {known}")
        with open_robot(common, tuple(machine.poses[name])) as robot:
            if _agree_to_goals(robot, machine.poses[name], writing, common):
                report(robot, robot.execute(Pose(name, speed=speed)), common)
    elif common.json:
        poses = {name: {axis: float(at) for axis, at in pose.items()} for name, pose in machine.poses.items()}
        emit(PoseList(poses), common)
    elif not machine.poses:
        note("the machine file has no pose; `motorbus pose --save NAME` adds one")
    else:
        for name, places in machine.poses.items():
            shown = ", ".join(f"{axis} {machine.axes[axis].show(at)}" for axis, at in places.items())
            print(f"{name}: {shown}")


def _save_pose(machine: MachineConfig, name: str, writing: Writing, common: Common) -> None:
    from motorbus.motion.machine_edit import pose_change

    file = Path(machine.path)
    if name in machine.poses and not writing.dry_run:
        confirm(f"replace the pose {name} of {file}", writing)
    with open_robot(common) as robot:
        places = {axis: round(place, 5) for axis, place in robot.positions().items() if place is not None}
        unknown = [axis for axis in robot.axes if axis not in places]
        change = pose_change(robot.config, name, places)
    if unknown:
        note(f"note: the position of {', '.join(unknown)} is not known: left out")
    if writing.dry_run:
        note(f"note: {file} stays as it is")
    else:
        edit_machine(file, change)
    if common.json:
        emit(SavedPose(name, str(file), places), common)
    else:
        _print_positions(robot, places)


# -- torque, stop ----------------------------------------------------------------------------------------------


def torque(
    switch: Annotated[Literal["on", "off"], Parameter(name="on|off")],
    /,
    *targets: Annotated[str, Parameter(name="TARGET")],
    dry_run: Annotated[bool, Parameter(help="Show what would be sent; write nothing.")] = False,
    common: Common = Common(),
) -> None:
    """Switch torque on without a jump, or off; without TARGET of all axes.

    On: the device holds its present position. Off: an arm sags. Off of a whole
    bus is first sent to all its devices at once, then to each until it acknowledges.

    Examples:

      motorbus torque on shoulder elbow
      motorbus torque off arm
      motorbus torque off feetech:/dev/ttyACM0
    """
    writing = Writing(yes=True, dry_run=dry_run)
    if switch == "on":
        with open_robot(common, targets) as robot:
            names = axes_of(robot, *targets) or None
            action = f"switch torque on of {', '.join(names or robot.axes)}, which hold where they are"
            if agree(action, writing, common):
                emit(TorqueResult(True, robot.enable_torque(names)), common)
        return
    reached = tuple(word for word in targets if _release_bus(common, word, writing))
    done, errors = _visit(
        common,
        targets,
        "disable_torque",
        lambda target: carry_out(writing, target, lambda device: device.disable_torque()),
    )
    if not dry_run and (done or reached):
        emit(TorqueResult(False, tuple(done), reached), common)
    _raise_all(done, errors)


def _release_bus(common: Common, word: str, writing: Writing) -> bool:
    """Torque off for all devices of a bus in one frame, where the word is a bus and its family has such a frame."""
    machine = None if is_address(word) else load_machine(common)
    if "#" in word or not (is_address(word) or (machine is not None and word in machine.buses)):
        return False
    with open_bus(common, word) as bus:
        if bus.family.link.stops[:1] != ("torque_off",):
            return False
        for request in bus.driver.stop({}).requests:
            carry_out(writing, bus, lambda open_one: open_one.run(request))  # noqa: B023
    return True


def stop(
    *targets: Annotated[str, Parameter(name="TARGET")],
    verify: Annotated[bool, Parameter(help="Watch until each device rests, at most 1 s.")] = False,
    common: Common = Common(),
) -> None:
    """Decelerate and hold; without TARGET all axes.

    Each device is visited, whatever fails on another. A bus that another program has
    open cannot be reached: Ctrl-C there stops it, or `motorbus estop`.

    Examples:

      motorbus stop
      motorbus stop shoulder elbow --verify
      motorbus stop feetech:/dev/ttyACM0
    """
    done, errors = _visit(common, targets, "stop", lambda target: target.device.stop())
    states = {name: StopState(getattr(promise, "value", str(promise))) for name, promise in done.items()}
    for words in _by_bus(common, targets) if verify else ():
        try:
            with open_robot(common, words) as robot:
                states |= robot.stop(verify=True).axes
        except MotorbusError as error:
            errors.append(error)
    if states and common.json:
        emit(StopResult(states), common)
    for name, one in () if common.json else states.items():
        at_rest = "at rest" if one.at_rest else "not at rest"
        print(f"{name}: {one.promise if one.at_rest is None else at_rest}", flush=True)
    moving = [name for name, state in states.items() if state.at_rest is False]
    if moving:
        raise with_others([VerificationFailed(f"{', '.join(moving)}: not seen at rest within 1 s"), *errors])
    _raise_all(done, errors)


def _visit(
    common: Common, words: Sequence[str], method: str, act: Callable[[Target], Any]
) -> tuple[dict[str, Any], list[MotorbusError]]:
    """Act on each device, whatever fails on another; gives the results by name, and the errors."""
    done: dict[str, Any] = {}
    errors: list[MotorbusError] = []
    skipped = []
    for group in _by_bus(common, words):
        try:
            with open_devices(common, group) as targets:
                for target in targets:
                    name = target.name
                    if name in done:
                        name = f"{target.bus.link.name}{name}"
                    if not hasattr(target.device, method):
                        skipped.append(name)
                        continue
                    try:
                        done[name] = act(target)
                    except LinkError:
                        raise
                    except MotorbusError as error:
                        error.summary = f"{name}: {error.summary}"
                        errors.append(error)
        except MotorbusError as error:
            if method == "stop" and isinstance(error, PortBusy):
                error.advice = "`motorbus estop BUS` reaches it now, through that program"
            errors.append(error)
    if skipped:
        text = f"{', '.join(skipped)}: the device has no {method.replace('_', ' ')}"
        if not done and not errors:
            raise RequestError(text)
        note(f"note: {text}")
    return done, errors


def _by_bus(common: Common, words: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """The words, one bus at a time: a bus that cannot be opened does not affect another one."""
    if not words and common.bus:
        words = (common.bus,)
    machine = None if words and all(map(is_address, words)) else load_machine(common)
    if machine is None:
        yield from ((word,) for word in words or ("",))
        return
    yield from ((word,) for word in words if is_address(word))
    names = machine.axes_of([word for word in words if not is_address(word)] if words else None)
    for bus in machine.buses:
        if axes := tuple(name for name in names if machine.axes[name].bus == bus):
            yield axes


def with_others(errors: Sequence[MotorbusError]) -> MotorbusError:
    """The first error, with a note for each other."""
    for error in errors[1:]:
        errors[0].add_note(f"also: {error.summary}")
    return errors[0]


def _raise_all(done: Mapping[str, Any], errors: Sequence[MotorbusError]) -> None:
    """Raise the errors: Partial if some devices did it."""
    if errors and done:
        raise Partial("; ".join(error.summary for error in errors), advice=errors[0].advice)
    if errors:
        raise with_others(errors)
