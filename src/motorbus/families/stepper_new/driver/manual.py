"""Manual motion: by an angle, for a time, to the home switch, together with others.

A jog with a velocity is a single move of velocity times time, so a host that dies leaves a motor that stops by itself.
Neither a position nor a notice comes back: angle and time of such a motion are estimates.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from math import inf, tau
from typing import Final, NamedTuple

from motorbus.core.register import is_number, shown
from motorbus.core.request import Request
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import Emit, Progress, SetBitrate, Sleep
from motorbus.core.timing import Timing, Turned
from motorbus.errors import NotHomed, RequestError
from motorbus.families.stepper_new.driver.io import check_seconds, read_input
from motorbus.families.stepper_new.driver.loan import lend
from motorbus.families.stepper_new.driver.node import Node
from motorbus.families.stepper_new.driver.requests import command, ignore
from motorbus.families.stepper_new.driver.stop import Promise, Watch, mark_unmoved
from motorbus.families.stepper_new.execution.ramp import Motion, motion, pulses_of, ramp_of, slowest
from motorbus.families.stepper_new.parameters import HOME_INPUT, REVERSE, Project
from motorbus.families.stepper_new.protocol import REQUEST_LENGTH

LONGEST_JOG: Final = 60.0  # s
DEADLINE: Final = 30.0  # s, of homing
LONGEST_HOMING: Final = 600.0  # s
READINGS: Final = 2  # of input 5 in a row
LOOK: Final = 0.1  # s between two looks for a stop
REPORT: Final = 0.25  # s between two reports of progress
CLOCK: Final = 1.02  # its clock may be slower by so much # assumption
SPARE: Final = 0.05  # s # assumption
ROUNDING: Final = 0.1  # share by which a velocity may differ from a whole RPM
EXACT: Final = 1e-9  # share; an RPM that was converted to rad/s and back
START: Final = 50  # Hz, where step 1 has none: the example of item 5
ACCELERATION: Final = 30  # Hz, likewise, of item 6
HUNDREDTHS: Final = 36000  # of a degree in a turn: the unit where a pulse as unit does not fit
MAX_DISTANCE: Final = 0xFFFFFF
MAX_WORD: Final = 0xFFFF  # of a speed in RPM, and of an acceleration


class Moved(NamedTuple):
    """A motion that was requested and had its time; all of it is estimated.

    `angle` in rad and `velocity` in rad/s, forward positive; `seconds` that it takes at most; `promise` of the stop.
    """

    node: int
    angle: float
    velocity: float
    seconds: float
    promise: Promise | None


class Homed(NamedTuple):
    """Input 5 was active after `seconds` in reverse at `velocity` (rad/s, estimated), and the stop was acknowledged."""

    node: int
    seconds: float
    velocity: float
    promise: Promise


# -- by an angle, for a time -------------------------------------------------------------------------------------------


async def move_by(
    node: Node,
    angle: float,
    *,
    velocity: float | None = None,
    acceleration: int | None = None,
    wait: bool = True,
) -> Moved:
    """Turn by `angle` (rad, forward positive, in whole pulses) with a loan of project 1, wait for its time, then stop.

    `velocity` in rad/s, above 0, in whole RPM; None: that of step 1. `acceleration` in Hz, 0 to 65535, as the
    controller takes it; None: that of step 1. `wait=False` is possible if project 1 contains this move already; it then
    is not stopped, and until its time is over nothing else may start.

    Raises RequestError, with nothing written, for a velocity more than 10 % off a whole RPM, less than a pulse, and as
    `lend`; Interrupted if it is stopped; OutcomeUnknown without an acknowledgement. The position is unknown after each
    error that is not `unmoved`.
    """
    _check_finite("angle", angle)
    rpm = None if velocity is None else whole_rpm(velocity)
    return await _move(node, "move_by", angle, rpm, acceleration, wait=wait)


async def jog(node: Node, velocity: float, seconds: float, *, acceleration: int | None = None) -> Moved:
    """Turn at `velocity` (rad/s, forward positive) for `seconds`, at most 60, then stop.

    It is a single move of velocity times time, so it ends by itself if the host dies. Its ramps make it a little
    longer. Returns and raises as `move_by`.
    """
    check_seconds("seconds", seconds, LONGEST_JOG)
    _check_finite("velocity", velocity)
    return await _move(node, "jog", velocity * seconds, whole_rpm(abs(velocity)), acceleration)


async def _move(
    node: Node, verb: str, angle: float, rpm: int | None, acceleration: int | None, *, wait: bool = True
) -> Moved:
    if acceleration is not None and acceleration not in range(MAX_WORD + 1):
        raise RequestError(
            f"acceleration {shown(acceleration)} is not possible", expected=f"0 to {MAX_WORD} Hz"
        )
    watch = Watch(node)

    async def change(project: Project) -> Project:
        check_geometry(project, verb, needs_speed=rpm is None)
        return shaped(paced(project, rpm, acceleration), angle)

    async def move(project: Project) -> Moved:
        return await _move_once(watch, project, wait=wait)

    return await mark_unmoved(watch, lend(watch, verb, change, move, keeps_moving=not wait))


async def run_once(node: Node) -> Moved:
    """Make the move of step 1 of project 1 (item 19), wait for its time, then stop.

    Nothing is edited. Raises RequestError if it has none, and as `move_by`.
    """
    watch = Watch(node)

    async def change(project: Project) -> Project:
        check_geometry(project, "run_once")
        return project

    async def move(project: Project) -> Moved:
        return await _move_once(watch, project)

    return await mark_unmoved(watch, lend(watch, "run_once", change, move))


async def _move_once(watch: Watch, project: Project, *, wait: bool = True) -> Moved:
    node, step = watch.node, project.step(1)
    pulses = _pulses(project)
    angle = step.sign * pulses * _pulse(project)
    velocity = step.sign * _velocity(project)
    await _request(watch, "run_once", _by_angle(node, angle, velocity))
    seconds = _longest(project, pulses)
    if wait:
        await _wait(watch, seconds, "moving")
    else:
        node.state.busy_until = await Sleep(0) + seconds
    return Moved(node.node, angle, velocity, seconds, Promise.STOP_ACCEPTED if wait else None)


async def jog_forward(node: Node, seconds: float) -> Moved:
    """Turn forward for `seconds`, at most 60, with the speed of step 1 of project 1 (item 18), then stop.

    The command itself has no end: if the host dies, the motor turns on. `jog` ends by itself. Raises RequestError
    without a speed, and as `move_by`.
    """
    return await _jog(node, "jog_forward", 1, seconds)


async def jog_reverse(node: Node, seconds: float) -> Moved:
    """Turn in reverse for `seconds` (item 17b); see `jog_forward`."""
    return await _jog(node, "jog_reverse", -1, seconds)


async def _jog(node: Node, verb: str, sign: int, seconds: float) -> Moved:
    check_seconds("seconds", seconds, LONGEST_JOG)
    watch = Watch(node)

    async def change(project: Project) -> Project:
        check_geometry(project, verb)
        return project

    async def turn(project: Project) -> Moved:
        velocity = sign * _velocity(project)
        await _request(watch, verb, _endless(node, velocity))
        await _wait(watch, seconds, verb)
        angle = sign * _motion(project, None).done(seconds) * _pulse(project)
        return Moved(node.node, angle, velocity, seconds, Promise.STOP_ACCEPTED)

    return await mark_unmoved(watch, lend(watch, verb, change, turn, ends=False))


# -- to the home switch ------------------------------------------------------------------------------------------------


async def home(
    node: Node, *, deadline: float = DEADLINE, velocity: float | None = None, at_most: float | None = None
) -> Homed:
    """Turn in reverse until input 5 is active (item 22), at most `deadline` s (up to 600), then stop in each case.

    The speed is that of step 1 of project 1; `velocity` (rad/s, above 0, in whole RPM) takes a loan for another one,
    `at_most` (rad/s) only if step 1 is faster. Reports `Progress` in ms. That the motor stops at the switch at once is
    an assumption.

    Raises NotHomed if input 5 is active before (nothing is moved), or not by the deadline; RequestError without a
    speed, and as `lend`; Interrupted; OutcomeUnknown if command or stop is not acknowledged.
    """
    check_seconds("deadline", deadline, LONGEST_HOMING)
    rpm = None if velocity is None else whole_rpm(velocity)
    limit = inf if at_most is None else at_most
    watch = Watch(node)

    async def change(project: Project) -> Project:
        await _check_released(node)
        check_geometry(project, "home", needs_speed=rpm is None)
        if rpm is not None:
            return paced(project, rpm, None)
        return project if _velocity(project) <= limit else paced(project, _rpm_below(limit), None)

    async def turn(project: Project) -> Homed:
        return await _turn_home(watch, _velocity(project), deadline)

    return await mark_unmoved(watch, lend(watch, "home", change, turn))


async def _check_released(node: Node) -> None:
    for _ in range(READINGS):
        if await read_input(node, HOME_INPUT):
            raise NotHomed(
                f"input {HOME_INPUT} is active before homing",
                expected="an input that is not active",
                cause="it stands at the home switch, or the switch is stuck or active at rest",
                advice="move forward, away from the switch; nothing was moved",
                node=node.node,
            )


async def _turn_home(watch: Watch, velocity: float, deadline: float) -> Homed:
    node = watch.node
    await _request(watch, "home", _endless(node, -velocity))
    now = begun = await Sleep(0)
    reported = -inf
    active = 0
    while now - begun < deadline:
        active = active + 1 if await read_input(node, HOME_INPUT) else 0
        watch.check()
        now = await Sleep(0)
        if active == READINGS:
            return Homed(node.node, now - begun, velocity, Promise.STOP_ACCEPTED)
        if now - reported >= REPORT:
            reported = now
            await Emit(Progress(round(1000 * (now - begun)), round(1000 * deadline), "homing"))
    raise NotHomed(
        f"input {HOME_INPUT} was not active within {deadline:g} s",
        cause="the switch is farther away, its wire is broken, or the motor does not turn",
        advice=f"check input {HOME_INPUT} by hand, then home again with a longer deadline",
        node=node.node,
    )


# -- together with others ----------------------------------------------------------------------------------------------


async def keep_time(
    node: Node, angle: float, timing: Timing, *, velocity: float, acceleration: float | None = None
) -> Turned:
    """Turn by `angle` (rad) with a loan of project 1; begin with the devices of `timing`, end with them or soon after.

    At most at `velocity` (rad/s, whole RPM) and, in each reading of the controller's number, at most at `acceleration`
    (rad/s²). The duration is that of the slowest whole RPM that is long enough for the others, or of 1 RPM. All values
    of the result are estimated. Raises RequestError for a velocity below 1 RPM, and as `move_by`; `timing.fails` gets
    each error once the others were asked.
    """
    _check_finite("angle", angle)
    for name, value in (
        ("velocity", velocity),
        ("acceleration", 1.0 if acceleration is None else acceleration),
    ):
        if not is_number(value) or value <= 0:
            raise RequestError(f"{name} {shown(value)} is not a finite number above 0")
    watch = Watch(node)
    asked = False

    def fail(error: BaseException) -> None:
        if asked:
            timing.fails(error)

    async def change(project: Project) -> Project:
        nonlocal asked
        check_geometry(project, "keep_time", needs_speed=False)
        quickest = _paced_for(project, angle, _rpm_below(velocity), acceleration)
        asked = True
        try:
            seconds = await timing.agreed(
                _duration(quickest), lambda least: _duration(_slowed(quickest, least))
            )
            watch.check()
        except BaseException as error:
            fail(error)
            raise
        return _slowed(quickest, seconds)

    async def turn(project: Project) -> Turned:
        watch.check()
        return await _turn_together(watch, project, timing)

    return await mark_unmoved(watch, lend(watch, "keep_time", change, turn, on_error=fail))


async def _turn_together(watch: Watch, project: Project, timing: Timing) -> Turned:
    node, step, pulses = watch.node, project.step(1), _pulses(project)
    move = _motion(project, pulses)
    first = move.moment(1)
    pulse = step.sign * _pulse(project)
    lead = REQUEST_LENGTH * 10 / await SetBitrate(0)
    await timing.start(lead + first)
    begun = await Sleep(0) + lead + first
    await _request(watch, "run_once", _by_angle(node, pulse * pulses, _velocity(project)))
    await _wait(watch, _longest(project, pulses), "moving")

    def way(at: float) -> float:
        return pulse * move.done(first + at) if at >= 0 else 0.0

    return Turned(node.node, pulse * pulses, begun, _duration(project), way)


def _paced_for(project: Project, angle: float, rpm: int, acceleration: float | None) -> Project:
    """The move at this speed, with a ramp that is in no reading steeper than `acceleration` (rad/s²)."""
    shape = shaped(paced(project, rpm, None), angle)
    if acceleration is None:
        return shape
    running = ramp_of(shape, shape.step(1)).run
    steepest = acceleration / _pulse(shape)  # Hz/s
    number = int(min(MAX_WORD, max(1.0, steepest / max(1000.0, running))))
    return shape.with_step(1, acceleration=min(number, shape.step(1).acceleration))


def _slowed(quickest: Project, seconds: float) -> Project:
    """The same move at the highest whole RPM with which it lasts so long (s); at 1 RPM if none does."""
    low, high = 1, quickest.step(1).speed
    while low < high:
        middle = (low + high + 1) // 2
        if _duration(paced(quickest, middle, None)) >= seconds:
            low = middle
        else:
            high = middle - 1
    return paced(quickest, low, None)


def _duration(project: Project) -> float:
    """s from the first pulse of the single move to its last."""
    move = _motion(project, _pulses(project))
    return move.duration - move.moment(1)


# -- requests and waits ------------------------------------------------------------------------------------------------


def _request(watch: Watch, name: str, setpoints: tuple[Setpoint, ...]) -> Request[None]:
    return command(watch.node, name, ignore, setpoints=setpoints, precondition=watch.precondition)


def _by_angle(node: Node, angle: float, velocity: float) -> tuple[Setpoint, ...]:
    """The setpoints of a move: the controller knows no limits of travel."""
    return (
        Setpoint(node.node, "relative", angle, -inf, inf),
        Setpoint(node.node, "speed", abs(velocity), -inf, inf),
    )


def _endless(node: Node, velocity: float) -> tuple[Setpoint, ...]:
    return (Setpoint(node.node, "velocity", velocity, -inf, inf),)


async def _wait(watch: Watch, seconds: float, what: str) -> None:
    """Let this time pass; reports `Progress` in ms. Raises Interrupted after a stop."""
    now = begun = await Sleep(0)
    while now < begun + seconds:
        await Emit(Progress(round(1000 * (now - begun)), round(1000 * seconds), f"{what}, estimated"))
        now = await Sleep(min(LOOK, begun + seconds - now))
        watch.check()


def _longest(project: Project, pulses: int) -> float:
    """s that a move may take, by the slowest reading of its ramp and a slow clock."""
    return slowest(project, project.step(1), pulses) * CLOCK + SPARE


def _motion(project: Project, pulses: int | None) -> Motion:
    return motion(ramp_of(project, project.step(1)), pulses, project.step(1).sign)


def _velocity(project: Project) -> float:
    return project.step(1).speed * tau / 60


def _pulse(project: Project) -> float:
    """rad of one pulse."""
    return tau / float(project.pulses_per_turn or 1)


# -- project 1 for a motion --------------------------------------------------------------------------------------------


def check_geometry(project: Project, verb: str, *, needs_speed: bool = True) -> None:
    """Raise RequestError if project 1 gives no pulses per turn, or no speed that is needed."""
    if project.pulses_per_unit is None or project.is_cleared:
        lacks = "is cleared, or gives no pulses per turn"
    elif needs_speed and not project.step(1).speed:
        lacks = "has no speed in step 1"
    else:
        return
    raise RequestError(
        f"{verb}() needs project 1, which {lacks}",
        expected="a project 1 with a speed in its step 1, from which manual motion takes it",
        advice="write project 1; nothing was sent that changes anything",
    )


def _pulses(project: Project) -> int:
    pulses = pulses_of(project, project.step(1))
    if not pulses:
        raise _less_than_a_pulse(project)
    return pulses


def _less_than_a_pulse(project: Project) -> RequestError:
    return RequestError(
        "this move is less than one pulse",
        expected=f"at least {_pulse(project):.4g} rad",
        cause="a controller may take a distance of 0 for an endless move",
        advice="nothing was moved",
    )


def whole_rpm(velocity: float) -> int:
    """The RPM of a velocity (rad/s) above 0. Raises RequestError if it is more than 10 % off, with those possible."""
    _check_finite("velocity", velocity)
    exact = velocity * 60 / tau
    rpm = round(min(exact, MAX_WORD + 1.0))
    if 0 < rpm <= MAX_WORD and abs(rpm - exact) <= ROUNDING * exact:
        return rpm
    near = [one for one in (int(min(exact, MAX_WORD)), int(min(exact, MAX_WORD)) + 1) if 0 < one <= MAX_WORD]
    raise RequestError(
        f"velocity {velocity:.6g} rad/s is {exact:.4g} RPM, and speeds are whole RPM",
        expected=" or ".join(f"{one * tau / 60:.4g} rad/s ({one} RPM)" for one in near),
        advice="give one of these; nothing was sent",
    )


def _rpm_below(velocity: float) -> int:
    """The highest whole RPM that is not above this velocity (rad/s). Raises RequestError below 1 RPM."""
    if is_number(velocity) and velocity * 60 / tau * (1 + EXACT) >= 1:
        return int(min(velocity * 60 / tau * (1 + EXACT), MAX_WORD))
    raise RequestError(
        f"velocity {shown(velocity)} rad/s is below 1 RPM, and speeds are whole RPM",
        expected=f"at least {tau / 60:.4g} rad/s",
        advice="allow more; nothing was sent",
    )


def paced(project: Project, rpm: int | None, acceleration: int | None) -> Project:
    """Project 1 with this speed in step 1 (None: its own), and a start frequency below it."""
    step = project.step(1)
    speed = step.speed if rpm is None else rpm
    running = float(speed * (project.pulses_per_turn or Fraction(0)) / 60)
    start = step.start_frequency or START
    return project.with_step(
        1,
        speed=speed,
        start_frequency=start if start < running else max(1, int(running / 2)),
        acceleration=acceleration if acceleration is not None else step.acceleration or ACCELERATION,
    )


def shaped(project: Project, angle: float) -> Project:
    """Project 1 with this angle (rad) as distance of step 1, in whole pulses.

    The unit is a pulse, or a part of one where a turn has no whole number of pulses; a hundredth of a degree where that
    does not fit. Raises RequestError for less than a pulse, and for too much.
    """
    turn = project.pulses_per_turn or Fraction(0)
    turns = Fraction(abs(angle) / tau)
    pulses = round(turns * turn)
    if not pulses:
        raise _less_than_a_pulse(project)
    unit, distance = turn.numerator, turn.denominator * pulses
    if max(unit, distance) > MAX_DISTANCE:
        unit, distance = HUNDREDTHS, round(turns * HUNDREDTHS)
    if distance > MAX_DISTANCE:
        raise RequestError(
            f"{angle:.6g} rad is too far for one move",
            expected=f"at most {MAX_DISTANCE * tau / unit:.6g} rad",
            advice="make several moves; nothing was moved",
        )
    direction = REVERSE if angle < 0 else 1 - REVERSE
    return replace(project, turn_distance=unit).with_step(1, distance=distance, direction=direction)


def _check_finite(name: str, value: float) -> None:
    if not is_number(value):
        raise RequestError(f"{name} {shown(value)} is not a finite number", advice="nothing was sent")
