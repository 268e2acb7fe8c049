"""The memory of a controller: four stored projects, and one copy that is edited.

Commands that edit carry no project, and two of them are answered with one: so one project is selected, and a save puts
the edited copy into a slot. # assumption
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from motorbus.families.stepper.edits import edited
from motorbus.families.stepper.parameters import (
    PROJECTS,
    Project,
    Step,
    checked_order,
    encode_image,
    with_steps,
)
from motorbus.families.stepper.simulator.quirks import Quirks

EXAMPLE: Final = with_steps(
    Project(number=1, microsteps=8, step_angle=180, turn_distance=1),
    (Step(distance=1, direction=1, start_frequency=50, acceleration=30, speed=100, delay=1000),),
)
"""The values of the manual's examples."""


class Memory:
    """`stored` projects by number, the edited copy `working`, and the `selected` number.

    `selected_at_power_on` is 1. # assumption
    """

    def __init__(self, quirks: Quirks) -> None:
        self.quirks: Final = quirks
        self.order: Final = checked_order(quirks.dump_order)
        self.stored = dict.fromkeys(range(1, PROJECTS + 1), Project())
        if quirks.shipped == "example":
            self.stored[1] = EXAMPLE
        self.selected_at_power_on = 1
        self.power_on()

    def power_on(self) -> None:
        """What was not saved is lost."""
        self.selected = self.selected_at_power_on
        self.working = self.stored[self.selected]

    def project(self, number: int) -> Project:
        """What a start of this project runs: of the selected one its edits, assumption."""
        project = self.working if number == self.selected else self.stored[number]
        return replace(project, number=number)

    def image(self, number: int) -> bytes:
        """The 220 bytes that a read of this project shows."""
        is_edited = self.quirks.read_view == "working" and number == self.selected
        return encode_image(self.working if is_edited else self.stored[number], self.order)

    def edit(self, name: str, values: Mapping[str, int]) -> None:
        """Carry out a command that sets parameters."""
        if name == "select_project":
            self.selected = values["project"]
            if self.quirks.select == "load":
                self.working = self.stored[self.selected]
        self.working = edited(self.working, name, values)

    def put(self, number: int, project: Project) -> None:
        """Store a project; the edited copy of the selected one changes with it."""
        self.stored[number] = project
        if number == self.selected:
            self.working = project
