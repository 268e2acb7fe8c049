"""What every motion by hand has in common: when it may begin, how long it may take, and that a stop of others ends it.

A controller tells nothing of a jog, a single move or a homing but that it has heard the order. So their time is
reckoned, by the slowest of the readings of the acceleration, and while it passes this host watches for stops: one that
was sent by anybody on this bus ends the wait, and none of these orders leaves after one.

Who reckons where the motor stands may believe a motion that returned: it was acknowledged, had its time, and nobody on
this bus has stopped it. Where it was on the way when something ended it nobody can tell: a stop slows down or not, an
acknowledgement that is lost says nothing, and a power cycle is noticed only where project 1 had to be edited. So after
every error the position is not known, but for those that are `unmoved`: the order had not left.
"""

from __future__ import annotations

from dataclasses import replace
from math import ceil, inf, isfinite
from sys import float_info
from typing import Final, NamedTuple, TypeVar

from motorbus.core.request import Stops
from motorbus.core.steps import Emit, Progress, Runnable, Sleep
from motorbus.errors import Interrupted, MotorbusError, OutcomeUnknown, Refused, RequestError
from motorbus.families.stepper import execution
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.execution import USUAL, Behaviour
from motorbus.families.stepper.program.plan import READINGS
from motorbus.families.stepper.table import Project, StopMode

T = TypeVar("T")


class Slowing(NamedTuple):
    """An event: the motor was told to stop, and has these `seconds` to come to rest before project 1 is given back."""

    seconds: float


LOOK: Final = 0.1
"""s between two looks at whether somebody has stopped it."""
CLOCK: Final = 1.02
"""Its clock may be slower by so much, an assumption: a controller with a resonator is good for 0.5 %."""
SPARE: Final = 0.05
"""s added to every reckoned time."""


class Watch:
    """Whether anybody has told the motor to stop since this was made: another task, another face, an emergency.

    `ordered` once the order to move may have left: before that nothing has moved, see `honest`, unless something else
    was `ended` for it. `looked` is the error of `look`.
    """

    def __init__(self, node: Node) -> None:
        self._node = node.node
        self._memory = node.memory
        self._before = self._memory.wanted
        self._stops: Stops | None = None
        self._left = 0
        self.ordered = self.ended = False
        self.looked: MotorbusError | None = None

    @property
    def overtaken(self) -> bool:
        """Whether somebody has begun to say stop since, accepted or not."""
        return self._memory.wanted != self._before

    def refusal(self, stops: Stops) -> MotorbusError | None:
        """For the exchange that begins the motion: it must not leave after a stop."""
        if self.overtaken or (self.looked is not None and self._has_left):
            return _early()
        self._stops, self._left = stops, stops(self._node)
        self.ordered = True
        return None

    def look(self, stops: Stops) -> MotorbusError:
        """For an exchange that never leaves: from here on every stop counts that does."""
        self._stops, self._left = stops, stops(self._node)
        self.looked = _early()
        return self.looked

    def check_before(self) -> None:
        """Raise Interrupted when somebody has said stop, though the motion was not ordered yet."""
        if self.overtaken or self._has_left:
            raise _early()

    def check(self) -> None:
        """Raise Interrupted when somebody has said stop since the motion was ordered."""
        if self.overtaken or self._has_left:
            raise _stopped("by somebody else", "where the motor stands now is not known")

    @property
    def _has_left(self) -> bool:
        return self._stops is not None and self._stops(self._node) != self._left


def _early() -> Interrupted:
    return _stopped("before it began", "the motor was not told to move")


def _stopped(when: str, state: str) -> Interrupted:
    return Interrupted(
        f"the motion was stopped {when}",
        cause="a stop was sent on this bus, by another task or as an emergency",
        advice=f"{state}; give the order again if it is still wanted",
    )


async def honest(watch: Watch, runnable: Runnable[T]) -> T:
    """Carry out what may move the motor; an error from before the order has left says so, it is `unmoved`.

    A RequestError is always from before: one that comes behind the order becomes OutcomeUnknown.
    """
    try:
        return await runnable
    except MotorbusError as error:
        ordered = watch.ordered and not isinstance(error, Refused)  # of the gate, which is asked last
        error.unmoved = not (ordered or watch.ended)
        if ordered and isinstance(error, RequestError):
            raise _afterwards(error) from error
        raise


