"""The exchanges everything else is made of: read a block, write a block, and be sure of a write.

A servo acknowledges the receipt of a write, or is set to acknowledge nothing at all (status return level 0), or
its acknowledgement is lost. `confirmed` tells these apart by reading back. Source of the semantics: FEETECH
serial bus servo protocol manual V1.01; STS3215 memory table V3.6.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from operator import attrgetter
from typing import Final, NamedTuple, TypeVar

from motorbus import errors
from motorbus.core.request import (
    Effect,
    ExactDecoder,
    Expected,
    Precondition,
    Priority,
    Request,
    Response,
    Stops,
    TimeoutClass,
)
from motorbus.core.setpoint import Deferred, Setpoint
from motorbus.errors import (
    MotorbusError,
    NoReply,
    OutcomeUnknown,
    RequestError,
    VerificationFailed,
    WireError,
)
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.node import CHANGES, Node, Settings

T = TypeVar("T")


PRESENT: Final = 56
"""Where feedback begins in every map: the present position."""
ACKNOWLEDGED: Final = wire.OVERHEAD
"""Bytes of a status packet without parameters, which answers PING and every write."""
settings_of_now: Final = attrgetter("settings")
"""What is known of a servo at present."""
DOUBTS: Final = (NoReply, OutcomeUnknown, WireError)
"""Ways in which a write can fail that leave open whether it was heard."""


class Block(NamedTuple):
    """Adjoining registers to be written at once, and what that does.

    `repeatable`: writing it twice does no more than writing it once. `under` are the settings that its goals were
    reckoned by, where it is kept for a while before it is sent; None: those that are known when it is made a packet.
    `refusal` is a further reason not to send it.
    """

    address: int
    data: bytes
    effect: Effect = Effect.NONE
    goals: tuple[Setpoint, ...] = ()
    repeatable: bool = True
    under: Settings | None = None
    refusal: Precondition | None = None


def read_block(
    node: Node,
    address: int,
    count: int,
    take: Callable[[bytes], T],
    *,
    priority: Priority = Priority.POLL,
    timeout: TimeoutClass = TimeoutClass.REPLY,
    whole: Callable[[int], ExactDecoder[T] | None] = lambda _: None,
) -> Request[T]:
    """READ `count` bytes from `address` on; the value is what `take` makes of them.

    One that is kept says by `whole` what a packet with so many bytes of data comes to; see `Request`.
    """

    def read(answer: Response) -> T:
        frame = answer.replies[0].data
        node.heard(frame[4], answer.at)
        return take(frame[5 : 5 + count])

    request, dues = _question(node, address, count)
    return Request(
        request,
        dues,
        read,
        priority=priority,
        reply_within=timeout,
        repeatable=True,
        reports_position=told_by({node.node: node}, address, count),
        decode_exact=whole(count),
    )


def _question(node: Node, address: int, count: int) -> tuple[bytes, tuple[Expected, ...]]:
    """The packet that reads this, and the reply that is due; made once for each servo, for they never change."""
    made = node.questions.get((address, count))
    if made is None:
        due = Expected(node.node, node.node, wire.OVERHEAD + count)
        made = node.questions[address, count] = wire.read(node.node, address, count), (due,)
    return made


def told_by(
    nodes: Mapping[int, Node], address: int, count: int
) -> bool | Callable[[Response], Mapping[int, float]]:
    """What a read of these registers of these servos says of where they are; see `Request.reports_position`."""
    return address == PRESENT and count > 1 and partial(places, nodes)


def places(nodes: Mapping[int, Node], answer: Response) -> dict[int, float]:
    """Where those are who are known well enough to tell (rad), by the settings that they have now."""
    found = {}
    for reply in answer.replies:
        node = nodes.get(reply.data[2])
        if node is not None and node.table is not None and node.settings is not None:
            row = node.table["present_position"]
            if row.unit:
                found[node.node] = float(node.value(row, row.decode(reply.data[5 : 5 + row.size])))
    return found


def acknowledged(
    node: Node,
    request: bytes,
    block: Block | None = None,
    *,
    priority: Priority = Priority.CONTROL,
    timeout: TimeoutClass = TimeoutClass.REPLY,
    refusal: Precondition | None = None,
    after: Callable[[], None] = lambda: None,
    later: Deferred | None = None,
) -> Request[None]:
    """A request that is answered by nothing but an acknowledgement; by silence at status return level 0.

    It is not sent once the settings of the servo are others than when it was made, unless `refusal` judges that.
    """

    def read(answer: Response) -> None:
        for reply in answer.replies:
            node.heard(reply.data[4], answer.at)
        if later is not None:
            later.done = True
        after()

    answers = node.settings is None or node.settings.answers_writes
    return Request(
        request,
        (Expected(node.node, node.node, ACKNOWLEDGED),) if answers else (),
        read,
        priority=priority,
        effect=block.effect if block else Effect.NONE,
        setpoints=block.goals if block else (),
        reply_within=timeout,
        repeatable=block is not None and block.repeatable,
        precondition=refusal or _refusal_of(node, block),
        deferred=later,
    )


def _refusal_of(node: Node, block: Block | None) -> Precondition:
    changed = changed_since([(node, block.under if block else None)])
    if block is None or block.refusal is None:
        return changed
    own = block.refusal
    return lambda stops: changed(stops) or own(stops)


def changed_since(made: Iterable[tuple[Node, Settings | None]]) -> Precondition:
    """Refuses an order for these servos once one has other settings than those, or than now (None): in another mode,
    with other limits or another zero it would mean something else. What is not known any more counts as other."""
    under = [(node, settings or node.settings) for node, settings in made]
    nodes, as_made = [node for node, _ in under], [settings for _, settings in under]

    seen: object = None

    def refusal(_: Stops) -> MotorbusError | None:
        nonlocal seen
        now = CHANGES.now
        if now is seen:
            return None
        if list(map(settings_of_now, nodes)) == as_made:
            seen = now
            return None
        for node, settings in under:
            if node.settings is not settings and node.settings != settings:
                return outdated(node)
        return None

    return refusal


def outdated(node: Node, what: str = "this order") -> RequestError:
    """The error for what was made under other settings of a servo than it has now."""
    return RequestError(
        f"{what} was made before the settings of node {node.node} were changed, and may mean something else now",
        expected="the mode, the limits and the zero that it was made for",
        cause="its mode, its limits, its zero or another EEPROM register was written since, here or by another task",
        advice="make it again: call the verb once more; what a loop keeps, after prepare(). Nothing was sent",
        node=node.node,
    )


def unanswered(
    request: bytes,
    effect: Effect,
    goals: tuple[Setpoint, ...] = (),
    *,
    priority: Priority = Priority.CONTROL,
    refusal: Precondition | None = None,
    after: Callable[[], None] = lambda: None,
    later: Deferred | None = None,
) -> Request[None]:
    """A request to several servos, which none of them answers."""

    def read(_: Response) -> None:
        if later is not None:
            later.done = True
        after()

    return Request(
        request,
        (),
        read,
        priority=priority,
        effect=effect,
        setpoints=goals,
        precondition=refusal,
        deferred=later,
    )


def write_block(
    node: Node,
    block: Block,
    *,
    priority: Priority = Priority.CONTROL,
    timeout: TimeoutClass = TimeoutClass.REPLY,
) -> Request[None]:
    """WRITE adjoining registers. The acknowledgement proves receipt, not more."""
    return acknowledged(
        node, wire.write(node.node, block.address, block.data), block, priority=priority, timeout=timeout
    )


async def confirmed(
    node: Node,
    block: Block,
    *,
    priority: Priority = Priority.CONTROL,
    timeout: TimeoutClass = TimeoutClass.REPLY,
) -> None:
    """WRITE; when no acknowledgement is due, or none came, find out by reading back.

    Raises OutcomeUnknown when that cannot be found out, VerificationFailed when the write did not take effect.
    """
    doubt: MotorbusError | None = None
    exchange = write_block(node, block, priority=priority, timeout=timeout)
    try:
        await exchange
    except DOUBTS as error:
        doubt = error
    if doubt is None and exchange.expected:
        return
    if doubt is not None and not block.repeatable:
        raise doubt
    await verified(node, block, doubt, timeout=timeout)


async def verified(
    node: Node,
    block: Block,
    doubt: MotorbusError | None = None,
    *,
    timeout: TimeoutClass = TimeoutClass.REPLY,
) -> None:
    """Read back what was written. Raises VerificationFailed when it differs, OutcomeUnknown when nobody answers.

    `doubt` is how the write itself failed, if it did.
    """
    try:
        found = await read_block(node, block.address, len(block.data), bytes, timeout=timeout)
    except DOUBTS as error:
        if isinstance(doubt, OutcomeUnknown):
            raise doubt from error
        raise unread(node, doubt or error) from error
    if found != block.data:
        raise _differs(node, block, found) from doubt


def unread(node: Node, why: MotorbusError) -> OutcomeUnknown:
    """The error for a write that has left, when nobody tells what became of it."""
    return errors.unread(why, node=node.node)


def _differs(node: Node, block: Block, found: bytes) -> VerificationFailed:
    last = block.address + len(block.data) - 1
    where = f"register {block.address}" + (f" to {last}" if last > block.address else "")
    return VerificationFailed(
        f"node {node.node}: {where} reads back different from what was written",
        sent=block.data,
        received=found,
        cause="the write was lost, the servo does not take this value, or another program writes it too",
        advice="read it again; see that no other program uses this bus, then write it again",
        node=node.node,
    )
