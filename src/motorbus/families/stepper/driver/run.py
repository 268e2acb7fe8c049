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
from motorbus.families.stepper.driver.stop import RUN, Watch, check_free, close_run
from motorbus.families.stepper.parameters import OUTPUTS, STOP_INPUT, Project
from motorbus.families.stepper.program.estimate import Estimate, earliest_end, estimate, reach
from motorbus.families.stepper.protocol import COMPLETED, RATE

LONGER: Final = 1.2  # share of the estimate that a project may take # assumption
SPARE: Final = 2.0  # s that it may take besides # assumption
CLOCK: Final = 0.98  # share of the shortest time before which a notice is false # assumption
SETTLES: Final = 20 / RATE  # s by which the bus may take an acknowledgement later than the notice behind it
STOPPING: Final = 3.0  # s in which a stop that was sent before a notice is acknowledged, if at all
REPORT: Final = 0.25  # s between two reports
LOOK: Final = 0.02  # s between two rounds of inputs


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
    ports = checked_ports(watch)
    wait = _Wait(node, timeout)

    async def begin() -> Levels:
        found = await _checked_project(node, project, endless, expert)
        levels = Levels(await inputs(node, ports))
        wait.expect(found, await Sleep(0))
        start = await catch(_start(wait.watch, found))
        if isinstance(start, MotorbusError) and not isinstance(start, OutcomeUnknown | NoReply | WireError):
            raise start
        wait.begin(start)
        return levels

    async def follow() -> None:
        try:
            await _follow(wait, await Exclusive(begin()))
        finally:
            wait.is_over = True

    async def listen() -> None:
        while not wait.is_over:
            await WaitFor(wait.take, LOOK)

    async def close() -> None:
        if wait.ran is not None and not node.state.may_run:
            await close_run(node, wait.ran.outcome.value)

    await with_cleanup(gather(follow(), listen()), close)
    assert wait.ran is not None
    return wait.ran


# -- start -------------------------------------------------------------------------------------------------------------


async def _checked_project(node: Node, number: int, endless: bool, expert: bool) -> Project:
    await check_free(node, RUN)
    program = await read_project(node, number)
    errors = [] if expert else [str(one) for one in program.lint() if one.level == "error"]
    refusals = {
        "has no steps; write it first": program.project.is_cleared,
        f"has errors: {'; '.join(errors)}": errors,
        "has no end; say endless=True": program.project.is_endless and not endless,
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


class _Wait:
    """The wait for one run: takes its acknowledgement, notices and time, and decides the outcome. Times in s, link
    clock.
    """

    def __init__(self, node: Node, timeout: float | None) -> None:
        self.watch: Final = Watch(node)
        self.timeout: Final = timeout
        self.ran: Ran | None = None
        self.is_over = False
        self.is_pending = True  # neither an acknowledgement nor its loss is known
        self.is_button_pressed = False  # input 4
        self._lost: MotorbusError | None = None
        self._notices: list[float] = []

    def expect(self, project: Project, at: float) -> None:
        """The project is about to be started."""
        self.predicted = estimate(project, self.watch.node.tick_ms)
        self._least = earliest_end(project) * CLOCK
        self._sent = self.start = at
        self._stopped = self.watch.node.state.stopped

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
        return self.start + self.predicted.seconds * LONGER + SPARE

    def take(self, notice: Notification) -> bool:
        """Take a notice; True if the outcome is known."""
        if notice.kind == COMPLETED:
            self._notices.append(notice.at)
            self.decide(notice.at)
        return self.ran is not None

    def decide(self, now: float) -> None:
        """Set `ran` if the outcome is known now."""
        state = self.watch.node.state
        if self.ran is not None or self.is_pending:
            return
        end = next((at for at in self._notices if self._is_own(at)), None)
        if state.stopped > self._stopped:
            self._end(Outcome.STOPPED, "a stop of this host was acknowledged")
        elif self.is_button_pressed:
            state.may_run = False
            self._end(Outcome.STOPPED, "input 4, which stops projects, was active")
        elif end is not None and not self.watch.is_stopped:
            state.may_run = False
            seconds = max(0.0, end - self.start)
            self._end(Outcome.COMPLETED, f"its notice came {seconds:.3f} s after the start", seconds)
        elif now < (self.deadline if end is None else end + STOPPING):
            return
        elif end is not None:
            state.may_run = False
            self._end(Outcome.UNKNOWN, "its notice came after a stop that was not acknowledged")
        elif self._lost is not None:
            why = f"neither an acknowledgement ({self._lost.summary}) nor a notice came; it may run"
            self._end(Outcome.UNKNOWN, why)
        elif self._notices:
            first = self._notices[0] - self._sent
            why = f"a notice came after {first:.3f} s, which is too early; it may still run"
            self._end(Outcome.UNKNOWN, why)
        else:
            self._end(Outcome.TIMEOUT, "no notice came in time; it may still run")

    def _is_own(self, at: float) -> bool:
        return at > self.start - SETTLES and at - self._sent >= self._least

    def _end(self, outcome: Outcome, why: str, seconds: float | None = None) -> None:
        self.ran = Ran(outcome, seconds, self.predicted, why)


async def _follow(wait: _Wait, levels: Levels) -> None:
    """Report, read the watched inputs, and decide, until the outcome is known."""
    reported, whole = -inf, wait.predicted.seconds
    wait.decide(await Sleep(0))
    while wait.ran is None:
        now = await Sleep(0)
        if now - reported >= REPORT:
            reported = now
            done = round(1000 * (now - wait.start))
            await Emit(Progress(done, round(1000 * whole), "running, estimated"))
        for port in levels.settled:
            await _read_watched(wait, levels, port)
        pause = LOOK if levels.settled or now >= wait.deadline else min(REPORT, wait.deadline - now)
        await WaitFor(wait.take, pause)
        wait.decide(await Sleep(0))


async def _read_watched(wait: _Wait, levels: Levels, port: int) -> None:
    active = await catch(read_input(wait.watch.node, port))
    if isinstance(active, NoReply | WireError):
        return
    if isinstance(active, MotorbusError):
        raise active
    if change := levels.take(port, active, await Sleep(0)):
        if port == STOP_INPUT and change.active:
            wait.is_button_pressed = True
        await Emit(change)
