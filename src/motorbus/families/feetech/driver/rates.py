"""Giving a servo another baud rate: one its map has a code for, one the link can have, and never half.

The codes 5, 6 and 7 are 76800, 57600 and 38400 bit/s in every source of the vendor; some libraries write 57600, 38400
and 19200 there and lose the servo. The bus keeps its own rate: who changes several servos of one bus opens it at the
new rate afterwards. The rest is `changing.py`; what becomes of a crash in the middle is `recovery.py`.
"""

from __future__ import annotations

from collections.abc import Sequence

from motorbus.core.family import Found
from motorbus.core.register import RegisterMap
from motorbus.core.request import TimeoutClass
from motorbus.core.steps import ASKED, Emit, Exclusive, JournalEntry, SetBitrate, Sleep, catch, with_cleanup
from motorbus.errors import LinkLost, MotorbusError, NoReply, RequestError
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.changing import guarded
from motorbus.families.feetech.driver.exchanges import read_block
from motorbus.families.feetech.driver.identity import writable
from motorbus.families.feetech.driver.jobs import SET_BAUD, Job, Place
from motorbus.families.feetech.driver.node import IMAGE, Node, as_nodes
from motorbus.families.feetech.driver.others import others_than
from motorbus.families.feetech.driver.placing import NOISE, locked, refuse_taken, whoever
from motorbus.families.feetech.driver.renaming import met_alone
from motorbus.families.feetech.driver.scanning import DRAIN
from motorbus.families.feetech.driver.sharing import refuse_duplicates
from motorbus.families.feetech.table import BAUD_CODES, BAUD_CODES_OF


async def set_baud(node: Node, rate: int, *, among: Sequence[int] = ()) -> Found:
    """Let this servo speak at `rate` bit/s from now on, for good; gives where it is now. The bus keeps its own rate.

    The servo goes limp. `among` are the ids that other servos on this bus may have; () means every one, which takes
    some seconds to ask. What it has already is not written again.

    Raises RequestError (nothing was written) for a rate that its map or the link does not have, a servo of its id that
    answers at any other rate, two servos that seem to have its id, an HLS servo that has it as its second id, or while
    another change on this bus is unfinished; otherwise as `set_id`.
    """
    _refuse_unknown(rate)
    asked = [one.node for one in as_nodes(among or range(wire.MAX_ID + 1))]
    await Emit(JournalEntry(SET_BAUD, ASKED, {}))
    image = await met_alone(node)
    table = await writable(node)
    _refuse_lacking(node, table, rate)
    present = await SetBitrate(0)
    job = Job(SET_BAUD, Place(node.node, present), Place(node.node, rate), image)
    if rate == present:
        await Exclusive(locked(job, node))
        return Found(node.node, rate, node.identity)
    await refuse_duplicates(node)
    await Exclusive(with_cleanup(_look_there(job.new), lambda: SetBitrate(present)))
    await Exclusive(with_cleanup(_look_around(job), lambda: SetBitrate(present)))
    others = await others_than(node, asked, (node.node,))
    job = job._replace(others=tuple(others))
    await guarded(job, node)
    return Found(node.node, rate, node.identity)


def _refuse_unknown(rate: int) -> None:
    if isinstance(rate, bool) or not isinstance(rate, int) or rate not in BAUD_CODES.values():
        raise RequestError(
            f"{rate!r} bit/s is no rate of these servos",
            expected=", ".join(map(str, BAUD_CODES.values())),
            advice="nothing was sent",
        )


def _refuse_lacking(node: Node, table: RegisterMap, rate: int) -> None:
    known = [BAUD_CODES[code] for code in BAUD_CODES_OF[table.name]]
    if rate not in known:
        raise RequestError(
            f"node {node.node} has no code for {rate} bit/s: its register map is {table.name}",
            expected=", ".join(map(str, known)),
            advice="nothing was written",
            node=node.node,
        )


async def _look_there(there: Place) -> None:
    """Is the link able to have this rate, and is the id free there?"""
    await SetBitrate(there.rate)
    refuse_taken(there, await whoever(there.id))


async def _look_around(job: Job) -> None:
    """Has nobody its id at any other rate? One whose rate is torn may appear at each of them, and must be the only one.

    A rate that the link does not have is no place where anybody is looked for, before or after.
    """
    for rate in BAUD_CODES.values():
        if rate in (job.old.rate, job.new.rate):
            continue
        refusal = await catch(SetBitrate(rate))
        if isinstance(refusal, LinkLost):
            raise refusal
        if isinstance(refusal, MotorbusError):
            continue
        await Sleep(DRAIN)
        image = await catch(_glance(job.old.id))
        if isinstance(image, LinkLost):
            raise image
        if not isinstance(image, NoReply):
            refuse_taken(Place(job.old.id, rate), image if isinstance(image, bytes) else NOISE)


async def _glance(id: int) -> bytes:
    return await read_block(Node(id), 0, IMAGE, bytes, timeout=TimeoutClass.SCAN)
