"""Back to the values of the factory: RESET (0x06), which newer headers call RECOVERY.

The manual says that it is for certain models only; others are silent. What is known from hardware is one report
(servolab, STS3215 firmware 3.10): the id is kept, the homing offset becomes 0, and the servo is deaf for about a
second. So it is looked for afterwards: under its id and under 1, at the present rate and at the factory's.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.family import Found
from motorbus.core.operation import Alone, Effect, Operation, Pause, Rank, Timeout, Tune
from motorbus.errors import NoReply, OutcomeUnknown, WireError
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.exchanges import DOUBTS, Block, acknowledged
from motorbus.families.feetech.driver.identity import ping, writable
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.scanning import scan
from motorbus.families.feetech.driver.torque import disable_torque
from motorbus.families.feetech.table import BAUD_CODES

DEAF: Final = 1.1
"""s until it answers again."""
_SHIPPED_ID: Final = 1


def factory_restore(node: Node) -> Operation[Found]:
    """Switch the torque off and set everything back as shipped, but as a rule not the id; gives where it is now.

    The bus keeps its rate, even where the servo is found at the factory's. Raises NoReply when it does not answer
    afterwards, OutcomeUnknown when it answers but has not acknowledged: its model may lack this.
    """
    yield from writable(node)
    try:
        return (yield from Alone(_restored(node)))
    finally:
        node.forget_settings()


def _restored(node: Node) -> Operation[Found]:
    others = set((yield from _others(node)))
    yield from disable_torque(node)
    doubt: BaseException | None = None
    try:
        yield from _reset(node)
    except DOUBTS as error:
        doubt = error
    yield from Pause(DEAF)
    present = yield from Tune(0)
    rates = () if present == BAUD_CODES[0] else (present, BAUD_CODES[0])
    found = yield from scan([id for id in dict.fromkeys((node.node, _SHIPPED_ID)) if id not in others], rates)
    if not found:
        raise _gone(node, others) from doubt
    if doubt is not None and (found[0].node, found[0].rate) == (node.node, present):
        raise _unacknowledged(node, found[0]) from doubt
    return found[0]


def _others(node: Node) -> Operation[list[int]]:
    """Another servo that has the id as shipped: it must not be taken for this one afterwards."""
    if node.node == _SHIPPED_ID:
        return []
    try:
        there = yield from ping(Node(_SHIPPED_ID))
    except WireError:
        there = True
    return [_SHIPPED_ID] if there else []


def _reset(node: Node) -> Operation[None]:
    block = Block(0, b"", Effect.PERSISTENT, repeatable=False)
    request = wire.factory_restore(node.node)
    yield from acknowledged(node, request, block, rank=Rank.CONFIGURATION, timeout=Timeout.STORE)


def _gone(node: Node, others: set[int]) -> NoReply:
    now = "the id of another servo" if others else "another id or rate"
    return NoReply(
        f"node {node.node} does not answer after its factory values were restored",
        cause=f"it may have {now} now, or take longer to start",
        advice="scan all ids at all rates",
        node=node.node,
    )


def _unacknowledged(node: Node, found: Found) -> OutcomeUnknown:
    return OutcomeUnknown(
        f"node {node.node} has not acknowledged the order to restore its factory values",
        received=f"it answers as id {found.node} at {found.rate} bit/s",
        cause="models without this order are silent; or the acknowledgement was lost",
        advice="read a register that you had changed: if it is as shipped, it was done",
        node=node.node,
    )
