"""Checks of a stepper controller: its stored projects and its home switch. Reads only."""

from __future__ import annotations

from typing import Final

from motorbus.core.findings import Check, Subject
from motorbus.errors import DeviceError, WireError
from motorbus.families.stepper.driver import io, projects
from motorbus.families.stepper.parameters import HOME_INPUT, PROJECTS
from motorbus.families.stepper.program.lint import lint
from motorbus.families.stepper.protocol import ONLY

FACTORY_ID: Final = ONLY


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


CHECKS: Final[tuple[Check, ...]] = (check,)
