"""Looking for servos: one broadcast read that all answer, then the silent ids one by one, many in flight at once.

Looking reads what every make has, the node id above all, and never writes: the goal position of these servos is the
preset of some encoders. A refusal counts as presence, too. Where nobody answers in the id format that is spoken, 11
bits by the manual, the other one is tried, for the manual prints identifiers in a way that may mean either. What does
not fit (two answers to one request, another id than the one that answers, bus errors) is told as a `Suspicion`.
Source: a public demo driver for the broadcast; the rest is CiA 301.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from motorbus.core.family import Found, Identity
from motorbus.core.request import ANY, EVERY_LANE, Priority, Request, Response, TimeoutClass
from motorbus.core.steps import Emit, Exclusive, Progress, SetBitrate, catch, gather, with_cleanup
from motorbus.errors import LinkError, LinkLost, NoReply, WireError
from motorbus.families.kst import wire
from motorbus.families.kst.driver.dialect import PLAIN, WINDOW, Dialect
from motorbus.families.kst.driver.exchanges import NODE_ID
from motorbus.families.kst.driver.feedback import position
from motorbus.families.kst.driver.identity import identify
from motorbus.families.kst.driver.listening import GLANCE, Heard, heard
from motorbus.families.kst.driver.node import Node, checked_ids
from motorbus.families.kst.driver.presence import glance
from motorbus.families.kst.wire import SdoReply

BROKEN: Final = (
    "the first frame was broken and nobody answered it, so no more were sent: this bus uses another rate"
)
OTHER_FORMAT: Final = {
    True: "answers in identifiers of 29 bits, which this bus does not speak: open it with id_format=ext",
    False: "answers in identifiers of 11 bits, which this bus does not speak: open it with id_format=std",
}
PASSES: Final = 2
"""Whoever is silent is asked once more: the first frame after power-up may be missed."""


class Suspicion(NamedTuple):
    """An event: something at this rate (and node; 0 for the bus) that a person should look at."""

    node: int
    rate: int
    what: str


class Skipped(NamedTuple):
    """An event: nothing was sent at this rate, and why."""

    rate: int
    why: str


async def scan(ids: Sequence[int] = (), rates: Sequence[int] = (), dialect: Dialect = PLAIN) -> list[Found]:
    """Every servo that answers, with what it is; `ids` () means all, by a broadcast first; `rates` () the present one.

    Who names other rates says that the bus may be spoken to at them. Even so each is listened to first, where the
    adapter can, and left out (`Skipped`) when errors show that the bus is in use at another rate; `scan_bit_rates`
    is for a bus of which nothing is known. What is sent first there is one broadcast, and no more where that was
    broken. The rate is set again at the end, whatever happens. Reports `Found` as soon as one answers, `Progress` and
    `Suspicion`. Writes nothing.
    """
    asked = checked_ids(ids or wire.NODES)
    present = await SetBitrate(0)
    if not rates or tuple(rates) == (present,):
        return await at_one_rate(dialect, asked, present, broadcast=not ids)
    everywhere = _at_all_rates(dialect, asked, tuple(rates), present, broadcast=not ids)
    return await Exclusive(with_cleanup(everywhere, lambda: SetBitrate(present)))


async def _at_all_rates(
    dialect: Dialect, asked: Sequence[int], rates: Sequence[int], present: int, *, broadcast: bool
) -> list[Found]:
    found: list[Found] = []
    for index, rate in enumerate(rates):
        if rate != present and await _in_use(dialect, rate):
            await Emit(Skipped(rate, Heard.ERRORS.value))
            continue
        try:
            await SetBitrate(rate)
        except LinkLost:
            raise
        except LinkError as unable:  # an adapter need not have every rate
            await Emit(Skipped(rate, unable.summary))
            continue
        careful = rate != present
        part = (index, len(rates))
        found += await at_one_rate(
            dialect, asked, rate, broadcast=broadcast or careful, careful=careful, part=part
        )
    return found


async def _in_use(dialect: Dialect, rate: int) -> bool:
    """Do errors show that the bus is in use at another rate? Nobody knows, with an adapter that cannot just listen."""
    try:
        return await heard(dialect, rate, GLANCE) is Heard.ERRORS
    except LinkLost:
        raise
    except LinkError:
        return False


async def at_one_rate(
    dialect: Dialect,
    asked: Sequence[int],
    rate: int,
    *,
    broadcast: bool,
    careful: bool = False,
    part: tuple[int, int] = (0, 1),
) -> list[Found]:
    """Who of these answers at the present rate, which is `rate`; the first of `part` is the share of the whole.

    With `careful` the broadcast, one frame, is the last when nobody answers it and bus errors come instead.
    """
    errors = dialect.memory.errors if dialect.memory else 0
    there = await _called(dialect, asked, rate) if broadcast else []
    if careful and not there and dialect.memory and dialect.memory.errors > errors:
        await Emit(Suspicion(0, rate, BROKEN))
        return []
    total = PASSES * part[1] * len(asked)
    for number in range(PASSES):
        done = (PASSES * part[0] + number) * len(asked)
        for batch in _batches([node for node in asked if node not in there]):
            looks = [_looked(Node(node, dialect), rate) for node in batch]
            there += [node for node in await gather(*looks) if node is not None]
            done += len(batch)
            await Emit(Progress(done, total, f"ids up to {batch[-1]} at {rate} bit/s"))
    if dialect.memory and dialect.memory.errors > errors:
        await Emit(Suspicion(0, rate, _errors(dialect.memory.errors - errors)))
    if not there and not careful:
        return await _strangers(dialect, asked, rate, broadcast=broadcast)
    if not broadcast:
        await _counted(dialect, sorted(there), rate)
    return await _identified(dialect, sorted(there), rate)


async def _strangers(dialect: Dialect, asked: Sequence[int], rate: int, *, broadcast: bool) -> list[Found]:
    """Who of these answers in the id format that is not spoken here. Told, and not asked more: that takes a new bus."""
    if dialect.memory is None or len(dialect.formats) > 1:
        return []
    extended = True not in dialect.formats
    heard_of = dialect.memory.strangers
    heard_of.clear()
    if broadcast:
        await called(extended)
    for batch in _batches([] if heard_of else asked):
        await gather(*[catch(_in_vain(Node(node, dialect), extended)) for node in batch])
    found = [Found(node, rate, None) for node in asked if node in heard_of]
    for one in found:
        await Emit(one)
        await Emit(Suspicion(one.node, rate, OTHER_FORMAT[extended]))
    return found


async def _in_vain(node: Node, extended: bool) -> object:
    """Its answer does not count as one here, and is noted on its way."""
    return await _present(node, extended)


def _errors(count: int) -> str:
    return (
        f"{count} bus errors during the scan: two servos with one id, another rate on the bus, bad wiring, "
        "or a missing terminator"
    )


def _batches(nodes: Sequence[int]) -> Iterator[Sequence[int]]:
    return (nodes[start : start + WINDOW] for start in range(0, len(nodes), WINDOW))


async def _counted(dialect: Dialect, nodes: Sequence[int], rate: int) -> None:
    """Ask each once more, and wait whether a second answer comes; a broadcast has shown that already."""
    for batch in _batches(nodes):
        looks = await gather(*[glance(Node(node, dialect)) for node in batch])
        for node, look in zip(batch, looks, strict=True):
            if look.several:
                await Emit(Suspicion(node, rate, TWICE))


async def _identified(dialect: Dialect, nodes: Sequence[int], rate: int) -> list[Found]:
    found: list[Found] = []
    for batch in _batches(nodes):
        told = await gather(*[catch(identify(Node(node, dialect))) for node in batch])
        places = await gather(*[catch(position(Node(node, dialect))) for node in batch])
        for node, one, place in zip(batch, told, places, strict=True):
            found.append(Found(node, rate, one if isinstance(one, Identity) else None))
            if isinstance(one, Identity) and isinstance(place, NoReply):
                await Emit(Suspicion(node, rate, TORN))
    return found


# --- everyone at once ---------------------------------------------------------------------------------------


async def _called(dialect: Dialect, asked: Sequence[int], rate: int) -> list[int]:
    """Who of these answers a read of the node id by everyone, in each id format that is expected."""
    there: list[int] = []
    for extended in sorted(dialect.formats):
        answer = await called(extended)
        for node in dict.fromkeys(reply.lane for reply in answer.replies if reply.lane in asked):
            replies = [wire.decode_reply(reply.data) for reply in answer.replies if reply.lane == node]
            if node not in there:
                there.append(node)
                dialect.learn_format(node, extended)
                await Emit(Found(node, rate, None))
            if len(replies) > 1:
                await Emit(Suspicion(node, rate, TWICE))
            await _compared(node, rate, replies[0])
    return there


def called(extended: bool, priority: Priority = Priority.CONFIGURATION) -> Request[Response]:
    """Read the node id of everyone at once; the replies come one after the other, by arbitration."""
    return Request(
        wire.encode_upload(wire.EVERYONE, NODE_ID, extended=extended),
        ANY,
        _about_ids,
        lane=EVERY_LANE,
        priority=priority,
    )


def _about_ids(answer: Response) -> Response:
    """Without what came late from something else."""
    told = [(reply, wire.decode_reply(reply.data)) for reply in answer.replies]
    mine = tuple(reply for reply, one in told if one is not None and one.index in (NODE_ID, 0))
    return answer._replace(replies=mine)


TWICE: Final = (
    "two answers to one request: two servos with one id; connect them one at a time, and provision one"
)
TORN: Final = "its id comes, its position never: two servos with one id, whose answers break each other"


async def _compared(node: int, rate: int, reply: SdoReply | None) -> None:
    """Tell when the id that was read is not the one that answered."""
    if reply is not None and reply.kind == "upload" and reply.data[:1] != bytes((node,)):
        what = f"answers as {node} and reads back the id {reply.data[0]}: written, and not in force before a restart"
        await Emit(Suspicion(node, rate, what))


# --- one by one ---------------------------------------------------------------------------------------------


async def _looked(node: Node, rate: int) -> int | None:
    """Its id when it answers. What answers wrongly, or twice, is there as well."""
    formats = (False, True) if node.dialect.undecided(node.node) else (node.dialect.extended(node.node),)
    for extended in formats:
        try:
            reply = await _present(node, extended)
        except NoReply:
            continue
        except WireError as error:
            await Emit(Suspicion(node.node, rate, f"{TWICE} ({error.summary})"))
            reply = None
        node.dialect.learn_format(node.node, extended)
        await Emit(Found(node.node, rate, None))
        await _compared(node.node, rate, reply)
        return node.node
    return None


def _present(node: Node, extended: bool) -> Request[SdoReply | None]:
    def read(answer: Response) -> SdoReply | None:
        return wire.decode_reply(answer.replies[0].data)

    return Request(
        wire.encode_upload(node.node, NODE_ID, extended=extended),
        (wire.upload_due(node.node, NODE_ID),),
        read,
        lane=node.node,
        priority=Priority.CONFIGURATION,
        reply_within=TimeoutClass.SCAN,
        repeatable=True,
    )
