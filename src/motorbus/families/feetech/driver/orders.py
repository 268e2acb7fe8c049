"""What a write by name comes to: raw values, blocks of adjoining registers, goals for the gate, and refusals.

All of it is decided before the first byte is sent. The same rules hold for WRITE, REG WRITE and SYNC WRITE.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from motorbus.core.entry import Entry, Storage, Table, Value
from motorbus.core.operation import Effect, Goal
from motorbus.errors import LimitExceeded, RequestError
from motorbus.families.feetech.driver.exchanges import Block
from motorbus.families.feetech.driver.identity import refuse_unless_writable
from motorbus.families.feetech.driver.node import COMMANDED, MANY_TURNS, POSITION, SCALED, STEP, Node
from motorbus.families.feetech.table import TABLES

_DUTY = 0.001


class Order(NamedTuple):
    """One row and the raw value it shall have."""

    row: Entry
    raw: int


def orders_of(node: Node, table: Table, values: Mapping[str, Value]) -> list[Order]:
    """The raw values to write, each checked against its row and against what a plain write may do."""
    orders = [Order(table[name], node.raw(table[name], value)) for name, value in values.items()]
    for order in orders:
        _check(order, node.node)
    return orders


def blocks(node: Node, orders: Iterable[Order]) -> Iterator[Block]:
    """Group orders whose registers adjoin, in the order of their addresses."""
    group: list[Order] = []
    for order in sorted(orders, key=lambda order: order.row.address):
        if group and order.row.address != group[-1].row.address + group[-1].row.size:
            yield _block(node, group)
            group = []
        group.append(order)
    if group:
        yield _block(node, group)


def only_block(node: Node, orders: Sequence[Order], what: str) -> Block:
    """These orders as one block of RAM registers. Raises RequestError when they are not that."""
    found = list(blocks(node, orders))
    if len(found) == 1 and all(order.row.storage is Storage.RAM for order in orders):
        return found[0]
    raise RequestError(
        f"{what} carries adjoining RAM registers only, not {', '.join(o.row.name for o in orders) or 'none'}",
        expected="registers whose addresses follow each other, such as goal_position, goal_time, goal_velocity",
        advice="leave out what does not belong, or write() it; nothing was sent",
        node=node.node,
    )


def position_goal(node: Node, row: Entry, to: float) -> tuple[int, Goal]:
    """A goal position in rad: its raw value, and the goal for the gate, which judges the limits.

    Raises DeviceError when its map is not commanded here, RequestError in other than position mode, LimitExceeded for
    what is no number or fits no register.
    """
    refuse_unless_writable(node)
    if node.mode != POSITION:
        raise RequestError(
            f"node {node.node} cannot go to a position in operating mode {node.mode}",
            expected="operating mode 0, position",
            advice="write(operating_mode=0) puts it into position mode; nothing was sent",
            node=node.node,
        )
    raw = node.raw(row, to) if math.isfinite(to) else row.high + 1
    if not row.low <= raw <= row.high:
        raise LimitExceeded(
            f"node {node.node}: {to} is no position it could go to",
            expected=f"{node.value(row, row.low):.4g} to {node.value(row, row.high):.4g} rad at the very most",
            advice="give a number in rad; nothing was sent",
            node=node.node,
        )
    return raw, Goal(node.node, "position", node.value(row, raw), *(node.limits or (None, None)))


def check_names(names: Iterable[str]) -> None:
    """Raise RequestError for a name that no register map has, before anything is sent."""
    tables = list(TABLES.values())
    for name in names:
        if not any(name in table for table in tables):
            tables[0][name]  # the look-up raises, with suggestions


def check_values(values: Mapping[str, Value]) -> None:
    """Raise RequestError for what no servo that is commanded would be given, before anything is sent.

    A name that only other maps have passes: whoever has it says what it is when it is known.
    """
    check_names(values)
    for name, value in values.items():
        faults = [_fault(TABLES[one][name], value) for one in sorted(COMMANDED) if name in TABLES[one]]
        if faults and faults[0] is not None and all(faults):
            raise faults[0]


def _fault(row: Entry, value: Value) -> RequestError | None:
    """What is wrong with this value whatever the settings of the servo are, which may scale some rows."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return RequestError(
            f"{row.name}: {value!r} is not a finite number", advice="give a number; nothing was sent"
        )
    try:
        _check(Order(row, 0 if row.name in SCALED else row.to_raw(value)))
    except RequestError as error:
        return error
    return None


def _check(order: Order, node: int | None = None) -> None:
    row, raw = order
    if refusal := _refusal(row, raw):
        raise RequestError(f"{row.name}: {refusal[0]}", advice=f"{refusal[1]}; nothing was sent", node=node)
    row.encode(raw)  # raises RequestError when out of range


def _refusal(row: Entry, raw: int) -> tuple[str, str] | None:
    """Why this may not be written by name, and what to do instead; None when it may."""
    if row.effect is Effect.IDENTITY:
        return (
            "a plain write would change how the servo is found, and may lose it",
            "leave it: safe ways to set ids and rates (set-id, set-baud) come with a later release",
        )
    if row.protected:
        return (
            "this register belongs to one servo alone and may not be copied; a wrong value can ruin it",
            "leave it as it is",
        )
    if not row.writable:
        return "this register can only be read", "read it instead"
    if row.name == "lock" and raw == 0:
        return (
            "an open lock would make every later write permanent",
            "just write the registers: write() opens the lock, verifies, and closes it again",
        )
    if row.name == "torque_enable" and raw != 0:
        return (
            "switching torque on by a plain write can jump to an old goal",
            "use enable_torque(), which first sets the goal to where the servo stands",
        )
    return None


def _block(node: Node, group: Sequence[Order]) -> Block:
    """One write of adjoining registers: its bytes, its greatest effect, and its goals for the gate."""
    return Block(
        group[0].row.address,
        b"".join(row.encode(raw) for row, raw in group),
        max(row.effect for row, _ in group),
        tuple(goal for row, raw in group for goal in _goals(node, row, raw)),
        repeatable=not any(row.name == "goal_position" and node.mode == STEP for row, _ in group),
    )


def _goals(node: Node, row: Entry, raw: int) -> Iterator[Goal]:
    """What this value of this row orders, in the operating mode the servo is in."""
    value = node.value(row, raw)
    if row.name == "goal_position" and node.mode == STEP:
        most = MANY_TURNS * row.scale
        yield Goal(node.node, "relative", value, -most, most)
    elif row.name == "goal_position":
        yield Goal(node.node, "position", value, *(node.limits or (None, None)))
    elif row.name == "goal_velocity":
        most = node.value(row, row.high)
        yield Goal(node.node, "velocity", value, -most, most)
    elif row.name == "goal_time":  # a duty in PWM mode; a time otherwise, and judged all the same
        yield Goal(node.node, "load", raw * _DUTY, -1.0, 1.0)
