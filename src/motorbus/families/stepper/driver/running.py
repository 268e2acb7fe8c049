"""A project started, and waited for: what a controller says of that, which is an acknowledgement and perhaps a notice.

Everything else is the host's: the project is read and judged before it starts, its notice is believed only where it can
be true, its progress is a model, and what cannot be known is called unknown. A wait never sends anything but readings
of inputs that somebody asked for; that it ends, in whatever way, stops nothing.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import inf, isfinite
from typing import Final

from motorbus.core.operation import (
    ASKED,
    Answer,
    Exchange,
    Journal,
    Listen,
    Operation,
    Pause,
    Report,
    Stops,
    Together,
    outcome,
)
from motorbus.errors import (
    Interrupted,
    LimitExceeded,
    MotorbusError,
    NoReply,
    OutcomeUnknown,
    RequestError,
    WireError,
)
from motorbus.families.stepper import execution
from motorbus.families.stepper.driver import goals, outputs, reading, stopping
from motorbus.families.stepper.driver.commands import motion
from motorbus.families.stepper.driver.inputs import Levels, checked, inputs
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.progress import Twin
from motorbus.families.stepper.driver.waiting import Outcome, Ran, Wait
from motorbus.families.stepper.execution import USUAL, Behaviour
from motorbus.families.stepper.program import Conditions, Plan, Program
from motorbus.families.stepper.table import PROJECTS, STOP_INPUT, Project, StopMode

TICK: Final = 0.25
"""s between two reports of progress."""
SOON: Final = 0.02
"""s between two rounds of watched inputs, and between two looks for the acknowledgement."""
AGAIN: Final = 0.05
"""s after which the branch that only listens looks whether the wait is over."""
_UNHEARD: Final = (OutcomeUnknown, NoReply, WireError)
"""What leaves it open whether a start was carried out."""


def start_project(
    node: Node,
    project: int,
    *,
    how: Behaviour = USUAL,
    endless: bool = False,
    stop_first: bool = False,
    expert: bool = False,
) -> Operation[Plan]:
    """Start a stored project, 1 to 4, without waiting for it; what it will do as `how` has it.

    It is read until two readings agree. Refused, with nothing started: a project without steps, one with lint errors
    (unless `expert`), one that never ends by itself (unless `endless`), and a start while an earlier project may still
    run (`stop_first` stops it; so does `stop`). Also refused while a change of project 1 is unfinished.

    Returns when the start is acknowledged, which is no proof that it runs: a busy controller may acknowledge and
    ignore it. Raises RequestError for what is refused, LimitExceeded for one without geometry, Interrupted for one that
    a stop has overtaken, OutcomeUnknown when the acknowledgement did not come; and as `dump` and `stop`.
    """
    _check(project, how)
    plan, stops = yield from _ready(node, project, how, endless, stop_first, expert)
    yield from _begin(node, plan, stops)
    return plan


def run(
    node: Node,
    project: int,
    *,
    how: Behaviour = USUAL,
    timeout: float | None = None,
    watch: Iterable[int] = (),
    stop_first: bool = False,
    endless: bool = False,
    expert: bool = False,
) -> Operation[Ran]:
    """Start a stored project, 1 to 4, and wait for its end: `completed`, `stopped`, `timeout` or `unknown`.

    completed  its notice came, and could be true: after the acknowledgement, not before the project can be through in
               any reading. A lost acknowledgement is no matter then: the notice proves that the start was heard
    stopped    a stop by this host was accepted meanwhile, or input 4 became active, if that is watched
    timeout    no notice until the deadline: `timeout` s, else 1.2 times the slowest prediction and 2 s. One that waits
               for inputs is waited for without end when no timeout is given
    unknown    the acknowledgement was lost and no notice came, or only one that cannot be its end

    What no host can tell: a notice that comes when it might be true is taken for true, also where two bytes of noise
    look like one, where a project that a button started ends, and where a device says it after a stop by a button that
    nobody watches. A project that a timeout or an unknown leaves behind may still run, so the next is refused until
    `stop`, or `stop_first`.

    `watch` names inputs, 1 to 5, that are read all the while: they tell the model when a wait is over. About every
    0.25 s an `Estimated` is reported, and an `InputChanged` for each watched input that changes. Refusals are those of
    `start_project`; one that never ends by itself needs `endless` and a `timeout`.

    A caller that is interrupted leaves the project running: nothing is sent. An emergency stop ends the wait with
    Interrupted; whether it was heard is not known, so the next run wants a `stop` first. Raises as `start_project`, and
    LinkError when the port goes away: the project goes on.
    """
    _check(project, how)
    _check_timeout(timeout, endless)
    ports = checked(watch)
    plan, stops = yield from _ready(node, project, how, endless, stop_first, expert)
    levels = Levels((yield from inputs(node, ports)))
    wait = Wait(node.memory, plan, (yield from Pause(0)), timeout)
    return (yield from _waited(node, wait, levels, stops))


# -- before it starts --------------------------------------------------------------------------------------------------


def _check(project: int, how: Behaviour) -> None:
    if isinstance(project, bool) or not isinstance(project, int) or not 1 <= project <= PROJECTS:
        raise RequestError(
            f"there is no project {project!r}", expected=f"1 to {PROJECTS}", advice="nothing was sent"
        )
    if not isinstance(how, Behaviour):
        raise RequestError(f"{how!r} is no Behaviour", expected="Behaviour(...)", advice="nothing was sent")


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
    number = isinstance(timeout, int | float) and not isinstance(timeout, bool)
    if not number or not isfinite(timeout) or timeout <= 0:
        raise RequestError(
            f"timeout: {timeout!r} is no time to wait for",
            expected="seconds, more than 0, or None",
            advice="nothing was sent",
        )


def _ready(
    node: Node, project: int, how: Behaviour, endless: bool, stop_first: bool, expert: bool
) -> Operation[tuple[Plan, int]]:
    """Whether it may be started: its plan, and how many stops were accepted before it was asked for."""
    yield from Report(Journal("run", ASKED, {"node": node.node}))
    if stop_first:
        yield from stopping.stop(node)
    elif node.memory.owed:
        raise _owed(project)
    stops = node.memory.stops
    program = yield from reading.read_project(node, project)
    plan = program.plan(how)
    _judge(program, plan, endless, expert)
    if stop_first:
        yield from Pause(_slowing(program.project, how))
    return plan, stops


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


def _owed(project: int) -> RequestError:
    return RequestError(
        f"project {project} is not started: another that this host started may still run",
        cause="neither its notice nor an accepted stop has come since; its notice would be taken for this one's",
        advice="stop() first, or say stop_first=True; nothing was started",
    )


def _slowing(project: Project, how: Behaviour) -> float:
    """s that a slow stop takes at most, for one that was stopped first; of this project, for the other is not known."""
    if project.stop_mode != StopMode.SLOW:
        return 0.0
    steps = [project.step(number) for number in range(1, execution.last_step(project) + 1)]
    moves = [execution.move(project, step, None, how) for step in steps]
    return max(
        (move.slowing(sum(piece.duration for piece in move.pieces[:1])).duration for move in moves), default=0
    )


# -- the start ---------------------------------------------------------------------------------------------------------


def _begin(node: Node, plan: Plan, stops: int) -> Operation[float]:
    """Send it; when it was acknowledged (s). It may run from the moment it leaves."""

    def overtaken(_: Stops) -> MotorbusError | None:
        if node.memory.stops == stops and not node.memory.stopping:
            return None
        return Interrupted(
            f"project {plan.project.number} is not started: a stop came in between",
            cause="somebody stopped this controller after the start was asked for",
            advice="start it again if it is still wanted; nothing was sent",
        )

    number, where = plan.project.number, goals.of_project(node, plan.project, plan.how)
    if node.memory.owed:  # by another run, while this one was read
        raise _owed(number)
    said = motion(node, "start_project", where, overtaken, project=number)
    node.memory.owed = True
    outputs.forget(node)
    try:
        return (yield from _timed(said))
    except (LimitExceeded, RequestError):
        node.memory.owed = False
        raise
    except Interrupted:
        node.memory.owed = node.memory.stops == stops
        raise


def _timed(said: Exchange[None]) -> Exchange[float]:
    """The same exchange, which gives the moment of its reply (s) once that is the right one."""

    def at(answer: Answer) -> float:
        if said.read is not None:
            said.read(answer)
        return answer.at

    return Exchange(
        said.request,
        said.replies,
        at,
        rank=said.rank,
        effect=said.effect,
        goals=said.goals,
        timeout=said.timeout,
        repeatable=said.repeatable,
        refusal=said.refusal,
    )


# -- three branches of one run -----------------------------------------------------------------------------------------


def _waited(node: Node, wait: Wait, levels: Levels, stops: int) -> Operation[Ran]:
    over = _Over()
    try:
        yield from Together(
            [_starting(node, wait, stops, over), _listening(wait, over), _following(node, wait, levels, over)]
        )
    except MotorbusError:
        raise
    except BaseException as interruption:
        number = wait.plan.project.number
        interruption.add_note(f"project {number} was started and goes on: nothing was sent to stop it")
        raise
    assert wait.ran is not None, "a wait ends with an outcome"
    return wait.ran


class _Over:
    """Whether one of the branches has failed, so that the others need not go on."""

    def __init__(self) -> None:
        self.failed = False


def _starting(node: Node, wait: Wait, stops: int, over: _Over) -> Operation[None]:
    try:
        wait.begun((yield from _begin(node, wait.plan, stops)))
    except _UNHEARD as error:
        wait.unacknowledged(error)
    except BaseException:
        over.failed = True
        raise


def _listening(wait: Wait, over: _Over) -> Operation[None]:
    """Nothing but listen: there is a listener also while the other branch reads inputs."""
    while wait.ran is None and not over.failed:
        yield from Listen(wait.heard, AGAIN)


def _following(node: Node, wait: Wait, levels: Levels, over: _Over) -> Operation[None]:
    """Look at the clock, tell where it should be, and read the inputs that are watched."""
    twin: Twin | None = None
    told = -inf
    try:
        while wait.ran is None and not over.failed:
            now = yield from Pause(0)
            if not wait.pending and twin is None:
                active = frozenset(port for port, level in levels.believed.items() if level)
                twin = Twin(wait.plan, wait.start, active)
            if twin is not None and now - told >= TICK:
                told = now
                yield from Report(twin.told(now))
            yield from _reading(node, wait, levels, twin)
            yield from Listen(wait.heard, _patience(wait, levels, now))
            wait.look((yield from Pause(0)))
    except BaseException:
        over.failed = True
        raise


def _patience(wait: Wait, levels: Levels, now: float) -> float:
    """How long to listen until the next look."""
    busy = wait.pending or bool(levels.believed)
    return max(0.0, min(SOON if busy else TICK, wait.deadline - now))


def _reading(node: Node, wait: Wait, levels: Levels, twin: Twin | None) -> Operation[None]:
    """Read each watched input once; a reading that fails tells nothing."""
    if wait.pending or twin is None:
        return
    for port in levels.believed:
        active = yield from outcome(reading.read_input(node, port))
        if isinstance(active, NoReply | WireError):
            continue
        if isinstance(active, MotorbusError):
            raise active
        change = levels.take(port, active, (yield from Pause(0)))
        if change is None:
            continue
        twin.press(port, change.active, max(change.at, wait.start))
        if port == STOP_INPUT and change.active:
            wait.button()
        yield from Report(change)


__all__ = ["TICK", "Outcome", "Ran", "run", "start_project"]
