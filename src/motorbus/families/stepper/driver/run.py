"""Start a stored project, and wait for its end.

The controller acknowledges a start and sends EE DD at the end, two bytes without checksum and number. So a notice
counts only after the acknowledgement, not before the project can have ended with any ramp, and if no stop was sent
since. An end of the wait stops nothing.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum
from math import inf, nan, tau
from typing import Final, NamedTuple

from motorbus.core.request import Notification
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import (
    INTENT,
    READABLE,
    Emit,
    Exclusive,
    JournalEntry,
    Progress,
    Sleep,
    WaitFor,
    catch,
    gather,
)
from motorbus.errors import (
    Interrupted,
    MotorbusError,
    NoReply,
    OutcomeUnknown,
    Refused,
    RequestError,
    WireError,
)
from motorbus.families.stepper.driver.io import Levels, check_seconds, checked_ports, inputs, read_input
from motorbus.families.stepper.driver.node import Node, command, ignore
from motorbus.families.stepper.driver.projects import read_project
from motorbus.families.stepper.driver.stop import RUN, Watch, check_free, close_run
from motorbus.families.stepper.parameters import OUTPUTS, STOP_INPUT, Project
from motorbus.families.stepper.program.estimate import Estimate, earliest_end, estimate, reach
from motorbus.families.stepper.protocol import COMPLETED, RATE

LONGER: Final = 1.2  # share of the estimate that a project may take # assumption
SPARE: Final = 2.0  # s that it may take besides # assumption
CLOCK: Final = 0.98  # share of the shortest time before which a notice is false # assumption
SETTLES: Final = 20 / RATE  # s by which the bus may take an acknowledgement later than the notice behind it
REPORT: Final = 0.25  # s between two reports
LOOK: Final = 0.02  # s between two rounds of inputs


class Outcome(Enum):
    """What is known at the end of the wait for a project."""

    COMPLETED = "completed"  # its notice came
    STOPPED = (
        "stopped"  # a stop of this host was acknowledged or the notice followed it, or input 4 read active
    )
    TIMEOUT = "timeout"  # no notice in time; it may still run
    UNKNOWN = "unknown"  # the start was not acknowledged, or its notice came too early


class Ran(NamedTuple):
    """The result of a run: `seconds` from the acknowledgement to the notice (None unless completed), the time that was
    `predicted`, and `why` the outcome is what it is."""

    outcome: Outcome
    seconds: float | None
    predicted: Estimate
    why: str


async def start_project(node: Node, project: int, *, endless: bool = False, expert: bool = False) -> Estimate:
    """Start project 1 to 4 (item 13) without waiting; return its estimated time.

    Returns at the acknowledgement; a busy controller may acknowledge and ignore it. Raises RequestError, with nothing
    started, for a project without steps, with errors of lint (unless `expert`), without an end (unless `endless`), and
    while a project may run or a change is unfinished; Interrupted if a stop came before it left; OutcomeUnknown without
    an acknowledgement; else as `dump`.
    """
    watch = Watch(node)

    async def check_and_start() -> Estimate:
        found = await _checked_project(node, project, endless, expert)
        await _start(watch, found)
        return estimate(found, node.tick_ms)

    return await Exclusive(check_and_start())


async def run(
    node: Node,
    project: int,
    *,
    timeout: float | None = None,
    watch: Iterable[int] = (),
    endless: bool = False,
    expert: bool = False,
) -> Ran:
    """Start project 1 to 4 and wait for its end: `completed`, `stopped`, `timeout` or `unknown`, see `Outcome`.

    It waits `timeout` s, else 1.2 times the estimate and 2 s, and without limit for a project that waits for inputs.
    `watch` are inputs, 1 to 5, that are read meanwhile. Reports `Progress` in ms, estimated, and `InputChanged`. A
    project that may still run refuses the next motion until `stop`; the journal records it.

    `endless` needs a `timeout`. An interrupted wait leaves the project running. An emergency stop raises Interrupted.
    Raises as `start_project`.
    """
    if timeout is not None:
        check_seconds("timeout", timeout)
    elif endless:
        raise RequestError("a project without end needs a timeout", advice="or use start_project()")
    guard, ports = Watch(node), checked_ports(watch)
    notices: list[float] = []
    is_over = False

    def take(notice: Notification) -> bool:
        if notice.kind == COMPLETED:
            notices.append(notice.at)
        return notice.kind == COMPLETED

    async def listen() -> None:
        while not is_over:
            await WaitFor(take, LOOK)

    async def begin() -> tuple[_Course, Levels]:
        found = await _checked_project(node, project, endless, expert)
        levels = Levels(await inputs(node, ports))
        sent = await Sleep(0)
        begun = await catch(_start(guard, found))
        if isinstance(begun, MotorbusError) and not isinstance(begun, OutcomeUnknown | NoReply | WireError):
            raise begun
        return _Course(guard, found, sent, begun, timeout, notices), levels

    async def follow() -> Ran:
        nonlocal is_over
        try:
            return await _follow(*await Exclusive(begin()))
        finally:
            is_over = True

    ran, _ = await gather(follow(), listen())
    if not node.state.may_run:
        await close_run(node, ran.outcome.value)
    return ran


# -- start -------------------------------------------------------------------------------------------------------------


async def _checked_project(node: Node, number: int, endless: bool, expert: bool) -> Project:
    await check_free(node, RUN)
    program = await read_project(node, number)
    errors = [] if expert else [str(one) for one in program.lint() if one.level == "error"]
    refusal = ""
    if program.project.is_cleared:
        refusal = "has no steps; write it first"
    elif errors:
        refusal = f"has errors: {'; '.join(errors)}"
    elif program.project.is_endless and not endless:
        refusal = "has no end; say endless=True"
    if refusal:
        raise RequestError(f"project {number} {refusal}", advice="nothing was started", node=node.node)
    return program.project


async def _start(watch: Watch, project: Project) -> float:
    """Start a project; return when it was acknowledged (s)."""
    node = watch.node
    facts = {
        "node": node.node,
        "project": project.number,
        "what": f"the run of project {project.number}",
        "cause": "it was started, and its end is not recorded",
        "advice": "`motorbus stop {bus}` ends it",
        READABLE: True,
    }
    await Emit(JournalEntry(RUN, INTENT, facts))
    node.state.may_run = node.state.is_noted = True
    node.state.outputs.update(dict.fromkeys(range(1, OUTPUTS + 1)))
    request = command(
        node,
        "start_project",
        ignore,
        setpoints=setpoints(node, project),
        precondition=watch.precondition,
        project=project.number,
    )
    try:
        return await request.with_decoder(lambda answer: answer.at)
    except (Refused, RequestError, Interrupted) as error:
        if not (watch.has_left and isinstance(error, Interrupted)):
            await close_run(node, "not started")
        raise


def setpoints(node: Node, project: Project) -> tuple[Setpoint, ...]:
    """What a start asks, for the gate: the farthest positions in rad from here, the highest speed in rad/s.

    A project without end is a velocity as well.
    """
    fastest = max((step.speed for step in project.used), default=0) * tau / 60
    low, high = reach(project)
    unit = tau / project.turn_distance if project.turn_distance else nan
    asked = [("relative", unit * far) for far in (high, low) if far] or [("relative", 0.0)]
    if project.is_endless:
        asked.append(("velocity", fastest))
    asked.append(("speed", fastest))
    return tuple(Setpoint(node.node, quantity, value, -inf, inf) for quantity, value in asked)


# -- wait --------------------------------------------------------------------------------------------------------------


class _Course:
    """One run of a project: requested at `sent`, acknowledged at `begun` or not (an error). Times in s, link clock."""

    def __init__(
        self,
        watch: Watch,
        project: Project,
        sent: float,
        begun: float | MotorbusError | None,
        timeout: float | None,
        notices: list[float],
    ) -> None:
        self.watch: Final = watch
        self.predicted: Final = estimate(project, watch.node.tick_ms)
        self.is_button_pressed = False  # input 4
        self._lost: Final = begun if isinstance(begun, MotorbusError) else None
        self.start: Final = begun if isinstance(begun, float) else sent
        self._earliest: Final = sent + earliest_end(project) * CLOCK
        self._notices: Final = notices
        self._stopped: Final = watch.node.state.stopped
        longest = self.predicted.seconds * LONGER + SPARE
        if self.predicted.waits and self._lost is None:
            longest = inf
        self.deadline: Final = self.start + (longest if timeout is None else timeout)

    def outcome(self, now: float) -> Ran | None:
        """The outcome; None if it is not known yet."""
        state = self.watch.node.state
        own = [at for at in self._notices if at > self.start - SETTLES and at >= self._earliest]
        if own or self.is_button_pressed:
            state.may_run = False
        if state.stopped > self._stopped:
            return self._ran(Outcome.STOPPED, "a stop of this host was acknowledged")
        if self.is_button_pressed:
            return self._ran(Outcome.STOPPED, "input 4, which stops projects, was active")
        if own and self.watch.is_stopped:
            return self._ran(Outcome.STOPPED, "its notice came after a stop that was not acknowledged yet")
        if own:
            seconds = max(0.0, own[0] - self.start)
            return self._ran(Outcome.COMPLETED, f"its notice came {seconds:.3f} s after the start", seconds)
        if now < self.deadline:
            return None
        if self._lost is not None:
            why = f"neither an acknowledgement ({self._lost.summary}) nor a notice came; it may run"
            return self._ran(Outcome.UNKNOWN, why)
        if self._notices:
            return self._ran(Outcome.UNKNOWN, "its only notice came too early; it may still run")
        return self._ran(Outcome.TIMEOUT, "no notice came in time; it may still run")

    def _ran(self, outcome: Outcome, why: str, seconds: float | None = None) -> Ran:
        return Ran(outcome, seconds, self.predicted, why)


async def _follow(course: _Course, levels: Levels) -> Ran:
    """Report and read the watched inputs until the outcome is known."""
    reported = -inf
    while True:
        now = await Sleep(0)
        if ran := course.outcome(now):
            return ran
        if now - reported >= REPORT:
            reported = now
            done, whole = now - course.start, course.predicted.seconds
            await Emit(Progress(round(1000 * done), round(1000 * whole), "running, estimated"))
        for port in levels.settled:
            await _read_watched(course, levels, port)
        await WaitFor(
            lambda notice: True, LOOK if levels.settled else max(LOOK, min(REPORT, course.deadline - now))
        )


async def _read_watched(course: _Course, levels: Levels, port: int) -> None:
    try:
        active = await read_input(course.watch.node, port)
    except (NoReply, WireError):
        return
    if change := levels.take(port, active, await Sleep(0)):
        course.is_button_pressed |= port == STOP_INPUT and change.active
        await Emit(change)
