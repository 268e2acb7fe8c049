"""What a controller remembers: four stored projects, and the one that is being edited.

The commands that edit carry no project number, and two of them are answered with one; so there is a selected project
and one copy of it that is edited, or so it is assumed. Saving puts that copy into a slot. Everything else is lost with
the supply.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import copy
from dataclasses import replace
from typing import Any, Final, cast

from motorbus.families.stepper.simulator.switches import Switches
from motorbus.families.stepper.table import (
    BLANK,
    PROJECTS,
    TABLE,
    Order,
    Project,
    Step,
    decode_image,
    edited,
    encode_image,
    with_steps,
)

FLAGS: Final = ("stop_mode", "mode4", "power_on_home")
"""What may belong to the device instead of to each project."""
EXAMPLE: Final = with_steps(
    Project(number=1, microsteps=8, step_angle=180, turn_distance=1),
    (Step(distance=1, direction=1, start_frequency=50, acceleration=30, speed=100, delay=1000),),
)
"""The values of the manual's examples."""


class Memory:
    """Four images and a working copy.

    `stored` are the images by project, 1 to 4; `working` is the image that is edited and `selected` its project. With
    flags that belong to the device, `flags` are those in force and every dump shows them.
    """

    def __init__(self, switches: Switches) -> None:
        self._switches = switches
        self._order = cast("Order", switches.dump_order)
        self.stored: dict[int, bytes] = dict.fromkeys(range(1, PROJECTS + 1), BLANK)
        if switches.shipped == "example":
            self.stored[1] = encode_image(EXAMPLE, self._order)
        self._stored_flags = dict.fromkeys(FLAGS, 0)
        self.flags = dict(self._stored_flags)
        self.selected = switches.selected_at_boot
        self.working = self.stored[self.selected]

    def copy(self) -> Memory:
        """One that goes its own way from now on."""
        twin = copy(self)
        twin.stored, twin.flags, twin._stored_flags = (
            dict(self.stored),
            dict(self.flags),
            dict(self._stored_flags),
        )
        return twin

    @property
    def _flags_are_shared(self) -> bool:
        return self._switches.flags_scope == "device"

    def restart(self) -> None:
        """The supply was away: what was not saved is lost."""
        self.selected = self._switches.selected_at_boot
        self.working = self.stored[self.selected]
        self.flags = dict(self._stored_flags)

    def image(self, number: int) -> bytes:
        """What reading this project shows."""
        shown = self._switches.read_view == "working" and number == self.selected
        image = self.working if shown else self.stored[number]
        if not self._flags_are_shared:
            return image
        return encode_image(self._with_flags(decode_image(image, self._order)), self._order, over=image)

    def project(self, number: int) -> Project:
        """What starting this project runs: what is edited of the selected one, of others what is stored."""
        image = self.working if number == self.selected else self.stored[number]
        project = decode_image(image, self._order)
        return self._with_flags(project) if self._flags_are_shared else project

    def _with_flags(self, project: Project) -> Project:
        changes: dict[str, Any] = self.flags
        return replace(project, **changes)

    def edit(self, command: str, values: Mapping[str, int]) -> None:
        """Carry out a command that sets parameters."""
        if command == "select_project":
            self.selected = values["project"]
            if self._switches.select == "load":
                self.working = self.stored[self.selected]
        if self._flags_are_shared and set(values) <= set(FLAGS):
            self.flags.update(values)
            return
        before = decode_image(self.working, self._order)
        self.working = encode_image(edited(before, command, values), self._order, over=self.working)

    def as_saved(self, number: int) -> bytes:
        """The image that saving as this project writes."""
        project = decode_image(self.working, self._order)
        return encode_image(replace(project, number=number), self._order, over=self.working)

    def save(self, number: int, image: bytes) -> None:
        """The image is in its slot."""
        self.stored[number] = image
        self._stored_flags = dict(self.flags)

    def clear(self, number: int) -> None:
        """All of a project is 0, what is being edited of it too."""
        self.stored[number] = BLANK
        if number == self.selected:
            self.working = BLANK

    def put(self, number: int, project: Project) -> None:
        """Store a project as if it had been written and saved."""
        self.stored[number] = encode_image(replace(project, number=number), self._order)
        if number == self.selected:
            self.working = self.stored[number]


class Rows(Mapping[str, int]):
    """The raw value of every row of the project that is being edited."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory

    def __getitem__(self, name: str) -> int:
        project = self._memory.project(self._memory.selected)
        row = TABLE[name]
        if not row.name.startswith("step_") or row.name == "step_angle":
            return int(getattr(project, row.name))
        _, number, field = row.name.split("_", 2)
        return int(getattr(project.step(int(number)), field))

    def __iter__(self) -> Iterator[str]:
        return iter(TABLE)

    def __len__(self) -> int:
        return len(TABLE)
