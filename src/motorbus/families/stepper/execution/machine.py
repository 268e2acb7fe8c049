"""A controller that carries out projects and manual motions, over time and with its inputs and outputs.

Time is an argument. What ends by itself ends at its own moment, so nothing depends on how often `advance` is called.
Source of each transition: stepper controller serial protocol manual; `# assumption` marks what it does not say.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from math import inf
from typing import Final

from motorbus.families.stepper import parameters
from motorbus.families.stepper.execution import ramp
from motorbus.families.stepper.execution.ramp import Motion
from motorbus.families.stepper.parameters import HOME_INPUT, START_INPUT, STOP_INPUT, Place, Project, Step

FIRST: Final = Place(1)
EMPTY_PASS: Final = 0.001  # s of a pass of an endless project in which nothing takes time # assumption


class Phase(Enum):
    """The present activity; the first three belong to a step of a project."""

    WAIT = "waiting for an input"
    MOVE = "moving"
    PAUSE = "pausing"
    IDLE = "idle"
    JOG = "jogging"
    ONCE = "making one move"
    HOMING = "homing"
    SLOWING = "slowing down"
    OFF = "off"


@dataclass(slots=True)
class Run:
    """A project that runs: its place, the pass (from 1) and when that began, and whether a command started it."""

    project: Project
    by_command: bool
    began: float
    place: Place = FIRST
    round: int = 1

    @property
    def step(self) -> Step:
        return self.project.step(self.place.step)


class Machine:
    """The state of a controller.

    `outputs` has three bits, bit 0 is output 1; `inputs` are the active ones, 1 to 5; `motion` is the move since
    `since`, from the position `base`. `notices` are the times of all ends that it reports; the caller empties it.
    """

    def __init__(self, *, tick_ms: float = ramp.TICK_MS) -> None:
        self.tick_ms = tick_ms
        self.phase = Phase.IDLE
        self.since = 0.0
        self.until = inf  # end of the phase
        self.motion: Motion | None = None
        self.base = 0
        self.run: Run | None = None
        self.outputs = 0
        self.leds = False
        self.inputs: frozenset[int] = frozenset()
        self.stop_mode = 0
        self.is_homed = False
        self.notices: list[float] = []
        self._now = 0.0

    def position(self, at: float) -> int:
        """In pulses."""
        if self.motion is None:
            return self.base
        is_over = self.motion.pulses is not None and at >= self.until
        done = self.motion.pulses if is_over else self.motion.done(at - self.since)
        return self.base + self.motion.sign * (done or 0)

    def frequency(self, at: float) -> float:
        """In pulses per second, negative in reverse."""
        if self.motion is None or at >= self.until:
            return 0.0
        return self.motion.sign * self.motion.frequency(at - self.since)

    def advance(self, to: float) -> None:
        """Let time pass until this moment."""
        while self.until <= to:
            self._now = self.until
            if self.run and self.phase is Phase.MOVE:
                self._end_motion(self.run)
            elif self.run and self.phase is Phase.PAUSE:
                self._next_step(self.run)
            else:
                self._finish()
        self._now = max(self._now, to)

    # -- commands --------------------------------------------------------------------------------------------------

    def power_on(self, at: float, *, home_with: Project | None = None) -> None:
        """Power on at rest, with all outputs off; with `home_with` home with the speed of its step 1."""
        self._now = at
        self._rest()
        self.stop_mode = 0
        if home_with:
            self.home(home_with, at)

    def power_off(self, at: float) -> None:
        """Without supply; the motor stays in its place."""
        self.advance(at)
        self._rest(Phase.OFF)
        self.run = None
        self.outputs, self.leds, self.is_homed = 0, False, False

    def start(self, project: Project, at: float, *, by_command: bool = True) -> None:
        """Start a project."""
        if not self._is_free(at):
            return
        self.stop_mode = project.stop_mode  # the stop mode belongs to each project # assumption
        self.run = Run(project, by_command, at)
        if project.used:
            self._begin_step(self.run)
        else:
            self._finish(completed=True)  # without steps it ends at once, with a notice # assumption
        self.advance(at)

    def jog(self, project: Project, sign: int, at: float) -> None:
        """Turn until stopped with the speed of step 1 of this project."""
        self._move_by_hand(Phase.JOG, project, None, sign, at)

    def run_once(self, project: Project, at: float) -> None:
        """Make the move of step 1 of this project, without its inputs, output and pause."""
        step = project.step(1)
        self._move_by_hand(Phase.ONCE, project, ramp.pulses_of(project, step), step.sign, at)

    def home(self, project: Project, at: float) -> None:
        """Turn in reverse with the speed of step 1 of this project until input 5.

        It ends at once, without a motion, if the input is active.
        """
        pulses = 0 if HOME_INPUT in self.inputs else None
        self._move_by_hand(Phase.HOMING, project, pulses, -1, at)

    def stop_project(self, at: float) -> None:
        """Stop the project."""
        self.advance(at)
        if self.run is not None:  # stop project leaves a manual motion alone # assumption
            self._stop()

    def stop_motor(self, at: float) -> None:
        """Stop the motor, and the project too. # assumption"""
        self.advance(at)
        if self.phase not in (Phase.IDLE, Phase.OFF):
            self._stop()

    def set_output(self, port: int, level: int, at: float) -> None:
        """Switch outputs (1 to 3, 4 for all) or the LEDs (5), at any time."""
        self.advance(at)
        if port == parameters.LEDS:
            self.leds = bool(level)
        self.outputs = parameters.outputs_after_port(self.outputs, port, level)

    def set_input(self, port: int, active: bool, at: float, *, start: Project | None = None) -> None:
        """Set an input, 1 to 5; `start` is the project that input 3 starts."""
        self.advance(at)
        rises = active and port not in self.inputs
        self.inputs = self.inputs | {port} if active else self.inputs - {port}
        if not rises:
            return
        if port == HOME_INPUT and self.phase is Phase.HOMING:
            self._rest()  # homing ends at once in every stop mode # assumption
            self.base, self.is_homed = 0, True
        elif self.run and self.phase is Phase.WAIT and self.run.step.start_input == port:
            self._begin_motion(self.run)
        elif self.run and self.phase is Phase.MOVE and self.run.step.stop_input == port:
            self._end_motion(self.run)
        if port == STOP_INPUT:
            self.stop_project(at)
        elif port == START_INPUT and start:
            self.start(start, at, by_command=False)
        self.advance(at)

    # -- motion ----------------------------------------------------------------------------------------------------

    def _go(self, phase: Phase, motion: Motion) -> None:
        self.base = self.position(self._now)
        self.phase, self.motion, self.since = phase, motion, self._now
        self.until = self._now + motion.duration

    def _rest(self, phase: Phase = Phase.IDLE, until: float = inf) -> None:
        self.base = self.position(self._now)
        self.phase, self.motion, self.since, self.until = phase, None, self._now, until

    def _stop(self) -> None:
        """Stop the motor as the stop mode says; a slow stop that began continues."""
        if self.phase is Phase.SLOWING:
            return
        slow = self.motion.slowing(self._now - self.since) if self.motion else None
        if slow is None or self.stop_mode == parameters.IMMEDIATE:
            self._finish()
        else:
            self._go(Phase.SLOWING, slow)

    def _is_free(self, at: float) -> bool:
        self.advance(at)
        return self.phase is Phase.IDLE  # a busy controller acknowledges and ignores a start # assumption

    def _move_by_hand(self, phase: Phase, project: Project, pulses: int | None, sign: int, at: float) -> None:
        if self._is_free(at):
            self.stop_mode = project.stop_mode
            speed = ramp.ramp_of(project, project.step(1), self.tick_ms)
            self._go(phase, ramp.motion(speed, pulses, sign))
            self.advance(at)

    # -- a project -------------------------------------------------------------------------------------------------

    def _begin_step(self, run: Run) -> None:
        port = run.step.start_input
        if port and port not in self.inputs:  # an active input starts a step at once # assumption
            self._rest(Phase.WAIT)
        else:
            self._begin_motion(run)

    def _begin_motion(self, run: Run) -> None:
        """Outputs and motor at the same moment."""
        self.outputs = parameters.outputs_after_step(self.outputs, run.step.output)
        self._go(Phase.MOVE, ramp.move_of(run.project, run.step, self.tick_ms))
        if run.step.stop_input in self.inputs:
            self._end_motion(run)

    def _end_motion(self, run: Run) -> None:
        """The motion is over, or its stop input ends it at once."""
        self._rest(Phase.PAUSE, self._now + run.step.delay / 1000)

    def _next_step(self, run: Run) -> None:
        place = run.project.following(run.place)
        if place is None:
            passes = run.project.passes
            if passes is not None and run.round >= passes:
                self._finish(completed=True)
                return
            if passes is None and self._now <= run.began:
                run.began = -inf
                self._rest(Phase.PAUSE, self._now + EMPTY_PASS)
                return
            run.round, run.began = run.round + 1, self._now
        run.place = place or FIRST
        self._begin_step(run)

    def _finish(self, *, completed: bool = False) -> None:
        """A motion or a project has ended. The notice follows a natural end of one that a command started."""
        self._rest()
        if completed and self.run and self.run.by_command:
            self.notices.append(self._now)
        self.run = None  # the outputs stay as they are at its end # assumption
