"""Selecting, saving and clearing a project by itself: three short commands, each of which does more than it says.

Selecting carries the number of steps and sets it. Saving stores whatever is being edited, under any number, so the
wrong project in the right place if it is not the one that is selected. Clearing project 1 takes the speed of jog,
single move and homing with it. So each reads the project first, and again when it is done.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final, NamedTuple

from motorbus.core.steps import Emit, Exclusive, Sleep, catch
from motorbus.errors import OutcomeUnknown, RequestError, WireError
from motorbus.families.stepper.driver import commands
from motorbus.families.stepper.driver.costs import taken
from motorbus.families.stepper.driver.editing import (
    Change,
    changes,
    differs,
    held,
    noted,
    read_back,
    read_until,
    refuse_while_lent,
    selected,
)
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.reading import image
from motorbus.families.stepper.driver.writing import Proof, Written, unwritable, written
from motorbus.families.stepper.table import PROJECTS, Project, checked_project, decode_image, encode_image

JOGS: Final = 1
"""The project whose step 1 says how manual motion goes."""


class EditsLost(NamedTuple):
    """An event: selecting a project has loaded what is stored of it, and these edits of it were not saved."""

    project: int
    changes: tuple[Change, ...]


async def select(node: Node, project: int) -> int:
    """Select a project, 1 to 4, without changing what is stored of it; gives how many steps it has.

    It is read before, for the command says how many steps there are, and read after. Edits that were not saved are
    lost, and reported as `EditsLost`. Raises RequestError for one that has been cleared, which has none to say;
    VerificationFailed when it reads as another project does: then this controller goes on editing that one's numbers
    under this number.
    """
    checked_project(project)
    return await Exclusive(_selected(node, project))


async def _selected(node: Node, project: int) -> int:
    await refuse_while_lent(node, "select")
    before = held(node, (await taken(node, project)).image, project)
    if before.is_cleared:
        raise RequestError(
            f"project {project} has been cleared: selecting it would give it a step",
            expected="a project with steps",
            advice="write it; nothing was changed",
            node=node.node,
        )
    await selected(node, before)
    shown = held(node, (await read_back(node, before))[0], project)
    if shown != before:
        await _told_apart(node, before, shown)
    return before.total_steps


async def _told_apart(node: Node, before: Project, shown: Project) -> None:
    """It reads otherwise once it is selected: its own edits were lost, or what is edited is another project's."""
    others = [number for number in range(1, PROJECTS + 1) if number != before.number]
    for number in others:
        theirs = decode_image(await image(node, number), node.order)
        if replace(theirs, number=before.number, total_steps=before.total_steps) == shown:
            raise differs(
                node, encode_image(shown, node.order), before,
                f"project {before.number} was selected and reads as project {number} does",
                "save nothing now; write_project writes whole projects on such a controller, and a power cycle brings "
                "back what is stored",
            )  # fmt: skip
    node.memory.unsaved = None
    await Emit(EditsLost(before.number, tuple(changes(before, shown))))


async def save(node: Node, project: int, *, expert: bool = False) -> Written:
    """Save what this host has edited of a project, 1 to 4, and not saved, as `write_project` saves what it writes.

    All of it is written once more before, behind the command that selects it: nobody can ask which project is being
    edited, and whichever that is would be stored. It is refused when
    this host left nothing of this project unsaved: whatever else is being edited would be stored in its place. An
    `expert` may do that; then all that can be verified is that it reads as before, and an acknowledgement that is lost
    is not asked for again.
    Raises RequestError, and as `write_project`.
    """
    number = checked_project(project)
    meant = node.memory.unsaved
    if meant is not None and meant.number == number:
        return await Exclusive(_kept(node, meant))
    if expert:
        return await Exclusive(_saved_as_is(node, number))
    raise RequestError(
        f"nothing of project {number} was edited on this bus and left unsaved",
        expected="edits of this host: saving stores whatever is being edited, also another project",
        advice="write_project() saves what it writes; with expert=True it is saved all the same; nothing was sent",
        node=node.node,
    )


async def _kept(node: Node, meant: Project) -> Written:
    await refuse_while_lent(node, "save")
    began = await Sleep(0)
    found = await taken(node, meant.number)
    return await written(node, found, meant, found.image, save=True, began=began)


async def _saved_as_is(node: Node, project: int) -> Written:
    await refuse_while_lent(node, "save")
    began = await Sleep(0)
    found = await taken(node, project)
    before = held(node, found.image, project)
    note = f"project {project} was being saved: what it holds is not known; read it"
    await noted(commands.save_project(node, project), note)
    now, dumps = await noted(read_back(node, before), note)
    if held(node, now, project) != before:
        raise differs(
            node, now, before, f"project {project} was saved and does not read as before",
            "another project was being edited, or this controller shows what is stored; write it if it is not as meant",
        )  # fmt: skip
    ended = await Sleep(0)
    spent = found.dumps + dumps
    return Written(project, (), 1, spent, ended - began, True, Proof.AS_BEFORE, unwritable(now, b""))


async def clear(node: Node, project: int, *, expert: bool = False) -> bytes:
    """Set all of a project, 1 to 4, to zero, stored and edited; gives the 220 bytes it had, which `Program` reads.

    Nothing is sent when it reads as cleared already. Project 1 is refused but to an `expert`: jog, single move and
    homing go by its step 1, and without it have no speed. Verified by reading it: zero in all that has a name, but for
    stop mode, mode 4 and homing at power-on, where these belong to the device. Saying it twice does no more than once,
    whichever project is selected, so an acknowledgement that is lost is asked for again.
    Raises RequestError for project 1; VerificationFailed when it does not read as cleared; OutcomeUnknown when it was
    not acknowledged in two tries.
    """
    number = checked_project(project)
    if number == JOGS and not expert:
        raise RequestError(
            f"project {number} is not cleared: jog, single move and homing take their speed from its step 1",
            expected="project 2, 3 or 4",
            advice="with expert=True it is cleared all the same; nothing was sent",
            node=node.node,
        )
    return await Exclusive(_emptied(node, number))


async def _emptied(node: Node, project: int) -> bytes:
    await refuse_while_lent(node, "clear")
    found = await taken(node, project)
    if not is_blank(decode_image(found.image, node.order)):
        await cleared(node, project)
    return found.image


async def cleared(node: Node, project: int) -> tuple[int, int]:
    """Clear a project and read it; gives how many commands and dumps that took. Call it inside `Exclusive`."""
    note = f"project {project} was being cleared: it may hold what it held, or nothing"
    tries = await noted(_until_cleared(node, project), note)
    now, dumps = await noted(read_until(node, project, is_blank), note)
    if not is_blank(decode_image(now, node.order)):
        raise differs(
            node, now, Project(), f"project {project} was cleared and does not read as cleared",
            "what was read is what the controller shows now; clear it again",
        )  # fmt: skip
    if node.memory.unsaved is not None and node.memory.unsaved.number == project:
        node.memory.unsaved = None
    return tries, dumps


async def _until_cleared(node: Node, project: int) -> int:
    told = await catch(commands.clear_project(node, project))
    if told is None:
        return 1
    if not isinstance(told, OutcomeUnknown | WireError):
        raise told
    await commands.clear_project(node, project)
    return 2


def is_blank(project: Project) -> bool:
    """Whether nothing is left of it; its number may be, and what may belong to the device."""
    return replace(project, number=0, stop_mode=0, mode4=0, power_on_home=0) == Project()
