"""After a crash or a loss of power in the middle of a change: find the servo, and end what was under way.

Wherever it is found, it ends under its old id and rate or under its new ones, locked, and the journal says which. A
cell whose write was cut may hold the old value, the new one, or neither: then the servo is looked for where one without
a valid id or rate might answer, as shipped. Carrying this out again, after another crash in the middle of it, does no
harm. One cell is one byte, so no order of writes avoids a torn one; a servo that answers to no id at all hears
broadcasts at the most, and those may be used only when it is alone on its bus; one that heeds no rate hears nothing.

Servos of one model cannot be told apart by more than their settings, and those that were written while the lock was
closed are gone after a power cut. So the servo is known by its model, its firmware and a place at which nobody else
answered before the change began; whoever answered before is never taken for it, and nothing new should be connected
until the change has ended. Whatever is written is judged by the settings just met, and a lock that was opened is closed
again, come what may.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, NamedTuple

from motorbus.core.request import Effect, Priority, TimeoutClass
from motorbus.core.steps import Emit, Exclusive, Progress, SetBitrate, Sleep, catch, with_cleanup
from motorbus.errors import LinkLost, MotorbusError, NoReply, OutcomeUnknown, RequestError, WireError
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.exchanges import Block, read_block, unanswered
from motorbus.families.feetech.driver.jobs import (
    AGAIN,
    SET_ID,
    SHIPPED_ID,
    WRITING,
    Course,
    Job,
    Place,
    elsewhere,
    job_of,
)
from motorbus.families.feetech.driver.node import IMAGE, Node
from motorbus.families.feetech.driver.others import others_than
from motorbus.families.feetech.driver.placing import (
    AWAKE,
    COMMIT,
    OPEN,
    followed,
    locked,
    look,
    met,
    rewritten,
    unlocked,
)
from motorbus.families.feetech.driver.sharing import duplicates
from motorbus.families.feetech.driver.torque import LIMP
from motorbus.families.feetech.table import BAUD_CODES

RESUMED: Final = "recovering"
ROUNDS: Final = 3
"""Times that everything is looked at again: a servo whose supply has just come back is deaf for a while."""
_REPEATS: Final = 3
_GLANCE: Final = 50
"""Polls that show whether two servos answer to the id as shipped."""


class Seen(NamedTuple):
    """A servo that answered: where, and its registers 0 to 39."""

    place: Place
    image: bytes


async def recover(node: Node, change: str, facts: Mapping[str, Any], *, alone: bool = False) -> str:
    """End a change that was cut off, as the journal tells of it: `change` its verb, `facts` what was known then.

    Gives "new" when the servo is under its new id or rate now, "old" when the change was taken back; locked in both
    cases. May be called again at any point. Who says `alone` vouches that no other servo is on this bus: then one that
    answers to no id any more is given its old one by broadcast.

    Raises NoReply when it is nowhere, OutcomeUnknown when two servos cannot be told apart, RequestError for facts of
    something else, or when `alone` is not true; the journal stays open then.
    """
    job = job_of(change, facts)
    course = Course(job, facts.get("reached", ()))
    present = await SetBitrate(0)

    async def work() -> str:
        await course.resume(RESUMED)
        return await recovered(job, course, alone=alone)

    try:
        return await Exclusive(with_cleanup(work(), lambda: SetBitrate(present)))
    except BaseException as error:
        if not isinstance(error, MotorbusError):  # one of ours says itself what to do
            error.add_note("the change may still be unfinished: recover() ends it")
        raise
    finally:
        node.forget_settings()


async def recovered(job: Job, course: Course, *, alone: bool = False) -> str:
    """As `recover`, with the bus for itself; may leave it at another rate."""
    for attempt in range(_REPEATS):
        found = await _found(job, course, alone)
        ended = await catch(_ended(job, course, found))
        if isinstance(ended, str):
            await course.end(ended)
            return ended
        if attempt == _REPEATS - 1:
            raise ended
        await Sleep(AWAKE)
    raise AssertionError("the loop above ends by itself")


async def _ended(job: Job, course: Course, found: Seen) -> str:
    """Bring the servo that was found to one of both places, for good, and lock it."""
    goal = found.place if found.place in (job.old, job.new) else job.old
    ended: list[str] = []
    await with_cleanup(
        _brought(job, course, found, goal, ended),
        lambda: _closed(job, found, goal) if not ended else SetBitrate(0),
    )
    return "new" if goal == job.new else "old"


async def _brought(job: Job, course: Course, found: Seen, goal: Place, ended: list[str]) -> None:
    place = found.place
    await SetBitrate(place.rate)
    node = met(place.id, found.image)
    again = place == goal and course.doubtful(goal) and await _may_be_lost(job, node, course)
    follows = job.second is not None and (course.following or found.image[job.second] != goal.id)
    if place != goal or again or follows:
        await others_than(node, job.others, (place.id, goal.id))
    if again:
        await course.reach(AGAIN)
    if place != goal or again:
        node = await rewritten(job, node, goal, course, found.image)
    if follows:
        await unlocked(job, node)
        await followed(job, node, goal, course)
    await locked(job, node)
    ended.append("locked")


async def _closed(job: Job, found: Seen, goal: Place) -> None:
    """Close the lock of a servo that could not be brought to its goal, wherever it is by now, as far as it answers."""
    await Sleep(COMMIT)  # a lock that closes too early may drop what is being stored
    for place in dict.fromkeys((found.place, goal)):
        await SetBitrate(place.rate)
        image = await catch(look(place.id))
        if isinstance(image, bytes) and image and job.is_like_it(image):
            await catch(locked(job, met(place.id, image)))


async def _may_be_lost(job: Job, node: Node, course: Course) -> bool:
    """May the write have met a closed lock, so that the value is gone at the next power-off?"""
    return AGAIN in course.reached or await read_block(node, job.lock, 1, bytes) != OPEN


# -- where is it? -------------------------------------------------------------------------------------------------


async def _found(job: Job, course: Course, alone: bool) -> Seen:
    """The servo, wherever it is. Raises NoReply, or OutcomeUnknown when two of them could be it."""
    for round in range(ROUNDS):
        here = await _among(job, (job.new, job.old))
        mine = [one for one in here if job.is_it(one.image)] or here
        if len(mine) > 1:
            raise await _two(job, mine)
        if mine:
            return mine[0]
        await Emit(Progress(round + 1, ROUNDS, f"looking for node {job.old.id}"))
        await Sleep(AWAKE)
    if alone:
        await _refuse_others(job)
    lost = await _lost(job, alone)
    if lost is not None:
        return lost
    if alone and job.verb == SET_ID:
        return await _called_back(job, course)
    raise _nowhere(job)


async def _among(job: Job, places: Iterable[Place]) -> list[Seen]:
    """Who of its kind answers at these places; nobody else did before the change began, see `guarded`."""
    found = []
    for place in dict.fromkeys(places):
        await SetBitrate(place.rate)
        try:
            image = await look(place.id)
        except WireError as garbled:
            raise _several(job, place) from garbled
        if image and job.is_like_it(image):
            found.append(Seen(place, image))
    return found


async def _lost(job: Job, alone: bool) -> Seen | None:
    """Where a servo may be whose cell holds neither value: as shipped; when it is alone, under any id at all.

    Whoever answered there before the change began is somebody else, and may look just like it.
    """
    taken = _others(job, alone)
    if job.verb == SET_ID:  # its rate is not touched: one of its kind at another rate is somebody else
        ids = (SHIPPED_ID, *(range(wire.MAX_ID + 1) if alone else ()))
        places = elsewhere(job, [id for id in ids if id not in taken], (job.old.rate,))
    else:
        places = elsewhere(job, (job.old.id,), tuple(BAUD_CODES.values()))
    for place in places:
        one = await _glimpsed(job, place)
        if one is not None:
            return one
    if SHIPPED_ID in taken and job.verb == SET_ID:
        await _hidden(job)
    return None


def _others(job: Job, alone: bool) -> set[int]:
    """Ids of other servos; when it is alone now, the one as shipped may be its own meanwhile."""
    return set(job.others) - ({SHIPPED_ID} if alone else set())


async def _glimpsed(job: Job, place: Place) -> Seen | None:
    """One of its kind at a place where nobody answered before; silence is the usual answer and is not waited for."""
    image = await catch(_asked(place))
    if isinstance(image, LinkLost):
        raise image
    return Seen(place, image) if isinstance(image, bytes) and job.is_like_it(image) else None


async def _asked(place: Place) -> bytes:
    await SetBitrate(place.rate)  # a rate that this link cannot have is no place to look at
    return await read_block(Node(place.id), 0, IMAGE, bytes, timeout=TimeoutClass.SCAN)


async def _hidden(job: Job) -> None:
    """Raise OutcomeUnknown when it seems to have joined another servo at the id as shipped."""
    await SetBitrate(job.old.rate)
    found = await catch(duplicates(Node(SHIPPED_ID), _GLANCE))
    if not isinstance(found, MotorbusError) and found.suspected:
        raise _several(job, Place(SHIPPED_ID, job.old.rate))


async def _called_back(job: Job, course: Course) -> Seen:
    """Give a servo that answers to no id its old one by broadcast; nobody else is there to hear it."""
    await SetBitrate(job.old.rate)
    limp = wire.write(wire.BROADCAST, LIMP.address, LIMP.data)
    await unanswered(limp, LIMP.effect, priority=Priority.STOP)
    await course.reach(WRITING, job.old)
    for block in (Block(job.lock, OPEN, Effect.PERSISTENT), job.block(job.old)):
        request = wire.write(wire.BROADCAST, block.address, block.data)
        await unanswered(request, block.effect, priority=Priority.CONFIGURATION)
        await Sleep(COMMIT)
    found = await _among(job, (job.old,))
    if not found:
        raise NoReply(
            f"the servo that was {job.old.id} does not answer after a broadcast either",
            cause="it has no power, it is not connected, or it heeds no rate that is tried",
            advice="FD, the vendor's program, may find it; `motorbus recover BUS --forget` gives the change up",
            node=job.old.id,
        )
    return found[0]


async def _refuse_others(job: Job) -> None:
    """Raise RequestError when somebody answers who cannot be the servo, or more than one does."""
    await SetBitrate(job.old.rate)
    there = []
    for id in range(wire.MAX_ID + 1):
        answer = await catch(read_block(Node(id), 0, IMAGE, bytes, timeout=TimeoutClass.SCAN))
        if isinstance(answer, LinkLost):
            raise answer
        if not isinstance(answer, NoReply):
            known = id in _others(job, alone=True)
            there.append((id, isinstance(answer, bytes) and job.is_like_it(answer) and not known))
    others = [id for id, is_it in there if not is_it or len(there) > 1]
    if others:
        raise RequestError(
            f"the servo is not alone: {', '.join(map(str, others))} answer",
            expected="no other servo on this bus",
            cause="servos of one kind, set alike, cannot be told apart, and a broadcast reaches them all",
            advice="take every other servo off this bus; nothing was written",
            node=others[0],
        )


def _nowhere(job: Job) -> NoReply:
    ids = " or ".join(str(id) for id in dict.fromkeys((job.old.id, job.new.id)))
    rates = " or ".join(str(rate) for rate in dict.fromkeys((job.old.rate, job.new.rate)))
    by_broadcast = (
        "; when it is the only servo on this bus, recover(alone=True) gives it its old id by broadcast"
        if job.verb == SET_ID
        else ""
    )
    return NoReply(
        f"the servo that was {job.old.id} is nowhere: neither as {ids} at {rates} bit/s nor as shipped",
        cause="it has no power, it is not connected, or the write of its cell was cut and it heeds no id or rate now",
        advice=f"see that it has power, then recover() again{by_broadcast}",
        node=job.old.id,
    )


# -- what cannot be decided ---------------------------------------------------------------------------------------


async def _two(job: Job, found: Sequence[Seen]) -> MotorbusError:
    """Both places are taken by servos of its kind: lock both, for one of them may be open, and say so."""
    for one in found:
        await SetBitrate(one.place.rate)
        await catch(locked(job, met(one.place.id, one.image)))
    where = " and ".join(f"{one.place.id} at {one.place.rate} bit/s" for one in found)
    return OutcomeUnknown(
        f"servos answer as {where}: which of them is the one that was to change is not known",
        expected="one of them",
        cause="another servo was connected meanwhile, or two had the same id",
        advice="take the one off this bus that does not belong to the change, then recover() again; both are locked",
        node=job.old.id,
    )


def _several(job: Job, place: Place) -> OutcomeUnknown:
    return OutcomeUnknown(
        f"two servos seem to answer as {place.id} at {place.rate} bit/s",
        expected="one",
        cause="two servos had one id, or the one that was to change has become what it was as shipped",
        advice="connect the one that was to change alone, then recover(alone=True)",
        node=place.id,
    )
