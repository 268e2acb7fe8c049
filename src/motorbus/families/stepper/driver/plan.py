"""A move together with others: planned, prepared, started in a slot of the caller, finished."""

from __future__ import annotations

from typing import Final

from motorbus.core.request import Request, Response
from motorbus.core.steps import Exclusive, Sleep
from motorbus.families.stepper.driver.loan import Loan
from motorbus.families.stepper.driver.manual import (
    EXACT,
    check_finite,
    checked_pulses,
    longest,
    motion_of,
    motion_request,
    paced,
    pulse_angle,
    rpm_below,
    shaped,
    wait,
)
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.projects import MANUAL, cached, check_free
from motorbus.families.stepper.driver.stop import Watch, mark_unmoved
from motorbus.families.stepper.execution.ramp import Motion, pulses_of, ramp_of
from motorbus.families.stepper.parameters import Project

VERB: Final = "plan_move"


async def plan_move(node: Node, angle: float, *, velocity: float, acceleration: float) -> PlannedMove:
    """Plan a turn by `angle` (rad, in whole pulses) with project 1; it is read and nothing is written.

    At most at `velocity` (rad/s) and, in each reading of the controller's number, at most at `acceleration` (rad/s²),
    as far as the number 1 allows. Less than a pulse gives a move by 0 rad. Raises RequestError for a velocity below
    1 RPM, an angle that is too far, and a project 1 without speed or pulses per turn.
    """
    check_finite("angle", angle)
    check_finite("acceleration", acceleration)
    rpm = rpm_below(velocity)
    watch = Watch(node)
    before = await cached(node, MANUAL)
    return PlannedMove(watch, before, _limited(shaped(before, angle, rpm), acceleration))


class PlannedMove:
    """A single move with a loan of project 1 from `prepare` to `finish`; see `core.family.SelfTimedMove`.

    Times go from the start to the last pulse. The speed is a whole RPM, at least 1: a move that could not be slow
    enough for a duration ends before it.
    """

    def __init__(self, watch: Watch, before: Project, quickest: Project) -> None:
        self._watch: Final = watch
        self._before: Final = before
        self._quickest: Final = quickest
        self._project = quickest
        self._loan: Loan | None = None
        self._begun: float | None = None  # s, link clock: the acknowledgement of the start

    @property
    def angle(self) -> float:
        """The whole signed movement (rad)."""
        move = _motion(self._quickest)
        return move.sign * (move.pulses or 0) * pulse_angle(self._quickest)

    @property
    def shortest(self) -> float:
        """The shortest duration (s)."""
        return _motion(self._quickest).duration

    def fit(self, duration: float) -> float:
        """The nearest duration (s) of a whole RPM, not shorter than `duration` unless 1 RPM is too fast."""
        return _motion(_slowed(self._quickest, duration)).duration

    async def prepare(self, duration: float) -> None:
        """Edit project 1. Raises as `lend` and for a move of less than a pulse; then `finish` gives project 1 back."""
        project = _slowed(self._quickest, duration)
        checked_pulses(project)

        async def borrow() -> None:
            await check_free(self._watch.node, VERB)
            self._project = project
            self._loan = Loan(self._watch, VERB, self._before, project)
            await self._loan.borrow()

        await mark_unmoved(self._watch, Exclusive(borrow()))

    @property
    def start(self) -> Request[None]:
        """The request that starts the prepared move. It does not leave after a stop."""
        request = motion_request(self._watch, "run_once", "relative", self.angle, self._project)
        return request.with_decoder(self._acknowledge)

    def _acknowledge(self, response: Response) -> None:
        self._begun = response.at

    def position(self, elapsed: float) -> float:
        """The angle (rad) done `elapsed` s after the start."""
        move = _motion(self._project)
        return move.sign * move.done(elapsed) * pulse_angle(self._project)

    async def finish(self) -> None:
        """Wait for the end of a move that was acknowledged, stop the motor if it may turn, give project 1 back.

        A second call does nothing. Raises Interrupted after a stop, and as `lend`.
        """
        loan, self._loan = self._loan, None
        if loan is not None:
            await mark_unmoved(self._watch, Exclusive(self._finish(loan)))

    async def _finish(self, loan: Loan) -> None:
        async with loan:
            if self._begun is None:
                return
            self._watch.check()
            passed = await Sleep(0) - self._begun
            seconds = longest(self._project, checked_pulses(self._project)) - passed
            await wait(self._watch, seconds, "moving")
            loan.rests = True


def _limited(project: Project, acceleration: float) -> Project:
    """The move with a ramp that is in no reading steeper than this (rad/s²), as far as the number 1 allows."""
    step = project.step(1)
    number = int(acceleration / pulse_angle(project) / max(1000.0, ramp_of(project, step).run))
    return project.with_step(1, acceleration=max(1, min(number, step.acceleration)))


def _slowed(quickest: Project, seconds: float) -> Project:
    """The same move at the highest whole RPM with which it lasts so long (s); at 1 RPM if none does."""
    low, high = 1, quickest.step(1).speed
    while low < high:
        middle = (low + high + 1) // 2
        if _motion(paced(quickest, middle)).duration * EXACT >= seconds:
            low = middle
        else:
            high = middle - 1
    return paced(quickest, low)


def _motion(project: Project) -> Motion:
    return motion_of(project, pulses_of(project, project.step(1)))
