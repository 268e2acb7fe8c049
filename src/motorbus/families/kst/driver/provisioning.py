"""Giving a servo its id and its bit rate, from the first look to the proof after the restart.

Five things make this more than two writes: nothing is in force before a save and a restart; the save is not
answered; no command restarts, so a person must; two servos with one id cannot be told apart afterwards; and power may
go at any moment. So the state is always found out by asking, never remembered: whoever calls this again, after
whatever happened, goes on from where things stand. "Saved" is only said after the servo came back with it.
Source: KST CAN protocol manual, commands 1 to 4.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.core.request import Priority
from motorbus.core.steps import Emit, Exclusive, Progress, SetBitrate, Sleep, with_cleanup
from motorbus.errors import NoReply, OutcomeUnknown, RequestError, VerificationFailed
from motorbus.families.kst.driver.exchanges import order
from motorbus.families.kst.driver.identity import code_of, identify, write_node_id
from motorbus.families.kst.driver.keeping import save
from motorbus.families.kst.driver.node import Node, checked_id, hexadecimal
from motorbus.families.kst.driver.presence import Presence, glance, glance_at, single, survey
from motorbus.families.kst.driver.refusals import above_zero
from motorbus.families.kst.driver.scanning import called

PATIENCE: Final = 120.0
"""s to wait for the power cycle."""
POLL: Final = 0.1
"""s between two looks at whether it has come back."""
GONE: Final = 3
"""Silent looks in a row that count as a loss of power; a single one may be a lost frame."""
STEPS: Final = 4


class PowerCycleNeeded(NamedTuple):
    """An event: the servo was told to save; somebody must now take its supply away and give it back."""

    node: int
    new_id: int
    new_rate: int


class Provisioned(NamedTuple):
    """A servo that came back under this id and at this rate (bit/s); `resumed`: it had them already when asked."""

    node: int
    rate: int
    firmware: str
    resumed: bool


class Job(NamedTuple):
    """What is wanted: of the servo `old`, at `rate` now, to become `new` at `new_rate`."""

    old: Node
    new: Node
    rate: int
    new_rate: int

    @property
    def moves_rate(self) -> bool:
        return self.new_rate != self.rate


class Place(NamedTuple):
    """Where the servo was found, and what is known of a restart: the id it read back when everything was written."""

    node: Node
    rate: int
    reads_back: int | None = None


async def provision(
    node: Node, *, new_id: int | None = None, new_rate: int | None = None, patience: float = PATIENCE
) -> Provisioned:
    """Give this servo another id, another bit rate (bit/s), or both, and see it come back with them.

    Checks that one servo alone answers and that the new id is free, writes, reads back, saves, reports
    `PowerCycleNeeded`, waits at most `patience` seconds for it to come back, and verifies. May be called again at any
    point. Whoever names a new rate says that this bus may be spoken to at it; it is listened to first.

    Raises RequestError (nothing was written) for an impossible id or rate, an id that is taken, two servos with one id,
    or another rate while other servos are on the bus; NoReply when it is nowhere; VerificationFailed when it comes back
    as it was, or beside another servo with its new id; OutcomeUnknown when it does not come back in time, or somebody
    answers under the old id and the new one.
    """
    if new_id is None and new_rate is None:
        raise RequestError(
            "what shall it become?", expected="new_id=, new_rate=, or both", advice="nothing was sent"
        )
    above_zero("patience", patience, "s", node=node.node)
    new = node if new_id is None else Node(checked_id(new_id), node.dialect)
    if new_rate is not None:
        code_of(new_rate)
    rate = await SetBitrate(0)
    job = Job(node, new, rate, rate if new_rate is None else new_rate)
    place = await Exclusive(with_cleanup(_changed(job), lambda: SetBitrate(rate)))
    if place is not None:
        await Emit(PowerCycleNeeded(node.node, new.node, job.new_rate))
        await _waited(job, place, patience)
    await Emit(Progress(STEPS - 1, STEPS, "it is back: verifying"))
    return await Exclusive(with_cleanup(_verified(job, place), lambda: SetBitrate(rate)))


async def set_id(node: Node, new: int, *, patience: float = PATIENCE) -> Provisioned:
    """Give this servo the id `new`; as `provision`, which see. It is in force after the power cycle this waits for."""
    return await provision(node, new_id=new, patience=patience)


async def set_baud(node: Node, rate: int, *, patience: float = PATIENCE) -> Provisioned:
    """Let this servo speak at `rate` bit/s; as `provision`, which see. The bus keeps its own rate."""
    return await provision(node, new_rate=rate, patience=patience)


# --- find out where things stand, and write what is missing -------------------------------------------------


async def _changed(job: Job) -> Place | None:
    """Write and save; returns where it was found. None when it has everything already, and nothing was written."""
    await Emit(Progress(0, STEPS, "looking who is there"))
    where = await _found(job)
    before = await glance(where.node)
    if (where.node.node, where.rate) == (job.new.node, job.new_rate):
        return None
    if where.rate != job.new_rate:
        await _alone_here(job, where)
    dialect = job.new.dialect
    dialect.learn_format(job.new.node, dialect.extended(where.node.node))  # it is the same servo
    await Emit(Progress(1, STEPS, f"writing to {hexadecimal(where.node.node)}"))
    if where.node.node != job.new.node or before.reads_back not in (None, job.new.node):
        await write_node_id(where.node, job.new.node)
    if where.rate != job.new_rate:
        row = where.node.table["bit_rate_code"]
        await order(where.node, row, code_of(job.new_rate), priority=Priority.CONFIGURATION)
    seen = await glance(where.node)
    await Emit(Progress(2, STEPS, "saving"))
    await save(where.node)
    return where._replace(reads_back=seen.reads_back)


async def _found(job: Job) -> Place:
    """Under which of both ids, and at which of both rates, does it answer now?"""
    for rate in dict.fromkeys((job.rate, job.new_rate)):
        if rate != job.rate:
            await glance_at(job.old.dialect, rate)
        there = await _at_this_rate(job, rate)
        if there is not None:
            return there
    raise NoReply(
        f"no servo answers as {_ids(job)}",
        expected=f"one servo at {' or '.join(map(str, dict.fromkeys((job.rate, job.new_rate))))} bit/s",
        cause="no power, a loose cable, another id, or another bit rate",
        advice="`motorbus scan BUS` lists who answers; nothing was written",
        node=job.old.node,
    )


async def _at_this_rate(job: Job, rate: int) -> Place | None:
    old = await single(job.old)
    if job.new.node == job.old.node:
        return Place(job.old, rate) if old else None
    new = await single(job.new)
    if old and new:
        raise RequestError(
            f"the id {hexadecimal(job.new.node)} is taken: a servo answers as it beside {hexadecimal(job.old.node)}",
            advice="choose a free id, or take that servo off the bus; nothing was written",
            node=job.new.node,
        )
    if new:
        return Place(job.new, rate)
    return Place(job.old, rate) if old else None


async def _alone_here(job: Job, where: Place) -> None:
    """A servo that comes back at another rate breaks the frames of those that stay at this one."""
    there: set[int] = set()
    for extended in sorted(job.old.dialect.formats):
        there |= {reply.lane for reply in (await called(extended, Priority.POLL)).replies}
    others = ", ".join(map(hexadecimal, sorted(there - {job.old.node, job.new.node})))
    if others:
        raise RequestError(
            f"{hexadecimal(where.node.node)} is not alone: {others} would stay at {where.rate} bit/s",
            expected="this servo alone, where its bit rate changes",
            cause="servos at two rates on one bus break each other's frames",
            advice="connect it alone; all at once are changed by broadcast_bit_rate() and broadcast_save(); "
            "nothing was written",
            node=where.node.node,
        )


def _ids(job: Job) -> str:
    ids = dict.fromkeys((job.old.node, job.new.node))
    return " or ".join(hexadecimal(node) for node in ids)


# --- wait for the power cycle, and prove it -----------------------------------------------------------------


async def _waited(job: Job, place: Place, patience: float) -> None:
    """Look at the old place and the new one in turn until it shows up at the new one."""
    begun: float | None = None
    silent = 0
    while True:
        now = await _seen(job, place.node, place.rate)
        begun = now.at if begun is None else begun
        came_back = silent >= GONE and now.there and not _pending(job, place, now)
        silent = 0 if now.there else silent + 1
        arrived = await _arrived(job, place, now)
        if arrived and not now.there:
            return
        if now.there and (came_back or _forgot(job, place, now)):
            raise _both(job, place) if arrived else _as_it_was(job, place)
        if now.at - begun > patience:
            raise _never_came(job, patience)
        await Sleep(POLL)


async def _arrived(job: Job, place: Place, now: Presence) -> bool:
    """Does it answer as it should by now? At another rate it is looked for only when it is silent at the old one, and
    only while nobody else is heard there."""
    if now.there and place.rate != job.new_rate:
        return False
    try:
        return (await _seen(job, job.new, job.new_rate)).there
    except RequestError:
        return False


async def _seen(job: Job, node: Node, rate: int) -> Presence:
    """One look at this id and rate; at another rate than the bus has, with the bus alone and its rate set again."""
    if rate == job.rate:
        return await glance(node)
    return await Exclusive(with_cleanup(_tuned(node, rate), lambda: SetBitrate(job.rate)))


async def _tuned(node: Node, rate: int) -> Presence:
    await glance_at(node.dialect, rate)
    return await glance(node)


def _pending(job: Job, place: Place, now: Presence) -> bool:
    """It answers as before and reads back the id to come: it was silent for a while, and has not restarted."""
    return now.reads_back == job.new.node != place.node.node


def _forgot(job: Job, place: Place, now: Presence) -> bool:
    """It read back the id to come, and reads back the old one now: it has restarted without it."""
    return place.reads_back == job.new.node != place.node.node and now.reads_back == place.node.node


async def _verified(job: Job, place: Place | None) -> Provisioned:
    if job.moves_rate:
        await SetBitrate(job.new_rate)
    if place is not None and await _still_there(job, place):
        raise _both(job, place)
    if (await survey(job.new)).several:
        raise _shared(job)
    identity = await identify(job.new)
    found = identity.details["reads_back_id"]
    if found not in (None, job.new.node):
        raise VerificationFailed(
            f"it answers as {hexadecimal(job.new.node)} and reads back the id {found}",
            expected=str(job.new.node),
            cause="another id was written to it since, which the next restart may bring into force",
            advice=f"set_node_id({job.new.node}) and save() put that right; then power-cycle it, and call this again",
            node=job.new.node,
        )
    await Emit(Progress(STEPS, STEPS, "verified after the restart"))
    return Provisioned(job.new.node, job.new_rate, identity.firmware, resumed=place is None)


async def _still_there(job: Job, place: Place) -> bool:
    """Does somebody answer under the id that it is to have no more? A single look before may have been lost."""
    if place.rate != job.new_rate or place.node.node == job.new.node:
        return False
    return (await glance(place.node)).there


def _both(job: Job, place: Place) -> OutcomeUnknown:
    return OutcomeUnknown(
        f"{hexadecimal(job.new.node)} answers, and {hexadecimal(place.node.node)} does too: which of them is the servo "
        "that was provisioned is not known",
        expected=f"{hexadecimal(job.new.node)} alone",
        cause="another servo has joined the bus meanwhile, or this one has not restarted",
        advice="take one of them off the bus, then call provision again: it finds out where things stand",
        node=job.new.node,
    )


def _shared(job: Job) -> VerificationFailed:
    return VerificationFailed(
        f"two servos answer as {hexadecimal(job.new.node)} after the restart, or the bus is disturbed",
        expected="one servo",
        cause="a servo that had this id already was silent when it was looked for, and has joined the bus since",
        advice="take one of them off the bus, then provision the other one to a free id",
        node=job.new.node,
    )


def _as_it_was(job: Job, place: Place) -> VerificationFailed:
    return VerificationFailed(
        f"{hexadecimal(place.node.node)} came back as it was, at {place.rate} bit/s: the change was not saved",
        expected=f"{hexadecimal(job.new.node)} at {job.new_rate} bit/s",
        cause="its supply went before its flash was written, or it did not hear the save, which it never answers",
        advice="call provision again, and keep its supply on until the power cycle is asked for",
        node=place.node.node,
    )


def _never_came(job: Job, patience: float) -> OutcomeUnknown:
    return OutcomeUnknown(
        f"{hexadecimal(job.old.node)} was told to become {hexadecimal(job.new.node)} at {job.new_rate} bit/s and to "
        f"save; it was not seen to come back within {patience:g} s",
        cause="its supply has not been taken away and given back yet, and there is no other way to restart it",
        advice="power-cycle it, then call provision again with the same arguments: it finds out where things stand",
        node=job.old.node,
    )
