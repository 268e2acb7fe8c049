"""Read and write registers by name, in API units; REG WRITE and ACTION.

Adjoining registers travel together. RAM is written at once, EEPROM by `eeprom.store`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple, TypeAlias

from motorbus.core.access import readable_rows, writable_values
from motorbus.core.register import Register, RegisterMap, Storage, Value, changed, shown
from motorbus.core.request import Effect, Request, Stops
from motorbus.core.setpoint import Deferred
from motorbus.errors import MotorbusError, RequestError
from motorbus.families.feetech import protocol
from motorbus.families.feetech.driver import eeprom, goals
from motorbus.families.feetech.driver.identity import check_map, known, writable
from motorbus.families.feetech.driver.motion import bound_in, calm_without_force, disable_torque, ordered
from motorbus.families.feetech.driver.node import BusFacts, Node, Pending
from motorbus.families.feetech.driver.requests import (
    Block,
    acknowledged,
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

    def decode(self, data: bytes) -> dict[str, int]:
        """The raw values in these bytes."""
        found = {}
        for row in self.rows:
            at = row.address - self.address
            found[row.name] = row.decode(data[at : at + row.size])
        return found


async def read(node: Node, /, *names: str) -> dict[str, Value]:
    """Registers in API units by name; without a name all that can be read. A name may be a key of `GROUPS`.

    Raises RequestError for an unknown name.
    """
    raws = await read_raw(node, *names)
    assert node.table is not None
    return {name: node.value(node.table[name], raw) for name, raw in raws.items()}


async def read_raw(node: Node, /, *names: str) -> dict[str, int]:
    """Registers as raw values by name; see `read`."""
    rows = rows_of(await known(node), names)
    found: dict[str, int] = {}
    for span in spans(rows, GAP):
        found |= span.decode(await read_block(node, span.address, span.size, bytes))
    return {row.name: found[row.name] for row in rows}


async def write(node: Node, /, *, force: bool = False, **values: Value) -> None:
    """Write registers by name, in API units; all are checked before the first is sent.

    Registers in EEPROM are written where they differ, with torque off; a servo that had torque gets it back, unless a
    goal means something else afterwards. `force` writes equal values too. Raises RequestError for what cannot be
    written by name, LimitExceeded for a goal outside the limits.
    """
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
        live = [*live, *limp]
    for row, raw in live:
        if raw and _bounds_force(node, row):
            await calm_without_force(node, row)
    for block in blocks_of(node, live):
        await ordered(node, block._replace(effect=Effect.NONE) if limp else block)


def _needs_limp(row: Register) -> bool:
    """Writing this RAM row moves a servo with torque, and it is no goal that the gate could judge."""
    return row.effect is Effect.MOTION and row.storage is Storage.RAM and not row.name.startswith("goal_")


def _bounds_force(node: Node, row: Register) -> bool:
    """At 0 this row leaves a servo without force: more lets it move to its goal."""
    if row.name == node.traits.current:
        return node.known_mode in goals.BOUNDED
    return row.name == node.traits.limit


# -- checks ----------------------------------------------------------------------------------------------------


def check_names(names: Iterable[str]) -> None:
    """Raise RequestError for a name that no register map has."""
    for name in names:
        if name not in GROUPS and not any(name in table for table in TABLES.values()):
            fix = "`motorbus info BUS#ID --registers` lists them"
            raise RequestError(f"no map has a register {shown(name)}", advice=fix)


def raw_values(node: Node, table: RegisterMap, values: Mapping[str, Value]) -> Raws:
    """These rows with their raw values. Raises RequestError for what cannot be written by name."""

    def to_raw(row: Register, value: Value) -> int:
        row = node.row(row.name)
        raw = node.raw(row, value)
        _check_value(node, row, raw)
        return raw

    found = writable_values(BY_NAME[table.name], values, to_raw, node=node.node, methods=METHODS)
    raws = {row.name: raw for row, raw in found}
    if node.settings is not None and raws.keys() & set(GROUPS["limits"]):
        held = zip(GROUPS["limits"], node.settings.raw_limits, strict=True)
        low, high = (raws.get(name, raw) for name, raw in held)
        if low >= high and (low or high):  # both 0 are no limits
            what = f"would have the position limits {low} to {high} (raw), which leave no range"
            raise node.refusal(what, "write both limits, the lower one first")
    return [(node.row(row.name), raw) for row, raw in found]


def _check_value(node: Node, row: Register, raw: int) -> None:
    """Raise RequestError for a value that only another method can write safely."""
    if row.name == "lock" and raw == 0:
        what = "would make every later write permanent with an open lock"
        raise node.refusal(what, "write() opens it by itself")
    if row.name == "torque_enable" and raw != 0 and not row.choices.get(raw, "").startswith("off"):
        raise node.refusal("could jump to an old goal by a plain torque on", "use enable_torque()")
    if row.name == node.traits.current and raw == 0 and node.known_mode in goals.BOUNDED:
        raise node.refusal(f"would never move with {row.name} 0 in this mode", "use disable_torque()")
    if row.effect is Effect.MOTION and row.name.startswith("goal_"):
        mode = goals.checked_mode(node)
        if mode is Mode.PWM and not node.traits.duty:
            raise goals.no_duty(node)
        if row.name == "goal_position" and mode is not Mode.STEP:
            goals.check_mode(node, Mode.POSITION)


# -- rows and blocks -------------------------------------------------------------------------------------------


def rows_of(table: RegisterMap, names: Sequence[str]) -> list[Register]:
    """The rows of these names, groups spelled out; all that can be read for none."""
    spelled: list[str] = []
    for name in names:
        spelled += [one for one in GROUPS[name] if one in table] if name in GROUPS else [name]
    return readable_rows(table, tuple(spelled))


def spans(rows: Iterable[Register], gap: int = 0) -> Iterator[Span]:
    """Rows at most `gap` bytes apart together; none crosses the border of two kinds of memory."""
    group: list[Register] = []
    end = 0
    for row in sorted(rows, key=lambda row: row.address):
        if group and (row.storage is not group[-1].storage or row.address - end > gap):
            yield Span(group[0].address, end - group[0].address, tuple(group))
            group = []
        group.append(row)
        end = row.address + row.size
    if group:
        yield Span(group[0].address, end - group[0].address, tuple(group))


def blocks_of(node: Node, raws: Raws) -> Iterator[Block]:
    """One block for each run of adjoining registers, by address, with its goals for the gate."""
    values = {row.name: raw for row, raw in raws}
    for span in spans(row for row, _ in raws):
        steps = node.known_mode is Mode.STEP and any(row.name == "goal_position" for row in span.rows)
        yield Block(
            span.address,
            b"".join(row.encode(values[row.name]) for row in span.rows),
            max(row.effect for row in span.rows),
            tuple(goal for row in span.rows for goal in goals.setpoints(node, row, values[row.name])),
            repeatable=not steps,
        )


def ram_block(node: Node, values: Mapping[str, Value], what: str) -> Block:
    """These values as one block of RAM registers. Raises RequestError if they are none, DeviceError for an unknown map.

    A bound of the force without a goal is refused: from 0 it would let the servo move to an old one.
    """
    check_map(node)
    assert node.table is not None
    raws = raw_values(node, node.table, values)
    for row, raw in () if values.keys() & ORDERS else raws:
        has_force = row.name == node.traits.current and node.known.bound
        if raw and _bounds_force(node, row) and not has_force:
            raise node.refusal(f"may jump by {row.name} in a {what}", f"write({row.name}=…) calms it first")
    blocks = list(blocks_of(node, raws))
    if len(blocks) != 1 or any(row.storage is not Storage.RAM or _needs_limp(row) for row, _ in raws):
        names = ", ".join(values) or "none"
        raise node.refusal(f"takes adjoining RAM registers by {what}, not {names}", "write() the others")
    node.known.bound = bound_in(node, blocks[0], node.known.bound)
    return blocks[0]


# -- REG WRITE and ACTION --------------------------------------------------------------------------------------


async def reg_write(node: Node, /, **values: Value) -> None:
    """REG WRITE adjoining RAM registers, carried out at the next ACTION; a second one replaces the first.

    Never sent twice: raises OutcomeUnknown if it was not acknowledged.
    """
    await writable(node)
    await reg_write_block(node, ram_block(node, values, "REG WRITE"))


async def reg_write_block(node: Node, block: Block) -> None:
    """REG WRITE this block; what is known then decides whether ACTION may follow."""
    facts = node.known
    facts.pending = None

    def note(stops: Stops) -> None:
        facts.pending = Pending(block.goals, facts.settings, facts.epoch, stops(node.node))

    wire = protocol.reg_write(node.node, block.address, block.data)
    once = block._replace(repeatable=False, unless=note if block.goals else None)
    await acknowledged(node, wire, once, deferred=Deferred(node.node))


async def action(node: Node) -> None:
    """ACTION: carry out the last REG WRITE of this servo. Never sent twice.

    Raises RequestError if it was stopped, limp or given other settings since; OutcomeUnknown without acknowledgement.
    """
    await writable(node)
    block = _released(node.facts, [node.node])
    await acknowledged(node, protocol.action(node.node), block, deferred=Deferred(node.node, begins=True))
    node.known.pending = None


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
    servos = nodes[0].facts.servos
    block = _released(nodes[0].facts, list(servos))
    deferred = Deferred(None, begins=True)

    def clear(_: None) -> None:
        for one in servos.values():
            one.pending = None

    request = unanswered(protocol.action(), block.effect, block.goals, unless=block.unless, deferred=deferred)
    return request.convert(clear)


def _released(facts: BusFacts, ids: Sequence[int]) -> Block:
    """What an ACTION to these ids releases. Raises RequestError if it is stale."""
    waiting = {id: pending for id in ids if (pending := facts.servos[id].pending)}

    def stale(stops: Stops) -> MotorbusError | None:
        for id, pending in waiting.items():
            one = facts.servos[id]
            if pending.settings is not one.settings:
                return outdated(id)
            if pending.epoch != one.epoch or stops(id) > pending.stops:
                what = f"node {id} was stopped or made limp after its REG WRITE"
                return RequestError(what, advice="reg_write() it again", node=id)
        return None

    if error := stale(lambda _: 0):
        raise error
    goals = tuple(goal for pending in waiting.values() for goal in pending.goals)
    effect = Effect.MOTION if goals else Effect.TORQUE
    return Block(0, b"", effect, goals, repeatable=False, unless=stale)
