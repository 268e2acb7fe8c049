"""The steps by which a servo gets to another id or rate: write the cell, see the servo there, lock it there.

Nothing here believes an acknowledgement: that of the id may come from the old id, from the new one (microduck-replica),
or not at all, that of the rate at either rate. What proves the change is the servo at its new place with all its other
registers as they were, and its lock still open: a servo that has lost its supply since would have it closed again, and
the write would be lost with the next power-off (FD 1.9.8.5: 1 means that writes are not kept). The lock is then closed
under the new id, or the EEPROM would stay open for good (microduck-replica).
"""

from __future__ import annotations

from typing import Final

from motorbus.core.request import Effect, Priority, TimeoutClass
from motorbus.core.steps import SetBitrate, Sleep
from motorbus.errors import NoReply, OutcomeUnknown, RequestError, WireError
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.exchanges import Block, confirmed, read_block, unanswered, verified
from motorbus.families.feetech.driver.identity import learn
from motorbus.families.feetech.driver.jobs import SECOND, WRITING, WRITTEN, Course, Job, Place
from motorbus.families.feetech.driver.node import IMAGE, Node
from motorbus.families.feetech.driver.torque import disable_torque

COMMIT: Final = 0.1
"""s until a cell is written and whatever was said of it has come: 21 ms were exceeded by a write to flash (a public
recovery tool for STS3215), at least 50 ms are to be left after a change of id or rate (feetech-cli). A
servo that acknowledges first, takes longer than this to store, and drops what is not stored when its lock closes, would
lose the write unseen; none is known."""
AWAKE: Final = 0.05
"""s between two looks at a servo that may still be starting."""
LOOKS: Final = 3
OPEN: Final = b"\0"
CLOSED: Final = b"\1"
NOISE: Final = b"\xff"
"""Stands for bytes that are no answer."""


async def rewritten(job: Job, node: Node, goal: Place, course: Course, before: bytes = b"") -> Node:
    """Write the cell with the lock open and see the servo at its goal; gives it as it is there, its lock open.

    `before` are its registers 0 to 39 as they are now, where they may differ from those of the job.

    Raises OutcomeUnknown when it is not seen there, or its lock has been closed since: it has lost its supply.
    """
    await unlocked(job, node)
    await course.reach(WRITING, goal)
    block = job.block(goal)
    request = wire.write(node.node, block.address, block.data)
    await unanswered(request, block.effect, priority=Priority.CONFIGURATION)
    await Sleep(COMMIT)
    await SetBitrate(goal.rate)
    image = await seen(goal.id)
    if not job.is_at(goal, image, before):
        raise _not_there(job, goal, image)
    there = like(node, goal.id)
    await _still_open(job, there)
    await course.reach(WRITTEN, goal)
    return there


async def followed(job: Job, node: Node, goal: Place, course: Course) -> None:
    """Write the second id of a servo that is at its goal, its lock open, where it goes along (`Job.second`).

    Raises VerificationFailed when it reads back different, OutcomeUnknown when the lock has been closed since.
    """
    if job.second is None:
        return
    await course.reach(SECOND, goal)
    block = Block(job.second, bytes((goal.id,)), Effect.PERSISTENT)
    await confirmed(node, block, priority=Priority.CONFIGURATION, timeout=TimeoutClass.STORE)
    await Sleep(COMMIT)
    await verified(node, block, timeout=TimeoutClass.STORE)
    await _still_open(job, node)


async def unlocked(job: Job, node: Node) -> None:
    """Open the lock of a servo, and let it go limp: in this order, for one that restarts later has its lock closed."""
    await confirmed(node, Block(job.lock, OPEN, Effect.PERSISTENT), timeout=TimeoutClass.STORE)
    await disable_torque(node)


async def _still_open(job: Job, node: Node) -> None:
    if await read_block(node, job.lock, 1, bytes) != OPEN:
        raise OutcomeUnknown(
            f"node {node.node} has closed its lock by itself: it has lost its supply in the middle of the change",
            expected="an open lock",
            cause="a loose supply cable, or somebody switched it off",
            advice="see that its supply stays on, then recover()",
            node=node.node,
        )


async def locked(job: Job, node: Node) -> None:
    """Close the lock of a servo, whose settings are known, and see that it is closed."""
    block = Block(job.lock, CLOSED, Effect.PERSISTENT)
    await confirmed(node, block, priority=Priority.CONFIGURATION, timeout=TimeoutClass.STORE)
    await verified(node, block, timeout=TimeoutClass.STORE)


async def look(id: int) -> bytes:
    """Registers 0 to 39 of whoever answers to this id; b"" for silence. Raises WireError for what is no answer."""
    try:
        return await read_block(Node(id), 0, IMAGE, bytes)
    except NoReply:
        return b""


async def whoever(id: int) -> bytes:
    """As `look`; what is no answer counts as somebody."""
    try:
        return await look(id)
    except WireError:
        return NOISE


def refuse_taken(place: Place, image: bytes) -> None:
    """Raise RequestError when somebody has answered at the place where a servo shall be."""
    if image == b"":
        return
    who = "bytes that are no answer came" if image == NOISE else "a servo answers"
    raise RequestError(
        f"the id {place.id} is taken at {place.rate} bit/s: {who}",
        expected="silence",
        cause="two servos with one id cannot be told apart, and every write reaches both",
        advice="choose a free id, or take the other servo off the bus; nothing was written",
        node=place.id,
    )


async def seen(id: int) -> bytes:
    """As `look`, for a servo that ought to be there and may still be starting."""
    for _ in range(LOOKS - 1):
        image = await look(id)
        if image != b"":
            return image
        await Sleep(AWAKE)
    return await look(id)


def met(id: int, image: bytes) -> Node:
    """The servo with these registers 0 to 39, ready to be written to."""
    node = Node(id)
    learn(node, image)
    return node


def like(node: Node, id: int) -> Node:
    """The same servo under this id."""
    there = Node(id)
    there.identity, there.table, there.settings = node.identity, node.table, node.settings
    return there


def _not_there(job: Job, goal: Place, image: bytes) -> OutcomeUnknown:
    return OutcomeUnknown(
        f"node {job.old.id} was told to become {called(job, goal)} and is not seen there as it was",
        received=image,
        expected="all its other registers unchanged",
        cause="the order was lost, or the servo has lost its supply"
        if not image
        else "another servo is there",
        advice="recover() finds it and ends the change",
        node=job.old.id,
    )


def called(job: Job, place: Place) -> str:
    """What this place is called, where only ids differ, or only rates."""
    return str(place.id) if job.old.rate == job.new.rate else f"one at {place.rate} bit/s"
