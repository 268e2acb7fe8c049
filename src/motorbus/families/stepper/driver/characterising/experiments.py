"""What can be tried on a controller to find out how it reads what its manual leaves open, and what would come of it.

A controller tells two things by itself: that it has heard, and that a project has ended. So an experiment is a small
project, a few commands at chosen moments, and the moments of their answers and of the notice. What each reading would
make of it is not argued but played with the same model that the simulator and the estimates have, in every combination
of the readings that could matter. A question has an answer when every combination that agrees with what was seen gives
the same one; else it stays open.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from itertools import product
from math import ceil
from typing import Any, Final, NamedTuple

from motorbus.errors import RequestError
from motorbus.families.stepper import execution
from motorbus.families.stepper.execution import USUAL, State
from motorbus.families.stepper.program.profile import Setting
from motorbus.families.stepper.table import Direction, Project, Step, with_steps

WAYS: Final[Mapping[str, tuple[Setting, ...]]] = {
    "rounding": ("trunc", "nearest", "carry"),
    "zero_distance": ("skip", "endless"),
    "seg_loop": ("total", "extra"),
    "proj_loop": ("total", "extra"),
    "motor_stop_ends_project": (True, False),
    "stop_project_scope": ("project", "all"),
    "busy": ("ignore", "silent", "restart"),
    "notice_on_stop": (False, True),
    "notice_on_once": (False, True),
    "clear_notice": (True, False),
}
"""The questions that experiments with the clock can answer, and the readings of each."""
FIFTHS: Final = 5
"""Parts into which one pulse is divided, so that pulses that are not whole can be asked for."""
SLOW_TURNS: Final = 0.3
"""Turns that all slow experiments together take at most, each way."""
SLACK: Final = 0.03
"""s by which an answer may be early or late: an adapter hands on what came every 16 ms."""
SLACK_PART: Final = 0.01
"""The same as a part of the time that passes."""
_LEAST_PULSES: Final = 200
_MOST_FREQUENCY: Final = 65535


class Motor(NamedTuple):
    """How the motor is told: what a project says of it, and what follows from that.

    `pulse` user units are one pulse, with `turn_distance` of them for a turn.
    """

    microsteps: int
    step_angle: int
    turn_distance: int
    pulse: int
    per_turn: Fraction

    @classmethod
    def of(cls, project: Project) -> Motor:
        """As a project has it. Raises RequestError when that is nothing to experiment with."""
        turn = project.pulses_per_turn
        if turn is None or turn < _LEAST_PULSES or FIFTHS * turn.numerator >= 1 << 24:
            shown = "none that can be said" if turn is None else f"{float(turn):g}"
            raise RequestError(
                f"project {project.number}: {shown} pulses for a turn of the motor",
                expected=f"{_LEAST_PULSES} or more, and such that a fifth of a pulse can be told",
                advice="name a scratch project that has the motor's microsteps and step angle",
            )
        return cls(
            project.microsteps,
            project.step_angle,
            FIFTHS * turn.numerator,
            FIFTHS * turn.denominator,
            turn,
        )

    def frequency(self, rpm: int) -> float:
        """Pulses per second at this speed."""
        return float(rpm * self.per_turn / 60)

    def step(self, pulses: Fraction | int, delay: int, *, rpm: int = 0, reverse: bool = False) -> Step:
        """A step of so many pulses at a steady speed, then a pause (ms); `rpm` 0 is about 1 kHz, and 60 RPM at most."""
        rpm = rpm or self.quick
        return Step(
            distance=int(pulses * self.pulse),
            direction=Direction.REVERSE if reverse else Direction.FORWARD,
            start_frequency=min(_MOST_FREQUENCY, ceil(self.frequency(rpm))),
            acceleration=1,
            speed=rpm,
            delay=delay,
        )

    def turns(self, pulses: int) -> float:
        """How far so many pulses turn it."""
        return float(pulses / self.per_turn)

    @property
    def quick(self) -> int:
        """RPM of about 1 kHz."""
        return max(1, min(60, round(60_000 / self.per_turn)))

    def slow(self, seconds: float) -> int:
        """Pulses of about so long a time at 1 RPM, which is the slowest there is."""
        return max(1, round(seconds * self.per_turn / 60))

    def project(self, number: int, *steps: Step, **values: int) -> Project:
        """A project for this motor, without loops unless `values` say so."""
        base = Project(
            number=number,
            microsteps=self.microsteps,
            step_angle=self.step_angle,
            turn_distance=self.turn_distance,
        )
        return replace(with_steps(base, steps), **values)  # type: ignore[arg-type]  # all numbers


class Act(NamedTuple):
    """A command, so many s after the first one."""

    at: float
    command: str


class Seen(NamedTuple):
    """What came of an experiment: which of its commands were answered, and when notices came (s after the first)."""

    answered: tuple[bool, ...]
    ends: tuple[float, ...]


class Trial(NamedTuple):
    """One experiment.

    `settles`  the questions it asks; `depends` others whose readings make a difference to it
    `project`  what is edited for it; one without steps is not written, and is one that the controller has
    `acts`     what is said, and when; `turns` how far the motor turns at most, in the experiment and its repetitions
    `needs`    what must be settled so before
    """

    name: str
    what: str
    settles: tuple[str, ...]
    depends: tuple[str, ...]
    project: Project
    acts: tuple[Act, ...]
    turns: float = 0.0
    needs: tuple[tuple[str, Setting], ...] = ()

    def ways(self, known: Mapping[str, Setting]) -> Iterator[dict[str, Setting]]:
        """Every combination of the readings that matter; what is known already has one."""
        names = (*self.settles, *self.depends)
        choices = [(known[name],) if name in known else WAYS[name] for name in names]
        for values in product(*choices):
            yield dict(zip(names, values, strict=True))

    def played(self, way: Mapping[str, Setting], at: tuple[float, ...]) -> Seen:
        """What a controller of this reading does when the commands come at these moments (s)."""
        readings: dict[str, Any] = dict(way)
        how = replace(USUAL, **readings)
        state, answered, ends = State(how=how), [], []
        for act, moment in zip(self.acts, at, strict=True):
            found = _done(state, act.command, self.project, moment)
            state = found.state
            answered.append(found.accepted or how.busy != "silent")
            ends += [one.at for one in found.told if one.kind == "completed"]
        found = execution.advance(state, at[-1] + 60.0)
        ends += [one.at for one in found.told if one.kind == "completed"]
        return Seen(tuple(answered), tuple(ends))

    def longest(self, known: Mapping[str, Setting]) -> float:
        """s after which nothing can come any more, whatever it reads."""
        at = tuple(act.at for act in self.acts)
        ends = [end for way in self.ways(known) for end in self.played(way, at).ends]
        return max(at[-1], *ends, 0.0)

    def most(self, known: Mapping[str, Setting]) -> int:
        """How many notices can come at most."""
        at = tuple(act.at for act in self.acts)
        return max(len(self.played(way, at).ends) for way in self.ways(known))


class Verdict(NamedTuple):
    """What an experiment says: answers, whether they rest on something that did not come, whether any reading does
    what was seen, and all that in words.
    """

    answers: Mapping[str, Setting]
    silent: bool
    fits: bool
    why: str


def judged(
    trial: Trial,
    known: Mapping[str, Setting],
    seen: list[tuple[tuple[float, ...], Seen]],
    least: float = 0.0,
) -> Verdict:
    """What all these repetitions agree on: for each, the moments of the commands and what was seen.

    `least` is the earliest moment at which a notice can be heard, behind the answer to the start.
    """
    ways = [(way, [trial.played(way, at) for at, _ in seen]) for way in trial.ways(known)]
    found = [one for _, one in seen]
    alike = [way for way, would in ways if all(map(_agrees, would, found, [least] * len(found)))]
    others = [would for way, would in ways if way not in alike]
    answers = {}
    for name in trial.settles:
        values = {way[name] for way in alike}
        if len(values) == 1:
            answers[name] = values.pop()
    silent = any(_lacks(one, it) for would in others for one, it in zip(found, would, strict=True))
    return Verdict(answers, silent, bool(alike), _told(found, [would[0] for would in others], bool(alike)))


def _agrees(would: Seen, seen: Seen, least: float) -> bool:
    return (
        would.answered == seen.answered
        and len(would.ends) == len(seen.ends)
        and all(
            abs(max(one, least) - other) <= SLACK + SLACK_PART * one
            for one, other in zip(would.ends, seen.ends, strict=True)
        )
    )


def _lacks(seen: Seen, would: Seen) -> bool:
    """Whether something of it is missing in what was seen."""
    unheard = any(due and not came for due, came in zip(would.answered, seen.answered, strict=True))
    return unheard or len(seen.ends) < len(would.ends)


def _told(seen: list[Seen], others: list[Seen], fits: bool) -> str:
    times = "once" if len(seen) == 1 else f"{len(seen)} times"
    text = f"seen {times}: {_described(seen[0])}"
    if not fits:
        return f"{text}; none of the readings does that each time"
    against = sorted({_described(one) for one in others} - {_described(seen[0])})
    return f"{text}; otherwise {' or '.join(against)}" if against else text


def _described(seen: Seen) -> str:
    ends = f"a notice after {', '.join(f'{end:.2f} s' for end in seen.ends)}" if seen.ends else "no notice"
    return ends if all(seen.answered) else f"{ends}, and one command not answered"


def _done(state: State, command: str, project: Project, at: float) -> execution.Next:
    if command == "start_project":
        return execution.start(state, project, at)
    if command == "run_once":
        return execution.run_once(state, project, at)
    return execution.stop_project(state, at) if command == "stop_project" else execution.stop_motor(state, at)
