"""Everything a controller is at one moment, as a value that is never changed: the machine makes the next one of it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from math import inf
from typing import NamedTuple

from motorbus.families.stepper.execution.behaviour import USUAL, Behaviour
from motorbus.families.stepper.execution.order import Place
from motorbus.families.stepper.execution.profile import Motion
from motorbus.families.stepper.table import Project, Step


class Phase(Enum):
    """What it is doing. The first three belong to a step of a project."""

    WAIT = "waiting for an input"
    MOVE = "moving"
    DWELL = "pausing"
    IDLE = "idle"
    JOG = "jogging"
    ONCE = "making one move"
    HOMING = "homing"
    RAMPDOWN = "slowing down"
    OFF = "off"


class After(Enum):
    """What follows when it has slowed down."""

    IDLE = "idle"
    STOPPED = "the project is stopped"
    DWELL = "the pause of the step"
    REVERSE = "jog the other way"
    HOMED = "the home position"


@dataclass(frozen=True, slots=True)
class Run:
    """A project under way.

    `place` is the step it is at, `round` which pass of the project (from 1), `asked` whether a command started it (else
    an input), `residue` what rounding has left over, `round_began` when this pass began (s).
    """

    project: Project
    place: Place
    asked: bool
    round: int = 1
    residue: Fraction = Fraction(0)
    round_began: float = 0.0

    @property
    def step(self) -> Step:
        """The step it is at."""
        return self.project.step(self.place.step)


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """What a controller is, and since when (s).

    `until`     when the phase ends by itself, infinity when it does not
    `motion`    the move under way, on a clock that begins at `since`; None at rest
    `base`      where the motor was at `since`, in pulses, forward positive; counted, for nobody can ask
    `run`       the project under way, or None
    `outputs`   three bits, bit 0 is output 1; `leds` are both of them; `inputs` holds the active ones, 1 to 5
    `stop_mode` what a stop does now: 0 slow, 1 immediate
    `manual`    the project whose step 1 manual motion takes its speed from, while there is such motion
    `homed`     whether the home switch has been met since power-on
    """

    phase: Phase = Phase.IDLE
    since: float = 0.0
    until: float = inf
    motion: Motion | None = None
    base: int = 0
    run: Run | None = None
    after: After = After.IDLE
    outputs: int = 0
    leds: bool = False
    inputs: frozenset[int] = frozenset()
    stop_mode: int = 0
    manual: Project | None = None
    homed: bool = False
    how: Behaviour = USUAL

    def position(self, at: float) -> int:
        """Where the motor is at this moment, in pulses."""
        motion = self.motion
        if motion is None:
            return self.base
        # late in a long run a difference of two moments is not exactly the duration any more
        over = motion.pulses is not None and at >= self.until
        done = motion.pulses if over else motion.done(at - self.since)
        return self.base + motion.sign * (done or 0)

    def frequency(self, at: float) -> float:
        """Pulses per second at this moment, negative in reverse."""
        if self.motion is None or at >= self.until:
            return 0.0
        return self.motion.sign * self.motion.frequency(at - self.since)

    @property
    def busy(self) -> bool:
        """Whether anything is under way."""
        return self.phase not in (Phase.IDLE, Phase.OFF)


class Happening(NamedTuple):
    """Something that took place: when (s), what, and at which step of a project (0: none).

    `kind` is "waits", "begins" (a step, with its outputs), "moved", "completed" (the notice), "ended" (a project, by
    itself), "stopped" (a project), "homed", or "rests" (manual motion is over).
    """

    at: float
    kind: str
    step: int = 0
