"""Manual motion: by an angle, for a time, to the home switch, or planned together with other axes.

A jog with a velocity is a single move of velocity times time, so a host that dies leaves a motor that stops by itself.
Neither a position nor a notice comes back: angle and time of such a motion are estimates. A move is stopped when its
estimated time and a margin of 2 % and 0.05 s have passed; a controller with a slower ramp than `ramp_tick_ms` says
falls short then.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import partial
from math import inf, tau
from typing import Final, NamedTuple

from motorbus.core.register import is_number, shown
from motorbus.core.request import Request, Response
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import Emit, Exclusive, Progress, Sleep
from motorbus.errors import NotHomed, RequestError
from motorbus.families.stepper.driver.io import check_seconds, read_input
from motorbus.families.stepper.driver.node import Node, command, ignore
from motorbus.families.stepper.driver.project1 import TemporaryProject1, with_project1
from motorbus.families.stepper.driver.projects import MANUAL, cached
from motorbus.families.stepper.driver.stop import Watch, check_free
from motorbus.families.stepper.execution import ramp
from motorbus.families.stepper.execution.ramp import Motion, move_of
from motorbus.families.stepper.parameters import HOME_INPUT, REVERSE, Project

LONGEST_JOG: Final = 60.0  # s
DEADLINE: Final = 30.0  # s, of homing
LONGEST_HOMING: Final = 600.0  # s
READINGS: Final = 2  # of input 5 in a row
PAUSE: Final = 0.02  # s between two readings, in which another thread can use the bus
REPORT: Final = 0.1  # s between two reports of progress, and two looks for a stop
CLOCK: Final = 1.02  # its clock may be slower by so much # assumption
MARGIN: Final = 0.05  # s that a move may take longer than estimated # assumption
ROUNDING: Final = 0.1  # share by which a velocity may differ from a whole RPM
EXACT: Final = 1 + 1e-9  # an RPM that was converted to rad/s and back
START: Final = 50  # Hz, where step 1 has none: the example of item 5
ACCELERATION: Final = 30  # Hz, likewise, of item 6
PLAN: Final = "plan_move"
MAX_DISTANCE: Final = 0xFFFFFF
MAX_RPM: Final = 0xFFFF


class Moved(NamedTuple):
    """A motion that was requested and had its time; all of it is estimated.

    `angle` in rad and `velocity` in rad/s, forward positive; `seconds` that it takes at most.
    """

    node: int
    angle: float
    velocity: float
    seconds: float


class Homed(NamedTuple):
    """Input 5 was active after `seconds` in reverse at `velocity` (rad/s, estimated), and the stop was acknowledged."""

    node: int
    seconds: float
    velocity: float


# -- by an angle, for a time -------------------------------------------------------------------------------------------


async def move_by(node: Node, angle: float, *, velocity: float | None = None, wait: bool = True) -> Moved:
    """Turn by `angle` (rad, forward positive, in whole pulses) with temporary use of project 1, wait for its time,
    then stop.

    `velocity` in rad/s, above 0, in whole RPM; None: that of step 1. `wait=False` is refused: project 1 has to be
    restored. Raises RequestError, with nothing written, for a velocity more than 10 % off a whole RPM, less than a
    pulse, and as `with_project1`; Interrupted if it is stopped; OutcomeUnknown without an acknowledgement. The position
    is unknown after an error of a motion that was requested.
    """
    if not wait:
        raise RequestError("a move of the stepper controller is always waited for")
    check_finite("angle", angle)
    return await _move(node, "move_by", angle, _rpm(velocity))


async def jog(node: Node, velocity: float, seconds: float) -> Moved:
    """Turn at `velocity` (rad/s, forward positive) for `seconds`, at most 60, then stop.

    It is a single move of velocity times time, so it ends by itself if the host dies. Its ramps make it a little
    longer. Returns and raises as `move_by`.
    """
    check_seconds("seconds", seconds, LONGEST_JOG)
    check_finite("velocity", velocity)
    return await _move(node, "jog", velocity * seconds, _rpm(abs(velocity)))


async def run_once(node: Node) -> Moved:
    """Make the move of step 1 of project 1 (item 19), wait for its time, then stop.

    Nothing is edited. Raises RequestError if it has none, and as `move_by`.
    """
    return await with_project1(node, "run_once", checked, _move_once)


async def jog_forward(node: Node, seconds: float) -> Moved:
    """Turn forward for `seconds`, at most 60, with the speed of step 1 of project 1 (item 18), then stop.

    The command itself has no end: if the host dies, the motor turns on. `jog` ends by itself. Raises RequestError
    without a speed, and as `move_by`.
    """
    return await _jog(node, "jog_forward", 1, seconds)


async def jog_reverse(node: Node, seconds: float) -> Moved:
    """Turn in reverse for `seconds` (item 17b); see `jog_forward`."""
    return await _jog(node, "jog_reverse", -1, seconds)


async def _move(node: Node, verb: str, angle: float, rpm: int | None) -> Moved:
    def change(project: Project) -> Project:
        project = shaped(project, angle, rpm)
        check_pulses(project)
        return project

    return await with_project1(node, verb, change, _move_once)


async def _move_once(watch: Watch, project: Project) -> Moved:
    check_pulses(project)
    move = move_of(project, project.step(1), watch.node.tick_ms)
    angle, seconds = angle_of(project), move.duration * CLOCK + MARGIN
    await motion_request(watch, "run_once", "relative", angle, project)
    await wait(watch, seconds, "moving")
    return Moved(watch.node.node, angle, move.sign * velocity_of(project), seconds)


async def _jog(node: Node, name: str, sign: int, seconds: float) -> Moved:
    check_seconds("seconds", seconds, LONGEST_JOG)

    async def turn(watch: Watch, project: Project) -> Moved:
        velocity = sign * velocity_of(project)
        await motion_request(watch, name, "velocity", velocity, project)
        await wait(watch, seconds, name)
        speed = ramp.ramp_of(project, project.step(1), node.tick_ms)
        angle = sign * ramp.motion(speed, None, sign).done(seconds) * pulse_angle(project)
        return Moved(node.node, angle, velocity, seconds)

    return await with_project1(node, name, checked, turn, ends=False)


# -- to the home switch ------------------------------------------------------------------------------------------------


async def home(node: Node, *, deadline: float = DEADLINE, velocity: float | None = None) -> Homed:
    """Turn in reverse until input 5 is active (item 22), at most `deadline` s (up to 600), then stop in each case.

    The speed is that of step 1 of project 1; `velocity` (rad/s, above 0, in whole RPM) is another one, with temporary
    use of project 1. Reports `Progress` in ms. That the motor stops at the switch at once is an assumption.

    Raises NotHomed if input 5 is active before (nothing is moved), or not by the deadline; RequestError without a
    speed, and as `move_by`; Interrupted; OutcomeUnknown if command or stop is not acknowledged.
    """
    check_seconds("deadline", deadline, LONGEST_HOMING)
    rpm = _rpm(velocity)

    async def turn(watch: Watch, project: Project) -> Homed:
        begun = await Sleep(0)
        await motion_request(watch, "home", "velocity", -velocity_of(project), project)
        seconds = await _until_home(watch, begun, deadline)
        return Homed(node.node, seconds, velocity_of(project))

    def change(project: Project) -> Project:
        return checked(project) if rpm is None else paced(project, rpm)

    return await with_project1(node, "home", change, turn, prepare=partial(_check_released, node))


async def _check_released(node: Node) -> None:
    for _ in range(READINGS):
        if await read_input(node, HOME_INPUT):
            raise NotHomed(
                f"input {HOME_INPUT} is active before homing",
                cause="it stands at the home switch, or the switch is stuck or active at rest",
                advice="move forward, away from the switch",
                node=node.node,
            )


async def _until_home(watch: Watch, begun: float, deadline: float) -> float:
    """Read input 5 until it is active; return the time (s) since `begun`. Raises NotHomed at the deadline."""
    now, active, reported = begun, 0, -inf
    while now - begun < deadline:
        active = active + 1 if await read_input(watch.node, HOME_INPUT) else 0
        watch.check()
        now = await Sleep(PAUSE)
        if active == READINGS:
            return now - begun
        if now - reported >= REPORT:
            reported = now
            await Emit(Progress(round(1000 * (now - begun)), round(1000 * deadline), "homing"))
    raise NotHomed(
        f"input {HOME_INPUT} was not active within {deadline:g} s",
        cause="the switch is farther away, its wire is broken, or the motor does not turn",
        advice=f"check input {HOME_INPUT} by hand, then home again with a longer deadline",
        node=watch.node.node,
    )


# -- together with others ------------------------------------------------------------------------------------------


async def plan_move(node: Node, angle: float, *, velocity: float, acceleration: float) -> PlannedMove:
    """Plan a turn by `angle` (rad, in whole pulses) with project 1; it is read and nothing is written.

    At most at `velocity` (rad/s) and at `acceleration` (rad/s²), as far as the number 1 allows. Less than a pulse gives
    a move by 0 rad. Raises RequestError for a velocity below 1 RPM, an angle that is too far, and a project 1 without
    speed or pulses per turn.
    """
    for name, value in (("angle", angle), ("velocity", velocity), ("acceleration", acceleration)):
        check_finite(name, value)
    rpm = int(min(velocity * 60 / tau * EXACT, MAX_RPM))
    if rpm < 1:
        raise RequestError(f"velocity {velocity:.4g} rad/s is below {tau / 60:.4g} rad/s, which is 1 RPM")
    watch = Watch(node)
    before = await cached(node, MANUAL)
    project = shaped(before, angle, rpm)
    number = int(acceleration / pulse_angle(project) * node.tick_ms / 1000)
    number = max(1, min(number, project.step(1).acceleration))
    return PlannedMove(watch, before, project.with_step(1, acceleration=number))


class PlannedMove:
    """A single move with temporary use of project 1 from `prepare` to `finish`; see `core.family.SelfTimedMove`.

    Times go from the start to the last pulse. The speed is a whole RPM, at least 1: a move that could not be slow
    enough for a duration ends before it.
    """

    def __init__(self, watch: Watch, before: Project, fastest: Project) -> None:
        self._watch: Final = watch
        self._before: Final = before
        self._fastest: Final = fastest
        self._project = fastest
        self._use: TemporaryProject1 | None = None
        self._begun: float | None = None  # s, link clock: the acknowledgement of the start

    @property
    def angle(self) -> float:
        """The whole signed movement (rad)."""
        return angle_of(self._fastest)

    @property
    def shortest(self) -> float:
        """The shortest duration (s)."""
        return self._motion(self._fastest).duration

    def fit(self, duration: float) -> float:
        """The nearest duration (s) of a whole RPM, not shorter than `duration` unless 1 RPM is too fast."""
        return self._motion(self._slowed(duration)).duration

    async def prepare(self, duration: float) -> None:
        """Edit project 1. Raises as `with_project1` and for a move of less than a pulse; then `finish` restores
        project 1.
        """
        project = self._slowed(duration)
        check_pulses(project)

        async def edit() -> None:
            await check_free(self._watch.node, PLAN)
            self._project = project
            self._use = TemporaryProject1(self._watch, PLAN, self._before, project)
            await self._use.edit()

        await Exclusive(edit())

    @property
    def start(self) -> Request[None]:
        """The request that starts the prepared move. It does not leave after a stop."""
        request = motion_request(self._watch, "run_once", "relative", self.angle, self._project)
        return request.with_decoder(self._acknowledge)

    def _acknowledge(self, response: Response) -> None:
        self._begun = response.at

    def position(self, elapsed: float) -> float:
        """The angle (rad) done `elapsed` s after the start."""
        move = self._motion(self._project)
        return move.sign * move.done(elapsed) * pulse_angle(self._project)

    async def finish(self) -> None:
        """Wait for the end of a move that was acknowledged, stop the motor if it may turn, restore project 1.

        A second call does nothing. Raises Interrupted after a stop, and as `with_project1`.
        """
        use, self._use = self._use, None
        if use is not None:
            await Exclusive(self._finish(use))

    async def _finish(self, use: TemporaryProject1) -> None:
        async with use:
            if self._begun is None:
                return
            self._watch.check()
            passed = await Sleep(0) - self._begun
            seconds = self._motion(self._project).duration * CLOCK + MARGIN
            await wait(self._watch, seconds - passed, "moving")
            use.rests = True

    def _slowed(self, seconds: float) -> Project:
        """The same move at the highest whole RPM with which it lasts so long (s); at 1 RPM if none does."""
        low, high = 1, self._fastest.step(1).speed
        while low < high:
            middle = (low + high + 1) // 2
            if self._motion(paced(self._fastest, middle)).duration * EXACT >= seconds:
                low = middle
            else:
                high = middle - 1
        return paced(self._fastest, low)

    def _motion(self, project: Project) -> Motion:
        return move_of(project, project.step(1), self._watch.node.tick_ms)


# -- requests and waits ------------------------------------------------------------------------------------------------


def motion_request(watch: Watch, name: str, quantity: str, value: float, project: Project) -> Request[None]:
    """A motion, for the gate with its angle or velocity; the controller knows no limits of travel."""
    node = watch.node
    setpoints = [Setpoint(node.node, quantity, value, -inf, inf)]
    if quantity == "relative":
        setpoints.append(Setpoint(node.node, "speed", velocity_of(project), -inf, inf))
    return command(node, name, ignore, setpoints=tuple(setpoints), precondition=watch.precondition)


async def wait(watch: Watch, seconds: float, what: str) -> None:
    """Let this time pass; reports `Progress` in ms. Raises Interrupted after a stop."""
    now = begun = await Sleep(0)
    while now < begun + seconds:
        await Emit(Progress(round(1000 * (now - begun)), round(1000 * seconds), f"{what}, estimated"))
        now = await Sleep(min(REPORT, begun + seconds - now))
        watch.check()


# -- project 1 for a motion --------------------------------------------------------------------------------------------


def velocity_of(project: Project) -> float:
    """rad/s of step 1."""
    return project.step(1).speed * tau / 60


def pulse_angle(project: Project) -> float:
    """rad of one pulse."""
    return tau / float(project.pulses_per_turn or 1)


def angle_of(project: Project) -> float:
    """rad of the move of step 1, forward positive."""
    step = project.step(1)
    return step.sign * ramp.pulses_of(project, step) * pulse_angle(project)


def checked(project: Project) -> Project:
    """This project 1. Raises RequestError if it gives no pulses per turn, or no speed."""
    if project.pulses_per_unit and project.step(1).speed and not project.is_cleared:
        return project
    raise RequestError("project 1 gives no speed in step 1, or no pulses per turn", advice="write project 1")


def check_pulses(project: Project) -> None:
    """Raise RequestError if the single move has no pulses: that may be a move without end."""
    if not angle_of(checked(project)):
        raise RequestError(f"this move is less than one pulse of {pulse_angle(project):.4g} rad")


def _rpm(velocity: float | None) -> int | None:
    """The RPM of a velocity (rad/s) above 0; None stays None. Raises RequestError if it is more than 10 % off."""
    if velocity is None:
        return None
    check_finite("velocity", velocity)
    exact = min(velocity * 60 / tau, MAX_RPM + 1.0)
    rpm = round(exact)
    if 0 < rpm <= MAX_RPM and abs(rpm - exact) <= ROUNDING * exact:
        return rpm
    raise RequestError(
        f"velocity {velocity:.6g} rad/s is {velocity * 60 / tau:.4g} RPM, and speeds are whole RPM",
        expected=f"a whole RPM, from {tau / 60:.4g} rad/s (1 RPM) to {MAX_RPM} RPM",
    )


def paced(project: Project, rpm: int) -> Project:
    """Project 1 with this speed in step 1 and a start frequency below it. Raises RequestError without a geometry."""
    step = project.step(1)
    project = checked(project.with_step(1, speed=rpm))
    running = ramp.ramp_of(project, project.step(1)).run
    start = step.start_frequency or START
    return project.with_step(
        1,
        start_frequency=start if start < running else max(1, int(running / 2)),
        acceleration=step.acceleration or ACCELERATION,
    )


def shaped(project: Project, angle: float, rpm: int | None) -> Project:
    """Project 1 as a move by this angle (rad), in whole pulses; `rpm` None: at its own speed.

    The unit is a pulse, or a part of one where a turn has no whole number of pulses. Raises RequestError for more than
    16,777,215 units in the move or in a turn; `check_pulses` does so for less than a pulse.
    """
    project = paced(project, checked(project).step(1).speed if rpm is None else rpm)
    turn = project.pulses_per_turn or Fraction(0)
    unit, distance = turn.numerator, turn.denominator * round(Fraction(abs(angle) / tau) * turn)
    if max(unit, distance) > MAX_DISTANCE:
        most = MAX_DISTANCE * tau / unit
        raise RequestError(f"{angle:.6g} rad is too far for one move", expected=f"at most {most:.6g} rad")
    direction = REVERSE if angle < 0 else 1 - REVERSE
    return replace(project, turn_distance=unit).with_step(1, distance=distance, direction=direction)


def check_finite(name: str, value: float) -> None:
    """Raise RequestError unless this is a finite number."""
    if not is_number(value):
        raise RequestError(f"{name} {shown(value)} is not a finite number")
