"""The bound of the current that HLS servos want with every order, where other series take a time.

In position and velocity mode the goal torque is the greatest current, and with 0 a servo acknowledges every order and
never moves. So no order from here carries a 0: it carries what the servo has been given, and where that is 0 what the
servo would set itself at power-up, its protection current. Source: FEETECH SDK, hls.py; HLS memory table.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from motorbus.core.register import Register, RegisterMap
from motorbus.core.steps import Emit
from motorbus.errors import RequestError
from motorbus.families.feetech.driver.exchanges import Block, read_block
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.table import Mode


class Powerless(NamedTuple):
    """An event for `Emit`: this servo had a bound of 0 A, so that it could not move; it gets `current` (A) now."""

    node: int
    current: float

    def __str__(self) -> str:
        return (
            f"node {self.node} had a goal torque of 0, with which it acknowledges every order and never moves; it gets "
            f"{self.current:.4g} A"
        )


async def ask_bound(node: Node, table: RegisterMap, current: float | None = None) -> None:
    """Read the present bound unless it is known, or is about to be set; nothing where the map has none.

    Reports `Powerless` when it is 0. Raises RequestError when its protection current is 0 as well.
    """
    if not node.control.current or node.bound is not None or current is not None:
        return
    row = table[node.control.current]
    node.bound = await read_block(node, row.address, row.size, row.decode)
    if not node.bound:
        raw = raw_bound(node, row, None)
        await Emit(Powerless(node.node, float(row.to_value(raw))))


def raw_bound(node: Node, row: Register, current: float | None) -> int:
    """The raw bound for an order: `current` (A), else what is set, else the protection current.

    Raises RequestError when that is 0, or is not known: an order may not make a servo powerless, and does not guess.
    """
    if current is not None:
        raw = node.raw(row, current)
        if 0 < raw <= row.high:
            return raw
        raise RequestError(
            f"node {node.node}: {current} A is no bound of its current",
            expected=f"{row.scale:.4g} to {row.to_value(row.high):.4g} A",
            advice="leave it out to keep what is set; nothing was sent",
            node=node.node,
        )
    protection = node.settings.protection_current if node.settings else 0
    if raw := abs(node.bound or 0) or protection:
        return raw
    raise RequestError(
        f"node {node.node} has a goal torque of 0 and a protection current of 0: it would never move",
        advice="give current= in A, or write(protection_current=…); nothing was sent",
        node=node.node,
    )


def leaving_current_mode(
    node: Node, table: RegisterMap, wanted: Mode | None, blocks: Sequence[Block]
) -> Sequence[Block]:
    """These blocks, which put a limp servo into another mode, with what makes a bound of its last goal current.

    The servo keeps that register, and in the next mode it bounds the current: whoever pushed with 0.1 A last would be
    left with a servo that hardly moves, in every program that comes after. So it becomes 0 first, which every order
    notices should the supply go in between, and what it is at power-up in the end: the protection current.
    """
    if not node.control.current or wanted is Mode.CURRENT or node.known_mode not in (Mode.CURRENT, None):
        return blocks
    row = table[node.control.current]
    protection = node.settings.protection_current if node.settings else 0
    return [Block(row.address, row.encode(0)), *blocks, Block(row.address, row.encode(protection))]


def refuse_current(node: Node, current: float | None) -> None:
    """Raise RequestError for a bound of the current where no register of the map holds one."""
    if current is None or node.control.current:
        return
    raise RequestError(
        f"node {node.node} has no register that bounds its current",
        expected="an HLS servo",
        advice="leave current out; its torque limit bounds its torque; nothing was sent",
        node=node.node,
    )
