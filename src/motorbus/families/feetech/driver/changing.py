"""A change of id or baud rate from its first record to its last, with nobody else on the bus.

Written, proved at the new place and locked there (`placing.py`); when anything comes in between, an error or Ctrl-C,
the servo is looked for and brought to one of both places at once (`recovery.py`). Only what kills this process, or
parts it from the servo, leaves the journal open.
"""

from __future__ import annotations

from motorbus.core.steps import ASKED, INTENT, Emit, Exclusive, JournalEntry, SetBitrate, catch, with_cleanup
from motorbus.errors import MotorbusError, RequestError, VerificationFailed
from motorbus.families.feetech.driver.identity import learn
from motorbus.families.feetech.driver.jobs import SET_ID, SHIPPED_ID, Course, Job, Place
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.placing import (
    called,
    followed,
    locked,
    look,
    refuse_taken,
    rewritten,
    whoever,
)
from motorbus.families.feetech.driver.recovery import recovered


async def guarded(job: Job, node: Node) -> None:
    """Carry out the job on this servo with nobody else on the bus, once nothing has come between since all was looked
    over: other tasks of this program may have changed a servo meanwhile, this one, or another one to the same place.

    Raises RequestError then, with nothing written; otherwise as `changed`.
    """
    done: list[str] = []
    try:
        await Exclusive(_once_more(job, node, done))
    except BaseException as error:
        for end in done:  # an interruption that came when all was over
            error.add_note(_became(job, end))
        raise
    finally:
        node.forget_settings()


async def _once_more(job: Job, node: Node, done: list[str]) -> None:
    await Emit(JournalEntry(job.verb, ASKED, {}))
    await with_cleanup(_unchanged(job), lambda: SetBitrate(job.old.rate))
    learn(node, job.image)
    await changed(job, node, Course(job))
    done.append("new")


async def _unchanged(job: Job) -> None:
    """Is it as it was, is its new place free, and the id that a servo has whose own is torn?"""
    if await whoever(job.old.id) != job.image:
        raise RequestError(
            f"node {job.old.id} is not what it was a moment ago",
            expected="the same servo with the same settings",
            cause="another task of this program changes servos on this bus, too, or it has lost its supply",
            advice="change one after the other; nothing was written",
            node=job.old.id,
        )
    shipped = Place(SHIPPED_ID, job.old.rate)
    if job.verb == SET_ID and SHIPPED_ID not in (job.old.id, job.new.id, *job.others):
        refuse_taken(shipped, await whoever(shipped.id))
    await SetBitrate(job.new.rate)
    refuse_taken(job.new, await whoever(job.new.id))


async def changed(job: Job, node: Node, course: Course) -> None:
    """Carry out the job on this servo, whose settings are known, and close its journal; the rate is the bus's own in
    the end. On failure or interruption it is brought to one of both places, locked, as far as can be.

    Raises what has failed, with a note of what became of it, unless it came to its new place all the same.
    """
    ends: list[str | MotorbusError] = []
    try:
        await with_cleanup(_attempt(job, node, course, ends), lambda: _settled(job, course, ends))
    except BaseException as error:
        if isinstance(error, MotorbusError) and ends == ["new"]:
            return
        for end in ends:
            error.add_note(_became(job, end))
        if course.reached and not ends:  # interrupted again, in the middle of clearing up
            error.add_note("the change may be unfinished: recover() ends it")
        raise


def _became(job: Job, end: str | MotorbusError) -> str:
    if isinstance(end, MotorbusError):
        return f"the change is unfinished, recover() ends it: {end.summary}"
    return f"the servo is {called(job, job.new if end == 'new' else job.old)}, and locked"


async def _attempt(job: Job, node: Node, course: Course, ends: list[str | MotorbusError]) -> None:
    await _begun(course)
    there = await rewritten(job, node, job.new, course)
    await followed(job, there, job.new, course)
    await locked(job, there)
    if job.old.rate != job.new.rate:
        await SetBitrate(job.old.rate)
    if await look(job.old.id) != b"":
        raise VerificationFailed(
            f"a servo answers as {job.old.id} after node {job.old.id} became {called(job, job.new)}",
            expected="silence",
            cause="there were two servos with this id, and one of them has not heard the order",
            advice="take one of them off the bus, then recover()",
            node=job.old.id,
        )
    await course.end("new")
    ends.append("new")


async def _begun(course: Course) -> None:
    """Record the intent. What cannot be recorded does not begin, and the servo need not be looked for."""
    try:
        await course.reach(INTENT)
    except MotorbusError:
        closed = await catch(course.end("old"))  # the record may be on the disk all the same
        if closed is None or isinstance(closed, RequestError):  # that of another change says so
            course.reached.clear()
        raise


async def _settled(job: Job, course: Course, ends: list[str | MotorbusError]) -> None:
    """Whatever has happened: bring it to one of both places, and set the rate of the bus back."""

    async def recover() -> None:
        if course.reached and not ends:
            ends.append(await catch(recovered(job, course)))

    await with_cleanup(recover(), lambda: SetBitrate(job.old.rate))
