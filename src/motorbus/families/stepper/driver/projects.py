"""Projects: read, write, clear, back up and restore, each verified.

A dump has no checksum: two equal dumps count, and one if it is as wanted. An acknowledgement repeats no value, so every
write is read back. Edits go to a copy that a save stores; the first edit selects the project, and whether that loads
what is stored is an assumption. So a project that does not read as wanted after the edits is written in full, once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final, NamedTuple

from motorbus.core.access import writable_values
from motorbus.core.register import Value
from motorbus.core.request import Request
from motorbus.core.steps import ASKED, READABLE, Emit, Exclusive, JournalEntry, Progress, catch
from motorbus.errors import (
    FramingError,
    OutcomeUnknown,
    RequestError,
    UnexpectedReply,
    VerificationFailed,
    WireError,
)
from motorbus.families.stepper import parameters
from motorbus.families.stepper.driver.io import read_input
from motorbus.families.stepper.driver.node import Node, command, ignore
from motorbus.families.stepper.driver.stop import check_free
from motorbus.families.stepper.parameters import PROJECTS, STEPS, Project, check_value, differences
from motorbus.families.stepper.program.backup import Backup
from motorbus.families.stepper.program.file import Program
from motorbus.families.stepper.protocol import REPLY_LENGTH, Edit, edits, edits_between

READINGS: Final = 5  # dumps of which two must be equal
TRIES: Final = 3  # of a save; flash wears
MANUAL: Final = 1  # the project from whose step 1 manual motion takes distance and speed

Changes = Mapping[str, tuple[int, int]]
"""Parameter name -> raw value before and after."""


class Written(NamedTuple):
    """The result of a write. `proof` is what is known:

    unchanged  it read as wanted, so nothing was sent; edits of another program that were not saved read the same
    edited     it reads as wanted, and power-off loses it
    saved      it reads as wanted after the save was acknowledged
    """

    project: int
    changes: Changes
    proof: str


# -- read --------------------------------------------------------------------------------------------------------------


def dump_once(node: Node, project: int) -> Request[bytes]:
    """The 226 bytes of project 1 to 4 (item 15), read once."""
    return command(node, "read_project", bytes, project=project)


async def dump(node: Node, project: int = 1) -> bytes:
    """The 226 bytes of project 1 to 4 by two equal readings, about 0.5 s.

    Raises FramingError if no two of five readings are equal, UnexpectedReply for the image of another project.
    """
    seen: list[bytes] = []
    while (data := await dump_once(node, project)) not in seen:
        seen.append(data)
        if len(seen) == READINGS:
            raise FramingError(
                f"project {project} read different {READINGS} times",
                cause="the line damages bytes, and a dump has no checksum",
                advice="check cable and ground",
                node=node.node,
            )
    found = parameters.decode_image(data[REPLY_LENGTH:], node.order)
    if found.number != project and not found.is_cleared:
        raise UnexpectedReply(
            f"the dump of project {project} is of project {found.number}", received=data, node=node.node
        )
    node.state.projects[project] = replace(found, number=project)
    return data


async def read_image(node: Node, number: int) -> Project:
    """A project by two equal dumps. Raises as `dump`."""
    data = await dump(node, number)
    return replace(parameters.decode_image(data[REPLY_LENGTH:], node.order), number=number)


async def cached(node: Node, number: int) -> Project:
    """A project as it was read last, else by two dumps.

    An input is read first: after a missing reply or a reconnect the bus then probes, which forgets the projects. With
    edits that are not saved the dumps are read: a power-off between two commands loses them without a missing reply.
    """
    if node.state.is_edited:
        node.state.projects.pop(number, None)
    elif number in node.state.projects:
        await read_input(node, 1)
    return node.state.projects.get(number) or await read_image(node, number)


async def read_project(node: Node, project: int = 1) -> Program:
    """Project 1 to 4 as a program (item 15); one that was cleared or erased has no steps. Raises as `dump`."""
    return Program.from_dump(await dump(node, project), name=f"project {project}", order=node.order)


async def read(node: Node, /, *names: str, project: int = 1) -> dict[str, Value]:
    """Parameters of a project in API units by name; without a name all. Raises as `dump`, RequestError for a name."""
    raws = await read_raw(node, *names, project=project)
    return {name: node.table[name].to_value(raw) for name, raw in raws.items()}


async def read_raw(node: Node, /, *names: str, project: int = 1) -> dict[str, int]:
    """Parameters of a project as raw values by name; see `read`."""
    rows = [node.table[name] for name in names or node.table]
    values = parameters.values_of(await read_image(node, project))
    return {row.name: values[row.name] for row in rows}


# -- edit, and read back -----------------------------------------------------------------------------------------------


async def read_back(node: Node, wanted: Project) -> Project:
    """The project of this number as it reads now: by one dump if it is as wanted, else by two equal ones."""
    data = await dump_once(node, wanted.number)
    if replace(parameters.decode_image(data[REPLY_LENGTH:], node.order), number=wanted.number) != wanted:
        return await read_image(node, wanted.number)
    node.state.projects[wanted.number] = wanted
    return wanted


async def bring(node: Node, before: Project, wanted: Project) -> bool:
    """Edit a project until it reads as wanted, without a save. False: it still reads as `before`.

    What differs is edited, then everything, each followed by a read; everything at once if nothing differs. A
    controller that reads as before after both shows what is stored, so its edits cannot be read. Raises
    VerificationFailed if it reads as neither, OutcomeUnknown for a command without an acknowledgement. Call it inside
    `Exclusive`.
    """
    for orders in (edits_between(before, wanted), edits(wanted)):
        if orders:
            await _send(node, wanted.number, orders)
            found = await read_back(node, wanted)
            if found == wanted:
                return True
    if found == before:
        return False
    raise _different(node, wanted, found, "it was edited; power-off brings back what is stored")


async def _send(node: Node, project: int, orders: list[Edit]) -> None:
    requests = []
    for edit in orders:
        values: dict[str, Any] = dict(edit.values)
        requests.append(command(node, edit.command, ignore, expert=True, **values))
    for done, request in enumerate(requests, 1):
        await request
        await Emit(Progress(done, len(requests), f"writing project {project}"))


def _different(node: Node, wanted: Project, found: Project, state: str) -> VerificationFailed:
    wrong = [f"{name}: {old} -> {new}" for name, (old, new) in differences(wanted, found).items()]
    return VerificationFailed(
        f"project {wanted.number} reads different from what was written: {state}",
        expected=f"(wanted -> read) {'; '.join(wrong)}",
        cause="it lost its supply, another program edits it, it refuses a value, or dump_order is wrong",
        advice="write it again",
        node=node.node,
    )


# -- write -------------------------------------------------------------------------------------------------------------


async def write_project(
    node: Node, program: Program, project: int | None = None, *, save: bool = True, expert: bool = False
) -> Written:
    """Write a program into project 1 to 4 (None: its own number), read it back, save it, read it back again.

    Only what differs is written; steps beyond the last are kept. A controller has one copy that is edited: edits of
    another project that were not saved are lost. `expert` allows errors of lint. Reports `Progress`. Raises
    RequestError, with nothing written; VerificationFailed if it reads different after three tries; OutcomeUnknown for a
    command without an acknowledgement. A second call completes what an error has left, and saves what was not saved.
    """
    number, change = _merge(program, project, expert)
    return await Exclusive(_write(node, "write_project", number, change, save))


async def difference(node: Node, program: Program, project: int | None = None) -> Changes:
    """What `write_project` would change. Only reads. Raises as it does before anything is written."""
    number, change = _merge(program, project, True)
    before = await read_image(node, number)
    return differences(before, change(before))


async def write(node: Node, /, *, project: int = 1, save: bool = True, **values: Value) -> Written:
    """Write parameters of a project by name, in API units: `write(project=2, step_3_delay=0.5)`; see `write_project`.

    Raises RequestError for what is unknown, out of range or not written by name, and for a project without steps unless
    `total_steps` is among them.
    """
    check_value("project", project)
    methods = {"mode4": "write_project()", "power_on_home": "write_project()"}
    rows = writable_values(node.table, values, node.raw, node=node.node, methods=methods)
    raws = {row.name: raw for row, raw in rows}
    for name, raw in raws.items():
        if name.endswith("_input"):
            _, step, field = name.split("_", 2)
            check_value(field, raw, step=int(step))

    def change(before: Project) -> Project:
        if before.is_cleared and "total_steps" not in raws:
            raise RequestError(f"project {project} has no steps", advice="write total_steps, 1 to 10, too")
        return parameters.amended(_without_erased(before), raws)

    return await Exclusive(_write(node, "write", project, change, save))


def _merge(program: Program, project: int | None, expert: bool) -> tuple[int, Callable[[Project], Project]]:
    """The number of the project to write, and what it becomes. Raises RequestError for what cannot be written."""
    number = program.project.number if project is None else project
    check_value("project", number)
    wanted = replace(program.project, number=number)
    for error in parameters.check_project(wanted, expert=True):
        raise error
    errors = [str(one) for one in program.lint() if one.level == "error"]
    if errors and not expert:
        raise RequestError(
            f"the program has errors: {'; '.join(errors)}", advice="correct it, or say expert=True"
        )

    def change(before: Project) -> Project:
        return replace(wanted, steps=wanted.used + _without_erased(before).steps[wanted.total_steps :])

    return number, change


def _without_erased(project: Project) -> Project:
    """The project; 0 in place of the values of erased memory, which no write may keep."""
    return Project(number=project.number) if project.total_steps > STEPS else project


async def _write(
    node: Node, verb: str, number: int, change: Callable[[Project], Project], save: bool
) -> Written:
    await check_free(node, verb)
    before = await read_image(node, number)
    wanted = change(before)
    changes = differences(before, wanted)
    is_unsaved = node.state.is_edited and node.state.selected == number
    if not changes and not (save and is_unsaved):
        return Written(number, {}, "unchanged")
    if save:
        await _store(node, before, wanted)
        return Written(number, changes, "saved")
    await bring(node, before, wanted)
    return Written(number, changes, "edited")


async def _store(node: Node, before: Project, wanted: Project) -> None:
    """Edit, read back, save, read back.

    A save without an acknowledgement is followed by all edits: a controller that lost its supply has another project
    selected, and a save alone would store that one.
    """
    for _ in range(TRIES):
        shows_edits = await bring(node, before, wanted)
        error = await catch(command(node, "save_project", ignore, project=wanted.number))
        if error is not None and not isinstance(error, OutcomeUnknown | WireError):
            raise error
        before = await read_back(node, wanted)
        if before == wanted and (error is None or not shows_edits):
            return
    raise _different(node, wanted, before, f"saved {TRIES} times")


# -- clear, back up, restore -------------------------------------------------------------------------------------------


async def clear(node: Node, project: int, *, expert: bool = False) -> Written:
    """Set all of project 1 to 4 to zero, stored and edited, and read it back (item 17a).

    Raises RequestError for project 1 unless `expert`: manual motion takes its speed from it. Raises VerificationFailed
    if it does not read as cleared, OutcomeUnknown without an acknowledgement in two tries.
    """
    check_value("project", project)
    if project == MANUAL and not expert:
        raise RequestError(
            "project 1 is kept: manual motion takes its speed from it", advice="say expert=True"
        )
    return await Exclusive(_clear(node, project))


async def _clear(node: Node, number: int) -> Written:
    await check_free(node, "clear")
    before, blank = await read_image(node, number), Project(number=number)
    if _is_blank(before):
        return Written(number, {}, "unchanged")
    try:
        await command(node, "clear_project", ignore, project=number)
    except (OutcomeUnknown, WireError):
        await command(node, "clear_project", ignore, project=number)  # twice is as once
    found = await read_image(node, number)
    if not _is_blank(found):
        raise _different(node, blank, found, "it was cleared")
    return Written(number, differences(before, blank), "saved")


def _is_blank(project: Project) -> bool:
    """Nothing is left of it, except flags that may belong to the device."""
    return replace(project, number=0, stop_mode=0, mode4=0, power_on_home=0) == Project()


async def backup(node: Node) -> Backup:
    """Read all projects, each by two equal dumps; only reads.

    Edits that were not saved are read in place of what is stored, an assumption. Reports `Progress`. Raises
    RequestError while project 1 is in use by an unfinished motion; else as `dump`.
    """

    async def read_all() -> Backup:
        await Emit(JournalEntry("backup", ASKED, {"node": node.node, READABLE: True}))
        dumps = {}
        for number in range(1, PROJECTS + 1):
            dumps[number] = await dump(node, number)
            await Emit(Progress(number, PROJECTS, "reading projects"))
        return Backup(dumps=dumps, order=node.order)

    return await Exclusive(read_all())


async def restore(node: Node, backup: Backup) -> tuple[Written, ...]:
    """Write the projects of a backup, save them and read them back, one after the other.

    Steps beyond the last are written too, a project that was cleared or erased is cleared, and lint is not asked. Bytes
    that the manual does not name cannot be written. Raises RequestError, with nothing sent, for numbers that no request
    can carry; else as `write_project`, with a note that names the restored projects.
    """
    wanted = [replace(backup.project(number), number=number) for number in backup.projects]
    for project in wanted:
        errors = parameters.check_project(replace(project, total_steps=STEPS), expert=True)
        for error in [] if project.is_cleared else errors:
            error.add_note(f"project {project.number} of the backup")
            raise error
    done: list[Written] = []

    async def restore_one(project: Project) -> Written:
        if project.is_cleared:
            return await _clear(node, project.number)
        return await _write(node, "restore", project.number, lambda before: project, True)

    async def restore_all() -> tuple[Written, ...]:
        for project in wanted:
            done.append(await restore_one(project))  # noqa: PERF401 - kept for the note of an error
        return tuple(done)

    try:
        return await Exclusive(restore_all())
    except BaseException as error:
        error.add_note(f"restored: {', '.join(str(one.project) for one in done) or 'no project'}")
        raise
