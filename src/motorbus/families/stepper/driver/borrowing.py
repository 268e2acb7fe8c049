"""Project 1 is borrowed for a motion by hand, and given back: the only way to say how fast and how far.

The frames of jog, single move and homing carry no speed: they take it from step 1 of project 1. So this step is edited,
the motion made, and the project brought back to what it was, all with nobody else on the bus but for a stop. Nothing is
saved, so a power cycle gives it back as well. What project 1 was is in the journal before the first edit leaves, and
the journal is closed when it reads as before: whatever cuts this off, an error, Ctrl-C or kill -9, the next one who
opens the bus is told, no motion of this host begins, and `recover` gives it back.

The motion is always followed by a stop, and while that is not accepted nothing is given back: nobody knows what an
edit does to a motor that turns. What cannot be given back at all: afterwards project 1 is the selected one, for no
controller tells which was before. Input 3 then starts project 1, where it starts the selected one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from math import inf
from typing import Any, Final, NamedTuple, TypeVar

from motorbus.core.steps import (
    ASKED,
    INTENT,
    OUTCOME,
    REACHED,
    Emit,
    Exclusive,
    JournalEntry,
    Procedure,
    Sleep,
    catch,
    with_cleanup,
)
from motorbus.errors import LinkError, MotorbusError, OutcomeUnknown, RequestError, VerificationFailed
from motorbus.families.stepper.driver import reading
from motorbus.families.stepper.driver.editing import brought
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.selecting import cleared
from motorbus.families.stepper.driver.stopping import BY_HAND, MAY_TURN, ended
from motorbus.families.stepper.driver.turning import Slowing, refuse_unless_idle, slowing
from motorbus.families.stepper.table import (
    STEPS,
    Order,
    Project,
    amended,
    check,
    checked_order,
    decode_image,
    differences,
    edits_between,
    encode_image,
)

T = TypeVar("T")

PROJECT: Final = 1
"""From its step 1 every motion by hand has its speed: stepper controller serial protocol manual, items 18, 19, 22."""
VERBS: Final = ("jog", "move_by", "home", "keep_time")
"""Those that may borrow."""
BORROWED: Final = "borrowed"
"""It was read back as wanted, so reading shows what is being edited."""
GIVEN_BACK: Final = "old"
"""How every borrow ends, in the journal and for `recover`."""
LONG: Final = 0.5
"""s; whoever waits longer than that for the motor to come to rest is told."""
TRIES: Final = 3
"""How often giving back is tried: after an emergency stop the bus itself repeats nothing."""
LOST: Final = "the controller has lost its supply meanwhile: where the motor stands is not known"
NOTE: Final = "project 1 may still be borrowed: recover() gives it back, and so does a power cycle"


class Accord(NamedTuple):
    """What is done with others before a motion begins; see `borrowed`.

    `settled` makes of what is wanted what is wanted with them, before anything is edited. `ready` is carried out when
    all is edited, just before the motion: whatever it raises, nothing was moved.
    """

    settled: Callable[[Project], Procedure[Project]]
    ready: Callable[[Project], Procedure[None]]


class Loan:
    """Project 1 as it was and as it is `wanted` meanwhile, for this verb, and how far it has come.

    `image`    its 220 bytes as they were, with numbers in this `order` of bytes
    `open`     the journal may hold it as unfinished
    `seen`     it was read back as wanted: a reading shows what is being edited, and can be believed
    `restless` a motion was ordered and no stop was accepted since
    `cut`      the motion has not come to its end by itself: behind the stop the motor may slow down still
    `heard`    the controller has told something since the stop, and an echo cannot have made that up
    `touched`  giving back has begun
    `lost`     before that it read as it was before the borrow: a power cycle has given it back
    """

    def __init__(self, verb: str, image: bytes, order: Order, wanted: Project) -> None:
        self.verb = verb
        self.image = image
        self.order: Final[Order] = order
        self.before = replace(decode_image(image, order), number=PROJECT)
        self.wanted = replace(wanted, number=PROJECT)
        self.open = self.seen = self.restless = self.cut = self.touched = self.lost = self.restored = False
        self.heard = True

    @property
    def needed(self) -> bool:
        """Whether anything has to be edited at all."""
        return self.wanted != self.before

    def name(self, node: Node) -> dict[str, object]:
        """Which borrow it is, among its facts."""
        return {"node": node.node, "image": self.image.hex()}

    def facts(self, node: Node) -> dict[str, object]:
        """All that is needed to give it back, as plain data."""
        return {
            **self.name(node),
            "what": f"the borrow of project {PROJECT} (for {self.verb})",
            "order": self.order,
            "motor": node.motor,
            "wanted": {
                f"step_{step}_{name}" if step else name: value
                for name, step, _, value in differences(self.before, self.wanted)
            },
        }

    def refuse_unless_returnable(self, node: Node) -> None:
        """Raise RequestError, before anything is sent, for a project that no command could bring back."""
        ways = [edits_between(self.before, self.wanted, rows=STEPS)]
        if not self.before.is_cleared:
            ways.append(edits_between(self.wanted, self.before, rows=STEPS))
        elif any(self.image[1:]):
            raise _not_returnable(node, "it has no steps, and holds something all the same")
        for edit in [one for way in ways for one in way]:
            try:
                check(edit.command, edit.values, expert=True)
            except RequestError as refusal:
                raise _not_returnable(node, refusal.summary) from refusal


def loan_of(verb: str, facts: Mapping[str, Any]) -> Loan:
    """The borrow that these facts tell of. Raises RequestError when they tell of none."""
    try:
        image, order = bytes.fromhex(facts["image"]), checked_order(facts["order"])
        loan = Loan(verb, image, order, amended(decode_image(image, order), _whole(facts["wanted"])))
        loan.seen = BORROWED in facts.get(REACHED, ())
        encode_image(loan.wanted, order)
        if verb not in VERBS:
            raise ValueError(verb)
    except (LookupError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise RequestError(
            f"these are not the facts of a borrow that can be recovered: {error!r}",
            expected="what the journal of the bus holds of a jog(), a move_by(), a keep_time() or a home()",
            advice="nothing was sent",
        ) from error
    return loan


def _whole(values: Mapping[str, object]) -> dict[str, int]:
    """These values, all of which are whole numbers. Raises TypeError for one that is none."""
    found = {name: value for name, value in values.items() if type(value) is int}
    if len(found) < len(values):
        raise TypeError(values)
    return found


async def borrowed(
    node: Node,
    verb: str,
    wanted: Callable[[Project], Procedure[Project]],
    motion: Callable[[Project], Procedure[T]],
    *,
    leave: bool = False,
    accord: Accord | None = None,
) -> T:
    """Make a motion with project 1 as `wanted` makes it of what it is, then stop, then give it back, come what may.

    Where it is so already nothing is edited. With `leave` it is not stopped once its order was acknowledged, and it
    must be so already. What is refused is refused before any `accord` with others is sought.

    Raises RequestError, with nothing sent that changes anything, while a borrow that was cut off is unfinished on this
    bus, while a project or a move that was left may not be over, for unsaved edits of another project, which a borrow
    would lose, and for a project 1 that could not be given back; VerificationFailed when it does not read as wanted;
    whatever `motion` raises; OutcomeUnknown when the controller has lost its supply meanwhile, when it tells nothing
    after the stop, or when the stop is not accepted: the motor may be turning then, and a note says that project 1 is
    still borrowed.
    """
    return await Exclusive(_borrowing(node, verb, wanted, motion, leave, accord))


async def _borrowing(
    node: Node,
    verb: str,
    wanted: Callable[[Project], Procedure[Project]],
    motion: Callable[[Project], Procedure[T]],
    leave: bool,
    accord: Accord | None,
) -> T:
    await refuse_unless_idle(node, f"{verb}()")
    await Emit(JournalEntry(verb, ASKED, {"node": node.node}))
    image = await reading.image(node, PROJECT)
    loan = Loan(verb, image, node.order, await wanted(decode_image(image, node.order)))
    if loan.needed:
        _refuse(node, loan, leave)
    if accord is not None:
        loan = Loan(verb, image, node.order, await accord.settled(loan.wanted))
        _refuse(node, loan, leave)
    try:
        value = await with_cleanup(_lent(node, loan, motion, leave, accord), lambda: _ended(node, loan))
    except BaseException as error:
        _annotate(error, loan)
        raise
    if loan.lost:
        raise _supply_lost(node, verb)
    return value


def _annotate(error: BaseException, loan: Loan) -> None:
    """Say beside an error what it does not say itself."""
    if not loan.heard:
        error.add_note(f"the stop was accepted, and nothing came since: {MAY_TURN}")
    if loan.lost:
        error.add_note(LOST)
    if loan.open:
        error.add_note(NOTE)


async def _lent(
    node: Node,
    loan: Loan,
    motion: Callable[[Project], Procedure[T]],
    leave: bool,
    accord: Accord | None,
) -> T:
    if loan.needed:
        await _recorded(node, loan)
        found = await brought(node, loan.image, loan.wanted)
        loan.seen = found.view == "working"
        if not loan.seen:
            raise _unseen(node)
        await Emit(JournalEntry(loan.verb, BORROWED, loan.name(node)))
    if accord is not None:
        await accord.ready(loan.wanted)
    loan.restless = loan.cut = True
    node.memory.turning = inf  # until a stop is accepted
    value = await motion(loan.wanted)
    loan.restless, loan.cut = not leave, False
    return value


async def _recorded(node: Node, loan: Loan) -> None:
    """Record the intent. What cannot be recorded does not begin, and nothing need be given back."""
    loan.open = True
    try:
        await Emit(JournalEntry(loan.verb, INTENT, loan.facts(node)))
    except MotorbusError:
        told = await catch(_closed(node, loan))  # the record may be on the disk all the same
        if isinstance(told, RequestError):  # that of another change says so itself
            loan.open = False
        raise


async def _ended(node: Node, loan: Loan) -> None:
    """Whatever has happened: the motor is told to stop, then project 1 is given back, then the journal is closed."""
    if loan.restless:
        await ended(node, BY_HAND)
        loan.restless = loan.heard = False
    if loan.open:
        await given_back(node, loan)
    elif not loan.heard:
        await _still_there(node)
        loan.heard = True


async def _still_there(node: Node) -> None:
    """Read something: an acknowledgement of 11 bytes may be an echo of what was said, and nobody has heard it."""
    for left in reversed(range(TRIES)):
        told = await catch(reading.dump_once(node, PROJECT))
        if not isinstance(told, MotorbusError):
            return
        if isinstance(told, LinkError):
            raise told
        if not left:
            raise _unheard(node, told)


def _unheard(node: Node, told: MotorbusError) -> OutcomeUnknown:
    return OutcomeUnknown(
        f"the stop was accepted, and nothing could be read since: {MAY_TURN}",
        sent=told.sent,
        received=told.received,
        expected=told.expected,
        cause="what came may have been an echo: the controller is gone, or hears nothing while it turns",
        advice="say stop again, or cut the power of the motor",
        node=node.node,
    )


async def given_back(node: Node, loan: Loan) -> None:
    """Bring project 1 back to what it was, see that it is, and close the journal. May be repeated at any point.

    A motor that was cut off slows down before. Raises what the last of several tries has raised.
    """
    if loan.cut:
        rest = slowing(replace(loan.wanted, total_steps=1))
        with suppress(Exception):  # whatever the listener says to that, the project is given back
            if rest >= LONG:
                await Emit(Slowing(rest))
        await Sleep(rest)
        loan.cut = False
    if not loan.restored:
        unsaved = node.memory.unsaved
        told = await _insisted(node, loan)
        if told is not None:
            raise told
        node.memory.unsaved = unsaved
        loan.restored = True
    await _closed(node, loan)


async def _insisted(node: Node, loan: Loan) -> MotorbusError | None:
    told: MotorbusError | None = None
    for _ in range(TRIES):
        told = await catch(_restored(node, loan))
        if told is None or isinstance(told, LinkError):
            break
    return told


async def _closed(node: Node, loan: Loan) -> None:
    await Emit(JournalEntry(loan.verb, OUTCOME, {"outcome": GIVEN_BACK, **loan.name(node)}))
    loan.open = False


async def _restored(node: Node, loan: Loan) -> None:
    """What is being edited may be anything by now: as wanted, half of it, or as it was, after a power cycle.

    A reading tells which, and only what differs is written; where no reading can be believed, all that was edited is
    written once more.
    """
    image = encode_image(loan.wanted, loan.order, over=loan.image)
    if loan.seen:
        image = await reading.image(node, PROJECT)
        loan.heard = True
        shown = replace(decode_image(image, loan.order), number=PROJECT)
        loan.lost = loan.lost or (shown == loan.before and not loan.touched)
    loan.touched = True
    if not loan.before.is_cleared:
        await brought(node, image, loan.before)
    elif any(image):
        await cleared(node, PROJECT)  # no command writes such a one, and what is stored was clear too


def _refuse(node: Node, loan: Loan, leave: bool) -> None:
    """Raise RequestError for a borrow that must not begin."""
    loan.refuse_unless_returnable(node)
    unsaved = node.memory.unsaved
    if unsaved is not None and unsaved.number != PROJECT:
        raise RequestError(
            f"project {unsaved.number} has edits that were not saved, and {loan.verb}() would lose them",
            cause="it has to select project 1, and there is one copy only that is edited",
            advice=f"save({unsaved.number}) first; nothing was sent",
            node=node.node,
        )
    if leave:
        raise RequestError(
            f"{loan.verb}(wait=False) is possible only with what project 1 has already",
            cause="what is borrowed for a motion must be given back behind it, so somebody has to wait",
            advice="wait in another thread or task; nothing was sent",
            node=node.node,
        )


def _supply_lost(node: Node, verb: str) -> OutcomeUnknown:
    return OutcomeUnknown(
        f"{verb}() was cut short: {LOST}",
        cause="project 1 read as before the borrow, though it was read back as lent: a power cycle loses edits",
        advice="see to the supply; project 1 is as it was, and nothing is left to recover",
        node=node.node,
    )


def _not_returnable(node: Node, why: str) -> RequestError:
    return RequestError(
        "project 1 could not be given back as it is, so it is not borrowed",
        cause=why,
        advice="write a sound project 1 and save it; nothing was sent",
        node=node.node,
    )


def _unseen(node: Node) -> VerificationFailed:
    return VerificationFailed(
        "what was edited for this motion cannot be read back, so nothing was moved",
        expected="project 1 as it is wanted for the motion",
        cause="this controller shows what is stored while something else is being edited, or heeds no edit before it "
        "is saved",
        advice="write step 1 of project 1, save it, and run_once()",
        node=node.node,
    )
