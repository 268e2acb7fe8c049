"""Start a stored project, and wait for its end.

The controller acknowledges a start and sends EE DD at the end, two bytes without checksum and number. So a notice
counts only after the acknowledgement, not before the project can have ended in any reading, and if no stop was sent
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
    ASKED,
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
    with_cleanup,
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
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.projects import read_project
from motorbus.families.stepper.driver.requests import command, ignore
from motorbus.families.stepper.driver.stop import RUN, Watch, check_idle, close_run, mark_unmoved
from motorbus.families.stepper.execution.sequence import earliest_end
from motorbus.families.stepper.parameters import OUTPUTS, STOP_INPUT, Project
from motorbus.families.stepper.program.estimate import Estimate, estimate, reach
from motorbus.families.stepper.protocol import COMPLETED, RATE

LONGER: Final = 1.2  # share of the slowest reading that a project may take # assumption
SPARE: Final = 2.0  # s that it may take besides # assumption
CLOCK: Final = 0.98  # share of the shortest time before which a notice is false # assumption
SETTLES: Final = 20 / RATE  # s by which the bus may take an acknowledgement later than the notice behind it
REPORT: Final = 0.25  # s between two reports
LOOK: Final = 0.02  # s between two rounds of inputs
UNHEARD: Final = (OutcomeUnknown, NoReply, WireError)  # errors of a start that may have been received


class Outcome(Enum):
    """What is known at the end of the wait for a project."""

    COMPLETED = "completed"  # its notice came
    STOPPED = "stopped"  # a stop of this host was acknowledged, or input 4 read active
    TIMEOUT = "timeout"  # no notice in time; it may still run
    UNKNOWN = "unknown"  # the start was not acknowledged, or the notice may not be its own


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
        return estimate(found)

    return await mark_unmoved(watch, Exclusive(check_and_start()))


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

    It waits `timeout` s, else 1.2 times the slowest estimate and 2 s, and without limit for a project that waits for
    inputs. `watch` are inputs, 1 to 5, that are read meanwhile. Reports `Progress` in ms, estimated, and
    `InputChanged`. A project that may still run refuses the next motion until `stop`; the journal records it.

    `endless` needs a `timeout`. An interrupted wait leaves the project running. An emergency stop raises Interrupted.
    Raises as `start_project`.
    """
    if timeout is not None:
        check_seconds("timeout", timeout)
    elif endless:
        raise RequestError("a project without end needs a timeout", advice="or use start_project()")
    guard, ports = Watch(node), checked_ports(watch)
    course = Course(guard, timeout)

    async def begin() -> Levels:
        found = await _checked_project(node, project, endless, expert)
        levels = Levels(await inputs(node, ports))
        course.expect(found, await Sleep(0))
        start = await catch(_start(guard, found))
        if isinstance(start, MotorbusError) and not isinstance(start, UNHEARD):
            raise start
        course.begin(start)
        return levels

    async def follow() -> None:
        try:
            await _follow(course, await Exclusive(begin()))
        finally:
            course.is_over = True

    async def listen() -> None:
        while course.ran is None and not course.is_over:
            await WaitFor(course.take, LOOK)

    async def close() -> None:
        if course.ran is not None and not node.state.may_run:
            await close_run(node, course.ran.outcome.value)

    await mark_unmoved(guard, with_cleanup(gather(follow(), listen()), close))
    assert course.ran is not None
    return course.ran


# -- start -------------------------------------------------------------------------------------------------------------


async def _checked_project(node: Node, number: int, endless: bool, expert: bool) -> Project:
    check_idle(node, f"start of project {number}")
    await Emit(JournalEntry(RUN, ASKED, {"node": node.node}))
    program = await read_project(node, number)
    errors = [] if expert else [str(one) for one in program.lint() if one.level == "error"]
    refusals = {
        "has no steps; write it first": program.project.is_cleared,
        f"has errors: {'; '.join(errors)}": errors,
        "has no end; say endless=True": earliest_end(program.project) is None and not endless,
    }
    for refusal, applies in refusals.items():
        if applies:
            raise RequestError(f"project {number} {refusal}", advice="nothing was started", node=node.node)
    return program.project


async def _start(watch: Watch, project: Project) -> float:
    """Start a project; return when it was acknowledged (s)."""
    node = watch.node
    facts = {
        "node": node.node,
        "project": project.number,
        "what": f"the run of project {project.number}",
        "cause": "it was started, and neither its notice nor a stop was acknowledged since",
        "advice": "`motorbus stop {bus}` ends it",
        READABLE: True,
    }
    await Emit(JournalEntry(RUN, INTENT, facts))
    node.state.may_run = True
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
        if not (watch.ordered and isinstance(error, Interrupted)):
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
    if earliest_end(project) is None:
        asked.append(("velocity", fastest))
    asked.append(("speed", fastest))
    return tuple(Setpoint(node.node, quantity, value, -inf, inf) for quantity, value in asked)


