"""How a servo fares, in one READ: whether its torque is on, and all that it feels.

Torque switch and feedback are at 40 and from 56 to 70 in every map. One READ of everything between costs 8 bytes and a
reply of 37; two READs would cost two requests, two headers and the return delay twice. What lies between is what the
servo was told since power-up, and there a restart shows: some firmware switches its torque on by itself when the next
goal comes, so that the switch alone would hide one.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.family import Health, State
from motorbus.core.register import RegisterMap
from motorbus.core.steps import Runnable
from motorbus.families.feetech.driver.exchanges import PRESENT, read_block
from motorbus.families.feetech.driver.feedback import FEEDBACK, state_of
from motorbus.families.feetech.driver.identity import known
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.torque import TORQUE_ENABLE

WHOLE: Final = PRESENT + FEEDBACK - TORQUE_ENABLE
"""Bytes of registers 40 to 70."""
ON: Final = 1
"""Of the torque switch: every other number is limp in one way or another, free or damped."""


def health(node: Node) -> Runnable[Health]:
    """Torque on or off, and one sample of everything as `telemetry` has it; of a known servo one exchange.

    `blank` is true while it has no acceleration and the goal velocity with which it powers up.
    """
    if node.table is None or node.settings is None:
        return _met(node)
    table = node.table

    def take(data: bytes) -> Health:
        return _health(node, table, data)

    return read_block(node, TORQUE_ENABLE, WHOLE, take)


async def _met(node: Node) -> Health:
    await known(node)
    return await health(node)


def _health(node: Node, table: RegisterMap, data: bytes) -> Health:
    told = [name for name in ("goal_velocity", node.control.acceleration) if name]
    blank = all(_raw(table, name, data) == (table[name].default or 0) for name in told)
    state: State = state_of(node, table, data[PRESENT - TORQUE_ENABLE :])
    return Health(state, torque=data[0] == ON, blank=blank)


def _raw(table: RegisterMap, name: str, data: bytes) -> int:
    row = table[name]
    return row.decode(data[row.address - TORQUE_ENABLE : row.address - TORQUE_ENABLE + row.size])
