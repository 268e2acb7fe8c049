"""Caps of an axis: how hard a servo may push until power-off, whatever is ordered, and never by a write to EEPROM.

Which servos can be capped is a question of the map: only where a register of RAM bounds the torque, and only on HLS one
bounds the current. Source: `table.CONTROL`.
"""

from __future__ import annotations

from motorbus.core.register import shown
from motorbus.core.setpoint import Setpoint
from motorbus.errors import RequestError
from motorbus.families.feetech.driver.bound import raw_bound, refuse_current
from motorbus.families.feetech.driver.exchanges import Block, verified
from motorbus.families.feetech.driver.identity import writable
from motorbus.families.feetech.driver.motion import calmed
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.orders import shown_mode
from motorbus.families.feetech.driver.registers import read_raw, write_limp
from motorbus.families.feetech.driver.rest import asked_anew, ordered
from motorbus.families.feetech.table import CONTROL, Mode


async def cap_torque(node: Node, fraction: float) -> None:
    """Limit the torque to this fraction of the stall torque, 0 to 1, until power-off.

    A limit of 0 releases the servo; before a greater one the goal becomes the present position, so nothing jumps.
    Raises RequestError outside 0 to 1 and for a servo whose torque is limited in EEPROM only, LimitExceeded for a
    released servo outside its position limits, VerificationFailed when it reads back different.
    """
    if isinstance(fraction, bool) or not isinstance(fraction, int | float) or not 0 <= fraction <= 1:
        raise RequestError(
            f"{shown(fraction)} is no torque limit",
            expected="a fraction of the stall torque, 0 to 1",
            advice="nothing was sent",
            node=node.node,
        )
    table = await writable(node)
    name = CONTROL[table.name].limit
    if not name:
        raise RequestError(
            f"node {node.node} keeps its torque limit in EEPROM (max_torque), which no cap is written to",
            expected="a servo with torque_limit among its registers",
            advice="write(max_torque=…) sets it for good; nothing was sent",
            node=node.node,
        )
    row = table[name]
    if fraction and not (await read_raw(node, name))[name]:
        await calmed(node, await asked_anew(node))
    await write_limp(node, {name: fraction})
    await verified(node, Block(row.address, row.encode(node.raw(row, fraction))))


async def cap_current(node: Node, current: float) -> None:
    """Bound its current (A, above 0) until power-off, or until an order brings another bound.

    Raises RequestError for a servo without such a register, a current that is none, or in a mode in which the register
    is no bound.
    """
    table = await asked_anew(node)
    refuse_current(node, current)
    if node.known_mode not in (Mode.POSITION, Mode.VELOCITY):
        raise RequestError(
            f"node {node.node} is in operating mode {shown_mode(node)}, in which its goal torque bounds no current",
            expected="operating mode position or velocity",
            advice="set_mode('position') first; nothing was sent",
            node=node.node,
        )
    row = table[node.control.current]
    raw = raw_bound(node, row, current)
    value = float(node.value(row, raw))
    goal = Setpoint(node.node, "cap", value, 0.0, float(node.value(row, row.high)))
    await ordered(node, table, Block(row.address, row.encode(raw), row.effect, (goal,)))
