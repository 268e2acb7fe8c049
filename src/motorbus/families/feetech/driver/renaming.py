"""Giving a servo another id: only when one servo has the old id and none the new one, and never half.

A write to an id reaches everybody who has it: two servos with one id would both be renamed (feetech-cli), and so would
an HLS servo whose second id it is, which hears writes and does not show in any answer. So the bus is looked over first.
For the same reason a second id that is the old id goes along: it would be the id of the next new servo.
The rest is `changing.py`; what becomes of a crash in the middle is `recovery.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from motorbus.core.family import Found
from motorbus.core.steps import ASKED, Emit, Exclusive, JournalEntry, SetBitrate
from motorbus.errors import WireError
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.changing import guarded
from motorbus.families.feetech.driver.exchanges import read_block
from motorbus.families.feetech.driver.identity import writable
from motorbus.families.feetech.driver.jobs import SET_ID, SHIPPED_ID, Job, Place
from motorbus.families.feetech.driver.node import IMAGE, Node, as_nodes, checked_id
from motorbus.families.feetech.driver.others import others_than
from motorbus.families.feetech.driver.placing import locked, refuse_taken, whoever
from motorbus.families.feetech.driver.sharing import refuse_duplicates


async def set_id(node: Node, new: int, *, among: Sequence[int] = ()) -> Found:
    """Give this servo the id `new`, for good; gives where it is now. A `Servo` of the new id speaks to it from then on.

    The servo goes limp. `among` are the ids that other servos on this bus may have; () means every one, which takes
    some seconds to ask. What it has already is not written again. The second id of an HLS servo becomes the new id,
    too, when it is the old one; any other second id stays.

    Raises RequestError (nothing was written) for an impossible id, one that answers already, two servos that seem to
    have the old id, an HLS servo that has one of both as its second id, or while another change on this bus is
    unfinished; DeviceError for a servo whose map is not known; OutcomeUnknown or VerificationFailed when it was cut off
    in the middle: a note says what became of it, and `recover` ends what is unfinished.
    """
    checked_id(new)
    asked = [one.node for one in as_nodes(among or range(wire.MAX_ID + 1))]
    await Emit(JournalEntry(SET_ID, ASKED, {}))
    image = await met_alone(node)
    assert node.identity is not None
    found = replace(node.identity, node=new)
    rate = await SetBitrate(0)
    job = Job(SET_ID, Place(node.node, rate), Place(new, rate), image)
    if new == node.node:
        await Exclusive(locked(job, node))
        return Found(new, rate, found)
    await refuse_duplicates(node)
    refuse_taken(Place(new, rate), await whoever(new))
    others = await others_than(node, asked, (new, node.node, SHIPPED_ID))
    job = job._replace(others=tuple(others))
    await guarded(job, node)
    return Found(new, rate, found)


async def met_alone(node: Node) -> bytes:
    """Registers 0 to 39 of a servo that may be written to. Garbled answers are called a bad line only when it does not
    seem to be two servos that give them. Raises RequestError when it does, otherwise as `writable`."""
    try:
        await writable(node)
        return await read_block(node, 0, IMAGE, bytes)
    except WireError:
        await refuse_duplicates(node)
        raise
