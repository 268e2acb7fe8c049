"""How what is being edited is brought to be as it is meant, and how one knows: by reading all of it back.

An acknowledgement repeats no value, and selecting a project does more than it says: it sets the number of steps, and
may load what is stored, or leave another project's numbers in place under a new name. So only what differs is sent,
then the whole project is read and compared, and where it is not as meant every field is sent. Nothing is saved here:
until somebody does, a power cycle brings back what is stored.

That edits go to a copy which is kept by saving alone is an assumption. So is that reading shows this copy; whether it
does is found out here each time, for a project that reads as it did before it was edited shows what is stored.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, Final, Literal, NamedTuple, TypeAlias

from motorbus.core.register import Register, Value
from motorbus.core.request import Priority, Request
from motorbus.core.steps import ASKED, READABLE, Emit, JournalEntry, Progress, Runnable
from motorbus.errors import RequestError, VerificationFailed
from motorbus.families.stepper import wire
from motorbus.families.stepper.driver.commands import nothing
from motorbus.families.stepper.driver.exchanges import T, command
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.reading import agreed, dump_once, readings
from motorbus.families.stepper.driver.turning import refuse_unless_idle
from motorbus.families.stepper.table import (
    EMPTY,
    STEPS,
    TABLE,
    Edit,
    Order,
    Project,
    decode_image,
    differences,
    edits,
    edits_between,
    step_row,
)

View: TypeAlias = Literal["untold", "working", "stored"]
"""What a read-back shows: the copy that is edited, what is stored, or nothing was written that could tell."""
FLAGS: Final = ("stop_mode", "mode4", "power_on_home")
"""What each project's dump holds, and may belong to the device nevertheless."""
_MOST: Final = 6
"""Differences that a message lists."""


class Change(NamedTuple):
    """One parameter that differs: its row, and both raw values. str() of it is "step_3_delay: 0.5 s -> 1 s"."""

    row: Register
    step: int
    raw_before: int
    raw_after: int

    @property
    def name(self) -> str:
        """As `read` and `write` call it."""
        return self.row.name

    @property
    def before(self) -> Value:
        """In the unit of the API."""
        return self.row.to_value(self.raw_before)

    @property
    def after(self) -> Value:
        """In the unit of the API."""
        return self.row.to_value(self.raw_after)

    def __str__(self) -> str:
        return f"{self.name}: {_words(self.row, self.raw_before)} -> {_words(self.row, self.raw_after)}"


class Readback(NamedTuple):
    """What came of editing: the 220 bytes that were read at last, what these are, and what was spent on it.

    `more` is what the first read-back showed to differ beyond what was planned; it was written as well.
    """

    image: bytes
    view: View
    commands: int
    dumps: int
    more: tuple[Change, ...] = ()


def changes(before: Project, after: Project) -> Iterator[Change]:
    """Every parameter in which two projects differ, but for their number; rows that are not carried out count too."""
    for name, step, old, new in differences(before, replace(after, number=before.number)):
        yield Change(step_row(step, name) if step else TABLE[name], step, old, new)


async def brought(node: Node, before_image: bytes, after: Project, *, every: bool = False) -> Readback:
    """Bring what is being edited to `after` in every named field, all ten rows, and read it back. Nothing is saved.

    `before_image` are the 220 bytes that were read before, and `after.number` says of which project. Only what differs
    is sent, behind the command that selects the project; nothing at all is sent, and nothing read, when nothing
    differs, unless `every` field is wanted. A read-back that is right, or as before, is one reading. If it is not
    right, every field is sent and it is read again: then it is as meant, view "working", or both times as it was
    before, and the controller shows what is stored, view "stored": what is edited cannot be seen then, but each field
    of it was acknowledged. On a bus where that has shown, every field is sent at once.

    Edits of another project that were not saved are lost. Call it inside `Exclusive`, for another caller's selection in
    between would lead these edits elsewhere. Reports `Progress`. Raises RequestError for a number that may not be
    sent, before anything is; VerificationFailed when the read-back is neither; OutcomeUnknown when a command was not
    acknowledged. An error from the middle has a note that says what may be half written.
    """
    before = held(node, before_image, after.number)
    some = _orders(node, edits_to(before, after))
    if not some and not every:
        return Readback(before_image, "untold", 0, 0)
    whole = _orders(node, all_edits(after), strict=False)
    rounds = [whole] if node.memory.shows_stored else [whole if every else some, whole]
    commands, dumps, unmoved = 0, 0, True
    more: tuple[Change, ...] = ()
    for orders in rounds:
        await _told(node, after.number, orders)
        reading = read_until(node, after.number, lambda it: it == after or _is_alike(it, before))
        image, count = await noted(reading, _unsaved(after.number))
        commands, dumps = commands + len(orders), dumps + count
        shown = held(node, image, after.number)
        if shown == after:
            node.memory.shows_stored = node.memory.shows_stored and not some
            view: View = "working" if some else "stored" if node.memory.shows_stored else "untold"
            return Readback(image, view, commands, dumps, more)
        if not _is_alike(shown, before):
            unmoved, more = False, tuple(_beyond(changes(before, after), changes(shown, after)))
    if unmoved:
        node.memory.shows_stored = True
        return Readback(image, "stored", commands, dumps)
    raise differs(
        node, image, after, f"project {after.number} is being edited and does not read as it was written",
        f"write it again; {_unsaved(after.number)}",
    )  # fmt: skip


