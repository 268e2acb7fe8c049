"""A project as numbers: what a controller stores of it, without a word about bytes.

The numbers are raw, as the controller has them, and named as the rows of the table. Any that fit their bytes can be
held, for a device may hold anything; what makes sense is said by the rows.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Final

from motorbus.core.register import shown
from motorbus.errors import RequestError
from motorbus.families.stepper.table.codes import ENDLESS, Direction

STEPS: Final = 10
"""Steps a project has room for."""
PROJECTS: Final = 4
HUNDREDTHS_PER_TURN: Final = 36000


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One step. Distance in user units, frequencies in Hz (pulses per second), speed in RPM, delay in ms."""

    distance: int = 0
    direction: int = 0
    start_frequency: int = 0
    acceleration: int = 0
    speed: int = 0
    output: int = 0
    delay: int = 0
    start_input: int = 0
    stop_input: int = 0

    @property
    def sign(self) -> int:
        """1 forward, -1 in reverse."""
        return -1 if self.direction == Direction.REVERSE else 1


EMPTY: Final = Step()


@dataclass(frozen=True, slots=True, kw_only=True)
class Project:
    """One project: 12 numbers of its own and always ten steps, of which the first `total_steps` are carried out.

    `step_angle` is in hundredths of a degree, `turn_distance` says how many user units make one turn of the motor.
    All zero is a project that has been cleared.
    """

    number: int = 0
    total_steps: int = 0
    loop_first: int = 0
    loop_last: int = 0
    loop_count: int = 0
    project_loop: int = 0
    microsteps: int = 0
    step_angle: int = 0
    turn_distance: int = 0
    stop_mode: int = 0
    mode4: int = 0
    power_on_home: int = 0
    steps: tuple[Step, ...] = field(default=(EMPTY,) * STEPS)

    def step(self, number: int) -> Step:
        """Step 1 to 10."""
        return self.steps[number - 1]

    def with_step(self, number: int, **values: int) -> Project:
        """The same project with some numbers of one step, 1 to 10, different."""
        steps = list(self.steps)
        steps[number - 1] = replace(steps[number - 1], **values)
        return replace(self, steps=tuple(steps))

    @property
    def pulses_per_turn(self) -> Fraction | None:
        """36000 * microsteps / step angle, exact; None when that cannot be said."""
        if not (self.microsteps and self.step_angle):
            return None
        return Fraction(HUNDREDTHS_PER_TURN * self.microsteps, self.step_angle)

    @property
    def pulses_per_unit(self) -> Fraction | None:
        """Pulses for one user unit, exact; None when that cannot be said."""
        turn = self.pulses_per_turn
        return turn / self.turn_distance if turn is not None and self.turn_distance else None

    @property
    def loop_is_on(self) -> bool:
        """Whether the step loop is carried out: 1 <= first <= last <= total, and a count. Else it is ignored."""
        return 1 <= self.loop_first <= self.loop_last <= self.total_steps and self.loop_count >= 1

    @property
    def is_endless(self) -> bool:
        """Whether only a stop ends it."""
        return self.project_loop == ENDLESS

    @property
    def is_cleared(self) -> bool:
        """Whether it has no steps to carry out."""
        return self.total_steps == 0


def checked_project(number: object) -> int:
    """The number of a project, 1 to 4. Raises RequestError for anything else."""
    if isinstance(number, int) and not isinstance(number, bool) and 1 <= number <= PROJECTS:
        return number
    raise RequestError(
        f"there is no project {shown(number)}", expected=f"1 to {PROJECTS}", advice="nothing was sent"
    )


def with_steps(project: Project, steps: tuple[Step, ...]) -> Project:
    """The project with these steps, at most ten, the rest empty; `total_steps` says how many."""
    return replace(project, total_steps=len(steps), steps=steps + (EMPTY,) * (STEPS - len(steps)))
