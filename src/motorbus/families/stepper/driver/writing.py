"""A program put into a controller: only what differs, read back before it is saved and after, and no more claimed.

The order is what makes it safe. The project is read until two dumps agree; what differs is sent, and read back as a
whole; then it is saved, and read back again. A controller that lost its supply in between has another project
selected, and saving would put that one's numbers into this slot: so the read-back comes right before the save, and the
one behind it tells when even that was too late.

Source of the commands: stepper controller serial protocol manual, items 1 to 12, 15, 16, 21, 25 and 26. That edits go
to a copy which saving keeps is an assumption, see `editing`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from enum import Enum
from typing import NamedTuple

from motorbus.core.register import Register, Value
from motorbus.core.steps import Emit, Exclusive, Sleep, catch
from motorbus.errors import MotorbusError, OutcomeUnknown, RequestError, WireError
from motorbus.families.stepper.driver.commands import save_project
from motorbus.families.stepper.driver.costs import Cost, Taken, taken
from motorbus.families.stepper.driver.editing import (
    FLAGS,
    Change,
    Readback,
    all_edits,
    brought,
    changes,
    differs,
    edits_to,
    held,
    noted,
    read_back,
    refuse_while_lent,
)
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.program import Conditions, Program
from motorbus.families.stepper.table import (
    BLANK,
    RESERVED,
    STEPS,
    Edit,
    Project,
    amended,
    checked_project,
    refusals,
)


class Proof(Enum):
    """What is known of a project when it has been written; the value says it, and says no more than that."""

    STORED = (
        "stored: the controller went on showing the old values until they were saved, so what it shows now is what it "
        "has stored"
    )
    ACKNOWLEDGED = (
        "what is being edited was read back as meant, and saving it was acknowledged; that it is stored is proved by a "
        "power cycle only"
    )
    NOT_SAVED = (
        "what is being edited was read back as meant; it was not saved, and a power cycle takes it away"
    )
    NOT_SEEN = (
        "every command was acknowledged; this controller shows what is stored, so what is being edited cannot be read; "
        "it was not saved, and a power cycle takes it away"
    )
    UNCHANGED = (
        "it read like this already, so nothing was written; edits that somebody else made and did not save read the "
        "same, and a power cycle takes those away"
    )
    AS_BEFORE = (
        "saving was acknowledged, and the project reads as before; whether that is what was meant nobody here knows, "
        "and that it is stored is proved by a power cycle only"
    )
    CLEARED = (
        "clearing was acknowledged, and the project reads as cleared; that it stays so is proved by a power cycle "
        "only"
    )


class Difference(NamedTuple):
    """What would be written, and what that takes.

    `changes` are the parameters by name, step and both values; `edits` the commands for them, the one that selects the
    project first. Where a reading shows nothing to change, and edits of this host that were not saved are to be saved,
    or undone unseen, `before` is the project as this host left it, and all of it is written. `reserved` are the bytes
    of the image that no command writes and that are not as in the program, or not 0 when that was not read from a
    controller: by offset, what the controller has there. `cost` is that of writing it as a whole, with the dumps
    before and after.
    """

    project: int
    before: Project
    after: Project
    changes: tuple[Change, ...]
    edits: tuple[Edit, ...]
    reserved: Mapping[int, int]
    cost: Cost

    def __bool__(self) -> bool:
        return bool(self.edits)

    def __str__(self) -> str:
        if not self:
            return f"project {self.project}: nothing differs"
        lines = [f"  {change}" for change in self.changes]
        return "\n".join([f"project {self.project}: {self.cost}", *lines])


class Planned(NamedTuple):
    """An event: this is about to be written; its handler returns before the first command leaves."""

    difference: Difference


class Written(NamedTuple):
    """What was written, and what is known of it.

    `changes` were planned; `more` are what the read-back showed to differ as well, once the project was selected: edits
    that were lost with that, another project's numbers, something that another program wrote; these were written too.
    `commands` that changed something and `dumps` that were read, `seconds` all of it took, `saved` whether it was
    saved now, `proof` how far that is known, `reserved` as in `Difference`.
    """

    project: int
    changes: tuple[Change, ...]
    commands: int
    dumps: int
    seconds: float
    saved: bool
    proof: Proof
    reserved: Mapping[int, int]
    more: tuple[Change, ...] = ()

    @property
    def shared(self) -> tuple[str, ...]:
        """The parameters among those written that may belong to the device, and so have changed for all projects."""
        return tuple(one.name for one in (*self.changes, *self.more) if one.name in FLAGS)

    def __str__(self) -> str:
        spent = Cost(self.commands, self.dumps, self.seconds)
        more = f" and {len(self.more)} more that the read-back showed to differ" if self.more else ""
        shared = f" ({', '.join(self.shared)}: perhaps for all projects)" if self.shared else ""
        return (
            f"project {self.project}, {len(self.changes)} changed{more}{shared}, {spent}: {self.proof.value}"
        )


class Kept(NamedTuple):
    """What came of saving: the image that was read at last, what was spent, and what is known."""

    image: bytes
    commands: int
    dumps: int
    proof: Proof


async def difference(
    node: Node, program: Program, project: int | None = None, *, save: bool = True
) -> Difference:
    """What `write_project` would write, and its cost; only reads.

    The cost is that of a controller that does as is assumed, or is known on this bus to show what is stored. One that
    does, or keeps another project's numbers when a project is selected, is found out while writing: 78 commands more.
    Raises RequestError as `write_project` does for what no project can hold, and as `dump`.
    """
    number, wanted = _wanted(program, project)
    found = await Exclusive(taken(node, number))
    return compared(node, found, _meant(node, found, wanted), program.raw, save=save)


async def write_project(
    node: Node, program: Program, project: int | None = None, *, save: bool = True, expert: bool = False
) -> Written:
    """Write a program into project 1 to 4, its own number when none is said, save it, and read it back.

    Only what differs is sent, nothing when nothing does; rows behind its last step stay as they are. All of it is sent
    where this host has left edits of this project unsaved that are to be saved now, or that cannot be read and are to
    be undone. Unless it is to `save`, a power cycle takes it away again. Edits of another project that were not saved
    are lost, for this selects its own. While a project runs, what edits do to it is not known. `expert` writes what
    lint calls an error, never what is out of range.

    An acknowledgement of the save that is lost is not believed to be either: unless what is stored can be read, all of
    it is written once more and saved once more, which does no harm, whereas saving alone would store another project
    here if the controller had lost its supply.

    Reports `Planned` before the first command, then `Progress`. Raises RequestError before anything is written, also
    while project 1 is lent to a motion that was cut off; VerificationFailed, with what the controller holds, when it
    does not read as it is meant; OutcomeUnknown when a command was never acknowledged. An error has a note that says
    what may be half written, and whether it was saved. Writing it again mends whatever an error has left.
    """
    number, wanted = _wanted(program, project)
    _linted(program, wanted, expert)
    return await Exclusive(_written(node, number, wanted, program.raw, save))


async def write(node: Node, /, *, project: int = 1, save: bool = True, **values: Value) -> Written:
    """Write parameters of a project by name, in API units, as `write_project` does: `write(step_3_delay=0.5)`.

    All are checked before anything is sent, each by itself; whether they make a good project is said by its lint, and
    starting it asks for that. A project that has been cleared needs its `total_steps` too.
    Raises RequestError for what is unknown, out of range or not written by name, and as `write_project`.
    """
    checked_project(project)
    raws = {name: _raw(node, node.table[name], value) for name, value in values.items()}
    return await Exclusive(_amended(node, project, raws, save))


async def written(
    node: Node, found: Taken, meant: Project, raw: bytes, *, save: bool, began: float
) -> Written:
    """Bring a project that was just read to `meant` in all ten rows, and save it. Call it inside `Exclusive`."""
    plan = compared(node, found, meant, raw, save=save)
    if not plan:
        unread = Readback(found.image, "untold", 0, 0)
        return await _done(plan, unread, found.dumps, began, Proof.UNCHANGED)
    alike = held(node, found.image, meant.number) == meant
    if not alike:
        node.memory.unsaved = None
    await Emit(Planned(plan))
    # nobody can ask which project is being edited: where the reading finds nothing to send, all of it is sent
    edited = await brought(node, found.image, meant, every=alike)
    if not save:
        node.memory.unsaved = meant
        proof = Proof.NOT_SEEN if edited.view == "stored" else Proof.NOT_SAVED
        return await _done(plan, edited, found.dumps, began, proof)
    kept = await saved(node, meant, edited)
    node.memory.unsaved = None
    spent = edited._replace(commands=edited.commands + kept.commands, dumps=edited.dumps + kept.dumps)
    return await _done(plan, spent, found.dumps, began, kept.proof, saved=True)


async def saved(node: Node, meant: Project, edited: Readback) -> Kept:
    """Save what has just been brought to be `meant`, and read it back. Raises as `write_project`."""
    kept = await noted(
        _saved(node, meant, edited),
        f"project {meant.number} was being saved: it may hold the old values or the new ones; read it, and write it "
        "again if it is not as meant",
    )
    if held(node, kept.image, meant.number) != meant:
        raise differs(
            node, kept.image, meant, f"project {meant.number} was saved and does not read as it was written",
            "what was read is what the controller shows now; write the project again, which sends what differs",
        )  # fmt: skip
    return kept._replace(proof=Proof.STORED) if edited.view == "stored" else kept


async def _saved(node: Node, meant: Project, edited: Readback) -> Kept:
    told = await catch(save_project(node, meant.number))
    if isinstance(told, MotorbusError) and not isinstance(told, OutcomeUnknown | WireError):
        raise told
    image, dumps = await read_back(node, meant)
    as_meant = held(node, image, meant.number) == meant
    if told is None or (as_meant and edited.view == "stored"):
        return Kept(image, 1, dumps, Proof.ACKNOWLEDGED)
    again = await brought(node, image, meant, every=True)
    await save_project(node, meant.number)
    image, last = await read_back(node, meant)
    return Kept(image, 2 + again.commands, dumps + again.dumps + last, Proof.ACKNOWLEDGED)


def compared(node: Node, found: Taken, meant: Project, raw: bytes, *, save: bool) -> Difference:
    """How a project that was just read differs from `meant`."""
    before, unsaved = held(node, found.image, meant.number), node.memory.unsaved
    edits = edits_to(before, meant)
    due = save if unsaved == meant else node.memory.shows_stored  # of what this host left unsaved
    if not edits and due and unsaved is not None and unsaved.number == meant.number:
        before, edits = unsaved, all_edits(meant)
    saves = 1 if save and edits else 0
    commands = 0 if not edits else len(all_edits(meant)) if node.memory.shows_stored else len(edits)
    dumps = found.dumps + (1 + saves if edits else 0)
    cost = found.tempo.cost(commands + saves, dumps, saves)
    reserved = unwritable(found.image, raw)
    return Difference(
        meant.number, before, meant, tuple(changes(before, meant)), tuple(edits), reserved, cost
    )


def unwritable(image: bytes, wanted: bytes) -> dict[int, int]:
    """The bytes that no command writes and that are not as wanted, 0 where nothing is: offset -> what is there."""
    other = wanted or BLANK
    return {at: image[at] for run in RESERVED for at in run if image[at] != other[at]}


async def _written(node: Node, number: int, wanted: Project, raw: bytes, save: bool) -> Written:
    await refuse_while_lent(node, "write_project")
    began = await Sleep(0)
    found = await taken(node, number)
    return await written(node, found, _meant(node, found, wanted), raw, save=save, began=began)


async def _amended(node: Node, number: int, raws: Mapping[str, int], save: bool) -> Written:
    await refuse_while_lent(node, "write")
    began = await Sleep(0)
    found = await taken(node, number)
    before = held(node, found.image, number)
    if before.is_cleared and "total_steps" not in raws:
        raise RequestError(
            f"project {number} has been cleared, and a project needs steps",
            expected="total_steps among the parameters, 1 to 10",
            advice="nothing was written",
            node=node.node,
        )
    meant = amended(before, raws)
    return await written(node, found, meant, found.image, save=save, began=began)


async def _done(
    plan: Difference, spent: Readback, before: int, began: float, proof: Proof, *, saved: bool = False
) -> Written:
    now = await Sleep(0)
    dumps = before + spent.dumps
    return Written(
        plan.project,
        plan.changes,
        spent.commands,
        dumps,
        now - began,
        saved,
        proof,
        plan.reserved,
        spent.more,
    )


def _wanted(program: Program, project: int | None) -> tuple[int, Project]:
    """The number and the numbers to write. Raises RequestError for what no project can hold."""
    number = checked_project(program.project.number if project is None else project)
    wanted = replace(program.project, number=number)
    if wanted.is_cleared:
        raise RequestError(
            f"there is nothing to write into project {number}: the program has no steps",
            expected=f"1 to {STEPS} steps",
            advice="clear() makes a project empty; nothing was sent",
        )
    if len(wanted.steps) != STEPS:
        raise RequestError(
            f"a project has {STEPS} rows of steps and not {len(wanted.steps)}",
            expected="total_steps says how many of them are carried out",
            advice="nothing was sent",
        )
    for error in refusals(wanted, expert=True):
        raise error
    return number, wanted


def _linted(program: Program, wanted: Project, expert: bool) -> None:
    judged = replace(program, project=wanted)
    errors = [str(found) for found in judged.lint(Conditions()) if found.level == "error"]
    if errors and not expert:
        raise RequestError(
            f"the program for project {wanted.number} would not do what it says: {errors[0]}",
            expected=f"no errors of lint; it has {len(errors)}",
            advice="lint() names them all; with expert=True it is written all the same; nothing was sent",
        )


def _meant(node: Node, found: Taken, wanted: Project) -> Project:
    """With the rows behind the last step as the controller has them."""
    there = held(node, found.image, wanted.number)
    return replace(wanted, steps=wanted.steps[: wanted.total_steps] + there.steps[wanted.total_steps :])


def _raw(node: Node, row: Register, value: Value) -> int:
    """The raw value to write. Raises RequestError when this may not be written by name."""
    refusal = "" if row.writable else "it is set by selecting the project"
    if row.protected:
        refusal = "write a program that says it; see its note in the table for what it does"
    if refusal:
        raise RequestError(f"{row.name} is not written by name: {refusal}", advice="nothing was sent")
    raw = node.raw(row, value)
    row.encode(raw, row.given(value))  # raises when it is out of range
    return raw
