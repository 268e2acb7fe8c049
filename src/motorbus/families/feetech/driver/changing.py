"""A change of id or baud rate from its first record to its last, with nobody else on the bus.

Written, proved at the new place and locked there (`placing.py`); when anything comes in between, an error or Ctrl-C,
the servo is looked for and brought to one of both places at once (`recovery.py`). Only what kills this process, or
parts it from the servo, leaves the journal open.
"""

from __future__ import annotations

from motorbus.core.operation import INTENT, Operation, Tune, afterwards, outcome
from motorbus.errors import MotorbusError, VerificationFailed
from motorbus.families.feetech.driver.jobs import Course, Job
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.placing import called, locked, look, rewritten
from motorbus.families.feetech.driver.recovery import recovered


def changed(job: Job, node: Node, course: Course) -> Operation[None]:
    """Carry out the job on this servo, whose settings are known, and close its journal; the rate is the bus's own in
    the end. On failure or interruption it is brought to one of both places, locked, as far as can be.

    Raises what has failed, with a note of what became of it, unless it came to its new place all the same.
    """
    ends: list[str | MotorbusError] = []
    try:
        yield from afterwards(_attempt(job, node, course, ends), lambda: _settled(job, course, ends))
    except BaseException as error:
        if isinstance(error, MotorbusError) and ends == ["new"]:
            return
        for end in ends:
            error.add_note(_became(job, end))
        raise


def _became(job: Job, end: str | MotorbusError) -> str:
    if isinstance(end, MotorbusError):
        return f"the change is unfinished, recover() ends it: {end.summary}"
    return f"the servo is {called(job, job.new if end == 'new' else job.old)}, and locked"


def _attempt(job: Job, node: Node, course: Course, ends: list[str | MotorbusError]) -> Operation[None]:
    yield from course.reach(INTENT)
    there = yield from rewritten(job, node, job.new, course)
    yield from locked(job, there)
    if job.old.rate != job.new.rate:
        yield from Tune(job.old.rate)
    if (yield from look(job.old.id)) != b"":
        raise VerificationFailed(
            f"a servo answers as {job.old.id} after node {job.old.id} became {called(job, job.new)}",
            expected="silence",
            cause="there were two servos with this id, and one of them has not heard the order",
            advice="take one of them off the bus, then recover()",
            node=job.old.id,
        )
    yield from course.end("new")
    ends.append("new")


def _settled(job: Job, course: Course, ends: list[str | MotorbusError]) -> Operation[None]:
    """Whatever has happened: bring it to one of both places, and set the rate of the bus back."""
    if course.reached and not ends:
        ends.append((yield from outcome(recovered(job, course))))
    yield from Tune(job.old.rate)
