"""Moving by hand: by an angle, or for a while, at a speed that somebody says, with the motor ending by itself.

The controller has no command for that. It has a single move, with the distance and the speed of step 1 of project 1,
which is borrowed for it (`borrowing`). A jog is such a move too, of exactly velocity times time: so a host that dies in
the middle of it leaves a motor that comes to its end, and none that turns for ever. The unit is made one pulse for it.

Nobody can ask whether a project runs. One that this host has started refuses a motion by hand; one that a button or
another host has started may ignore the order, and the stop at its end stops it.

No position comes back, and no notice of the end. What is told of such a motion is what was ordered and how long that
should take; it is reckoning, and is called *estimated*.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from math import copysign, tau
from typing import Final, NamedTuple

from motorbus.core.steps import Sleep
from motorbus.errors import RequestError
from motorbus.families.stepper import execution, wire
from motorbus.families.stepper.driver import commands, goals
from motorbus.families.stepper.driver.borrowing import PROJECT, borrowed
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.reading import dump
from motorbus.families.stepper.driver.stopping import Promise
from motorbus.families.stepper.driver.turning import (
    Watch,
    finite,
    honest,
    longest,
    refuse_unless_turning,
    waited,
    within,
)
from motorbus.families.stepper.table import PROJECTS, Direction, Project, Step, decode_image

LONGEST: Final = 60.0
"""s that a jog may last at most."""
OFF: Final = 0.1
"""How far the speed may be from the one that was said, as a fraction: speeds are whole RPM."""
START: Final = 50
"""Hz where step 1 has no start frequency: the example of the stepper controller serial protocol manual, item 5."""
ACCELERATION: Final = 30
"""Hz where step 1 has no acceleration: the example of the same manual, item 6."""
HUNDREDTHS: Final = 36000
"""The unit, in so many for a turn, where one pulse as the unit does not fit."""
_DISTANCE: Final = 0xFFFFFF
_WORD: Final = 0xFFFF
"""The greatest speed (RPM) and acceleration (Hz) that a frame holds."""


class Moved(NamedTuple):
    """A motion that was ordered and has had its time: all of it *estimated*, for the controller tells nothing of it.

    `angle` in rad of the motor, forward positive; `velocity` in rad/s, likewise; `seconds` how long it may take at
    most, and what was waited.
    """

    node: int
    angle: float
    velocity: float
    seconds: float
    promise: Promise | None

    def __str__(self) -> str:
        rpm = abs(self.velocity) * 60 / tau
        return (
            f"estimated: {self.angle:.6g} rad at {self.velocity:.6g} rad/s ({rpm:.0f} RPM), {self.seconds:.3f} s "
            "at most; nothing tells where the motor stands"
        )


async def move_by(
    node: Node,
    angle: float,
    *,
    velocity: float | None = None,
    acceleration: int | None = None,
    wait: bool = True,
) -> Moved:
    """Turn the motor by an angle (rad, forward positive), with a journalled borrow of project 1; then stop.

    `velocity` in rad/s, above 0, is rounded to whole RPM; None is that of step 1. `acceleration` is the number that the
    controller takes, in Hz, 0 to 65535; None is that of step 1. Where step 1 has none, or no start frequency, it is
    that of the manual's example; a start frequency that is not below the running one becomes half of that. The angle is
    rounded to whole pulses. A project 1 that was cleared takes its geometry from the first other project that has one.

    Waits as long as the slowest reading of the ramp says, then says stop, which ends what turns still. Without `wait`
    it goes on when this returns: possible only when nothing had to be borrowed. Until it may be over, nothing else
    begins on this bus but a stop.

    When it returns, and it was waited for, the motor has turned by `Moved.angle`, *estimated*: in whole pulses, and
    not where steps were lost. An error that is `unmoved` has moved nothing; after any other, also an interruption,
    nobody knows where it stands.

    Raises RequestError, before anything is written, for a speed that is 0 or more than 10 % off in whole RPM, an angle
    of less than a pulse or too far, and as `borrowed`; Interrupted when somebody stops it; OutcomeUnknown when the
    order was not acknowledged: it is stopped then, also without `wait`.
    """
    finite(angle, "angle")
    rpm = None if velocity is None else whole_rpm(finite(velocity, "velocity"))
    return await _turned(node, "move_by", angle, rpm, acceleration, wait)


async def jog(node: Node, velocity: float, seconds: float, *, acceleration: int | None = None) -> Moved:
    """Turn at a velocity (rad/s, forward positive) for a while (s, at most 60), then stop.

    It is one single move of exactly velocity times seconds, see `move_by`: the motor ends by itself when this host
    dies. It takes a little longer for its ramps, and for its speed is in whole RPM. Returns and raises as `move_by`.
    """
    rpm = whole_rpm(abs(finite(velocity, "velocity")))
    angle = velocity * within(seconds, LONGEST, "seconds")
    return await _turned(node, "jog", angle, rpm, acceleration, True)


async def _turned(
    node: Node, verb: str, angle: float, rpm: int | None, acceleration: int | None, wait: bool
) -> Moved:
    ramp = None if acceleration is None else _checked_acceleration(acceleration)
    watch = Watch(node)

    async def wanted(project: Project) -> Project:
        project = await grounded(node, project, verb, rpm)
        return shaped(paced(project, rpm, ramp), angle)

    async def motion(project: Project) -> Moved:
        return await single(node, project, watch, wait=wait)

    return await honest(watch, borrowed(node, verb, wanted, motion, leave=not wait))


def _checked_acceleration(number: int) -> int:
    if isinstance(number, int) and not isinstance(number, bool) and 0 <= number <= _WORD:
        return number
    raise RequestError(
        f"acceleration: {number!r} is not possible",
        expected=f"0 to {_WORD} Hz, a whole number: as the controller takes it",
        advice="nothing was sent",
    )


async def run_once(node: Node) -> Moved:
    """Make the single move that project 1 has in its step 1, wait for as long as it may take, then stop.

    Nothing is edited. Raises RequestError when it has none, and as `move_by`.
    """
    watch = Watch(node)

    async def wanted(project: Project) -> Project:
        refuse_unless_turning(node, project, "run_once")
        _pulses(project)
        return project

    async def motion(project: Project) -> Moved:
        return await single(node, project, watch)

    return await honest(watch, borrowed(node, "run_once", wanted, motion))


async def jog_forward(node: Node, seconds: float) -> Moved:
    """Turn forward for a while (s, at most 60), then stop; a host that dies meanwhile leaves the motor turning.

    It is the manual's jog, which has the speed of step 1 of project 1 and no end of its own; `jog` has both. Raises
    RequestError when project 1 has no speed, and as `move_by`.
    """
    return await _endless(node, "jog_forward", 1, seconds)


async def jog_reverse(node: Node, seconds: float) -> Moved:
    """The same in reverse; a host that dies meanwhile leaves the motor turning."""
    return await _endless(node, "jog_reverse", -1, seconds)


async def _endless(node: Node, verb: str, sign: int, seconds: float) -> Moved:
    within(seconds, LONGEST, "seconds")
    watch = Watch(node)

    async def wanted(project: Project) -> Project:
        refuse_unless_turning(node, project, verb)
        return project

    async def motion(project: Project) -> Moved:
        await commands.motion(node, verb, goals.of_jog(node, project, sign), watch.refusal)
        await waited(watch, seconds, verb.replace("_", " "))
        pulses = execution.move(project, project.step(1), None).done(seconds)
        angle = sign * pulses * tau / float(project.pulses_per_turn or 1)
        return Moved(node.node, angle, sign * _velocity(project), seconds, Promise.STOP_ACCEPTED)

    return await honest(watch, borrowed(node, verb, wanted, motion))


async def single(node: Node, project: Project, watch: Watch, *, wait: bool = True) -> Moved:
    """The single move of step 1 as project 1 has it, and the wait for it; who calls it says stop.

    Raises RequestError for a move of less than a pulse: a controller may take a distance of 0 for one without an end.
    """
    step, count = project.step(1), _pulses(project)
    await commands.motion(node, "run_once", goals.of_move(node, project), watch.refusal)
    seconds = longest(project, count)
    if wait:
        await waited(watch, seconds, "moving")
    else:
        node.memory.turning = await Sleep(0) + seconds
    angle = step.sign * count * tau / float(project.pulses_per_turn or 1)
    promise = Promise.STOP_ACCEPTED if wait else None
    return Moved(node.node, angle, step.sign * _velocity(project), seconds, promise)


def _pulses(project: Project) -> int:
    count, _ = execution.pulses(project, project.step(1))
    if not count:
        raise less_than_a_pulse(project)
    return count


def _velocity(project: Project) -> float:
    return project.step(1).speed * tau / 60


# -- what project 1 has to be for it ----------------------------------------------------------------------------------


def whole_rpm(velocity: float) -> int:
    """The speed in RPM, as the controller takes it, for a velocity (rad/s) above 0.

    Raises RequestError when it is more than 10 % off, naming those that are possible.
    """
    exact = velocity / tau * 60
    near = min(max(exact, 0.0), _WORD + 1.0)
    rpm = round(near)
    if 0 < rpm <= _WORD and abs(rpm - exact) <= OFF * exact:
        return rpm
    raise RequestError(
        f"{velocity:.6g} rad/s are {exact:.4g} RPM, and speeds are whole RPM",
        expected=" or ".join(
            f"{one * tau / 60:.4g} rad/s ({one} RPM)"
            for one in (int(min(near, _WORD)), int(near) + 1)
            if 0 < one <= _WORD
        )
        or f"above 0, at most {_WORD * tau / 60:.6g} rad/s",
        cause="the nearest is more than 10 % off" if exact > 0 else "it is not above 0",
        advice="choose one of these, or move_by() an angle; nothing was sent",
    )


async def grounded(node: Node, project: Project, verb: str, rpm: int | None) -> Project:
    """Project 1 with something to turn by; one that was cleared takes its geometry from another project.

    Raises RequestError when there is neither, or no speed was said and it has none.
    """
    if rpm is None:
        refuse_unless_turning(node, project, verb)
    if project.pulses_per_turn is not None and not project.is_cleared:
        return project
    if project.is_cleared:
        for number in range(PROJECT + 1, PROJECTS + 1):
            image = (await dump(node, number))[wire.REPLY_LENGTH :]
            other = decode_image(image, node.order)
            if other.pulses_per_unit is not None and not other.is_cleared:
                return _with_geometry(other)
    raise RequestError(
        "no project says how many pulses make a turn",
        expected="microsteps and a step angle in project 1, or in another one where project 1 is cleared",
        advice="write project 1; nothing was sent",
        node=node.node,
    )


def _with_geometry(other: Project) -> Project:
    return Project(
        number=PROJECT,
        total_steps=1,
        microsteps=other.microsteps,
        step_angle=other.step_angle,
        turn_distance=other.turn_distance,
    )


def paced(project: Project, rpm: int | None, acceleration: int | None) -> Project:
    """The project with this speed in its step 1, and a ramp that leads up to it."""
    step = project.step(1)
    speed = step.speed if rpm is None else rpm
    running = float(speed * (project.pulses_per_turn or Fraction(0)) / 60)
    return project.with_step(
        1,
        speed=speed,
        start_frequency=start_below(step, running),
        acceleration=acceleration if acceleration is not None else step.acceleration or ACCELERATION,
    )


def start_below(step: Step, running: float) -> int:
    """The start frequency (Hz): that of the step while it is below the running frequency (Hz), else half of that."""
    usual = step.start_frequency or START
    return usual if usual < running else max(1, int(running / 2))


def shaped(project: Project, angle: float) -> Project:
    """The project with this angle (rad) as the distance of its step 1, in whole pulses, the unit made to fit.

    The unit is one pulse, or a part of it where the pulses of a turn are not whole, so that every move is of whole
    pulses; where that does not fit it is a hundredth of a degree. Raises RequestError for less than a pulse, and for
    what is too far to be said.
    """
    turn = project.pulses_per_turn or Fraction(0)
    turns = Fraction(abs(angle) / tau)  # exact, and so without an end: a product of floats may be infinite
    pulses = round(turns * turn)
    if not pulses:
        raise less_than_a_pulse(project)
    unit, distance = turn.numerator, turn.denominator * pulses
    if unit > _DISTANCE or distance > _DISTANCE:
        unit, distance = HUNDREDTHS, round(turns * HUNDREDTHS)
    if distance > _DISTANCE:
        raise RequestError(
            f"{angle:.6g} rad are too far for one move",
            expected=f"at most {_DISTANCE} units, which are {_DISTANCE * tau / unit:.6g} rad",
            advice="make several moves; nothing was sent",
        )
    direction = Direction.REVERSE if copysign(1.0, angle) < 0 else Direction.FORWARD
    return replace(project, turn_distance=unit).with_step(1, distance=distance, direction=int(direction))


def less_than_a_pulse(project: Project) -> RequestError:
    """The error for a move that would send no pulse."""
    turn = project.pulses_per_turn
    return RequestError(
        "this move is less than one pulse",
        expected=f"at least {tau / float(turn):.4g} rad" if turn else "a distance",
        cause="a controller may take a distance of 0 for a move without an end",
        advice="nothing was sent",
    )