def _beyond(planned: Iterable[Change], found: Iterable[Change]) -> Iterator[Change]:
    """Those of parameters that were not to change."""
    known = {change.name for change in planned}
    return (change for change in found if change.name not in known)


async def refuse_while_lent(node: Node, verb: str, *, reads: bool = False) -> None:
    """Raise RequestError while project 1 is lent to a motion that was cut off: what was lent would be kept.

    Unless it only `reads`, also while something may still turn: what editing does then nobody knows. Call it inside
    `Exclusive`: a motion that is not cut off has the bus for itself until it has given project 1 back.
    """
    if not reads:
        await refuse_unless_idle(node, f"{verb}()")
    await Emit(JournalEntry(verb, ASKED, {"node": node.node, READABLE: reads}))


def held(node: Node, image: bytes, number: int) -> Project:
    """The project of this number that an image holds; that it repeats its number there is an assumption, 0 will do."""
    project = decode_image(image, node.order)
    return project if project.number else replace(project, number=number)


def edits_to(before: Project, after: Project) -> list[Edit]:
    """The commands that make one project of the other, none when nothing differs; a cleared one is written in full."""
    if before.is_cleared:
        return edits(after, rows=_filled(after))
    return edits_between(before, after, rows=STEPS)


def all_edits(after: Project) -> list[Edit]:
    """The commands that write every field of a project, all ten rows: 78."""
    return edits(after, rows=STEPS)


async def selected(node: Node, project: Project) -> None:
    """Select a project with the number of steps it has. Raises RequestError when it has none."""
    await _told(node, project.number, _orders(node, edits(project, rows=0)[:1]))


async def read_back(node: Node, meant: Project) -> tuple[bytes, int]:
    """The 220 bytes of a project as they are now, and how many dumps that took.

    One reading is enough when it is as `meant` in every named field, for no line changes bytes into that; any other is
    believed when two agree. Raises as `dump`.
    """
    return await read_until(node, meant.number, lambda shown: shown == meant)


async def read_until(node: Node, project: int, right: Callable[[Project], bool]) -> tuple[bytes, int]:
    """As `read_back`, where more than one project would be right."""
    image = (await dump_once(node, project))[wire.REPLY_LENGTH :]
    if right(held(node, image, project)):
        return image, 1
    seen = await readings(node, project)
    return agreed(node, project, seen)[wire.REPLY_LENGTH :], 1 + len(seen)


def differs(node: Node, image: bytes, meant: Project, what: str, advice: str) -> VerificationFailed:
    """The error for a project that does not read as it is meant; it says what the controller shows now."""
    shown = held(node, image, meant.number)
    found = [str(one) for one in changes(meant, shown)]
    more = f" and {len(found) - _MOST} more" if len(found) > _MOST else ""
    other: Order = "big" if node.order == "little" else "little"
    swapped = replace(decode_image(image, other), number=meant.number) == meant
    return VerificationFailed(
        what,
        received=image,
        expected=f"(meant -> read) {'; '.join(found[:_MOST]) or 'its number'}{more}",
        cause=f"its dumps have the {'highest' if other == 'big' else 'lowest'} byte of a number first"
        if swapped
        else "it lost its supply, something else edited it, or it does not take one of these values",
        advice=f"open the bus with dump_order={other}" if swapped else advice,
        node=node.node,
    )


def _orders(node: Node, wanted: Sequence[Edit], *, strict: bool = True) -> list[Request[None]]:
    """The commands; unless `strict`, without those that no controller takes, which then hold what they held before."""
    found = []
    for edit in wanted:
        try:
            found.append(_order(node, edit))
        except RequestError:
            if strict:
                raise
    return found


def _filled(project: Project) -> int:
    """How many rows it takes to say it: those it carries out, and those behind that hold something."""
    rows = (number for number in range(1, STEPS + 1) if project.step(number) != EMPTY)
    return max(min(project.total_steps, STEPS), *rows, 0)


def _order(node: Node, edit: Edit) -> Request[None]:
    values: dict[str, Any] = dict(edit.values)
    return command(node, edit.command, nothing, priority=Priority.CONFIGURATION, expert=True, **values)


async def _told(node: Node, project: int, orders: Sequence[Request[None]]) -> None:
    if node.memory.unsaved is not None and node.memory.unsaved.number != project:
        node.memory.unsaved = None  # those edits are lost with the selection of this one
    number = 0
    try:
        for number, order in enumerate(orders):
            await Emit(Progress(number, len(orders), f"writing project {project}"))
            await order
    except BaseException as error:
        error.add_note(f"{number} of {len(orders)} commands were acknowledged; {_unsaved(project)}")
        raise
    await Emit(Progress(len(orders), len(orders), f"writing project {project}"))


def _unsaved(project: int) -> str:
    return (
        f"what is edited of project {project} may be half written; it was not saved, so a power cycle brings back "
        "what is stored"
    )


async def noted(runnable: Runnable[T], note: str) -> T:
    """Carry it out; an error or an interruption of it gets this note."""
    try:
        return await runnable
    except BaseException as error:
        error.add_note(note)
        raise


def _is_alike(shown: Project, before: Project) -> bool:
    """Whether it is the old one; stop mode and its like may belong to the device and be another's already."""
    flags = {name: getattr(before, name) for name in FLAGS}
    return replace(shown, number=before.number, **flags) == before


def _words(row: Register, raw: int) -> str:
    if raw in row.choices:
        return row.choices[raw]
    return f"{row.to_value(raw):.6g} {row.unit}" if row.unit else str(raw)
