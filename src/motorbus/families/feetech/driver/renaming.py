"""Giving a servo another id: only when one servo has the old id and none the new one, and never half.

A write to an id reaches everybody who has it: two servos with one id would both be renamed (feetech-cli), and so would
an HLS servo whose second id it is, which hears writes and does not show in any answer. So the bus is looked over first.
The rest is `changing.py`; what becomes of a crash in the middle is `recovery.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from motorbus.core.family import Found
from motorbus.core.operation import ASKED, Alone, Journal, Operation, Progress, Report, Timeout, Tune, outcome
from motorbus.errors import NoReply, RequestError
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.changing import changed
from motorbus.families.feetech.driver.exchanges import read_block
from motorbus.families.feetech.driver.identity import identify, identity_of, writable
from motorbus.families.feetech.driver.jobs import SET_ID, Course, Job, Place
from motorbus.families.feetech.driver.node import IMAGE, Node, as_nodes, checked_id
from motorbus.families.feetech.driver.placing import locked, refuse_taken, whoever
from motorbus.families.feetech.driver.sharing import refuse_duplicates
from motorbus.families.feetech.table import TABLES

_HEAD: Final = 5


def set_id(node: Node, new: int, *, among: Sequence[int] = ()) -> Operation[Found]:
    """Give this servo the id `new`, for good; gives where it is now. A `Servo` of the new id speaks to it from then on.

    The servo goes limp. `among` are the ids that other servos on this bus may have; () means every one, which takes
    some seconds to ask. What it has already is not written again.

    Raises RequestError (nothing was written) for an impossible id, one that answers already, two servos that seem to
    have the old id, an HLS servo that has one of both as its second id, or while another change on this bus is
    unfinished; DeviceError for a servo whose map is not known; OutcomeUnknown or VerificationFailed when it was cut off
    in the middle: a note says what became of it, and `recover` ends what is unfinished.
    """
    checked_id(new)
    asked = [one.node for one in as_nodes(among or range(wire.MAX_ID + 1))]
    yield from Report(Journal(SET_ID, ASKED, {}))
    yield from writable(node)
    rate = yield from Tune(0)
    image = yield from read_block(node, 0, IMAGE, bytes)
    job = Job(SET_ID, Place(node.node, rate), Place(new, rate), image)
    if new == node.node:
        yield from Alone(locked(job, node))
        return Found(new, rate, (yield from identify(node)))
    yield from refuse_duplicates(node)
    refuse_taken(Place(new, rate), (yield from whoever(new)))
    others = yield from others_than(node, asked, (new, node.node))
    job = job._replace(others=tuple(others))
    try:
        yield from Alone(changed(job, node, Course(job)))
    finally:
        node.forget_settings()
    return Found(new, rate, (yield from identify(Node(new))))


def others_than(node: Node, asked: Sequence[int], ids: Sequence[int]) -> Operation[list[int]]:
    """Who else is on this bus, of these ids; a servo whose second id is one of `ids` raises RequestError."""
    others = []
    for done, id in enumerate(asked):
        yield from Report(Progress(done + 1, len(asked), f"who else is there? id {id}"))
        if id == node.node:
            continue
        head = yield from outcome(read_block(Node(id), 0, _HEAD, bytes, timeout=Timeout.SCAN))
        if isinstance(head, NoReply):
            continue
        others.append(id)
        if isinstance(head, bytes):
            yield from _refuse_second(id, head, ids)
    return others


def _refuse_second(id: int, head: bytes, ids: Sequence[int]) -> Operation[None]:
    table = TABLES.get(identity_of(id, head).table)
    if table is None or "second_id" not in table:
        return
    row = table["second_id"]
    second = yield from read_block(Node(id), row.address, row.size, row.decode)
    if second in ids:
        raise RequestError(
            f"servo {id} has {second} as its second id: it would obey every write to {second} without a word",
            expected="no servo whose second id is one of " + " and ".join(map(str, ids)),
            cause="HLS servos hear writes to a second id (register 7)",
            advice=f"take servo {id} off the bus meanwhile; nothing was written",
            node=id,
        )
