"""Everything a controller has stored, taken out and put back.

Each project is read until two dumps agree, for a copy that nobody can check later must be right when it is made. What
is put back is equal in all that has a name: bytes that the manual does not name cannot be written, and are told.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Final

from motorbus.core.steps import Emit, Exclusive, Progress, Sleep
from motorbus.errors import RequestError
from motorbus.families.stepper import wire
from motorbus.families.stepper.driver.costs import Taken, taken
from motorbus.families.stepper.driver.editing import (
    FLAGS,
    changes,
    differs,
    held,
    read_back,
    refuse_while_lent,
)
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.selecting import cleared, is_blank
from motorbus.families.stepper.driver.writing import Proof, Written, unwritable, written
from motorbus.families.stepper.program.backups import Backup
from motorbus.families.stepper.table import PROJECTS, Project, checked_project, decode_image, refusals

ALL: Final = tuple(range(1, PROJECTS + 1))


async def backup(node: Node, projects: Iterable[int] = ALL) -> Backup:
    """Read these projects, each until two dumps agree; about 0.5 s for each. Only reads.

    Edits of the selected project that were not saved are read in place of what is stored of it, or so it is assumed.
    Reports `Progress`. Raises RequestError for a number that is none, and while projects are lent to a motion that was
    cut off, for then it would keep what was lent; as `dump` else.
    """
    numbers = _numbers(projects)
    return await Exclusive(_read(node, numbers))


async def _read(node: Node, numbers: tuple[int, ...]) -> Backup:
    await refuse_while_lent(node, "backup", reads=True)
    dumps = {}
    for done, number in enumerate(numbers):
        await Emit(Progress(done, len(numbers), f"reading project {number}"))
        dumps[number] = wire.encode_dump(number, (await taken(node, number)).image)
    await Emit(Progress(len(numbers), len(numbers), "reading projects"))
    return Backup(dumps=dumps, order=node.order)


async def restore(node: Node, backup: Backup, projects: Iterable[int] | None = None) -> tuple[Written, ...]:
    """Put projects of a backup back, all that are in it when none are said: written, saved and read back, each in turn.

    As `write_project`, but rows behind the last step are put back too, and nothing is asked of lint: it was there
    before. What was cleared is cleared, project 1 as well. `Written.reserved` are the bytes that cannot be written and
    differ. Reports `Planned` and `Progress`. Raises RequestError, before anything is sent, for what no project can
    hold; as `write_project` and `clear` else, with a note that says which projects are restored; VerificationFailed
    also when stop mode, mode 4 or homing at power-on differ among them and this controller has one of each for all.
    """
    numbers = _numbers(backup.projects if projects is None else projects)
    meant = {number: replace(backup.project(number), number=number) for number in numbers}
    for project in meant.values():
        for error in () if project.is_cleared else refusals(project, expert=True):
            raise RequestError(
                f"project {project.number} of this backup cannot be written: {error.summary}",
                expected=error.expected,
                advice="restore the others; nothing was sent",
            )
    return await Exclusive(_restored(node, backup, meant))


async def _restored(node: Node, backup: Backup, meant: dict[int, Project]) -> tuple[Written, ...]:
    await refuse_while_lent(node, "restore")
    done: list[Written] = []
    try:
        for number, project in meant.items():
            began = await Sleep(0)
            found = await taken(node, number)
            image = backup.image(number)
            if project.is_cleared:
                done.append(await _emptied(node, found, number, image, began))
            else:
                done.append(await written(node, found, project, image, save=True, began=began))
        await _still_so(node, meant)
    except BaseException as error:
        told = ", ".join(str(one.project) for one in done) or "none"
        error.add_note(f"of the projects {', '.join(map(str, meant))} these were restored: {told}")
        raise
    return tuple(done)


async def _emptied(node: Node, found: Taken, number: int, image: bytes, began: float) -> Written:
    before = decode_image(found.image, node.order)
    commands, dumps, proof = 0, 0, Proof.UNCHANGED
    if not is_blank(before):
        commands, dumps = await cleared(node, number)
        proof = Proof.CLEARED
    ended = await Sleep(0)
    return Written(
        number, tuple(changes(before, Project())) if commands else (), commands, found.dumps + dumps, ended - began,
        bool(commands), proof, unwritable(found.image, image),
    )  # fmt: skip


async def _still_so(node: Node, meant: dict[int, Project]) -> None:
    """Flags that belong to the device are those of the project that was written last."""
    written_ones = [project for project in meant.values() if not project.is_cleared]
    if len({tuple(getattr(project, name) for name in FLAGS) for project in written_ones}) < 2:
        return
    for project in written_ones:
        image, _ = await read_back(node, project)
        if held(node, image, project.number) != project:
            raise differs(
                node, image, project, f"project {project.number} was restored and has changed with the others",
                "this controller has one stop mode, mode 4 and homing at power-on for all projects: say which is meant",
            )  # fmt: skip


def _numbers(projects: Iterable[int]) -> tuple[int, ...]:
    """These projects, each once, in the order they are said in. Raises RequestError for a number that is none."""
    return tuple(dict.fromkeys(checked_project(number) for number in projects))
