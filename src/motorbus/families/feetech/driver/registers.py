"""Registers by name: read and write them in API units.

What adjoins is read and written together. A write goes the way its row asks for: RAM at once, EEPROM through the
guarded sequence of `eeprom.py`, and what `orders.py` refuses not at all.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from motorbus.core.register import Register, RegisterMap, Storage, Value
from motorbus.core.request import Effect, Precondition, Request, Stops
from motorbus.core.setpoint import Deferred
from motorbus.core.steps import Runnable
from motorbus.errors import MotorbusError, OutcomeUnknown, RequestError
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver import eeprom
from motorbus.families.feetech.driver.bound import leaving_current_mode
from motorbus.families.feetech.driver.exchanges import (
    Block,
    acknowledged,
    changed_since,
    confirmed,
    outdated,
    read_block,
    unanswered,
)
from motorbus.families.feetech.driver.identity import known, refuse_unless_writable, writable
from motorbus.families.feetech.driver.node import Node, Pending
from motorbus.families.feetech.driver.orders import (
    Order,
    blocks,
    check_names,
    check_values,
    is_goal,
    limps,
    only_block,
    orders_of,
)
from motorbus.families.feetech.driver.rest import is_limp
from motorbus.families.feetech.driver.torque import disable_torque

IDLE: Final = b"\0"
WAITING: Final = b"\1"
_REDEFINES_GOALS: Final = frozenset(("operating_mode", "phase", "angular_resolution"))
"""EEPROM registers that give a goal another meaning."""
_GAP: Final = 8
"""Bytes between two rows that are cheaper to read than to leave out: a request has 8, a reply 6, and a pause."""


class Span(NamedTuple):
    """Rows that one READ brings."""

    address: int
    size: int
    rows: tuple[Register, ...]


async def read(node: Node, /, *names: str) -> dict[str, Value]:
    """Registers in API units by name, all that can be read when none is named.

    Raises RequestError for an unknown name (nothing is sent then), NoReply when the servo is silent.
    """
    raws = await read_raw(node, *names)
    assert node.table is not None
    table = node.table
    return {name: node.value(table[name], raw) for name, raw in raws.items()}


async def read_raw(node: Node, /, *names: str) -> dict[str, int]:
    """Registers as raw values by name, all that can be read when none is named."""
    check_names(names)
    table = await known(node)
    rows = rows_of(table, names)
    found: dict[str, int] = {}
    for span in spans(rows):
        data = await read_block(node, span.address, span.size, bytes)
        found.update(decode(span, data))
    return {row.name: found[row.name] for row in rows}


def rows_of(table: RegisterMap, names: Sequence[str]) -> list[Register]:
    """The rows of these names in this order; every readable one when none is named."""
    rows = [table[name] for name in names] if names else list(table.values())
    return [row for row in rows if row.readable]


def spans(rows: Iterable[Register]) -> Iterator[Span]:
    """Group rows so that few READs bring them all; never across the border of two kinds of memory."""
    group: list[Register] = []
    for row in sorted(rows, key=lambda row: row.address):
        if group and (row.storage is not group[-1].storage or row.address - _end(group[-1]) > _GAP):
            yield _span(group)
            group = []
        group.append(row)
    if group:
        yield _span(group)


def decode(span: Span, data: bytes) -> dict[str, int]:
    """The raw values in the bytes of a span."""
    return {
        row.name: row.decode(data[row.address - span.address : _end(row) - span.address]) for row in span.rows
    }


def _span(group: list[Register]) -> Span:
    return Span(group[0].address, _end(group[-1]) - group[0].address, tuple(group))


def _end(row: Register) -> int:
    return row.address + row.size


async def write(node: Node, /, **values: Value) -> None:
    """Write registers by name, in API units; all are checked before the first is sent.

    Registers in EEPROM are read first, and what differs goes through the guarded sequence: unlock, torque off, write,
    read back, lock. A servo that had torque gets it back, with the goal at its present position, also when the write
    fails; an arm sags meanwhile. Torque stays off where a goal would mean something else afterwards
    (`torque_after_write`), where `enable_torque` refuses, and after a stop or a restart meanwhile. Reports
    `TorqueAfterWrite`. When all of them hold that already, none is written and it keeps its torque, unless registers
    that act on the torque are named with them. That others wrote them behind a closed lock, so that they are gone at
    power-off, cannot be seen: `rewrite` is for that. What changes the meaning of a goal (`control_loop` of HLS) lets
    it go limp as well. Raises RequestError for what cannot or must not be written so, and for goals together with
    EEPROM; DeviceError when the register map is not known, VerificationFailed when EEPROM reads back different.
    """
    await _written(node, values, always=False)


async def write_limp(node: Node, values: Mapping[str, Value]) -> None:
    """As `write`, and torque stays off after a write to EEPROM."""
    await _written(node, values, always=False, restore=False)


async def torque_after_write(node: Node, /, **values: Value) -> str | None:
    """What a write of these registers does to the torque: None when it is off, or none of them is in EEPROM; "" when
    the servo gets it back; else why it stays off."""
    check_values(values)
    table = await writable(node)
    orders = orders_of(node, table, values)
    if not any(order.row.storage is Storage.EEPROM for order in orders) or await is_limp(node):
        return None
    return _stays_off(node, orders)


def _stays_off(node: Node, orders: Sequence[Order]) -> str:
    """Why the torque must stay off after these, "" where it may come back."""
    raws = {order.row.name: order.raw for order in orders}
    settings = node.settings
    for order in orders:
        if order.row.name in _REDEFINES_GOALS or limps(order.row):
            return f"{order.row.name} changes what a goal means"
    if raws.keys() & {"min_position_limit", "max_position_limit"}:
        unlimited = settings is None or settings.many_turns or settings.limits is None
        if unlimited or raws.get("max_position_limit") == 0:
            return "position limits of 0 change what a goal means"
    return "torque_enable is written too" if "torque_enable" in raws else ""


async def rewrite(node: Node, /, **values: Value) -> None:
    """As `write`, and registers in EEPROM are written for good whatever they read: one more write to each cell.

    For settings that another program may have made with the lock closed: they read as set, and are gone at power-off.
    """
    await _written(node, values, always=True)


async def _written(node: Node, values: Mapping[str, Value], *, always: bool, restore: bool = True) -> None:
    check_values(values)
    table = await writable(node)
    orders = orders_of(node, table, values)
    _refuse_goals_among_settings(node, orders)
    kept = list(blocks(node, [order for order in orders if order.row.storage is Storage.EEPROM]))
    live = [order for order in orders if order.row.storage is not Storage.EEPROM]
    limp = any(limps(order.row) for order in live)
    if kept:
        torque = eeprom.Torque(_stays_off(node, orders)) if restore else None
        stored = _kept(node, table, orders, kept)
        wrote = await eeprom.store(node, table, stored, always=always, torque=torque)
        limp |= not wrote and any(order.row.effect is Effect.TORQUE for order in live)
    if limp:
        await disable_torque(node)
        await _confirmed_limp(node, [order for order in live if limps(order.row)])
    made = None if kept else node.settings
    for block in list(blocks(node, [order for order in live if not limps(order.row)])):
        await confirmed(node, block._replace(under=made))


def _refuse_goals_among_settings(node: Node, orders: Sequence[Order]) -> None:
    """What lies in EEPROM, or must be written limp, may give a goal another meaning, and lets go before."""
    goals = [order.row.name for order in orders if is_goal(order.row)]
    before = [order.row.name for order in orders if order.row.storage is Storage.EEPROM or limps(order.row)]
    if goals and before:
        raise RequestError(
            f"node {node.node}: {', '.join(goals)} together with {', '.join(before)}, for which the servo goes limp",
            expected="goals alone",
            advice=f"write {', '.join(before)} first, then enable_torque() and the goals; nothing was sent",
            node=node.node,
        )


def _kept(node: Node, table: RegisterMap, orders: Iterable[Order], kept: Sequence[Block]) -> Sequence[Block]:
    """What is stored, and where that changes the mode, what the last goal of the old mode would do to the new one."""
    for order in orders:
        if order.row.name == "operating_mode":
            return leaving_current_mode(node, table, node.control.modes.get(order.raw), kept)
    return kept


async def _confirmed_limp(node: Node, orders: Sequence[Order]) -> None:
    """Write what would move a servo that holds to one that was made limp, which it cannot move."""
    for block in blocks(node, orders):
        await confirmed(node, block._replace(effect=Effect.NONE))


async def reg_write(node: Node, /, **values: Value) -> None:
    """REG WRITE: hand over a write of adjoining RAM registers that is carried out at the next ACTION.

    A second one replaces the first; a power cycle loses it. It survives torque off and an emergency stop, so `action`
    refuses it after those, until the next one; a write to EEPROM replaces it by torque off, and `action` refuses as
    well. Never sent twice: raises OutcomeUnknown when it was not acknowledged.
    """
    check_values(values)
    table = await writable(node)
    await hand_over(node, table, to_hand_over(node, table, values))


def to_hand_over(node: Node, table: RegisterMap, values: Mapping[str, Value]) -> Block:
    """What a REG WRITE of these would bring: adjoining registers, not to be sent twice. Raises RequestError."""
    return only_block(node, orders_of(node, table, values), "REG WRITE")._replace(repeatable=False)


async def hand_over(node: Node, table: RegisterMap, block: Block) -> None:
    """REG WRITE one block, and see that it was taken. Raises OutcomeUnknown when nobody knows."""
    request = wire.reg_write(node.node, block.address, block.data)
    exchange = acknowledged(
        node, request, block, refusal=_handed_over(node, block), later=Deferred(node.node)
    )
    await exchange
    if not exchange.expected:
        await _pending(node, table, exchange)
    if not block.goals:
        node.pending = None


def _handed_over(node: Node, block: Block) -> Precondition:
    """Keep in mind what is handed over, and how often the servo had been stopped when it left."""
    changed = changed_since([(node, block.under)])
    if block.goals:
        node.pending = Pending(block.goals, node.settings)

    def refusal(stops: Stops) -> MotorbusError | None:
        if block.goals:
            node.pending = Pending(block.goals, node.settings, stops(node.node))
        return changed(stops)

    return refusal


async def _pending(node: Node, table: RegisterMap, exchange: Request[None]) -> None:
    """A servo that acknowledges nothing still says whether a REG WRITE waits."""
    if await waits(node, table) != WAITING:
        raise OutcomeUnknown(
            f"node {node.node} holds no REG WRITE after one was sent",
            sent=exchange.wire,
            cause="it was lost on the way, or an ACTION came in between",
            advice="read the goal registers before sending it again",
            node=node.node,
        )


def waits(node: Node, table: RegisterMap) -> Request[bytes]:
    """`WAITING` or `IDLE`. It is held against what it ought to be, which a dry run takes for granted."""
    return read_block(
        node, table["reg_write_pending"].address, 1, lambda told: IDLE if told == IDLE else WAITING
    )


def action(node: Node) -> Runnable[None]:
    """ACTION for this servo: carry out what REG WRITE left. Never sent twice; nothing pending does nothing.

    Raises RequestError when the settings of the servo were changed since its REG WRITE, or when it was let go or
    stopped since, by whomever on this bus: reg_write() it again. Raises DeviceError when the register map is not known,
    for then nobody knows what waits; OutcomeUnknown when it was not acknowledged, or still waits on a servo that
    acknowledges nothing; Refused, where bounds are set, for what nobody on this bus has handed over since it was opened
    (reason `unknown`), and for what they do not allow from where it is now.
    """
    if node.table is None or node.settings is None:
        return _met(node)
    refuse_unless_writable(node)
    exchange = acknowledged(
        node,
        wire.action(node.node),
        _released([node]),
        refusal=_still_wanted([node]),
        after=lambda: _carried_out([node]),
        later=Deferred(node.node, begins=True),
    )
    return exchange if exchange.expected else _seen(node, node.table, exchange)


async def _met(node: Node) -> None:
    await writable(node)
    await action(node)


async def _seen(node: Node, table: RegisterMap, exchange: Request[None]) -> None:
    """A servo that acknowledges nothing still says whether a REG WRITE waits."""
    await exchange
    if await waits(node, table) != IDLE:
        raise OutcomeUnknown(
            f"node {node.node} still holds a REG WRITE after ACTION was sent",
            sent=exchange.wire,
            cause="ACTION was lost on the way, or another REG WRITE came in between",
            advice="read the goal registers before sending it again",
            node=node.node,
        )


def action_all(nodes: Sequence[Node] = ()) -> Request[None]:
    """ACTION as a broadcast: every servo carries out what REG WRITE left, at the same moment; nobody answers.

    `nodes` are those whose goals were handed over here, for the gate to see once more, and to be refused as `action`
    says. Raises DeviceError when the register map of one of these is known not to be described. Servos that are not
    named obey as well, also those that were let go since (a write to EEPROM makes what waits harmless, a stop cannot):
    name all.
    """
    for node in nodes:
        if node.identity is not None:
            refuse_unless_writable(node)
    block = _released(nodes)
    return unanswered(
        wire.action(),
        block.effect,
        block.goals,
        refusal=_still_wanted(nodes),
        after=lambda: _carried_out(nodes),
        later=Deferred(None, begins=True),
    )


def _released(nodes: Sequence[Node]) -> Block:
    """What ACTION lets go, as far as it was handed over here. What others handed over on this bus the gate knows and
    judges besides; ACTION is then no more than torque here: leave to go for a goal."""
    goals = tuple(goal for node in nodes if node.pending is not None for goal in node.pending.goals)
    return Block(0, b"", Effect.MOTION if goals else Effect.TORQUE, goals, repeatable=False)


def _still_wanted(nodes: Sequence[Node]) -> Precondition:
    """Refuses what was handed over under other settings, now already, or before a servo was told to let go."""

    def refusal(stops: Stops) -> MotorbusError | None:
        for node in nodes:
            if node.pending is not None and node.pending.withdrawn:
                return _taken_back(node)
            if node.pending is not None and node.pending.settings != node.settings:
                return outdated(node, "the REG WRITE that waits")
            if node.pending is not None and stops(node.node) > node.pending.stops:
                return _let_go_since(node)
        return None

    if (error := refusal(lambda _: 0)) is not None:
        raise error
    return refusal


def _let_go_since(node: Node) -> RequestError:
    return RequestError(
        f"node {node.node} was told to let go after its REG WRITE was handed over, and ACTION would move it",
        expected="no stop between the two",
        cause="disable_torque(), an emergency stop, or a write to EEPROM, which begins with torque off",
        advice="reg_write() it again, which replaces what waits; nothing was sent",
        node=node.node,
    )


def _taken_back(node: Node) -> RequestError:
    return RequestError(
        f"the REG WRITE for node {node.node} was taken back, for another servo had not acknowledged its own",
        expected="a REG WRITE that is wanted still",
        cause="reg_write_all() releases all or nothing",
        advice="reg_write() it again, which replaces what waits; nothing was sent",
        node=node.node,
    )


def _carried_out(nodes: Iterable[Node]) -> None:
    for node in nodes:
        node.pending = None
