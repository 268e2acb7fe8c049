"""Letting go, whatever happens: torque off ignores alarms, needs to know nothing of the servo, and visits everyone.

Register 40 is the torque switch in every map, so this works on servos that nobody has identified. It has the priority
of a stop: it passes whoever holds the bus, and an emergency stop that is latched.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from motorbus.core.request import Effect, Priority, Request
from motorbus.core.setpoint import torque_off
from motorbus.core.steps import catch, with_cleanup
from motorbus.errors import MotorbusError, VerificationFailed
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.exchanges import DOUBTS, Block, unanswered, verified, write_block
from motorbus.families.feetech.driver.node import Node, as_nodes

TORQUE_ENABLE: Final = 40
LIMP: Final = Block(TORQUE_ENABLE, b"\0", Effect.TORQUE)
_TRIES: Final = 3


def limp(node: int) -> Block:
    """Torque off for this servo, by name: whoever does not answer would be taken for everybody."""
    return LIMP._replace(goals=(torque_off(node),))


async def disable_torque(node: Node) -> None:
    """Torque off: the servo goes limp. Alarms do not matter; said up to three times until it is acknowledged.

    Without an acknowledgement the switch is read back: after the third time, or each time where none is due (status
    return level 0). Raises OutcomeUnknown when nobody answers at all, VerificationFailed when the torque is still on.
    """
    doubt: MotorbusError | None = None
    for _ in range(_TRIES):
        exchange = write_block(node, limp(node.node), priority=Priority.STOP)
        try:
            await exchange
            if not exchange.expected:
                await verified(node, LIMP)
            return
        except (*DOUBTS, VerificationFailed) as error:
            doubt = error
    if isinstance(doubt, VerificationFailed):
        raise doubt
    await verified(node, LIMP, doubt)


def disable_torque_everyone() -> Request[None]:
    """Torque off for every servo on the line, in one broadcast; no servo acknowledges it."""
    return unanswered(
        wire.write(wire.BROADCAST, LIMP.address, LIMP.data), LIMP.effect, priority=Priority.STOP
    )


async def disable_torque_all(ids: Iterable[int | Node]) -> dict[int, MotorbusError]:
    """Torque off for all of these: at once by SYNC WRITE, then one after the other until acknowledged.

    Visits everyone whatever happens. The value holds, by id, the error of each that did not acknowledge. An
    interruption is raised after everyone has been visited.
    """
    nodes = as_nodes(ids)
    errors: dict[int, MotorbusError] = {}
    waiting = list(nodes)
    await with_cleanup(_at_once(nodes), lambda: _one_by_one(waiting, errors))
    return errors


async def _at_once(nodes: Sequence[Node]) -> None:
    for exchange in all_limp(nodes):
        await catch(exchange)  # whoever did not hear is visited


async def _one_by_one(waiting: list[Node], errors: dict[int, MotorbusError]) -> None:
    """Visit those who wait, and begin again where it was when interrupted."""
    while waiting:
        failure = await catch(disable_torque(waiting[0]))
        if failure is not None:
            errors[waiting[0].node] = failure
        del waiting[0]


def all_limp(nodes: Sequence[Node]) -> Iterator[Request[None]]:
    """SYNC WRITE torque off to these, as many frames as it takes; nobody answers."""
    capacity = wire.sync_write_capacity(len(LIMP.data))
    for start in range(0, len(nodes), capacity):
        ids = [node.node for node in nodes[start : start + capacity]]
        request = wire.sync_write(LIMP.address, [(number, LIMP.data) for number in ids])
        yield unanswered(request, LIMP.effect, tuple(map(torque_off, ids)), priority=Priority.STOP)
