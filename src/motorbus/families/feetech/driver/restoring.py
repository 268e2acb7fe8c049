"""Back to the values of the factory: RESET (0x06), which newer headers call RECOVERY.

The manual says that it is for certain models only; others are silent. What is known from hardware is one report
(servolab, STS3215 firmware 3.10): the id is kept, the homing offset becomes 0, and the servo is deaf for about a
second; feetech-cli documents id 1 and 1 Mbaud instead. So it is looked for afterwards: under its id and under 1, at
the present rate and at those its series ships with. Who was in such a place before is not taken for it.

It is not `clear_turns` (0x0A), which some SDKs call RESET too: that one forgets the turns and nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from motorbus.core.family import Found
from motorbus.core.register import RegisterMap
from motorbus.core.request import Effect, Priority, TimeoutClass
from motorbus.core.steps import Exclusive, SetBitrate, Sleep, with_cleanup
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


async def factory_restore(node: Node) -> Found:
    """Switch the torque off and set everything back as shipped, but as a rule not the id; gives where it is now.

    The bus keeps its rate, even where the servo is found at the factory's. Raises NoReply when it does not answer
    afterwards, OutcomeUnknown when it answers but has not acknowledged: its model may lack this.
    """
    table = await writable(node)
    try:
        return await Exclusive(_restored(node, factory_rates(table)))
    finally:
        node.forget_settings()


def factory_rates(table: RegisterMap) -> tuple[int, ...]:
    """The rates (bit/s) at which servos of this map ship; two where that depends on the model (SCS)."""
    code = table["baud_rate"].default
    return (BAUD_CODES[0], BAUD_CODES[1]) if code is None else (BAUD_CODES[code],)


async def _restored(node: Node, factory: Sequence[int]) -> Found:
    present = await SetBitrate(0)
    ids = tuple(dict.fromkeys((node.node, _SHIPPED_ID)))
    places = dict.fromkeys(dict.fromkeys((present, *factory)), ids)
    taken = await with_cleanup(_taken(node, present, places), lambda: SetBitrate(present))
    await disable_torque(node)
    doubt: BaseException | None = None
    try:
        await _reset(node)
    except DOUBTS as error:
        doubt = error
    await Sleep(DEAF)
    found = await _found(present, places, taken)
    if found is None:
        raise _gone(node, taken) from doubt
    if doubt is not None and (found.node, found.rate) == (node.node, present):
        raise _unacknowledged(node, found) from doubt
    return found


async def _taken(node: Node, present: int, places: Mapping[int, Sequence[int]]) -> set[tuple[int, int]]:
    """Where, of all the places it may go to, another servo is already: (id, rate)."""
    taken = set()
    for rate, ids in places.items():
        if rate != present:
            await SetBitrate(rate)
        for id in ids:
            if (id, rate) != (node.node, present) and await _there(id):
                taken.add((id, rate))
    return taken


async def _there(id: int) -> bool:
    try:
        return await ping(Node(id))
    except WireError:
        return True


async def _found(
    present: int, places: Mapping[int, Sequence[int]], taken: set[tuple[int, int]]
) -> Found | None:
    for rate, ids in places.items():
        free = [id for id in ids if (id, rate) not in taken]
        found = await scan(free, () if rate == present else (rate,)) if free else []
        if found:
            return found[0]
    return None


async def _reset(node: Node) -> None:
    block = Block(0, b"", Effect.PERSISTENT, repeatable=False)
    request = wire.factory_restore(node.node)
    await acknowledged(node, request, block, priority=Priority.CONFIGURATION, timeout=TimeoutClass.STORE)


def _gone(node: Node, taken: set[tuple[int, int]]) -> NoReply:
    others = ", ".join(f"id {id} at {rate} bit/s" for id, rate in sorted(taken))
    now = f"the place of another servo ({others})" if others else "another id or rate"
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
