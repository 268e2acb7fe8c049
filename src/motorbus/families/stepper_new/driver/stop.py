"""Stop, and what a stop ends.

Two commands stop: "stop project", and "stop motor" for manual motion; no source says whether one of them stops both.
Both are harmless at rest. An acknowledgement means that the controller received it, not that the motor rests.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from math import inf
from typing import Final, TypeVar

from motorbus.core.request import Priority, Request, Response, Stops
from motorbus.core.steps import OUTCOME, Emit, JournalEntry, Runnable, Sleep, catch
from motorbus.errors import Interrupted, LinkError, MotorbusError, OutcomeUnknown, Refused, RequestError
from motorbus.families.stepper_new.driver.node import Node
from motorbus.families.stepper_new.driver.requests import command, ignore

T = TypeVar("T")

RUN: Final = "run"  # the journal entry of a project that was started
PROJECT_FIRST: Final = ("stop_project", "stop_motor")
MOTOR_FIRST: Final = ("stop_motor", "stop_project")  # for manual motion
TRIES: Final = 5  # of each command; a silent controller takes about 2 s


class Promise(Enum):
    """What an acknowledged stop means."""

    STOP_ACCEPTED = (
        "stop accepted for project and motor; it decelerates or stops at once by its stop mode, and does not report "
        "when it rests"
    )


async def stop(node: Node) -> Promise:
    """Stop the project and any other motion; each command is repeated until it is acknowledged, five times at most.

    No motion leaves afterwards that was requested before. Raises OutcomeUnknown if one is not acknowledged: the motor
    may be turning. Raises LinkError if the port is gone.
    """
    node.state.stops_asked += 1
    promise = await end_motion(node)
    await close_run(node, "stopped")
    return promise


async def end_motion(node: Node, names: tuple[str, ...] = PROJECT_FIRST) -> Promise:
    """Send both stop commands until they are acknowledged, as part of a procedure. Raises as `stop`."""
    state = node.state
    failures: dict[str, MotorbusError] = {}
    state.stopping += 1
    try:
        for _ in range(TRIES):
            failures = await _failures(node, tuple(failures) or names)
            if not failures or any(isinstance(one, LinkError | Interrupted) for one in failures.values()):
                break
    finally:
        state.stopping -= 1
    if failures:
        raise _not_accepted(node, failures)
    state.stops_accepted += 1
    state.may_run = False
    state.busy_until = -inf
    return Promise.STOP_ACCEPTED


async def _failures(node: Node, names: tuple[str, ...]) -> dict[str, MotorbusError]:
    failures = {}
    for name in names:
        error = await catch(command(node, name, ignore))
        if error is not None:
            failures[name] = error
    return failures


def _not_accepted(node: Node, failures: Mapping[str, MotorbusError]) -> MotorbusError:
    for error in failures.values():
        if isinstance(error, LinkError):
            error.add_note("the stop was not acknowledged: the motor may be turning")
            return error
    first = next(iter(failures.values()))
    return OutcomeUnknown(
        f"{' and '.join(failures)} not acknowledged: the motor may be turning",
        sent=first.sent,
        received=first.received,
        expected=first.expected,
        cause=first.cause,
        advice="stop again, or cut the power of the motor",
        node=node.node,
    )


def stop_requests(node: Node, *, acknowledged: bool) -> tuple[Request[Response], ...]:
    """Both stop commands for an emergency stop; without waiting for a reply unless `acknowledged`."""
    requests = []
    for name in PROJECT_FIRST:
        one = command(node, name, ignore)
        expected = one.expected if acknowledged else ()
        requests.append(
            Request[Response](one.wire, expected, priority=Priority.STOP, effect=one.effect, repeatable=True)
        )
    return tuple(requests)


async def close_run(node: Node, outcome: str) -> None:
    """The project that was started does not run any more: write its outcome to the journal, if that is possible."""
    node.state.may_run = False
    await catch(Emit(JournalEntry(RUN, OUTCOME, {"outcome": outcome})))


# -- motion and stops --------------------------------------------------------------------------------------------------


class Watch:
    """Whether a stop came since this was made, and whether the motion request may have left (`ordered`).

    `precondition` is that of the motion request: it does not leave after a stop.
    """

    def __init__(self, node: Node) -> None:
        self.node: Final = node
        self._asked = node.state.stops_asked
        self._stops: Stops | None = None
        self._count = 0
        self.ordered = False

    @property
    def is_stopped(self) -> bool:
        """A stop was requested, by `stop` or as an emergency stop, whether acknowledged or not."""
        sent = self._stops is not None and self._stops(self.node.node) != self._count
        return sent or self.node.state.stops_asked != self._asked

    def precondition(self, stops: Stops) -> MotorbusError | None:
        """See `Request.precondition`."""
        if self.is_stopped:
            return _stopped("before it began", "nothing was moved; repeat the call if it is still wanted")
        self._stops, self._count = stops, stops(self.node.node)
        self.ordered = True
        return None

    def check(self) -> None:
        """Raise Interrupted after a stop."""
        if self.is_stopped:
            moved = "the motor is at an unknown position" if self.ordered else "nothing was moved"
            raise _stopped("by a stop on this bus", moved)


def _stopped(when: str, advice: str) -> Interrupted:
    return Interrupted(f"the motion was stopped {when}", advice=advice)


async def mark_unmoved(watch: Watch, runnable: Runnable[T]) -> T:
    """Run a motion. Its error is `unmoved` if the motion request did not leave; else no error is a RequestError."""
    try:
        return await runnable
    except MotorbusError as error:
        ordered = watch.ordered and not isinstance(error, Refused)  # the gate refuses after the precondition
        error.unmoved = not ordered
        if ordered and isinstance(error, RequestError):
            raise OutcomeUnknown(
                f"after the motion was requested: {error.summary}",
                expected=error.expected,
                cause=error.cause,
                advice="the motor is at an unknown position",
                node=error.node,
            ) from error
        raise


async def check_idle(node: Node, what: str) -> None:
    """Raise RequestError while a project or a move that was started on this bus may not have ended."""
    state = node.state
    left = state.busy_until - await Sleep(0)
    if not state.may_run and left <= 0:
        return
    raise RequestError(
        f"{what} refused: {'a project that was started may still run' if state.may_run else 'a move may not be over'}",
        expected="its notice, or an acknowledged stop" if state.may_run else f"{left:.1f} s more, or a stop",
        cause="a busy controller ignores a start, and a notice does not name its project",
        advice="call stop() first; nothing was sent",
        node=node.node,
    )
