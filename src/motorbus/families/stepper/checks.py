"""Checks of a stepper controller: its stored projects and its home switch. Reads only."""

from __future__ import annotations

from typing import Final

from motorbus.core.findings import Check, Subject
from motorbus.errors import DeviceError, WireError
from motorbus.families.stepper.driver import io, projects
from motorbus.families.stepper.parameters import HOME_INPUT, PROJECTS, Project
from motorbus.families.stepper.program.lint import lint
from motorbus.families.stepper.protocol import ONLY

FACTORY_ID: Final = ONLY
FEWEST: Final = 3  # numbers that show the byte order of a dump


async def check(subject: Subject) -> None:
    """All checks of one controller."""
    node = subject.device
    for number in range(1, PROJECTS + 1):
        try:
            project = await projects.read_image(node, number)
        except (WireError, DeviceError) as error:
            cause = "another device, or the other byte order of dumps (dump_order=big)"
            subject.error("stepper-foreign", error.summary, cause, "check the device and its dump_order")
            return
        if project.is_cleared:
            continue
        if _is_reversed(project):
            cause = "the controller sends the other byte of a number first"
            other = "big" if node.order == "little" else "little"
            evidence = f"project {number}: every number is a multiple of 256"
            subject.error("stepper-foreign", evidence, cause, f"open the bus with dump_order={other}")
            return
        for one in lint(project):
            if one.level == "error":
                where = f"project {number}" + (f", step {one.step}" if one.step else "")
                fix = f"`motorbus stepper read {subject.where} --project {number}`, correct and write it"
                subject.warn("project-error", f"{where}: {one.text} ({one.rule})", one.reason, fix)
        if number == 1 and project.power_on_home:
            levels = await io.inputs(node, (HOME_INPUT,))
            if not levels[HOME_INPUT]:
                evidence = f"homing at power-on is set, input {HOME_INPUT} is not active"
                cause = "it still searches, the switch is not connected, or the motor has moved since"
                fix = f"move onto the switch and look at `motorbus stepper io {subject.where}`"
                subject.inform("homing-not-seen", evidence, cause, fix)


def _is_reversed(project: Project) -> bool:
    """All numbers of several bytes would be small in the other byte order."""
    step = project.steps[0]
    numbers = [project.microsteps, project.turn_distance, step.distance, step.start_frequency, step.speed]
    used = [number for number in numbers if number]
    return len(used) >= FEWEST and all(number % 256 == 0 for number in used)


CHECKS: Final[tuple[Check, ...]] = (check,)
