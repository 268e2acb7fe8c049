"""One call upon a controller: what ends by itself until then, what is asked, and all that follows without time.

Nothing here nests. What takes no time ends at the same moment, and that is met by the same loop as everything else that
ends, so ten thousand steps without motion or pause are no deeper than one.

Source of each transition: stepper controller serial protocol manual; what is assumed is a switch of `Behaviour` or in
the list of assumptions.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf
from typing import Any, Final, NamedTuple

from motorbus.families.stepper.execution import order
from motorbus.families.stepper.execution.order import Place
from motorbus.families.stepper.execution.profile import Motion
from motorbus.families.stepper.execution.state import After, Happening, Phase, Run, State
from motorbus.families.stepper.table import (
    HOME_INPUT,
    START_INPUT,
    STOP_INPUT,
    Project,
    StopMode,
    after_step,
)

EMPTY_PASS: Final = 0.001
"""s after a pass of an endless project in which nothing took time; an assumption, for no device is infinitely fast."""
_MANUAL: Final = (Phase.JOG, Phase.ONCE, Phase.HOMING)
_OF_PROJECT: Final = (Phase.WAIT, Phase.MOVE, Phase.DWELL)


class Next(NamedTuple):
    """What came of it. `accepted` is False for a start that found something under way, and was ignored."""

    state: State
    told: tuple[Happening, ...] = ()
    accepted: bool = True


class Turn:
    """One call: the state as it becomes, and what happens meanwhile."""

    def __init__(self, state: State, at: float) -> None:
        self.state = state
        self.told: list[Happening] = []
        self.accepted = True
        self.at = state.since
        self._pass_until(at)

    def result(self) -> Next:
        """What came of it, with all that takes no time."""
        self._pass_until(self.at)
        return Next(self.state, tuple(self.told), self.accepted)

    def _pass_until(self, at: float) -> None:
        while self.state.until <= at:
            self.at = self.state.until
            self._ends()
        self.at = max(self.at, at)

    def become(self, **changes: Any) -> None:
        """Change the state."""
        self.state = replace(self.state, **changes)

    def tell(self, kind: str) -> None:
        """It happened now."""
        run = self.state.run
        self.told.append(Happening(self.at, kind, run.place.step if run else 0))

    def may_start(self) -> bool:
        """Whether a start begins something; with busy=restart what runs is ended for it."""
        if not self.state.busy:
            self.accepted = self.state.phase is not Phase.OFF
        elif self.state.how.busy != "restart":
            self.accepted = False
        else:
            self.rest()
            self.become(run=None, manual=None)
        return self.accepted

    # -- motion ---------------------------------------------------------------------------------------------------

    def go(self, phase: Phase, motion: Motion, **changes: Any) -> None:
        """Begin a motion now."""
        base = self.state.position(self.at)
        self.become(
            phase=phase, since=self.at, until=self.at + motion.duration, motion=motion, base=base, **changes
        )

    def rest(self, phase: Phase = Phase.IDLE, until: float = inf) -> None:
        """Be without motion from now on."""
        base = self.state.position(self.at)
        self.become(phase=phase, since=self.at, until=until, motion=None, base=base)

    def halt(self, after: After, *, mode: int | None = None) -> None:
        """End the motion under way as the stop mode says (or this one), and go on to what follows."""
        state = self.state
        slow = (state.stop_mode if mode is None else mode) == StopMode.SLOW
        if slow and state.motion is not None:
            slowing = state.motion.slowing(self.at - state.since)
            if slowing.pieces:
                self.go(Phase.RAMPDOWN, slowing, after=after)
                return
        self.become(after=after)
        self._halted()

    def _halted(self) -> None:
        after, last = self.state.after, self.state.motion
        self.rest()
        if after is After.STOPPED:
            self._finish(natural=False)
        elif after is After.DWELL:
            self._moved()
        elif after is After.REVERSE and last is not None and self.state.manual is not None:
            self.by_hand(Phase.JOG, self.state.manual, None, -last.sign)
        elif after is After.HOMED:
            self._homed()
        else:
            self._manual_ends()

    def by_hand(self, phase: Phase, project: Project, count: int | None, sign: int) -> None:
        """Jog, one move or homing, with the speed of step 1 of the project."""
        if self.state.how.flags_scope == "project":
            self.become(stop_mode=project.stop_mode)
        motion = order.move(project, project.step(1), count, self.state.how, sign)
        self.go(phase, motion, manual=project)

    def homed_already(self) -> None:
        """Homing ends before it begins: input 5 is active. Its end is told as any other."""
        self._manual_ends(quiet=not self.state.how.notice_on_once)

    def _homed(self) -> None:
        self.become(base=0, homed=True)
        self.tell("homed")
        self._manual_ends(quiet=not self.state.how.notice_on_once)

    def _manual_ends(self, *, quiet: bool = True) -> None:
        self.become(manual=None)
        self.tell("rests")
        if not quiet:
            self.tell("completed")

    # -- what ends by itself ------------------------------------------------------------------------------------------

    def _ends(self) -> None:
        phase = self.state.phase
        if phase is Phase.MOVE:
            self._moved()
        elif phase is Phase.DWELL:
            self._next()
        elif phase is Phase.RAMPDOWN:
            self._halted()
        else:  # one move has been made, or the manual motion had no speed
            self.rest()
            self._manual_ends(quiet=phase is not Phase.ONCE or not self.state.how.notice_on_once)

    # -- a project ----------------------------------------------------------------------------------------------------

    def start(self, project: Project, asked: bool) -> None:
        """Begin with step 1 of the first pass."""
        if self.state.how.flags_scope == "project":
            self.become(stop_mode=project.stop_mode)
        self.become(run=Run(project, Place(1), asked, round_began=self.at))
        if order.last_step(project):
            self._begin()
        else:
            self._finish(natural=True, quiet=not self.state.how.clear_notice)

    def _begin(self) -> None:
        run = self._run()
        waits_for = run.step.start_input
        if waits_for and (self.state.how.start_input == "edge" or waits_for not in self.state.inputs):
            self.rest(Phase.WAIT)
            self.tell("waits")
        else:
            self._go()

    def _go(self) -> None:
        """Outputs and motor at the same moment."""
        run, how = self._run(), self.state.how
        step = run.step
        count: int | None
        count, residue = order.pulses(run.project, step, how, run.residue)
        if not step.distance and how.zero_distance == "endless":
            count = None
        outputs = after_step(self.state.outputs, step.output, zero_is_off=how.output_zero == "off")
        motion = order.move(run.project, step, count, how)
        self.go(Phase.MOVE, motion, outputs=outputs, run=replace(run, residue=residue))
        self.tell("begins")
        if step.stop_input and step.stop_input in self.state.inputs:
            self._cut_short()

    def _moved(self) -> None:
        self.rest(Phase.DWELL, self.at + self._run().step.delay / 1000)
        self.tell("moved")

    def _next(self) -> None:
        run = self._run()
        place = order.following(run.project, run.place, self.state.how)
        if place is not None:
            self.become(run=replace(run, place=place))
            self._begin()
            return
        passes = order.passes(run.project, self.state.how)
        if passes is not None and run.round >= passes:
            self._finish(natural=True)
        elif (
            passes is None and self.at <= run.round_began
        ):  # it took no time, so the next would never come to an end
            self.rest(Phase.DWELL, self.at + EMPTY_PASS)
            self.become(run=replace(run, round_began=-inf))
        else:
            self.become(run=replace(run, place=Place(1), round=run.round + 1, round_began=self.at))
            self._begin()

    def _cut_short(self) -> None:
        """The stop input of the step is active."""
        how = self.state.how
        mode = None if how.stop_input == "mode" else StopMode.IMMEDIATE
        self.halt(After.STOPPED if how.stop_input_scope == "project" else After.DWELL, mode=mode)

    def _finish(self, *, natural: bool, quiet: bool = False) -> None:
        run, how = self._run(), self.state.how
        self.tell("ended" if natural else "stopped")
        self.rest()
        if (natural or how.notice_on_stop) and (run.asked or how.notice_on_in3) and not quiet:
            self.tell("completed")
        self.become(run=None, outputs=0 if how.outputs_on_stop == "off" else self.state.outputs)

    def _run(self) -> Run:
        assert self.state.run is not None, "only a project has steps"
        return self.state.run

    # -- stops and inputs ---------------------------------------------------------------------------------------------

    def stop_project(self) -> None:
        """Command 14 or input 4."""
        phase = self.state.phase
        if phase in _OF_PROJECT:
            self.halt(After.STOPPED)
        elif phase is Phase.RAMPDOWN and self.state.run is not None:
            self.become(after=After.STOPPED)
        elif self.state.how.stop_project_scope == "all":
            self._stop_manual()

    def stop_motor(self) -> None:
        """Command 20."""
        if self.state.run is None:
            self._stop_manual()
        elif self.state.how.motor_stop_ends_project:
            self.stop_project()
        elif self.state.phase is Phase.MOVE:
            self.halt(After.DWELL)

    def _stop_manual(self) -> None:
        if self.state.phase in _MANUAL:
            self.halt(After.IDLE)
        elif self.state.phase is Phase.RAMPDOWN:
            self.become(after=After.IDLE)

    def input_rises(self, port: int, in3_project: Project | None) -> None:
        """An input has become active."""
        state = self.state
        if port == HOME_INPUT and state.phase is Phase.HOMING:
            self.halt(After.HOMED, mode=None if state.how.home_stop == "mode" else StopMode.IMMEDIATE)
            return
        run = state.run
        if run is not None and state.phase is Phase.WAIT and run.step.start_input == port:
            self._go()
        elif run is not None and state.phase is Phase.MOVE and run.step.stop_input == port:
            self._cut_short()
        if port == STOP_INPUT:
            self.stop_project()
        elif port == START_INPUT and in3_project is not None and self.may_start():
            self.start(in3_project, asked=False)
