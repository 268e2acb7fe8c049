"""What a write by name comes to: raw values, blocks of adjoining registers, goals for the gate, and refusals.

All of it is decided before the first byte is sent. The same rules hold for WRITE, REG WRITE and SYNC WRITE.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import tau
from typing import Final, NamedTuple

from motorbus.core.register import Register, RegisterMap, Storage, Value, is_number, shown
from motorbus.core.request import Effect
from motorbus.core.setpoint import Setpoint
from motorbus.errors import LimitExceeded, RequestError
from motorbus.families.feetech.driver.exchanges import Block
from motorbus.families.feetech.driver.identity import refuse_unless_writable
from motorbus.families.feetech.driver.node import MANY_TURNS, SCALED, Node
from motorbus.families.feetech.table import TABLES, Mode

DUTY: Final = 0.001
"""What one count of a duty is, as a fraction. Source: STS3215 memory table V3.6; SCS memory table 1902."""
NO_LOAD: Final = 3400
"""Counts/s that no servo exceeds much: of an STS3215 without load. Source: STS3215 memory table V3.6."""
COUNT: Final = tau / 4096
"""rad; what a count of it is."""
_CALIBRATE: Final = 128
_INSTEAD: Final = {
    "id": "use set_id(), which sees to it that the servo is found again",
    "baud_rate": "use set_baud(), which sees to it that the servo is found again",
    "homing_offset": "use calibrate(), which reckons it from where the servo stands",
}


class Order(NamedTuple):
    """One row and the raw value it shall have."""

    row: Register
    raw: int


def orders_of(node: Node, table: RegisterMap, values: Mapping[str, Value]) -> list[Order]:
    """The raw values to write, each checked against its row and against what a plain write may do."""
    orders = [Order(table[name], node.raw(table[name], value)) for name, value in values.items()]
    for order, value in zip(orders, values.values(), strict=True):
        _check(order, value, node.node)
        _refuse_unheeded(node, order.row)
        if order.row.name == node.control.current:
            _check_bound(node, order)
            node.bound = None
    return orders


def _refuse_unheeded(node: Node, row: Register) -> None:
    """A goal says what its mode makes of it: where nobody knows that, the gate could not judge it."""
    if node.settings is None or not is_goal(row):
        return
    mode = node.known_mode
    if mode is None or (mode is Mode.PWM and not node.control.duty):
        raise RequestError(
            f"node {node.node} is in operating mode {shown_mode(node)}, in which nobody has published what "
            f"{row.name} does",
            expected="a mode whose goals can be judged",
            advice="set_mode('position'), or disable_torque(); nothing was sent",
            node=node.node,
        )
    if row.name == "goal_position" and mode not in (Mode.POSITION, Mode.STEP):
        raise unheeded(node, Mode.POSITION, "heeds no goal position")


def _check_bound(node: Node, order: Order) -> None:
    """The trap of HLS: a goal torque of 0 in position or velocity mode makes a servo that holds nothing."""
    if order.raw or node.known_mode not in (Mode.POSITION, Mode.VELOCITY):
        return
    raise RequestError(
        f"{order.row.name}: 0 would leave node {node.node} without force, for in {shown_mode(node)} mode this register "
        "bounds its current",
        expected=f"above 0, to {order.row.to_value(order.row.high):.4g} {order.row.unit}",
        advice="disable_torque() lets it go limp; nothing was sent",
        node=node.node,
    )


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
    if len(found) == 1 and all(order.row.storage is Storage.RAM and not limps(order.row) for order in orders):
        return found[0]
    raise RequestError(
        f"{what} carries adjoining RAM registers only, not {', '.join(o.row.name for o in orders) or 'none'}",
        expected="registers whose addresses follow each other, such as goal_position, goal_time, goal_velocity",
        advice="leave out what does not belong, or write() it; nothing was sent",
        node=node.node,
    )


def is_goal(row: Register) -> bool:
    """Whether writing it orders a movement, for the gate to judge."""
    return row.effect is Effect.MOTION and row.storage is Storage.RAM and not limps(row)


def limps(row: Register) -> bool:
    """Whether this RAM register may be written to a limp servo only: it moves a servo, and is no goal to judge."""
    return row.effect is Effect.MOTION and row.storage is Storage.RAM and not row.name.startswith("goal_")


def position_goal(node: Node, row: Register, to: float) -> tuple[int, Setpoint]:
    """A goal position in rad: its raw value, and the goal for the gate, which judges the limits.

    Raises DeviceError when its map is not known, RequestError in other than position mode or when both its limits are
    0 and nobody has published what that means, LimitExceeded for what is no number or fits no register.
    """
    refuse_unless_writable(node)
    if node.known_mode is not Mode.POSITION:
        raise unheeded(node, Mode.POSITION, "cannot go to a position")
    if node.limits is None:
        raise no_limits(node)
    raw = node.raw(row, to) if is_number(to) else row.high + 1
    if not row.low <= raw <= row.high:
        raise LimitExceeded(
            f"node {node.node}: {shown(to)} rad is no position it could go to",
            expected=f"{node.value(row, row.low):.4g} to {node.value(row, row.high):.4g} rad at the very most",
            advice="give a number in rad; nothing was sent",
            node=node.node,
        )
    return raw, Setpoint(node.node, "position", node.value(row, raw), *(node.limits or (None, None)))


def unheeded(node: Node, wanted: Mode, complaint: str) -> RequestError:
    """The error for an order that a servo does not heed in the mode it is in."""
    code = node.control.code(wanted)
    has = ", ".join(mode.value for mode in node.control.has)
    return RequestError(
        f"node {node.node} {complaint} in operating mode {shown_mode(node)}",
        expected=f"operating mode {wanted.value}" + (f" ({code})" if code is not None else ""),
        advice=f"set_mode({wanted.value!r}) changes that; nothing was sent"
        if wanted in node.control.has
        else f"servos of its map have {has} mode only; nothing was sent",
        node=node.node,
    )


def no_limits(node: Node) -> RequestError:
    """The error for a servo whose limits are both 0 in a map where nobody has published what that means."""
    return RequestError(
        f"both position limits of node {node.node} are 0, and nobody has published what that means on "
        f"{node.identity.table if node.identity else 'its map'}",
        expected="a greatest position above the least",
        advice="write(min_position_limit=…, max_position_limit=…), or disable_torque(); nothing was sent",
        node=node.node,
    )


def shown_mode(node: Node) -> str:
    """The mode a servo is in, for reading eyes: the word, or the number that no source explains."""
    if node.known_mode is not None:
        return node.known_mode.value
    return str(node.settings.mode_code) if node.settings else "unknown"


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
        faults = [_fault(table[name], value) for table in TABLES.values() if name in table]
        if faults and faults[0] is not None and all(faults):
            raise faults[0]


def _fault(row: Register, value: Value) -> RequestError | None:
    """What is wrong with this value whatever the settings of the servo are, which may scale some rows."""
    if not is_number(value):
        return RequestError(
            f"{row.name}: {shown(value)} is not a finite number", advice="give a number; nothing was sent"
        )
    try:
        _check(Order(row, 0 if row.name in SCALED else row.to_raw(value)), value)
    except RequestError as error:
        return error
    return None


def _check(order: Order, value: Value, node: int | None = None) -> None:
    row, raw = order
    if refusal := _refusal(row, raw):
        raise RequestError(f"{row.name}: {refusal[0]}", advice=f"{refusal[1]}; nothing was sent", node=node)
    row.encode(raw, row.given(value))  # raises RequestError when out of range


def _refusal(row: Register, raw: int) -> tuple[str, str] | None:
    """Why this may not be written by name, and what to do instead; None when it may."""
    if row.effect is Effect.IDENTITY:
        return (
            "a plain write would change how the servo is found, and may lose it",
            _INSTEAD.get(row.name, "leave it as it is"),
        )
    if row.protected:
        return (
            "this register belongs to one servo alone and may not be copied; a wrong value can ruin it",
            _INSTEAD.get(row.name, "leave it as it is"),
        )
    if not row.writable:
        return "this register can only be read", "read it instead"
    if row.name == "lock" and raw == 0:
        return (
            "an open lock would make every later write permanent",
            "just write the registers: write() opens the lock, verifies, and closes it again",
        )
    if row.name == "torque_enable" and raw == _CALIBRATE:
        return "128 is no state of the torque: it rewrites the homing offset", "use calibrate()"
    if row.name == "torque_enable" and not row.choices.get(raw, "").startswith("off"):
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
        tuple(goal for row, raw in group for goal in goals_of(node, row, raw)),
        repeatable=not any(row.name == "goal_position" and node.known_mode is Mode.STEP for row, _ in group),
    )


def goals_of(node: Node, row: Register, raw: int) -> Iterator[Setpoint]:
    """What this value of this row orders, in the operating mode the servo is in."""
    value = node.value(row, raw)
    if row.name == "goal_position" and node.known_mode is Mode.STEP:
        most = MANY_TURNS * row.scale
        yield Setpoint(node.node, "relative", value, -most, most)
    elif row.name == "goal_position":
        yield Setpoint(node.node, "position", value, *(node.limits or (None, None)))
    elif row.name == "goal_velocity":
        yield speed_goal(node, row, raw)
    elif row.name == node.control.current:
        quantity = "current" if node.known_mode is Mode.CURRENT else "cap"
        yield Setpoint(node.node, quantity, value, node.value(row, row.low), node.value(row, row.high))
    elif row.name == "goal_time":  # a duty in PWM mode; a time otherwise, and judged all the same
        yield Setpoint(node.node, "load" if node.known_mode is Mode.PWM else "time", raw * DUTY, -1.0, 1.0)


def speed_goal(node: Node, row: Register, raw: int) -> Setpoint:
    """What a goal velocity orders: to turn at it in velocity mode, else how fast it goes to its goal at most.

    Where 0 means the maximum, that is what it says: as fast as no servo goes much faster.
    """
    low, high = float(node.value(row, row.low)), float(node.value(row, row.high))
    if node.known_mode is Mode.VELOCITY:
        return Setpoint(node.node, "velocity", float(node.value(row, raw)), low, high)
    most = raw == 0 and (node.settings is None or node.settings.zero_is_maximum)
    return Setpoint(
        node.node, "speed", min(NO_LOAD * COUNT, high) if most else float(node.value(row, raw)), low, high
    )
