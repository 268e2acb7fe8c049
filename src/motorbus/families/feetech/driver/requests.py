"""Requests to one servo: read registers, write registers, and prove a write.

An acknowledgement proves receipt of a write and may be lost; `confirmed` then reads back. A servo at status return
level 0 acknowledges nothing: each write waits for its time-out and is read back, so `write(status_return_level=1)`
first. Source: FEETECH serial bus servo protocol manual V1.01; STS3215 memory table V3.6.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cache, partial
from typing import Final, NamedTuple, TypeVar

from motorbus import errors
from motorbus.core.request import (
    Effect,
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
from motorbus.families.feetech import protocol
from motorbus.families.feetech.driver.node import Node

T = TypeVar("T")

ID: Final = 5  # in every map
PRESENT: Final = 56  # where feedback begins in every map: the present position
TORQUE_ENABLE: Final = 40  # in every map
ON: Final = b"\1"  # of the torque switch; any other value is limp
REPLY: Final = TimeoutClass.REPLY
STORE: Final = TimeoutClass.STORE
SOUND: Final = 0xFD  # low byte of the sum of a whole valid packet, header and checksum included
DATA: Final = 5  # offset of the parameters in a reply
DOUBTS: Final = (NoReply, OutcomeUnknown, WireError)
"""Failures of a write that the servo may have received."""


class Block(NamedTuple):
    """Adjoining registers to write at once, and what that does.

    `repeatable`  writing it twice has the same effect as writing it once
    `unless`      a further reason not to send it
    """

    address: int
    data: bytes
    effect: Effect = Effect.NONE
    goals: tuple[Setpoint, ...] = ()
    repeatable: bool = True
    unless: Precondition | None = None


def read_block(
    node: Node,
    address: int,
    count: int,
    take: Callable[[bytes], T],
    *,
    timeout: TimeoutClass = REPLY,
) -> Request[T]:
    """READ `count` bytes; `take` makes the value of them."""

    def decode(answer: Response) -> T:
        frame = answer.replies[0].data
        node.note_reply(frame[4], answer.at)
        return take(frame[DATA : DATA + count])

    return Request(
        protocol.read(node.node, address, count),
        (Expected(node.node, node.node, protocol.OVERHEAD + count),),
        decode,
        reply_within=timeout,
        repeatable=True,
        reports_position=reports_position({node.node: node}, address, count),
    )


@cache
def read_id(node: int, count: int = 1, *, within: TimeoutClass = REPLY) -> Request[bool]:
    """READ from the id register on; True if the id is that of the node."""

    def decode(answer: Response) -> bool:
        return bool(answer.replies) and answer.replies[0].data[DATA] == node

    return Request(
        protocol.read(node, ID, count),
        (Expected(node, node, protocol.OVERHEAD + count),),
        decode,
        reply_within=within,
        repeatable=True,
    )


def reports_position(
    nodes: Mapping[int, Node], address: int, count: int
) -> bool | Callable[[Response], Mapping[int, float]]:
    """`Request.reports_position` of a read of these registers."""
    return address == PRESENT and count > 1 and partial(_positions, nodes)


def _positions(nodes: Mapping[int, Node], answer: Response) -> dict[int, float]:
    found = {}
    for reply in answer.replies:
        node = nodes.get(reply.data[2])
        if node is not None and node.table is not None and node.settings is not None:
            row = node.table["present_position"]
            if row.unit:
                found[node.node] = float(node.value(row, row.decode(reply.data[DATA : DATA + row.size])))
    return found


def write_block(
    node: Node, block: Block, *, priority: Priority = Priority.CONTROL, timeout: TimeoutClass = REPLY
) -> Request[None]:
    """WRITE adjoining registers. The acknowledgement proves receipt only."""
    wire = protocol.write(node.node, block.address, block.data)
    return acknowledged(node, wire, block, priority=priority, timeout=timeout)


def acknowledged(
    node: Node,
    wire: bytes,
    block: Block,
    *,
    priority: Priority = Priority.CONTROL,
    timeout: TimeoutClass = REPLY,
    deferred: Deferred | None = None,
) -> Request[None]:
    """A request with an acknowledgement.

    It is refused once the settings of the servo differ from those of the moment when it was made.
    """

    def decode(answer: Response) -> None:
        node.note_reply(answer.replies[0].data[4], answer.at)

    return Request(
        wire,
        (Expected(node.node, node.node, protocol.OVERHEAD),),
        decode,
        priority=priority,
        effect=block.effect,
        setpoints=block.goals,
        reply_within=timeout,
        repeatable=block.repeatable,
        precondition=unchanged([node], block.unless),
        deferred=deferred,
    )


def unanswered(
    wire: bytes,
    effect: Effect,
    goals: tuple[Setpoint, ...] = (),
    *,
    priority: Priority = Priority.CONTROL,
    unless: Precondition | None = None,
    deferred: Deferred | None = None,
) -> Request[None]:
    """A request without a reply, as every broadcast; it counts as carried out once it was sent."""
    return Request(
        wire,
        (),
        lambda _: None,
        priority=priority,
        effect=effect,
        setpoints=goals,
        repeatable=priority is Priority.STOP,
        precondition=unless,
        deferred=deferred,
    )


def unchanged(nodes: Iterable[Node], further: Precondition | None = None) -> Precondition:
    """Refuses a request once one of these servos has other settings than now: its goals would mean something else."""
    made = [(node, node.settings) for node in nodes]

    def refusal(stops: Stops) -> MotorbusError | None:
        for node, settings in made:
            if node.known.settings is not settings:
                return outdated(node.node)
        return further(stops) if further is not None else None

    return refusal


def outdated(node: int) -> RequestError:
    """The error for an order that was made by other settings than the servo has now."""
    return RequestError(
        f"node {node} has other settings than when this order was made, which may mean something else now",
        advice="give the order again; in a loop, begin another",
        node=node,
    )


async def confirmed(node: Node, block: Block, *, timeout: TimeoutClass = REPLY) -> None:
    """WRITE; without an acknowledgement read back.

    Raises OutcomeUnknown if nothing can be read, VerificationFailed if it reads different.
    """
    try:
        await write_block(node, block, timeout=timeout)
    except DOUBTS as error:
        if not block.repeatable:
            raise
        await verified(node, block, error, timeout=timeout)


async def instruct(node: Node, wire: bytes, *, repeatable: bool = True) -> MotorbusError | None:
    """Send an instruction that changes what the servo keeps; gives the doubt whether it was received."""
    block = Block(0, b"", Effect.PERSISTENT, repeatable=repeatable)
    try:
        await acknowledged(node, wire, block, priority=Priority.CONFIGURATION, timeout=STORE)
    except DOUBTS as error:
        return error
    return None


async def verified(
    node: Node, block: Block, doubt: MotorbusError | None = None, *, timeout: TimeoutClass = REPLY
) -> None:
    """Read back what was written; `doubt` is how the write failed. Raises as `confirmed`."""
    try:
        found = await read_block(node, block.address, len(block.data), bytes, timeout=timeout)
    except DOUBTS as error:
        node.known.forget()  # it may be another servo when it answers again
        if isinstance(doubt, OutcomeUnknown):
            raise doubt from error
        raise errors.unread(doubt or error, node=node.node) from error
    if found == block.data:
        return
    last = block.address + len(block.data) - 1
    where = f"register {block.address}" + (f" to {last}" if last > block.address else "")
    raise VerificationFailed(
        f"node {node.node}: {where} reads back different",
        sent=block.data,
        received=found,
        cause="the write was lost, the servo does not take this value, or another program writes it too",
        advice="close other programs on this bus, then write it again",
        node=node.node,
    ) from doubt