# -- wait --------------------------------------------------------------------------------------------------------------


class Course:
    """One run: takes its acknowledgement, notices and time, and decides the outcome. Times in s, link clock."""

    def __init__(self, watch: Watch, timeout: float | None) -> None:
        self.watch: Final = watch
        self.timeout: Final = timeout
        self.ran: Ran | None = None
        self.is_over = False
        self.is_pending = True  # neither an acknowledgement nor its loss is known
        self.is_button_pressed = False  # input 4
        self._lost: MotorbusError | None = None
        self._notices: list[tuple[float, bool]] = []

    def expect(self, project: Project, at: float) -> None:
        """The project is about to be started."""
        self.predicted = estimate(project)
        earliest = earliest_end(project)
        self._least = inf if earliest is None else earliest * CLOCK
        self._sent = self.start = at
        self._accepted = self.watch.node.state.stops_accepted

    def begin(self, start: float | MotorbusError | None) -> None:
        """It was acknowledged at this time, or not; None in a dry run."""
        self.is_pending = False
        if isinstance(start, MotorbusError):
            self._lost = start
        else:
            self.start = start or self._sent

    @property
    def deadline(self) -> float:
        """Until when its notice is waited for (s)."""
        if self.timeout is not None:
            return self.start + self.timeout
        if self.predicted.waits and self._lost is None:
            return inf
        return self.start + self.predicted.high * LONGER + SPARE

    def take(self, notice: Notification) -> bool:
        """Take a notice; True if the outcome is known."""
        if notice.kind == COMPLETED:
            self._notices.append((notice.at, self.watch.is_stopped or self.watch.node.state.stopping > 0))
            self.decide(notice.at)
        return self.ran is not None

    def decide(self, now: float) -> None:
        """Set `ran` if the outcome is known now. While a stop is being sent it is not."""
        state = self.watch.node.state
        if self.ran is not None or self.is_pending or state.stopping:
            return
        own = [
            (at, is_doubtful)
            for at, is_doubtful in self._notices
            if at > self.start - SETTLES and at - self._sent >= self._least
        ]
        if state.stops_accepted > self._accepted:
            self._end(Outcome.STOPPED, "a stop of this host was acknowledged")
        elif self.is_button_pressed:
            self._end(Outcome.STOPPED, "input 4, which stops projects, was active")
        elif own:
            state.may_run = False
            at, is_doubtful = own[0]
            if is_doubtful:
                self._end(Outcome.UNKNOWN, "its notice came after a stop that was not acknowledged")
            else:
                seconds = max(0.0, at - self.start)
                self._end(Outcome.COMPLETED, f"its notice came {seconds:.3f} s after the start", seconds)
        elif now < self.deadline:
            return
        elif self._lost is not None:
            why = f"neither an acknowledgement ({self._lost.summary}) nor a notice came; it may run"
            self._end(Outcome.UNKNOWN, why)
        elif self._notices:
            first = self._notices[0][0] - self._sent
            self._end(
                Outcome.UNKNOWN, f"a notice came after {first:.3f} s, which is too early; it may still run"
            )
        else:
            self._end(Outcome.TIMEOUT, "no notice came in time; it may still run")

    def _end(self, outcome: Outcome, why: str, seconds: float | None = None) -> None:
        self.ran = Ran(outcome, seconds, self.predicted, why)


async def _follow(course: Course, levels: Levels) -> None:
    """Report, read the watched inputs, and decide, until the outcome is known."""
    reported, whole = -inf, course.predicted.seconds
    course.decide(await Sleep(0))
    while course.ran is None:
        now = await Sleep(0)
        if now - reported >= REPORT and whole < inf:
            reported = now
            await Emit(
                Progress(round(1000 * (now - course.start)), round(1000 * whole), "running, estimated")
            )
        for port in levels.settled:
            await _read_watched(course, levels, port)
        pause = LOOK if levels.settled or now >= course.deadline else min(REPORT, course.deadline - now)
        await WaitFor(course.take, pause)
        course.decide(await Sleep(0))


async def _read_watched(course: Course, levels: Levels, port: int) -> None:
    active = await catch(read_input(course.watch.node, port))
    if isinstance(active, NoReply | WireError):
        return
    if isinstance(active, MotorbusError):
        raise active
    if change := levels.take(port, active, await Sleep(0)):
        if port == STOP_INPUT and change.active:
            course.is_button_pressed = True
        await Emit(change)