def _afterwards(error: RequestError) -> OutcomeUnknown:
    return OutcomeUnknown(
        f"the motion was ordered, and afterwards: {error.summary}",
        expected=error.expected,
        cause=error.cause,
        advice="where the motor stands is not known",
        node=error.node,
    )


async def waited(watch: Watch, seconds: float, what: str) -> None:
    """Let so much time (s) pass while something turns; reports `Progress` in ms, by the clock alone.

    Raises Interrupted when somebody has stopped it.
    """
    began = now = await Sleep(0)
    end = (
        began + seconds
    )  # a moment to compare with: what is left of a time may be rounded to nothing, again and again
    while now < end:
        await Emit(Progress(round(1000 * (now - began)), round(1000 * seconds), f"{what}, estimated"))
        now = await Sleep(min(LOOK, end - now))
        watch.check()


def longest(project: Project, count: int | None) -> float:
    """s that a move of so many pulses with the speed of step 1 may take, by the slowest reading of its ramp.

    With a little more for a slow clock; infinity for a move without an end.
    """
    seconds = max(execution.move(project, project.step(1), count, how).duration for how in _readings())
    return seconds * CLOCK + SPARE if seconds < inf else inf


def slowing(project: Project, how: Behaviour = USUAL) -> float:
    """s that it takes at most to come to rest after a stop, from any of its steps; 0 where a stop ends it at once.

    By the slowest of the readings of its ramp, `how` among them.
    """
    if project.stop_mode != StopMode.SLOW or project.pulses_per_unit is None:
        return 0.0
    steps = [project.step(number) for number in range(1, max(1, execution.last_step(project)) + 1)]
    moves = [execution.move(project, step, None, one) for step in steps for one in _readings(how)]
    return max(move.slowing(sum(piece.duration for piece in move.pieces[:1])).duration for move in moves)


def _readings(how: Behaviour = USUAL) -> list[Behaviour]:
    return [how, *(replace(how, **changes) for changes in READINGS.values())]


async def refuse_unless_idle(node: Node, what: str) -> None:
    """Raise RequestError while something that was begun on this bus may still turn: `what` would end it half-way."""
    now = await Sleep(0)
    if not node.memory.owed and node.memory.turning <= now:
        return
    begun = "a project that was started may still run" if node.memory.owed else "a move may not be over"
    raise RequestError(
        f"{begun}, so {what} is refused",
        expected="its notice, or an accepted stop" if node.memory.owed else "its time, or an accepted stop",
        cause="a busy controller ignores such an order, a stop ends whatever turns, and a notice does not say whose "
        "end it tells",
        advice=_until_idle(node, now),
        node=node.node,
    )


def refuse_unless_turning(node: Node, project: Project, verb: str) -> None:
    """Raise RequestError when step 1 of project 1 has no speed, or nothing says how far a turn is."""
    if project.step(1).speed and not project.is_cleared and project.pulses_per_unit is not None:
        return
    what = "is cleared" if project.is_cleared else "has no speed in step 1, or no pulses for a turn"
    raise RequestError(
        f"project 1 {what}, so {verb}() has no speed",
        expected="a speed in step 1 of project 1, from which jog, single move and homing take it",
        advice="write project 1, or say a velocity; nothing was sent",
        node=node.node,
    )


def within(seconds: float, most: float, what: str) -> float:
    """A time that somebody has said (s). Raises RequestError when it is not above 0 and at most `most`."""
    if _is_finite(seconds) and 0 < seconds <= most:
        return seconds
    raise RequestError(
        f"{what}: {seconds!r} s is not possible",
        expected="above 0" + (f", at most {most:g} s" if most < inf else ""),
        advice="nothing was sent",
    )


def finite(value: float, what: str) -> float:
    """A number that somebody has said. Raises RequestError for one that is none, or not finite."""
    if _is_finite(value):
        return value
    raise RequestError(
        f"{what}: {value!r} is not a finite number", expected="a finite number", advice="nothing was sent"
    )


def _is_finite(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return -float_info.max <= value <= float_info.max


def _until_idle(node: Node, now: float) -> str:
    """What to do until nothing turns any more."""
    left = node.memory.turning - now
    if node.memory.owed:
        how = "say stop() first, or wait for the notice: a project that runs until it is stopped has none"
    elif isfinite(left):
        how = f"wait {ceil(10 * left) / 10:g} s more, or say stop() first"
    else:
        how = "say stop() first: nobody knows how long it turns"
    return f"{how}; nothing was sent"
