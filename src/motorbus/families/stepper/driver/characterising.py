"""Finding out how one controller reads what its manual leaves open, with nothing but the clock and its dumps.

Somebody takes the load off the motor and lends a project. What is tried moves the motor by a fraction of a turn; what
comes of it is compared with every combination of the readings, and an answer is given where one is left. What nobody
can see from here, as the level of an output or the effect of an input, stays open, and the profile says why. So does
all that rests on something which did not come, when anything else on this line was lost.

Nothing is saved. In the end what is edited is a stored project again, in every field, whatever happens.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import isfinite
from typing import Final, NamedTuple

from motorbus.core.operation import ASKED, INTENT, OUTCOME, Alone, Journal, Operation, Report, afterwards
from motorbus.errors import RequestError, VerificationFailed
from motorbus.families.stepper import wire
from motorbus.families.stepper.driver.editing import brought
from motorbus.families.stepper.driver.experiments import Motor
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.reading import dump
from motorbus.families.stepper.driver.stopping import stop
from motorbus.families.stepper.driver.study import Experiment, Study
from motorbus.families.stepper.driver.trials import RAMP_SECONDS, RAMP_STEPS, controls, trials
from motorbus.families.stepper.program.profile import Profile
from motorbus.families.stepper.table import (
    PROJECTS,
    TABLE,
    Order,
    Project,
    decode_image,
    refusals,
    row_value,
)

LEAST_TRAVEL: Final = 0.5
MOST_TRAVEL: Final = 100.0
VERB: Final = "characterise"
_CLEARLY: Final = 8
_NOMINAL: Final = Project(microsteps=8, step_angle=180)


class Borrowed(NamedTuple):
    """What is stored, by project, and the project that is edited again in the end."""

    stored: Mapping[int, bytes]
    home: Project
    order: Order


def characterise(node: Node, *, scratch: int = 4, travel: float = 1.0) -> Operation[Profile]:
    """Find out what can be found out: about two minutes, in which the motor turns now and then.

    Take the load off the motor first: it goes by up to 240 RPM, never more than `travel` turns (0.5 to 100) each way
    from where it is. Whatever runs is stopped first. Project `scratch`, 1 to 4, and project 1 are edited and not saved;
    edits of any project that were not saved are lost. In the end the first project of 1 to 4 that has steps is
    selected and edited as it is stored, and every project reads as before. How many microsteps the motor has is taken
    from the scratch project, or from that one.

    Reports `Experiment` before each experiment, `Progress` while writing, and what it is about to do to the journal:
    cut off by a crash, `recover` puts back what was edited; so does a power cycle.

    Raises RequestError for impossible numbers and when no project has steps, before anything is written;
    VerificationFailed when something does not read as it was written; OutcomeUnknown when a command that
    must be heard was not acknowledged: the motor may be turning if that was a stop; Interrupted when somebody
    stops the controller meanwhile.
    """
    if scratch not in range(1, PROJECTS + 1):
        raise _refused(f"scratch: there is no project {scratch!r}", f"1 to {PROJECTS}")
    if not (isfinite(travel) and LEAST_TRAVEL <= travel <= MOST_TRAVEL):
        raise _refused(f"travel: {travel!r} turns", f"{LEAST_TRAVEL:g} to {MOST_TRAVEL:g}")
    return (yield from Alone(_characterised(node, scratch, travel)))


def experiments(*, travel: float = 1.0) -> tuple[Experiment, ...]:
    """What `characterise` would do, for a motor of 1600 pulses a turn: sends nothing.

    Times are those of one repetition at most, without the commands that write it; each is done two or three times.
    """
    motor = Motor.of(_NOMINAL)
    found = [
        Experiment(one.name, one.what, one.settles, one.turns, one.longest({}))
        for one in (*controls(motor, 4), *trials(motor, 4, 3))
    ]
    turns = min(travel, RAMP_SECONDS * 240 / 60)
    ramps = ("ramp", "ramp_tick_ms")
    what = "two moves forward and two back, at several speeds and accelerations"
    return (*found, Experiment("ramp", what, ramps, turns, 2 * RAMP_SECONDS * RAMP_STEPS))


def _refused(what: str, expected: str) -> RequestError:
    return RequestError(what, expected=expected, advice="nothing was sent")


def _characterised(node: Node, scratch: int, travel: float) -> Operation[Profile]:
    yield from Report(Journal(VERB, ASKED, {"node": node.node}))
    yield from stop(node)
    stored: dict[int, bytes] = {}
    for number in range(1, PROJECTS + 1):
        stored[number] = (yield from dump(node, number))[wire.REPLY_LENGTH :]
    order = likely_order(tuple(stored.values()), node.order)
    home = _home(stored, order, scratch)
    own = decode_image(stored[scratch], order)
    motor = Motor.of(home if own.is_cleared else own)
    facts = {"node": node.node, "image": stored[home.number].hex(), "project": home.number}
    study = Study(Node(node.node, node.motor, order, node.memory), scratch, travel, stored, motor, home.number)
    yield from Report(Journal(VERB, INTENT, facts))
    found = yield from afterwards(
        study.work(), lambda: put_back(study.node, Borrowed(stored, home, study.node.order))
    )
    yield from Report(Journal(VERB, OUTCOME, {"node": node.node, "outcome": "restored"}))
    return found


def put_back(node: Node, borrowed: Borrowed) -> Operation[None]:
    """Stop it, and let what is edited be a stored project again, every field of it; then all four are read."""
    yield from stop(node)
    order = node.order
    here = Node(node.node, node.motor, order, node.memory)
    home = decode_image(borrowed.stored[borrowed.home.number], order)
    home = _numbered(home, borrowed.home.number)
    yield from brought(here, borrowed.stored[home.number], home, every=True)
    for number, image in borrowed.stored.items():
        now = (yield from dump(here, number))[wire.REPLY_LENGTH :]
        if decode_image(now, order) != decode_image(image, order):
            raise VerificationFailed(
                f"project {number} does not read as it did before the experiments",
                received=now,
                expected=image.hex(" ").upper(),
                advice="nothing was saved: a power cycle brings back what is stored",
                node=node.node,
            )


def _numbered(project: Project, number: int) -> Project:
    from dataclasses import replace

    return replace(project, number=number)


def _home(stored: Mapping[int, bytes], order: Order, scratch: int) -> Project:
    """The project that is edited again in the end. Raises RequestError when there is none that could be."""
    numbers = [number for number in stored if number != scratch]
    for number in (*numbers, scratch):
        project = _numbered(decode_image(stored[number], order), number)
        if not project.is_cleared and not any(refusals(project, expert=True)):
            return project
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
