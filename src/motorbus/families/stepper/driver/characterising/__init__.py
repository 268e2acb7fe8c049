"""Finding out how one controller reads what its manual leaves open, with nothing but the clock and its dumps.

Somebody takes the load off the motor and lends a project. What is tried moves the motor by a fraction of a turn; what
comes of it is compared with every combination of the readings, and an answer is given where one is left. What nobody
can see from here, as the level of an output or the effect of an input, stays open, and the profile says why. So does
all that rests on something which did not come, when anything else on this line was lost.

Nothing is saved. In the end what is edited is a stored project again, in every field, whatever happens; until then the
journal says so.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import isfinite
from typing import Any, Final

from motorbus.core.steps import ASKED, INTENT, OUTCOME, Emit, Exclusive, JournalEntry, catch, with_cleanup
from motorbus.errors import LinkError, RequestError, VerificationFailed
from motorbus.families.stepper.driver import reading
from motorbus.families.stepper.driver.characterising.experiments import Motor
from motorbus.families.stepper.driver.characterising.findings import Case
from motorbus.families.stepper.driver.characterising.study import (
    SELECTION,
    VIEWS,
    Experiment,
    ramp_experiment,
    studied,
)
from motorbus.families.stepper.driver.characterising.trials import controls, trials
from motorbus.families.stepper.driver.editing import brought
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.stopping import ended
from motorbus.families.stepper.driver.turning import refuse_unless_idle
from motorbus.families.stepper.program.profile import Profile
from motorbus.families.stepper.table import (
    BLANK,
    OUTPUTS,
    PROJECTS,
    TABLE,
    Order,
    Project,
    checked_project,
    decode_image,
    refusals,
    row_value,
)

LEAST_TRAVEL: Final = 0.5
MOST_TRAVEL: Final = 100.0
VERB: Final = "characterise"
GIVEN_BACK: Final = "old"
"""How every characterisation ends, in the journal and for `recover`."""
NOTE: Final = (
    "what was edited for the experiments may be there still: recover() puts it back; so does a power cycle"
)
TRIES: Final = 3
"""How often it is tried to edit the stored project again; after an emergency stop the bus itself repeats nothing."""
_CLEARLY: Final = 8
"""Bits by which numbers must be smaller in the other order of bytes to be read so."""
_FACTS: Final = ("node", "what", "project", "image")
_NOMINAL: Final = Project(microsteps=8, step_angle=180)


async def characterise(node: Node, *, scratch: int = 4, travel: float = 1.0) -> Profile:
    """Find out what can be found out: one to two minutes, in which the motor turns now and then.

    Take the load off the motor first: it goes by up to 240 RPM, never more than `travel` turns (0.5 to 100) each way
    from where it is, and outputs may go off. Whatever runs is stopped first. Project `scratch`, 1 to 4, and project 1
    are edited and not saved. In the end the first project that has steps is selected, the scratch project last, and
    edited as it is stored, and every project reads as before. How many microsteps the motor has is taken from the
    scratch project, or from that one.

    Reports `Experiment` before each experiment, and to the journal what it is about to do: cut off by a crash,
    `recover` puts back what was edited; so does a power cycle. A line that loses something leaves questions open.

    Raises RequestError, before anything is written, for impossible numbers, while a project that was started on this
    bus may run, for edits that were not saved, and when no project has steps; VerificationFailed when something does
    not read as it was written; Interrupted when somebody stops the controller meanwhile; OutcomeUnknown when a stop is
    not accepted: the motor may be turning then; whatever reading and writing raise on a line that is too bad.
    """
    checked_project(scratch)
    if not (isfinite(travel) and LEAST_TRAVEL <= travel <= MOST_TRAVEL):
        raise _refused(f"travel: {travel!r} turns", f"{LEAST_TRAVEL:g} to {MOST_TRAVEL:g}")
    return await Exclusive(_characterised(node, scratch, travel))


def experiments(*, travel: float = 1.0) -> tuple[Experiment, ...]:
    """What `characterise` would do, for a motor of 1600 pulses a turn: sends nothing.

    Times are those of one run at most, without what is written for it; each is made two or three times.
    """
    motor = Motor.of(_NOMINAL)
    before = [VIEWS, *map(Experiment.of, controls(motor, 4)), SELECTION]
    return (*before, *map(Experiment.of, trials(motor, 4, 3)), ramp_experiment(travel))


async def recovered(node: Node, facts: Mapping[str, Any]) -> str:
    """Put back what was edited when the host was cut off, `facts` being what the journal says. Gives "old".

    Raises RequestError, with nothing sent, for facts of something else; else as `characterise`.
    """
    try:
        image, project = bytes.fromhex(facts["image"]), int(facts["project"])
        order = likely_order((image,), node.order)
        refused = project not in range(1, PROJECTS + 1) or decode_image(image).is_cleared
        known = {name: facts[name] for name in _FACTS}
    except (KeyError, TypeError, ValueError):
        refused = True
    if refused:
        raise RequestError(
            "these are not the facts of a characterisation that can be recovered",
            expected="what the journal of the bus holds",
            advice="nothing was sent",
        )
    await Exclusive(put_back(Node(node.node, node.motor, order, node.memory), image, known))
    return GIVEN_BACK


def _refused(what: str, expected: str) -> RequestError:
    return RequestError(what, expected=expected, advice="nothing was sent")


async def _characterised(node: Node, scratch: int, travel: float) -> Profile:
    await refuse_unless_idle(node, f"{VERB}()")
    _refuse_unsaved(node)
    await Emit(JournalEntry(VERB, ASKED, {"node": node.node}))
    await ended(node)
    stored: dict[int, bytes] = {}
    for number in range(1, PROJECTS + 1):
        stored[number] = await reading.image(node, number)
    order = likely_order(tuple(stored.values()), node.order)
    home = _home(stored, order, scratch)
    here = Node(node.node, node.motor, order, node.memory)
    lent = decode_image(stored[scratch], order)
    case = Case(here, scratch, travel, stored, home if lent.pulses_per_turn is None else scratch)
    facts = _facts(node, stored, home)
    node.memory.commanded(tuple(range(1, OUTPUTS + 1)), None)
    await Emit(JournalEntry(VERB, INTENT, facts))
    try:
        found = await with_cleanup(studied(case), lambda: _returned(case, stored[home], facts))
    except BaseException as error:
        if not case.returned:
            error.add_note(NOTE)
        raise
    await _compared(case.node, stored)
    return found


async def _returned(case: Case, image: bytes, facts: Mapping[str, Any]) -> None:
    await put_back(case.node, image, facts, case.seen)
    case.returned = True


def _facts(node: Node, stored: Mapping[int, bytes], home: int) -> dict[str, object]:
    what = f"the loan of projects for {VERB}()"
    return {"node": node.node, "what": what, "project": home, "image": stored[home].hex()}


def _refuse_unsaved(node: Node) -> None:
    if (unsaved := node.memory.unsaved) is not None:
        raise RequestError(
            f"project {unsaved.number} has edits that were not saved, and {VERB}() would lose them",
            advice=f"save({unsaved.number}) first; nothing was sent",
            node=node.node,
        )


async def put_back(node: Node, image: bytes, facts: Mapping[str, Any], seen: bool = False) -> None:
    """Stop it, let what is edited be the project of these facts again, with this image, and say so.

    `seen` says that reading shows what is edited: then every field is sent only where a reading says that it must be.
    """
    await ended(node)
    for left in reversed(range(TRIES)):
        told = await catch(_edited_again(node, image, int(facts["project"]), seen))
        if told is None:
            break
        if isinstance(told, LinkError) or not left:
            raise told
    await Emit(JournalEntry(VERB, OUTCOME, {"outcome": GIVEN_BACK, **facts}))


async def _edited_again(node: Node, image: bytes, number: int, seen: bool) -> None:
    project = replace(decode_image(image, node.order), number=number)
    await brought(node, BLANK if seen else image, project, every=not seen)


async def _compared(node: Node, stored: Mapping[int, bytes]) -> None:
    """See that all of them read as before. Raises VerificationFailed when one does not."""
    for number, image in stored.items():
        now = await reading.image(node, number)
        if _carried_out(now, node.order) != _carried_out(image, node.order):
            raise VerificationFailed(
                f"project {number} does not read as it did before the experiments",
                received=now,
                expected=image.hex(" ").upper(),
                advice="nothing was saved: a power cycle brings back what is stored",
                node=node.node,
            )


def _carried_out(image: bytes, order: Order) -> Project:
    """A project as it is carried out, whatever number it thinks it has."""
    return replace(decode_image(image, order), number=0)


def _home(stored: Mapping[int, bytes], order: Order, scratch: int) -> int:
    """The project that is edited again in the end. Raises RequestError when there is none that could be."""
    for number in (*(one for one in stored if one != scratch), scratch):
        project = replace(decode_image(stored[number], order), number=number)
        if not project.is_cleared and not any(refusals(project, expert=True)):
            return number
    raise RequestError(
        "no project has steps, so none could be edited again in the end",
        expected="one that was written and saved",
        advice="write a project first; it also tells how many microsteps the motor has; nothing was written",
    )


def likely_order(images: tuple[bytes, ...], said: Order) -> Order:
    """Which byte of a number seems to come first: the other order than was said if it makes much smaller numbers."""
    other: Order = "big" if said == "little" else "little"
    return other if _bits(images, said) - _bits(images, other) > _CLEARLY else said


def _bits(images: tuple[bytes, ...], order: Order) -> int:
    return sum(value.bit_length() for image in images for value in _numbers(image, order))


def _numbers(image: bytes, order: Order) -> Iterator[int]:
    return (row_value(image, row, order) for row in TABLE.values() if row.size > 1)
