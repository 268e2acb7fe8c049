"""The commands of the stepper controller that are cut off; see `tests/conformance/cuts.py`."""

from __future__ import annotations

from dataclasses import replace
from math import tau
from typing import Any

from motorbus.families.stepper import FAMILY
from motorbus.families.stepper.parameters import Project, Step, encode_image, with_steps
from motorbus.families.stepper.program.backup import Backup
from motorbus.families.stepper.program.file import Program
from tests.conformance.cuts import Call, Command

MANUAL = with_steps(
    Project(
        number=1, microsteps=8, step_angle=180, turn_distance=400, loop_first=1, loop_last=2, loop_count=3
    ),
    (
        Step(distance=7, direction=1, start_frequency=60, acceleration=40, speed=90, delay=300, output=2),
        Step(distance=50, start_frequency=50, acceleration=30, speed=120),
    ),
)
"""A project 1 in which every field that a motion changes has a value of its own."""
STORED = replace(MANUAL, number=2, turn_distance=77)
WRITTEN = replace(
    with_steps(STORED, (*STORED.steps[:1], Step(distance=56814, speed=300, start_frequency=200))), stop_mode=1
)
BACKUP = Backup(
    dumps={
        number: b"\xff\xaa\x3e" + bytes([number, 0, 0]) + encode_image(project)
        for number, project in {2: WRITTEN, 3: Project(), 4: replace(STORED, number=4)}.items()
    }
)


def stepper(method: str, *arguments: Any, name: str = "", selected: int = 1, **fields: Any) -> Command:
    def prepare(device: Any) -> None:
        device.store.selected_at_power_on = selected
        for number, project in {1: MANUAL, 2: STORED, 3: replace(STORED, number=3)}.items():
            device.put(number, project)
        device.power_cycle()

    def state(device: Any) -> object:
        return device.store.image(1), dict(device.store.stored), device.status()["phase"]

    return Command(
        name=f"stepper-{method}{name}",
        subject=FAMILY,
        ids=(1,),
        call=Call(method, arguments, fields.pop("options", {})),
        state=state,
        address=lambda device: (1, FAMILY.link.rate),
        contents=lambda device: (device.status(), dict(device.store.stored), dict(device.memory)),
        prepare=prepare,
        **fields,
    )


def motion(method: str, *arguments: Any, **fields: Any) -> Command:
    """A manual motion with temporary use of project 1."""
    return stepper(method, *arguments, journalled=True, **fields)


def edit(method: str, *arguments: Any, **fields: Any) -> Command:
    """A change of a project, which the next call completes."""
    return stepper(method, *arguments, guarded=False, **fields)


RELABELLED = {"select": "relabel"}
STORED_VIEW = {**RELABELLED, "read_view": "stored", "save_cut": "empty"}
HOMING = {"velocity": tau, "deadline": 5.0}
AT_HOME = {"home_switch": "wired", "home_at": -30}

COMMANDS = [
    motion("jog", tau, 0.5, pairs=50),
    motion("jog", tau, 0.5, name="-relabel", quirks=RELABELLED, selected=2, cuts=20, pairs=50),
    motion("move_by", -tau, options={"velocity": tau}, pairs=50),
    motion("home", options=HOMING, quirks=AT_HOME, then=Call("jog", (tau, 0.5)), cuts=40, pairs=50),
    motion("home", name="-relabel", options=HOMING, quirks={**AT_HOME, **RELABELLED}, selected=2,
         then=Call("jog", (tau, 0.5)), cuts=20),
    motion("run", 1, guarded=False, pairs=50),
    edit("write_project", Program(project=WRITTEN), atomic=True, restart=1, pairs=50),
    edit("write_project", Program(project=WRITTEN), name="-relabel", quirks=STORED_VIEW, selected=2, cuts=20),
    edit("restore", BACKUP, restart=1, cuts=40, pairs=50),
    edit("clear", 2, atomic=True, pairs=50),
]  # fmt: skip
