"""A controller for the tests of its machine: orders by name, its state, and all that happened, in order."""

from __future__ import annotations

from typing import Any

from motorbus.families.stepper import execution
from motorbus.families.stepper.execution import Behaviour, Happening, Next, State
from motorbus.families.stepper.table import Project, Step, with_steps

# one turn a second: 1600 pulses at 1600 Hz, without a ramp, so every time is plain to see
TURN = Step(distance=1600, speed=60, start_frequency=1600)
GEOMETRY = Project(number=1, microsteps=8, step_angle=180, turn_distance=1600, stop_mode=1)


def project(*steps: Step, **values: Any) -> Project:
    """A project of 1600 pulses a turn with these steps and an immediate stop, unless said otherwise."""
    made = with_steps(GEOMETRY, steps or (TURN,))
    return Project(**{**{name: getattr(made, name) for name in Project.__dataclass_fields__}, **values})


def step(**values: int) -> Step:
    """One turn in one second, with some numbers different."""
    return Step(**{**{name: getattr(TURN, name) for name in Step.__dataclass_fields__}, **values})


class Course:
    """What a controller goes through; `now` is the moment at which it is asked next."""

    def __init__(self, inputs: tuple[int, ...] = (), **how: Any) -> None:
        self.now = 0.0
        self.told: list[Happening] = []
        self.accepted = True
        self.state: State = execution.power_on(0.0, Behaviour(**how), inputs=frozenset(inputs)).state

    def __call__(self, name: str, *arguments: Any, **named: Any) -> Course:
        """Ask for something now: `course("start", project)`."""
        if name in ("set_input", "set_output", "jog", "start", "run_once", "home"):
            found: Next = getattr(execution, name)(self.state, *arguments, self.now, **named)
        else:
            found = getattr(execution, name)(self.state, self.now)
        return self._took(found)

    def wait(self, seconds: float) -> Course:
        """Let time pass."""
        self.now += seconds
        return self._took(execution.advance(self.state, self.now))

    def to_the_end(self) -> Course:
        """Let pass all that ends by itself."""
        while execution.due(self.state) < float("inf"):
            self.now = max(self.now, execution.due(self.state))
            self._took(execution.advance(self.state, self.now))
        return self

    def _took(self, found: Next) -> Course:
        self.state, self.accepted = found.state, found.accepted
        self.told += found.told
        return self

    @property
    def kinds(self) -> list[str]:
        """What happened, without when."""
        return [one.kind for one in self.told]

    @property
    def position(self) -> int:
        return self.state.position(self.now)

    def at(self, kind: str) -> list[float]:
        """When it happened, to a microsecond."""
        return [round(one.at, 6) for one in self.told if one.kind == kind]
