"""Checks of a stepper controller: its stored projects and its home switch. Reads only."""

from __future__ import annotations

from collections import Counter
from typing import Final

from motorbus.core.findings import Check, Subject
from motorbus.families.stepper.driver import io, projects
from motorbus.families.stepper.parameters import HOME_INPUT, PROJECTS, Project
from motorbus.families.stepper.program.lint import lint
from motorbus.families.stepper.protocol import ONLY

FACTORY_ID: Final = ONLY
DUMPS: Final = 20  # of project 1; they have no checksum
FEWEST: Final = 3  # numbers that show the byte order of a dump


async def check(subject: Subject) -> None:
    """All checks of one controller."""
    node = subject.device
    dumps = Counter([await projects.dump_once(node, 1) for _ in range(DUMPS)])
    if len(dumps) > 1:
        evidence = f"{DUMPS - max(dumps.values())} of {DUMPS} dumps of project 1 differ"
        subject.add("line-noise", evidence)
        return
    for number in range(1, PROJECTS + 1):
        project = await projects.read_image(node, number)
        if _is_reversed(project):
            fix = f"open the bus with dump_order={'big' if node.order == 'little' else 'little'}"
            subject.add(
                "stepper-foreign", f"every number of project {number} is a multiple of 256", action=fix
            )
            return
        for one in lint(project):
            if one.level == "error" and not project.is_cleared:
                subject.add("project-error", f"project {number}: {one.text} ({one.rule})", one.reason)
        if number == 1 and project.power_on_home and not (await io.inputs(node, (HOME_INPUT,)))[HOME_INPUT]:
            subject.add("homing-not-seen", f"homing at power-on is set, input {HOME_INPUT} is not active")


def _is_reversed(project: Project) -> bool:
    """All numbers of several bytes would be small in the other byte order."""
    step = project.steps[0]
    numbers = [project.microsteps, project.turn_distance, step.distance, step.start_frequency, step.speed]
    used = [number for number in numbers if number]
    return len(used) >= FEWEST and all(number % 256 == 0 for number in used)


CHECKS: Final[tuple[Check, ...]] = (check,)
