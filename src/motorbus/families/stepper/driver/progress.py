"""Where a project probably is: a model that runs beside the controller, since the controller tells nothing.

The twin is the machine of `execution`, started when the controller acknowledged and advanced to the link's clock. It
knows no input that nobody reads and no switch that nobody has found out, so everything it says is an estimate. It is
told of the inputs that are watched; a notice ends it.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, tau
from typing import NamedTuple

from motorbus.families.stepper import execution
from motorbus.families.stepper.execution import Phase, Place, State
from motorbus.families.stepper.program import Plan


class Estimated(NamedTuple):
    """An event: where a project that runs is by estimate. Nothing in it was measured.

    `at`           the moment it is about (s, link's clock)
    `fraction`     0 to 1 of motion and pauses, waits not counted; None for a project without an end
    `round`        which pass of the project, from 1, of `passes` (None: without an end)
    `step`         the step, 1 to 10; 0 when it should be over
    `position`     rad of the motor from where it was at the start, forward positive
    `waiting_for`  the input that it should be waiting for, as far as the watched inputs tell; None: for none
    """

    at: float
    fraction: float | None
    round: int
    passes: int | None
    step: int
    position: float
    waiting_for: int | None


class Twin:
    """A model of one run: `plan` as it was started at the moment `at` (s), with these inputs active."""

    def __init__(self, plan: Plan, at: float, active: frozenset[int] = frozenset()) -> None:
        self._plan = plan
        self._steps = {step.number: step for step in plan.steps}
        self._before = _offsets(plan)
        self._fraction = 0.0
        self._round = 1
        ready = execution.power_on(at, plan.how, inputs=active).state
        self.state: State = execution.start(ready, plan.project, at).state

    def press(self, port: int, active: bool, at: float) -> None:
        """An input has changed, at this moment or before."""
        self.state = execution.set_input(self.state, port, active, at).state

    def told(self, at: float) -> Estimated:
        """What it does at this moment, which is not before the last one."""
        self.state = state = execution.advance(self.state, at).state
        run = state.run
        if run is not None:
            self._round = run.round
        waits = run is not None and state.phase is Phase.WAIT
        return Estimated(
            at=at,
            fraction=self._through(state, at),
            round=self._round,
            passes=self._plan.passes,
            step=run.place.step if run is not None else 0,
            position=self._angle(state.position(at)),
            waiting_for=run.step.start_input if run is not None and waits else None,
        )

    def _angle(self, pulses: int) -> float:
        turn = self._plan.project.pulses_per_turn
        return pulses * tau / float(turn) if turn else 0.0

    def _through(self, state: State, at: float) -> float | None:
        """How much of it is behind; never less than it was, for a step may take longer than on average."""
        each = self._plan.pass_seconds
        if self._plan.passes is None or each == inf:
            return None
        total, run = each * self._plan.passes, state.run
        if run is None:
            self._fraction = 1.0
        elif total > 0:
            here = self._before[run.place] + self._into(state, at)
            self._fraction = max(self._fraction, min(1.0, (each * (run.round - 1) + here) / total))
        return self._fraction

    def _into(self, state: State, at: float) -> float:
        """s of the present step that are behind, its wait not counted."""
        if state.run is None or state.phase is Phase.WAIT:
            return 0.0
        step, since = self._steps[state.run.place.step], at - state.since
        if state.phase is Phase.MOVE:
            return since
        return step.motion + (since if state.phase is Phase.DWELL else 0.0)


def _offsets(plan: Plan) -> Mapping[Place, float]:
    """s of a pass before each execution of a step begins."""
    took = {step.number: step.seconds for step in plan.steps}
    found, before = {}, 0.0
    for place in execution.one_pass(plan.project, plan.how):
        found[place] = before
        before += took[place.step]
    return found
