"""A bench with a project to run, and other operations beside the run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from motorbus.core.request import Data
from motorbus.core.steps import Gather, Procedure, Sleep, gather
from motorbus.families.stepper import driver
from motorbus.families.stepper.driver import Ran
from motorbus.families.stepper.execution import Happening
from motorbus.families.stepper.table import Project, Step, decode_image, with_steps
from motorbus.link.base import Delivery, PerfectLine, Side
from tests.families.stepper.bench import Bench
from tests.protocol.stepper.execution.course import GEOMETRY
from tests.protocol.stepper.vectors import DUMP_A, DUMP_B

READ_1 = "FF AA 3E 01 00 00 00 00 00 00 E8"
START_1 = "FF AA 4E 01 00 00 00 00 00 00 F8"
STOPS = ["FF AA 5E 00 00 00 00 00 00 00 07", "FF AA 03 0D 00 00 00 00 00 00 B9"]
A = decode_image(DUMP_A[6:])
B = decode_image(DUMP_B[6:])
TURN = Step(distance=1600, speed=60, start_frequency=400, acceleration=100)
"""A turn in a little more than a second."""


def made(*steps: Step, **values: Any) -> Project:
    return replace(with_steps(GEOMETRY, steps or (TURN,)), **values)


class Running(Bench):
    """A bench whose controller has this project, and has been heard of."""

    def __init__(self, project: Project = A, **options: Any) -> None:
        super().__init__(**options)
        self.number = project.number
        self.kept: list[Happening] = []
        self.simulated.put(project.number, project)
        self.device.ping()
        self.sent()

    def __enter__(self) -> Running:
        return self

    def __exit__(self, *exc: object) -> None:
        self.bus.close()

    def go(self, **options: Any) -> Ran:
        return self.device.run(self.number, **options)

    def beside(self, *others: Procedure[Any], **options: Any) -> Ran:
        """The run, with other operations on the same bus."""
        both: Gather[Any] = gather(driver.run(self.device, self.number, **options), *others)
        found = self.run(both)
        assert isinstance(found[0], Ran)
        return found[0]

    def power_cycle(self) -> None:
        """Take the supply away and give it back; `kept` has what happened before, which the controller forgets."""
        self.simulated.unplug()
        self.kept += self.simulated.told
        self.simulated.plug()

    @property
    def owed(self) -> bool:
        return self.device.memory.owed

    @property
    def starts(self) -> int:
        return sum(frame.startswith("FF AA 4E") for frame in self.sent())

    def told(self, kind: type[Any]) -> list[Any]:
        return [event for event in self.events if isinstance(event, kind)]


async def later(seconds: float, do: Callable[[], Procedure[Any]]) -> Any:
    """Another operation, after a while."""
    await Sleep(seconds)
    return await do()


async def at(seconds: float, do: Callable[[], object]) -> None:
    """Something that happens to the controller, after a while."""
    await Sleep(seconds)
    do()


class Armed(PerfectLine):
    """Lets faults begin with the start of a project, so that what is read before is read well; `started` says when."""

    def __init__(self, **faults: Any) -> None:
        self.faults = faults
        self.there: Running | None = None
        self.started: list[float] = []

    def carry(self, sender: Side, data: Data, moment: float) -> list[Delivery]:
        if sender is Side.HOST and isinstance(data, bytes) and data[2] == 0x4E:
            self.started.append(moment)
            if self.there is not None:
                self.there.simulated.switch(**self.faults)
        return super().carry(sender, data, moment)


def armed(project: Project = A, options: dict[str, Any] | None = None, **faults: Any) -> Running:
    """A bench whose faults begin with the start."""
    line = Armed(**faults)
    line.there = Running(project, line=line, **(options or {}))
    return line.there
