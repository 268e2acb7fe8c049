"""A move together with others: planned, prepared, started in a slot of the caller, finished."""

from __future__ import annotations

from math import tau
from typing import Final

from motorbus.core.request import Request, Response
from motorbus.core.steps import Exclusive, Sleep
from motorbus.errors import RequestError
from motorbus.families.stepper.driver import manual
from motorbus.families.stepper.driver.manual import EXACT, MAX_RPM, angle_of, paced
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.project1 import TemporaryProject1
from motorbus.families.stepper.driver.projects import MANUAL, cached
from motorbus.families.stepper.driver.stop import Watch, check_free
from motorbus.families.stepper.execution.ramp import Motion, move_of
from motorbus.families.stepper.parameters import Project

VERB: Final = "plan_move"


async def plan_move(node: Node, angle: float, *, velocity: float, acceleration: float) -> PlannedMove:
    """Plan a turn by `angle` (rad, in whole pulses) with project 1; it is read and nothing is written.

    At most at `velocity` (rad/s) and at `acceleration` (rad/s²), as far as the number 1 allows. Less than a pulse gives
    a move by 0 rad. Raises RequestError for a velocity below 1 RPM, an angle that is too far, and a project 1 without
    speed or pulses per turn.
    """
    for name, value in (("angle", angle), ("velocity", velocity), ("acceleration", acceleration)):
        manual.check_finite(name, value)
    rpm = int(min(velocity * 60 / tau * EXACT, MAX_RPM))
    if rpm < 1:
        raise RequestError(f"velocity {velocity:.4g} rad/s is below {tau / 60:.4g} rad/s, which is 1 RPM")
    watch = Watch(node)
    before = await cached(node, MANUAL)
    project = manual.shaped(before, angle, rpm)
    number = int(acceleration / manual.pulse_angle(project) * node.tick_ms / 1000)
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
        manual.check_pulses(project)

        async def edit() -> None:
            await check_free(self._watch.node, VERB)
            self._project = project
            self._use = TemporaryProject1(self._watch, VERB, self._before, project)
            await self._use.edit()

        await Exclusive(edit())

    @property
    def start(self) -> Request[None]:
        """The request that starts the prepared move. It does not leave after a stop."""
        request = manual.motion_request(self._watch, "run_once", "relative", self.angle, self._project)
        return request.with_decoder(self._acknowledge)

    def _acknowledge(self, response: Response) -> None:
        self._begun = response.at

    def position(self, elapsed: float) -> float:
        """The angle (rad) done `elapsed` s after the start."""
        move = self._motion(self._project)
        return move.sign * move.done(elapsed) * manual.pulse_angle(self._project)

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
            seconds = self._motion(self._project).duration * manual.CLOCK + manual.MARGIN
            await manual.wait(self._watch, seconds - passed, "moving")
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
