"""Project 1 is lent to a manual motion, and given back.

The frames of jog, single move and homing carry neither speed nor distance: both are those of step 1 of project 1. So
this step is edited for the motion and brought back after it. Nothing is saved, so power-off brings it back too. The
journal holds project 1 before the first edit leaves; `recover` gives it back after a crash. Project 1 stays selected:
no request tells which project was selected before.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import replace
from typing import Any, Final, TypeVar

from motorbus.core.steps import INTENT, OUTCOME, REACHED, Emit, Exclusive, Guard, JournalEntry, Sleep, catch
from motorbus.errors import LinkError, MotorbusError, OutcomeUnknown, RequestError, VerificationFailed
from motorbus.families.stepper import parameters
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.projects import MANUAL, bring, cached, check_free, read_image
from motorbus.families.stepper.driver.requests import STOPS
from motorbus.families.stepper.driver.stop import RUN, Watch, close_run, end_motion, mark_unmoved
from motorbus.families.stepper.execution.ramp import slowest_stop
from motorbus.families.stepper.parameters import STEPS, Project, amended, differences, encode_image

T = TypeVar("T")

LENT: Final = "lent"  # journal: project 1 was read back as wanted
RETURNING: Final = "returning"  # journal: it may be half given back
TRIES: Final = 3  # to give it back
VERBS: Final = ("jog", "move_by", "home", "plan_move")


class Loan(Guard):
    """From `borrow` on project 1 reads as `wanted`. At the end of the block the motor is stopped and project 1 is as
    before.

    `rests`: the motion has ended by itself. Raises OutcomeUnknown if project 1 was as before without being given back.
    """

    def __init__(self, watch: Watch, verb: str, before: Project, wanted: Project) -> None:
        self.node: Final = watch.node
        self.watch: Final = watch
        self.verb: Final = verb
        self.before: Final = before
        self.wanted: Final = wanted
        self.rests = self._is_open = self._is_lent = False

    async def borrow(self) -> None:
        """Edit project 1. After an error the block gives it back."""
        if self.wanted == self.before:
            return
        self._check()
        await self._begin()
        if not await bring(self.node, self.before, self.wanted):
            raise VerificationFailed(
                "project 1 shows what is stored, so its edits cannot be read, and nothing was moved",
                advice="write step 1 of project 1, save it, and call run_once()",
                node=self.node.node,
            )
        await self._note(LENT)
        self._is_lent = True

    def _check(self) -> None:
        """Raise RequestError if edits would be lost, or project 1 could not be given back."""
        unsaved = self.node.state.unsaved
        if unsaved is not None and unsaved.number != MANUAL:
            raise RequestError(
                f"{self.verb}() would lose the edits of project {unsaved.number} that are not saved",
                advice=f"save({unsaved.number}) first",
            )
        for error in parameters.check_project(replace(self.before, total_steps=STEPS), expert=True):
            raise RequestError(f"project 1 could not be given back: {error.summary}", expected=error.expected)

    async def _begin(self) -> None:
        facts: dict[str, object] = {
            "node": self.node.node,
            "motor": self.node.motor,
            "order": self.node.order,
            "image": encode_image(self.before, self.node.order).hex(),
            "lent": {name: new for name, (_, new) in differences(self.before, self.wanted).items()},
            "what": f"the loan of project 1 to {self.verb}()",
        }
        self._is_open = True
        try:
            await Emit(JournalEntry(self.verb, INTENT, facts))
        except MotorbusError:
            self._is_open = False
            raise

    async def leave(self, error: BaseException | None) -> None:
        if self.watch.ordered:
            await end_motion(self.node, STOPS[::-1])
            if not self.rests:
                await Sleep(slowest_stop(replace(self.wanted, total_steps=1)))
        if not self._is_open:
            return
        await self._note(RETURNING)
        found = await give_back(self.node, self.before, self.wanted, is_read=self._is_lent)
        await self._note(OUTCOME, outcome="old")
        if found and self.watch.ordered and error is None:
            raise OutcomeUnknown(
                f"{self.verb}() was cut short: the controller lost its supply, and the motor is at an unknown position",
                cause="project 1 read as before the loan, though it was read back as lent",
            )

    async def _note(self, state: str, **facts: object) -> None:
        await Emit(JournalEntry(self.verb, state, {"node": self.node.node, **facts}))


async def give_back(node: Node, before: Project, lent: Project, *, is_read: bool) -> bool:
    """Make project 1 what it was. True if it was so already: a power cycle has done it.

    `is_read`: it was read as `lent`; else what reads as before may be what is stored, so the edits are undone unread.
    """
    tries = 0
    while True:
        error = await catch(_bring_back(node, before, lent, is_read))
        if not isinstance(error, MotorbusError):
            return error and not tries
        tries += 1
        if tries == TRIES or isinstance(error, LinkError):
            error.add_note("project 1 may still be lent: recover() gives it back, and so does a power cycle")
            raise error


async def _bring_back(node: Node, before: Project, lent: Project, is_read: bool) -> bool:
    shown = await read_image(node, MANUAL)
    if shown == before and is_read:
        return True
    await bring(node, lent if shown == before else shown, before)
    return False


async def lend(
    node: Node,
    verb: str,
    change: Callable[[Project], Project],
    motion: Callable[[Watch, Project], Awaitable[T]],
    *,
    prepare: Callable[[], Awaitable[None]] | None = None,
    ends: bool = True,
) -> T:
    """Make a manual motion with project 1 as `change` makes it, then stop, then give project 1 back.

    `prepare` runs after project 1 was read. `ends`: the motion ends by itself; else the motor decelerates after the
    stop, which is waited for. Nothing is edited where project 1 is so already. An error is `unmoved` if the motion
    request did not leave.

    Raises RequestError, with nothing written, while a project may run or a change is unfinished, for unsaved edits of
    another project, and if project 1 could not be given back; VerificationFailed if it does not read as wanted;
    OutcomeUnknown if the controller lost its supply or the stop is not acknowledged; and what `motion` raises.
    """
    watch = Watch(node)

    async def work() -> T:
        await check_free(node, verb)
        before = await cached(node, MANUAL)
        if prepare is not None:
            await prepare()
        loan = Loan(watch, verb, before, change(before))
        async with loan:
            await loan.borrow()
            value = await motion(watch, loan.wanted)
            loan.rests = ends
        return value

    return await mark_unmoved(watch, Exclusive(work()))


async def recover(node: Node, change: str, facts: Mapping[str, Any]) -> str:
    """Stop the motor and give project 1 back after a crash; `change` and `facts` are those of the journal.

    Returns "old"; "stopped" for a project that may have run. May be called again. Raises RequestError for facts of
    something else, for a bus with another motor or byte order, and if something else has written project 1 since: then
    nothing is edited. Raises OutcomeUnknown if the stop is not acknowledged.
    """
    if change == RUN:
        await end_motion(node)
        await close_run(node, "stopped")
        return "stopped"
    before, lent = _checked_facts(node, change, facts)
    return await Exclusive(_recover(node, change, before, lent, facts.get(REACHED, ())))


async def _recover(node: Node, change: str, before: Project, lent: Project, reached: tuple[str, ...]) -> str:
    await end_motion(node, STOPS[::-1])
    shown = await read_image(node, MANUAL)
    if LENT in reached and RETURNING not in reached:
        values, changed = parameters.values_of(shown), differences(before, lent)
        if foreign := [name for name, pair in changed.items() if values[name] not in pair]:
            raise RequestError(
                f"something else has written project 1 since: {', '.join(foreign)}",
                advice="if it is right, `motorbus recover BUS --forget` ends the loan",
            )
        before = amended(shown, {name: old for name, (old, _) in changed.items()})
    await Sleep(slowest_stop(replace(shown, total_steps=1)))
    await Emit(JournalEntry(change, RETURNING, {"node": node.node}))
    await give_back(node, before, lent, is_read=LENT in reached)
    await Emit(JournalEntry(change, OUTCOME, {"outcome": "old", "node": node.node}))
    return "old"


def _checked_facts(node: Node, change: str, facts: Mapping[str, Any]) -> tuple[Project, Project]:
    """Project 1 before the loan, and lent. Raises RequestError for facts of something else or of another bus."""
    try:
        order, motor = parameters.checked_order(facts["order"]), facts["motor"]
        before = replace(parameters.decode_image(bytes.fromhex(facts["image"]), order), number=MANUAL)
        lent = amended(before, facts["lent"])
        encode_image(lent)
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise RequestError(f"the journal entry {change!r} is not a loan of project 1: {error}") from error
    if (order, motor) != (node.order, node.motor) or change not in VERBS:
        raise RequestError(
            f"the journal entry {change!r} is of a bus with motor={motor},dump_order={order}",
            expected=f"one of {', '.join(VERBS)}, and the bus as it was opened then",
        )
    return before, lent
