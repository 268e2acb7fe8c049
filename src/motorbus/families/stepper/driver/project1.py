"""Temporary use of project 1 by a manual motion.

The frames of jog, single move and homing carry neither speed nor distance: both are those of step 1 of project 1. So
this step is edited for the motion and restored after it. Nothing is saved, so power-off restores it too. The journal
holds project 1 before the first edit leaves; `recover` restores it after a crash. Project 1 stays selected: no request
tells which project was selected before.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import replace
from typing import Any, Final, TypeVar

from motorbus.core.steps import INTENT, OUTCOME, REACHED, Emit, Exclusive, Guard, JournalEntry, Sleep
from motorbus.errors import LinkError, MotorbusError, OutcomeUnknown, RequestError, VerificationFailed
from motorbus.families.stepper import parameters
from motorbus.families.stepper.driver.node import STOPS, Node
from motorbus.families.stepper.driver.projects import MANUAL, bring, cached, read_image
from motorbus.families.stepper.driver.stop import RUN, Watch, check_free, close_run, end_motion
from motorbus.families.stepper.execution.ramp import stop_seconds
from motorbus.families.stepper.parameters import STEPS, Project, amended, differences, encode_image

T = TypeVar("T")

EDITED: Final = "edited"  # journal: project 1 was read back as wanted
RESTORING: Final = "restoring"  # journal: it may be half restored
TRIES: Final = 3  # to restore it
VERBS: Final = ("jog", "move_by", "home", "plan_move")


class TemporaryProject1(Guard):
    """From `edit` on project 1 reads as `wanted`. At the end of the block the motor is stopped and project 1 is as
    before.

    `rests`: the motion has ended by itself. Raises OutcomeUnknown if project 1 was as before without being restored.
    """

    def __init__(self, watch: Watch, verb: str, before: Project, wanted: Project) -> None:
        self.node: Final = watch.node
        self.watch: Final = watch
        self.verb: Final = verb
        self.before: Final = before
        self.wanted: Final = wanted
        self.rests = self._is_noted = self._is_read = False
        self._was_edited = watch.node.state.is_edited

    async def edit(self) -> None:
        """Edit project 1. After an error the block restores it."""
        if self.wanted == self.before:
            return
        self._check()
        changed = {name: new for name, (_, new) in differences(self.before, self.wanted).items()}
        self._is_noted = True
        try:
            await self._note(
                INTENT,
                motor=self.node.motor,
                order=self.node.order,
                image=encode_image(self.before, self.node.order).hex(),
                changed=changed,
                what=f"the temporary use of project 1 by {self.verb}()",
            )
        except MotorbusError:
            self._is_noted = False
            raise
        if not await bring(self.node, self.before, self.wanted):
            raise VerificationFailed(
                "project 1 shows what is stored, so its edits cannot be read, and nothing was moved",
                advice="write step 1 of project 1, save it, and call run_once()",
                node=self.node.node,
            )
        await self._note(EDITED)
        self._is_read = True

    def _check(self) -> None:
        """Raise RequestError if edits would be lost, or project 1 could not be restored."""
        state = self.node.state
        if state.is_edited and state.selected != MANUAL:
            number = "the selected project" if state.selected is None else f"project {state.selected}"
            raise RequestError(
                f"{self.verb}() would lose the edits of {number} that are not saved",
                advice="write it with a save first; select_project(1, STEPS) gives them up",
            )
        for error in parameters.check_project(replace(self.before, total_steps=STEPS), expert=True):
            raise RequestError(f"project 1 could not be restored: {error.summary}", expected=error.expected)

    async def leave(self, error: BaseException | None) -> None:
        if self.watch.has_left:
            await end_motion(self.node, STOPS[::-1])
            if not self.rests:
                await Sleep(stop_seconds(self.wanted, self.wanted.step(1), self.node.tick_ms))
        if not self._is_noted:
            return
        await self._note(RESTORING)
        was_restored = await restore(self.node, self.before, self.wanted, is_read=self._is_read)
        self.node.state.is_edited = self._was_edited
        await self._note(OUTCOME, outcome="old")
        if was_restored and self.watch.has_left and error is None:
            raise OutcomeUnknown(
                f"{self.verb}() was cut short: the controller lost its supply, and the motor is at an unknown position",
                cause="project 1 reads as before, though it was read back as edited",
            )

    async def _note(self, state: str, **facts: object) -> None:
        await Emit(JournalEntry(self.verb, state, {"node": self.node.node, **facts}))


async def restore(node: Node, before: Project, wanted: Project, *, is_read: bool) -> bool:
    """Make project 1 what it was. True if it was so already: a power cycle has done it.

    `is_read`: it was read as `wanted`; else what reads as before may be what is stored, so the edits are undone unread.
    """
    tries = 0
    while True:
        tries += 1
        try:
            shown = await read_image(node, MANUAL)
            if shown == before and is_read:
                return tries == 1
            await bring(node, wanted if shown == before else shown, before)
        except MotorbusError as error:
            if tries == TRIES or isinstance(error, LinkError):
                error.add_note(
                    "project 1 may still be edited: recover() restores it, and so does a power cycle"
                )
                raise
        else:
            return False


async def with_project1(
    node: Node,
    verb: str,
    change: Callable[[Project], Project],
    motion: Callable[[Watch, Project], Awaitable[T]],
    *,
    prepare: Callable[[], Awaitable[None]] | None = None,
    ends: bool = True,
) -> T:
    """Make a manual motion with project 1 as `change` makes it, then stop, then restore project 1.

    `prepare` runs after project 1 was read. `ends`: the motion ends by itself; else the motor decelerates after the
    stop, which is waited for. Nothing is edited where project 1 is so already.

    Raises RequestError, with nothing written, while a project may run or a change is unfinished, for unsaved edits of
    another project, and if project 1 could not be restored; VerificationFailed if it does not read as wanted;
    OutcomeUnknown if the controller lost its supply or the stop is not acknowledged; and what `motion` raises.
    """
    watch = Watch(node)

    async def work() -> T:
        await check_free(node, verb)
        before = await cached(node, MANUAL)
        if prepare is not None:
            await prepare()
        async with TemporaryProject1(watch, verb, before, change(before)) as use:
            await use.edit()
            value = await motion(watch, use.wanted)
            use.rests = ends
        return value

    return await Exclusive(work())


async def recover(node: Node, change: str, facts: Mapping[str, Any]) -> str:
    """Stop the motor and restore project 1 after a crash; `change` and `facts` are those of the journal.

    Returns "old"; "stopped" for a project that may have run. May be called again. Raises RequestError for facts of
    something else, for a bus with another motor or byte order, and if something else has written project 1 since: then
    nothing is edited. Raises OutcomeUnknown if the stop is not acknowledged.
    """
    if change == RUN:
        await end_motion(node)
        await close_run(node, "stopped")
        return "stopped"
    before, wanted = _checked_facts(node, change, facts)
    return await Exclusive(_recover(node, change, before, wanted, facts.get(REACHED, ())))


async def _recover(
    node: Node, change: str, before: Project, wanted: Project, reached: tuple[str, ...]
) -> str:
    await end_motion(node, STOPS[::-1])
    shown = await read_image(node, MANUAL)
    if EDITED in reached and RESTORING not in reached:
        values, changed = parameters.values_of(shown), differences(before, wanted)
        if foreign := [name for name, pair in changed.items() if values[name] not in pair]:
            raise RequestError(
                f"something else has written project 1 since: {', '.join(foreign)}",
                advice="if it is right, `motorbus recover BUS --forget` ends this change",
            )
        before = amended(shown, {name: old for name, (old, _) in changed.items()})
    await Sleep(stop_seconds(shown, shown.step(1), node.tick_ms))
    await Emit(JournalEntry(change, RESTORING, {"node": node.node}))
    await restore(node, before, wanted, is_read=EDITED in reached)
    await Emit(JournalEntry(change, OUTCOME, {"outcome": "old", "node": node.node}))
    return "old"


def _checked_facts(node: Node, change: str, facts: Mapping[str, Any]) -> tuple[Project, Project]:
    """Project 1 before and during the motion. Raises RequestError for facts of something else or of another bus."""
    try:
        order, motor = parameters.checked_order(facts["order"]), facts["motor"]
        before = replace(parameters.decode_image(bytes.fromhex(facts["image"]), order), number=MANUAL)
        wanted = amended(before, facts["changed"])
        encode_image(wanted)
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise RequestError(f"the journal entry {change!r} is no temporary use of project 1") from error
    if (order, motor) != (node.order, node.motor) or change not in VERBS:
        raise RequestError(
            f"the journal entry {change!r} is of a bus with motor={motor},dump_order={order}",
            expected=f"one of {', '.join(VERBS)}, and the bus as it was opened then",
        )
    return before, wanted
