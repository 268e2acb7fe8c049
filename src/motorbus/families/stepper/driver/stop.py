"""Stop, and what a stop ends.

"Stop project" and "stop motor" are both sent: no source says whether one of them stops everything. Both are harmless at
rest. An acknowledgement means that the controller received it, not that the motor rests.
"""

from __future__ import annotations

from enum import Enum
from typing import Final

from motorbus.core.request import Stops
from motorbus.core.steps import ASKED, OUTCOME, Emit, JournalEntry, catch
from motorbus.errors import Interrupted, LinkError, MotorbusError, OutcomeUnknown, RequestError
from motorbus.families.stepper.driver.node import STOPS, Node, command, ignore

RUN: Final = "run"  # journal entry of a project that was started
TRIES: Final = 5  # of each command; a silent controller takes about 2 s


class Promise(Enum):
    """What an acknowledged stop means."""

    STOP_ACCEPTED = (
        "stop accepted for project and motor; it decelerates or stops at once, by its stop mode; standstill was not "
        "verified"
    )


async def stop(node: Node) -> Promise:
    """Stop the project and any other motion; each command is repeated until it is acknowledged, five times at most.

    No motion leaves afterwards that was requested before. Raises OutcomeUnknown if one is not acknowledged: the motor
    may be turning. Raises LinkError if the port is gone.
    """
    node.state.stops += 1
    await end_motion(node)
    await close_run(node, "stopped")
    return Promise.STOP_ACCEPTED


async def end_motion(node: Node, names: tuple[str, ...] = STOPS) -> None:
    """Send both stop commands until they are acknowledged, as part of a procedure. Raises as `stop`."""
    errors: dict[str, MotorbusError] = {}
    for _ in range(TRIES):
        found = {name: await catch(command(node, name, ignore)) for name in tuple(errors) or names}
        errors = {name: error for name, error in found.items() if error is not None}
        if not errors or any(isinstance(error, LinkError | Interrupted) for error in errors.values()):
            break
    for error in errors.values():
        if isinstance(error, LinkError):
            raise error
        raise OutcomeUnknown(
            f"{' and '.join(errors)} not acknowledged: the motor may be turning",
            sent=error.sent,
            received=error.received,
            cause=error.cause or error.summary,
            advice="stop again, or cut the power of the motor",
            node=node.node,
        )


async def close_run(node: Node, outcome: str) -> None:
    """The project that was started does not run any more: write its outcome to the journal, if that is possible."""
    node.state.may_run = node.state.is_noted = False
    await catch(Emit(JournalEntry(RUN, OUTCOME, {"outcome": outcome})))


async def check_free(node: Node, verb: str) -> None:
    """Raise RequestError while a project of this bus may run, or a change of this bus is unfinished in the journal."""
    if node.state.may_run:
        raise RequestError(
            f"{verb}() refused: a project that was started may still run",
            expected="its notice, or an acknowledged stop",
            cause="a busy controller ignores a start, and a notice does not name its project",
            advice="call stop() first",
            node=node.node,
        )
    if node.state.is_noted:
        await close_run(node, "stopped")  # by an emergency stop or a command of the manual
    await Emit(JournalEntry(verb, ASKED, {"node": node.node}))


class Watch:
    """Whether a stop came since this was made, and whether the motion request may have left (`has_left`).

    `precondition` is that of the motion request: it does not leave after a stop.
    """

    def __init__(self, node: Node) -> None:
        self.node: Final = node
        self.has_left = False
        self._asked = node.state.stops
        self._stops: Stops | None = None
        self._count = 0

    @property
    def is_stopped(self) -> bool:
        """A stop was requested, by `stop` or as an emergency stop, whether acknowledged or not."""
        is_sent = self._stops is not None and self._stops(self.node.node) != self._count
        return is_sent or self.node.state.stops != self._asked

    def precondition(self, stops: Stops) -> MotorbusError | None:
        """See `Request.precondition`."""
        if self.is_stopped:
            return Interrupted("a stop came before the motion began", advice="repeat the call")
        self._stops, self._count = stops, stops(self.node.node)
        self.has_left = True
        return None

    def check(self) -> None:
        """Raise Interrupted after a stop."""
        if self.is_stopped:
            state = "the motor is at an unknown position" if self.has_left else "nothing was moved"
            raise Interrupted("the motion was interrupted by a stop on this bus", advice=state)
