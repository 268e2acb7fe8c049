"""Read and write registers by name, in API units; REG WRITE and ACTION.

Adjoining registers travel together. RAM is written at once, EEPROM by `eeprom.store`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from typing import Final, NamedTuple, TypeAlias

from motorbus.core.access import readable_rows, writable_values
from motorbus.core.register import Register, RegisterMap, Storage, Value, changed, is_number, shown
from motorbus.core.request import Effect, Request, Stops
from motorbus.core.setpoint import Deferred
from motorbus.errors import MotorbusError, OutcomeUnknown, RequestError
from motorbus.families.feetech import protocol
from motorbus.families.feetech.driver import eeprom, goals
from motorbus.families.feetech.driver.identity import check_map, known, writable
from motorbus.families.feetech.driver.motion import calm_without_force, disable_torque
from motorbus.families.feetech.driver.node import Node, Pending
from motorbus.families.feetech.driver.requests import (
    Block,
    acknowledged,
    confirmed,
    outdated,
    read_block,
    unanswered,
)
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.traits import Mode

METHODS: Final[Mapping[str, str]] = {
    "id": "set_id(), which finds the servo again",
    "baud_rate": "set_baud(), which finds the servo again",
    "second_id": "set_id(), which changes an equal second id too",
    "phase": "set_multi_turn(), which changes its one known bit; another value can ruin the servo",
}
"""The device methods that write protected rows."""
GROUPS: Final[Mapping[str, tuple[str, ...]]] = {
    "gains": ("position_p", "position_i", "position_d", "velocity_p", "velocity_i", "current_p", "current_i"),
    "limits": ("min_position_limit", "max_position_limit"),
    "protection": (
        *("max_temperature", "max_voltage", "min_voltage", "max_torque", "unload_mask"),
        *("protection_current", "overcurrent_time", "protective_torque", "overload_torque", "overload_time"),
    ),
}
"""Names that stand for several rows when read; a map may lack some."""
BY_NAME: Final = {
    name: table.derive(name, changed(table["homing_offset"], protected=False))
    if "homing_offset" in table
    else table
    for name, table in TABLES.items()
}
"""The rows as a write by name sees them: a known homing offset may be restored, though it belongs to one servo."""
ORDERS: Final = frozenset(("goal_position", "goal_velocity"))
REDEFINES_GOALS: Final = frozenset(("operating_mode", "angular_resolution", "homing_offset"))
GAP: Final = 8  # bytes between two rows that are cheaper to read than to leave out

Raws: TypeAlias = Sequence[tuple[Register, int]]


class Span(NamedTuple):
    """Rows that one READ returns."""

    address: int
    size: int
    rows: tuple[Register, ...]


async def read(node: Node, /, *names: str) -> dict[str, Value]:
    """Registers in API units by name; without a name all that can be read. A name may be a key of `GROUPS`.

    Raises RequestError for an unknown name.
    """
    raws = await read_raw(node, *names)
    assert node.table is not None
    return {name: node.value(node.table[name], raw) for name, raw in raws.items()}


async def read_raw(node: Node, /, *names: str) -> dict[str, int]:
    """Registers as raw values by name; see `read`."""
    check_names(names)
    rows = rows_of(await known(node), names)
    found: dict[str, int] = {}
    for span in spans(rows):
        found |= decode_span(span, await read_block(node, span.address, span.size, bytes))
    return {row.name: found[row.name] for row in rows}


async def write(node: Node, /, *, force: bool = False, **values: Value) -> None:
    """Write registers by name, in API units; all are checked before the first is sent.

    Registers in EEPROM are written where they differ, with torque off; a servo that had torque gets it back, unless a
    goal means something else afterwards (`TorqueAfterWrite`). `force` writes equal values too. Raises RequestError for
    what cannot be written by name, LimitExceeded for a goal outside the limits.
    """
    check_values(values)
    table = await writable(node)
    raws = raw_values(node, table, values)
    stored = [one for one in raws if one[0].storage is Storage.EEPROM]
    limp = [one for one in raws if _needs_limp(one[0])]
    live = [one for one in raws if one not in stored and one not in limp]
    moving = [row.name for row, _ in live if row.effect is Effect.MOTION]
    if moving and (stored or limp):
        others = ", ".join(row.name for row, _ in (*stored, *limp))
        what = f"goes limp for {others}, so it cannot take {', '.join(moving)} as well"
        raise node.refusal(what, f"write {others} first, then enable_torque() and the goals")
    if stored:
        keep_torque = not limp and not REDEFINES_GOALS & values.keys()
        blocks = [block._replace(goals=()) for block in blocks_of(node, stored)]
        await eeprom.store(node, table, blocks, force=force, keep_torque=keep_torque)
    if limp:
        await disable_torque(node)
        live = sorted((*live, *limp), key=lambda one: one[0].address)
    for row, raw in live:
        if raw and _bounds_force(node, row):
            await calm_without_force(node, row)
    for block in blocks_of(node, live):
        await confirmed(node, block._replace(effect=Effect.NONE) if limp else block)


def _needs_limp(row: Register) -> bool:
    """Writing this RAM row moves a servo with torque, and it is no goal that the gate could judge."""
    return row.effect is Effect.MOTION and row.storage is Storage.RAM and not row.name.startswith("goal_")


def _bounds_force(node: Node, row: Register) -> bool:
    """At 0 this row leaves a servo without force: more lets it move to its goal."""
    if row.name == node.traits.current:
        return node.known_mode in (Mode.POSITION, Mode.VELOCITY)
    return row.name == node.traits.limit


# -- checks ----------------------------------------------------------------------------------------------------


def check_names(names: Iterable[str]) -> None:
    """Raise RequestError for a name that no register map has."""
    known = {name for table in TABLES.values() for name in table} | set(GROUPS)
    for name in names:
        if name not in known:
            near = get_close_matches(str(name), sorted(known), n=3)
            raise RequestError(
                f"no map has a register {shown(name)}",
                expected=f"perhaps {', '.join(near)}" if near else "",
                advice="`motorbus info BUS#ID --registers` lists them",
            )


def check_values(values: Mapping[str, Value]) -> None:
    """Raise RequestError for an unknown name, no number, and a row that no map lets a user write."""
    check_names(values)
    for name, value in values.items():
        rows = [table[name] for table in BY_NAME.values() if name in table]
        if not rows or not is_number(value):
            raise RequestError(f"{name}: {shown(value)} is not a finite number")
        if all(row.protected or not row.writable for row in rows):
            row = rows[0]
            refusal = f"use {METHODS[name]}" if row.writable and name in METHODS else "it can only be read"
            raise RequestError(f"{name} is not written by name: {refusal}")


def raw_values(node: Node, table: RegisterMap, values: Mapping[str, Value]) -> Raws:
    """These rows with their raw values. Raises RequestError for what cannot be written by name."""

    def to_raw(row: Register, value: Value) -> int:
        row = node.row(row.name)
        raw = node.raw(row, value)
        _check_value(node, row, raw)
        return raw

    raws = writable_values(BY_NAME[table.name], values, to_raw, node=node.node, methods=METHODS)
    _check_limits(node, {row.name: raw for row, raw in raws})
    return [(node.row(row.name), raw) for row, raw in raws]


def _check_limits(node: Node, raws: Mapping[str, int]) -> None:
    """Raise RequestError for a low limit that is not below the high one; both 0 are no limits."""
    if node.settings is None or not raws.keys() & set(GROUPS["limits"]):
        return
    low, high = (
        raws.get(name, raw) for name, raw in zip(GROUPS["limits"], node.settings.raw_limits, strict=True)
    )
    if low >= high and (low or high):
        what = f"would have the position limits {low} to {high} (raw), which leave no range"
        raise node.refusal(what, "write both limits, the lower one first")


def _check_value(node: Node, row: Register, raw: int) -> None:
    """Raise RequestError for a value that only another method can write safely."""
    mode = node.known_mode
    if row.name == "lock" and raw == 0:
        what = "would make every later write permanent with an open lock"
        raise node.refusal(what, "write() opens it by itself")
    if row.name == "torque_enable" and raw != 0 and not row.choices.get(raw, "").startswith("off"):
        raise node.refusal("could jump to an old goal by a plain torque on", "use enable_torque()")
    if row.name == node.traits.current and raw == 0 and mode in (Mode.POSITION, Mode.VELOCITY):
        raise node.refusal(f"would never move with {row.name} 0 in this mode", "use disable_torque()")
    if row.effect is Effect.MOTION and row.name.startswith("goal_"):
        if goals.checked_mode(node) is Mode.PWM and not node.traits.duty:
            raise goals.no_duty(node)
        if row.name == "goal_position" and mode is not Mode.STEP:
            goals.check_mode(node, Mode.POSITION)
        if row.name == node.traits.current:
            node.bound = None


# -- rows and blocks -------------------------------------------------------------------------------------------


def rows_of(table: RegisterMap, names: Sequence[str]) -> list[Register]:
    """The rows of these names, groups spelled out; all that can be read for none."""
    spelled = [
        part
        for name in names
        for part in ([one for one in GROUPS[name] if one in table] if name in GROUPS else [name])
    ]
    return readable_rows(table, tuple(spelled))


def spans(rows: Iterable[Register]) -> Iterator[Span]:
    """Group rows so that few READs return all; none crosses the border of two kinds of memory."""
    group: list[Register] = []
    for row in sorted(rows, key=lambda row: row.address):
        if group and (row.storage is not group[-1].storage or row.address - _end(group[-1]) > GAP):
            yield _span(group)
            group = []
        group.append(row)
    if group:
        yield _span(group)


def _span(group: Sequence[Register]) -> Span:
    return Span(group[0].address, _end(group[-1]) - group[0].address, tuple(group))


def _end(row: Register) -> int:
    return row.address + row.size


def decode_span(span: Span, data: bytes) -> dict[str, int]:
    """The raw values in the bytes of a span."""
    return {
        row.name: row.decode(data[row.address - span.address : _end(row) - span.address]) for row in span.rows
    }


def blocks_of(node: Node, raws: Raws) -> Iterator[Block]:
    """One block for each run of adjoining registers, by address, with its goals for the gate."""
    group: list[tuple[Register, int]] = []
    for row, raw in sorted(raws, key=lambda one: one[0].address):
        if group and row.address != _end(group[-1][0]):
            yield _block(node, group)
            group = []
        group.append((row, raw))
    if group:
        yield _block(node, group)


def _block(node: Node, group: Raws) -> Block:
    is_step = node.known_mode is Mode.STEP and any(row.name == "goal_position" for row, _ in group)
    return Block(
        group[0][0].address,
        b"".join(row.encode(raw) for row, raw in group),
        max(row.effect for row, _ in group),
        tuple(goal for row, raw in group for goal in goals.setpoints(node, row, raw)),
        repeatable=not is_step,
    )


def ram_block(node: Node, values: Mapping[str, Value], what: str) -> Block:
    """These values as one block of RAM registers. Raises RequestError if they are none, or unknown map."""
    check_map(node)
    assert node.table is not None
    raws = raw_values(node, node.table, values)
    found = list(blocks_of(node, raws))
    _check_force(node, raws, what)
    if len(found) == 1 and all(row.storage is Storage.RAM and not _needs_limp(row) for row, _ in raws):
        return found[0]
    names = ", ".join(values) or "none"
    raise node.refusal(f"takes adjoining RAM registers by {what}, not {names}", "write() the others")


def _check_force(node: Node, raws: Raws, what: str) -> None:
    """Raise RequestError for a bound of the force without a goal: from 0 it would let the servo move to an old one."""
    if any(row.name in ORDERS for row, _ in raws):
        return
    for row, raw in raws:
        known = row.name == node.traits.current and node.has_force
        if raw and _bounds_force(node, row) and not known:
            raise node.refusal(f"may jump by {row.name} in a {what}", f"write({row.name}=…) calms it first")


# -- REG WRITE and ACTION --------------------------------------------------------------------------------------


async def reg_write(node: Node, /, **values: Value) -> None:
    """REG WRITE adjoining RAM registers, carried out at the next ACTION; a second one replaces the first.

    Never sent twice: raises OutcomeUnknown if it was not acknowledged.
    """
    check_values(values)
    await writable(node)
    await hand_over(node, ram_block(node, values, "REG WRITE"))


async def hand_over(node: Node, block: Block) -> None:
    """REG WRITE one block, and see that it waits."""

    facts, id = node.facts, node.node

    def note(stops: Stops) -> None:
        facts.pending[id] = Pending(block.goals, node.settings, facts.epochs[id], stops(id))

    if not block.goals:
        facts.pending.pop(id, None)
    wire = protocol.reg_write(node.node, block.address, block.data)
    block = block._replace(repeatable=False, unless=note if block.goals else None)
    request = acknowledged(node, wire, block, deferred=Deferred(node.node))
    await request
    if not request.expected:
        await _check_waiting(node, True, request)


async def action(node: Node) -> None:
    """ACTION: carry out the last REG WRITE of this servo. Never sent twice.

    Raises RequestError if it was stopped, limp or given other settings since; OutcomeUnknown without acknowledgement.
    """
    await writable(node)
    deferred = Deferred(node.node, begins=True)
    block = _released([node], [node.node])
    request = acknowledged(node, protocol.action(node.node), block, deferred=deferred)
    await request
    node.facts.pending.pop(node.node, None)
    if not request.expected:
        await _check_waiting(node, False, request)


def action_all(nodes: Sequence[Node]) -> Request[None]:
    """ACTION as a broadcast without replies: every servo carries out its last REG WRITE at the same moment.

    `nodes` are some servos of the bus; all others obey as well. It is refused as `action` says if it is stale for one
    servo to which a REG WRITE of this bus object went, and the gate judges the goals of all of these once more.
    """
    if not nodes or not all(isinstance(node, Node) for node in nodes):
        raise RequestError("action_all() takes servo objects, which know what waits", expected="one or more")
    for node in nodes:
        if node.identity is not None:
            check_map(node)
    pending = nodes[0].facts.pending
    block = _released(nodes, list(pending))
    request = unanswered(
        protocol.action(),
        block.effect,
        block.goals,
        unless=block.unless,
        deferred=Deferred(None, begins=True),
    )
    return request.convert(lambda _: pending.clear())


def _released(nodes: Sequence[Node], ids: Sequence[int]) -> Block:
    """What an ACTION to these ids releases. Raises RequestError if it is stale."""

    def stale(stops: Stops) -> MotorbusError | None:
        return _stale(nodes, ids, stops)

    if error := stale(lambda _: 0):
        raise error
    waiting = nodes[0].facts.pending
    goals = tuple(goal for id in ids if id in waiting for goal in waiting[id].goals)
    effect = Effect.MOTION if goals else Effect.TORQUE
    return Block(0, b"", effect, goals, repeatable=False, unless=stale)


def _stale(nodes: Sequence[Node], ids: Sequence[int], stops: Stops) -> MotorbusError | None:
    """The error if one of these was stopped, limp or given other settings since its REG WRITE."""
    facts = nodes[0].facts
    for node in nodes:
        pending = facts.pending.get(node.node)
        if pending is not None and (pending.settings != node.settings or node.is_outdated):
            return outdated(node)
    for id in ids:
        pending = facts.pending.get(id)
        if pending is not None and (pending.epoch != facts.epochs[id] or stops(id) > pending.stops):
            what = f"node {id} was stopped or made limp after its REG WRITE"
            return RequestError(what, advice="reg_write() it again", node=id)
    return None


async def _check_waiting(node: Node, waits: bool, request: Request[None]) -> None:
    """See by its register whether a REG WRITE waits in a servo that acknowledges nothing."""
    row = node.row("reg_write_pending")
    if await read_block(node, row.address, 1, lambda data: data != b"\0") is not waits:
        raise OutcomeUnknown(
            f"node {node.node} holds {'no' if waits else 'still a'} REG WRITE",
            sent=request.wire,
            cause="a request was lost, or another program sent one",
            advice="read the goal registers before sending it again",
            node=node.node,
        )
