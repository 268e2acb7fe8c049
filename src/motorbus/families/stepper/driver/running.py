"""A project started, and waited for: what a controller says of that, which is an acknowledgement and perhaps a notice.

Everything else is the host's: the project is read and judged before it starts, its notice is believed only where it can
be true, its progress is a model, and what cannot be known is called unknown. A wait never sends anything but readings
of inputs that somebody asked for; that it ends, in whatever way, stops nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import inf
from typing import Final, NamedTuple

from motorbus.core.request import Notification, Stops
from motorbus.core.steps import (
    ASKED,
    Emit,
    Exclusive,
    JournalEntry,
    Procedure,
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
from motorbus.families.stepper.driver import goals, outputs, reading, stopping
from motorbus.families.stepper.driver.commands import motion
from motorbus.families.stepper.driver.exchanges import timed
from motorbus.families.stepper.driver.inputs import Levels, checked, inputs
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.owing import RUN, owed, settled
from motorbus.families.stepper.driver.progress import Twin
from motorbus.families.stepper.driver.turning import Watch, honest, refuse_unless_idle, slowing, within
from motorbus.families.stepper.driver.waiting import Outcome, Ran, Wait
from motorbus.families.stepper.execution import USUAL, Behaviour
from motorbus.families.stepper.program import Conditions, Plan, Program
from motorbus.families.stepper.table import STOP_INPUT, checked_project

TICK: Final = 0.25
"""s between two reports of progress."""
SOON: Final = 0.02
"""s between two rounds of watched inputs, and between two looks for the acknowledgement."""
AGAIN: Final = 0.05
"""s after which the branch that only listens looks whether the wait is over."""
_UNHEARD: Final = (OutcomeUnknown, NoReply, WireError)
"""What leaves it open whether a start was carried out."""


async def start_project(
    node: Node,
    project: int,
    *,
    how: Behaviour = USUAL,
    endless: bool = False,
    stop_first: bool = False,
    expert: bool = False,
) -> Plan:
    """Start a stored project, 1 to 4, without waiting for it; what it will do as `how` has it.

    It is read until two readings agree. Refused, with nothing started: a project without steps, one with lint errors
    (unless `expert`), one that never ends by itself (unless `endless`), and a start while an earlier project may still
    run (`stop_first` stops it; so does `stop`). Also refused while a change of project 1 is unfinished, and while a
    move may not be over. A motion by hand of this bus that is under way is waited for.

    Returns when the start is acknowledged, which is no proof that it runs: a busy controller may acknowledge and
    ignore it. Raises RequestError for what is refused, LimitExceeded for one without geometry, Interrupted for one that
    a stop has overtaken, OutcomeUnknown when the acknowledgement did not come; and as `dump` and `stop`.
    """
    asked = _Asked(checked_project(project), _checked(how), endless, stop_first, expert)
    watch = Watch(node)
    return await honest(watch, Exclusive(_started(node, asked, watch)))


async def run(
    node: Node,
    project: int,
    *,
    how: Behaviour = USUAL,
    timeout: float | None = None,
    watch: Iterable[int] = (),
    stop_first: bool = False,
    endless: bool = False,
    expert: bool = False,
) -> Ran:
    """Start a stored project, 1 to 4, and wait for its end: `completed`, `stopped`, `timeout` or `unknown`.

    completed  its notice came, and could be true: after the acknowledgement, not before the project can be through in
               any reading. A lost acknowledgement is no matter then: the notice proves that the start was heard
    stopped    a stop by this host was accepted meanwhile, or input 4 became active, if that is watched
    timeout    no notice until the deadline: `timeout` s, else 1.2 times the slowest prediction and 2 s. One that waits
               for inputs is waited for without end when no timeout is given
    unknown    the acknowledgement was lost and no notice came, or only one that cannot be its end

    What no host can tell: a notice that comes when it might be true is taken for true, also where two bytes of noise
    look like one, where a project that a button started ends, and where a device says it after a stop by a button that
    nobody watches. A project that a timeout, an unknown or a button leaves behind may still run, so the next is refused
    until `stop`, or `stop_first`; the journal of the bus remembers it when this program has ended.

    `watch` names inputs, 1 to 5, that are read all the while: they tell the model when a wait is over. About every
    0.25 s an `Estimated` is reported, and an `InputChanged` for each watched input that changes. Refusals are those of
    `start_project`; one that never ends by itself needs `endless` and a `timeout`.

    A caller that is interrupted leaves the project running: nothing is sent. An emergency stop ends the wait with
    Interrupted; whether it was heard is not known, so the next run wants a `stop` first. Raises as `start_project`, and
    LinkError when the port goes away: the project goes on. An error that is `unmoved` has started nothing.

    Who reckons where the motor stands knows it no longer: also `completed` may be a button's end, and a step may have
    been cut by its stop input.
    """
    asked = _Asked(checked_project(project), _checked(how), endless, stop_first, expert)
    _check_timeout(timeout, endless)
    course = _Course(timeout, checked(watch))
    guard = Watch(node)
    branches = (_launched(node, asked, course, guard), _listening(course), _following(node, course))
    await honest(guard, _waited(node, project, course, guard, branches))
    assert course.wait is not None, "a start that fails raises"
    assert course.wait.ran is not None, "a wait ends with an outcome"
    return course.wait.ran


async def _waited(
    node: Node, project: int, course: _Course, watch: Watch, branches: Iterable[Procedure[None]]
) -> None:
    """Run the branches; the journal gets an end that is known, whatever else goes wrong."""

    async def settle() -> None:
        if course.wait is not None and course.wait.ran is not None and not node.memory.owed:
            await settled(node, course.wait.ran.outcome.value)

    try:
        await with_cleanup(gather(*[_failing(course, branch) for branch in branches]), settle)
    except MotorbusError:
        raise
    except BaseException as interruption:
        if watch.ordered:
            interruption.add_note(f"project {project} was started and goes on: nothing was sent to stop it")
        raise


# -- before it starts --------------------------------------------------------------------------------------------------


class _Asked(NamedTuple):
    project: int
    how: Behaviour
    endless: bool
    stop_first: bool
    expert: bool


def _checked(how: Behaviour) -> Behaviour:
    if not isinstance(how, Behaviour):
        raise RequestError(f"{how!r} is no Behaviour", expected="Behaviour(...)", advice="nothing was sent")
    return how


def _check_timeout(timeout: float | None, endless: bool) -> None:
    if timeout is None:
        if endless:
            raise RequestError(
                "a project that never ends is not waited for without a timeout",
                expected="timeout=SECONDS beside endless=True",
                cause="its notice never comes",
                advice="nothing was sent; start_project does not wait",
            )
        return
    within(timeout, inf, "timeout")


async def _ready(node: Node, asked: _Asked, watch: Watch) -> Plan:
    """Whether it may be started: its plan."""
    if asked.stop_first:
        watch.ended = True
        await stopping.ended(node)
        await settled(node, "stopped")
    else:
        await refuse_unless_idle(node, f"starting project {asked.project}")
    await Emit(JournalEntry(RUN, ASKED, {"node": node.node}))
    program = await reading.read_project(node, asked.project)
    plan = program.plan(asked.how)
    _judge(program, plan, asked.endless, asked.expert)
    if asked.stop_first:
        await Sleep(slowing(program.project, asked.how))  # of this one, for the other is not known
    return plan


def _judge(program: Program, plan: Plan, endless: bool, expert: bool) -> None:
    if program.project.is_cleared:
        raise RequestError(
            f"{program.name} has no steps: there is nothing to run",
            cause="it was cleared, or never written",
            advice="write it first; nothing was started",
        )
    errors = [found for found in program.lint(Conditions(how=plan.how)) if found.level == "error"]
    if errors and not expert:
        raise RequestError(
            f"{program.name} will not do what it seems to say: {'; '.join(map(str, errors))}",
            expected="a project without errors",
            advice="mend it, or say expert=True; nothing was started",
        )
    if (plan.estimate.endless or plan.estimate.seconds == inf) and not endless:
        raise RequestError(
            f"{program.name} never ends by itself",
            cause="it runs until it is stopped, and its notice never comes",
            advice="say endless=True, and a timeout to wait for; nothing was started",
        )


# -- the start: all of it alone, so that nothing of this bus moves or edits between the reading and the order ----------


async def _started(node: Node, asked: _Asked, watch: Watch) -> Plan:
    plan = await _ready(node, asked, watch)
    await _begin(node, plan, watch)
    return plan


async def _begin(node: Node, plan: Plan, watch: Watch) -> float:
    """Send it; when it was acknowledged (s). It may run from the moment it leaves."""
    number, left = plan.project.number, False

    def overtaken(_: Stops) -> MotorbusError | None:
        nonlocal left
        left = watch.ordered = not watch.overtaken
        return None if left else _overtaken(number)

    where = goals.of_project(node, plan.project, plan.how)
    said = motion(node, "start_project", where, overtaken, project=number)
    await owed(node, number)
    outputs.forget(node)
    try:
        return await timed(said)
    except (Refused, RequestError, Interrupted) as error:
        if not (isinstance(error, Interrupted) and left):
            await settled(node, "not started")
        raise


def _overtaken(number: int) -> Interrupted:
    return Interrupted(
        f"project {number} is not started: a stop came in between",
        cause="somebody stopped this controller after the start was asked for",
        advice="start it again if it is still wanted; nothing was sent",
    )


# -- three branches of one run -----------------------------------------------------------------------------------------


class _Course:
    """What the branches of one run share: its `wait` once it is about to start, and whether one of them has failed."""

    def __init__(self, timeout: float | None, ports: Sequence[int]) -> None:
        self.timeout = timeout
        self.ports = ports
        self.levels = Levels({})
        self.wait: Wait | None = None
        self.failed = False

    @property
    def over(self) -> bool:
        return self.failed or (self.wait is not None and self.wait.ran is not None)

    def heard(self, notice: Notification) -> bool:
        return self.wait is not None and self.wait.heard(notice)


async def _failing(course: _Course, branch: Procedure[None]) -> None:
    try:
        await branch
    except BaseException:
        course.failed = True
        raise


async def _launched(node: Node, asked: _Asked, course: _Course, watch: Watch) -> None:
    await Exclusive(_launching(node, asked, course, watch))


async def _launching(node: Node, asked: _Asked, course: _Course, watch: Watch) -> None:
    plan = await _ready(node, asked, watch)
    course.levels = Levels(await inputs(node, course.ports))
    course.wait = wait = Wait(node.memory, plan, await Sleep(0), course.timeout)
    try:
        wait.begun(await _begin(node, plan, watch))
    except _UNHEARD as error:
        wait.unacknowledged(error)


async def _listening(course: _Course) -> None:
    """Nothing but listen: there is a listener also while the other branch reads inputs."""
    while not course.over:
        await WaitFor(course.heard, AGAIN)


async def _following(node: Node, course: _Course) -> None:
    """Look at the clock, tell where it should be, and read the inputs that are watched."""
    while course.wait is None and not course.failed:
        await Sleep(SOON / 10)  # less than a start takes on the line: its beginning is not missed
    if course.wait is not None:
        await _followed(node, course, course.wait, course.levels)


async def _followed(node: Node, course: _Course, wait: Wait, levels: Levels) -> None:
    twin: Twin | None = None
    told = -inf
    while not course.over:
        now = await Sleep(0)
        if not wait.pending and twin is None:
            active = frozenset(port for port, level in levels.believed.items() if level)
            twin = Twin(wait.plan, wait.start, active)
        if twin is not None and now - told >= TICK:
            told = now
            await Emit(twin.told(now))
        await _reading(node, wait, levels, twin)
        await WaitFor(wait.heard, _patience(wait, levels, now))
        wait.look(await Sleep(0))


def _patience(wait: Wait, levels: Levels, now: float) -> float:
    """How long to listen until the next look; behind its deadline too, where it waits for a stop that is being said."""
    left = wait.deadline - now
    busy = wait.pending or bool(levels.believed) or left <= 0
    pause = SOON if busy else TICK
    return min(pause, left) if left > 0 else pause


async def _reading(node: Node, wait: Wait, levels: Levels, twin: Twin | None) -> None:
    """Read each watched input once; a reading that fails tells nothing."""
    if wait.pending or twin is None:
        return
    for port in levels.believed:
        active = await catch(reading.read_input(node, port))
        if isinstance(active, NoReply | WireError):
            continue
        if isinstance(active, MotorbusError):
            raise active
        change = levels.take(port, active, await Sleep(0))
        if change is None:
            continue
        twin.press(port, change.active, max(change.at, wait.start))
        if port == STOP_INPUT and change.active:
            wait.button()
        await Emit(change)


__all__ = ["TICK", "Outcome", "Ran", "run", "start_project"]
