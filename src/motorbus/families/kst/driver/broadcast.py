"""Everyone at once: requests to node 0, which all carry out and each answers under its own id.

The manual says that 0 is a broadcast and not which requests it allows. A public demo driver reads so; that writes are
carried out follows from the manual, whether they are acknowledged is not known, so silence is no error here. With one
exception: nobody gives all servos one id by mistake.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

from motorbus.core.family import IdChanged
from motorbus.core.register import Register, Value
from motorbus.core.request import ANY, EVERY_LANE, Effect, Priority, Request, Response, TimeoutClass
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import Emit, Exclusive
from motorbus.errors import RequestError
from motorbus.families.kst import wire
from motorbus.families.kst.driver.dialect import PLAIN, Dialect
from motorbus.families.kst.driver.exchanges import OtherSize, sized
from motorbus.families.kst.driver.identity import code_of
from motorbus.families.kst.driver.motion import Started, counts
from motorbus.families.kst.driver.node import Node, checked_id, checked_ids
from motorbus.families.kst.table import SAVE


async def broadcast_read(name: str, dialect: Dialect = PLAIN) -> dict[int, Value]:
    """An object of everyone, in API units, by node.

    Who refuses it, is silent, says something longer, or says two different things (two servos with one id), is
    missing. Raises RequestError for an object that is unknown or can only be written.
    """
    row = dialect.profile.table[name]
    if not row.readable:
        raise RequestError(f"{name} can only be written", advice="nothing was sent")
    return await Exclusive(_read(row, dialect))


async def _read(row: Register, dialect: Dialect) -> dict[int, Value]:
    """With the bus alone: what a node says to everyone's question looks just like what it says to its own."""
    found: dict[int, Value] = {}
    for extended in sorted(dialect.formats):
        frame = wire.encode_upload(wire.EVERYONE, row.address, row.subindex or 0, extended=extended)
        answer = await Request[Response](frame, ANY, lane=EVERY_LANE)
        found |= _values(row, answer, dialect)
    return found


def _values(row: Register, answer: Response, dialect: Dialect) -> dict[int, Value]:
    told: dict[int, set[bytes]] = {}
    for reply in answer.replies:
        one = wire.decode_reply(reply.data)
        if one is not None and one.kind == "upload" and _about(row, one):
            with suppress(OtherSize):
                told.setdefault(reply.lane, set()).add(sized(Node(reply.lane, dialect), row, one))
    return {node: row.to_value(row.decode(data.pop())) for node, data in told.items() if len(data) == 1}


def _about(row: Register, reply: wire.SdoReply) -> bool:
    return (reply.index, reply.subindex) == (row.address, row.subindex or 0)


async def broadcast_position(to: float, nodes: Sequence[int], dialect: Dialect = PLAIN) -> tuple[int, ...]:
    """Send everyone on the bus to `to` rad; returns who acknowledged. Where the profile has a start rule, everyone is
    started first, and `Started` (node 0) tells so.

    `nodes` are those that are there, for the gate and the emergency stop; everyone else on the bus moves as well.
    Raises LimitExceeded when `to` is outside the range of the profile, RequestError for no nodes.
    """
    there = checked_ids(nodes)
    if not there:
        raise RequestError(
            "who is on this bus? everyone will move, and what moves must be known to be stopped",
            expected="the ids of all servos on it",
            advice="scan() lists them; nothing was sent",
        )
    row = dialect.profile.table["goal_position"]
    raw = counts(Node(there[0], dialect), to)
    value, low, high = (float(row.to_value(number)) for number in (raw, row.low, row.high))
    goals = tuple(Setpoint(node, "position", value, low, high) for node in there)
    return await Exclusive(_moved(dialect, row, raw, goals))


async def _moved(dialect: Dialect, row: Register, raw: int, goals: tuple[Setpoint, ...]) -> tuple[int, ...]:
    if dialect.must_start:
        for extended in sorted(dialect.formats):
            frame = wire.encode_start(dialect.nmt, wire.EVERYONE, True, extended=extended)
            await Request[Response](
                frame, (), lane=EVERY_LANE, priority=Priority.CONTROL, effect=Effect.MOTION, setpoints=goals
            )
            await Emit(Started(wire.EVERYONE, frame))
    return await _written(dialect, row, raw, goals)


async def broadcast_save(dialect: Dialect = PLAIN) -> tuple[int, ...]:
    """Let everyone save; returns who acknowledged, which by the manual is nobody. The bus is then left alone until the
    flash of all has been written."""
    row = dialect.profile.table["store"]
    return await Exclusive(_written(dialect, row, SAVE, timeout=TimeoutClass.STORE))


async def broadcast_bit_rate(rate: int, dialect: Dialect = PLAIN) -> tuple[int, ...]:
    """Give everyone another bit rate (bit/s), in force after a save and a restart; returns who acknowledged."""
    row = dialect.profile.table["bit_rate_code"]
    return await Exclusive(_written(dialect, row, code_of(rate)))


async def broadcast_node_id(new: int, dialect: Dialect = PLAIN, *, force: bool = False) -> tuple[int, ...]:
    """Give everyone on the bus this id. Raises RequestError without `force`: with more than one servo there, they could
    not be told apart any more."""
    checked_id(new)
    if not force:
        raise RequestError(
            f"a broadcast would give every servo on this bus the id {new}",
            cause="servos with one id answer together, and cannot be given different ids any more but one at a time",
            advice="connect one servo and use provision(); force=True does it all the same; nothing was sent",
        )
    return await Exclusive(_readdressed(dialect, new))


async def _readdressed(dialect: Dialect, new: int) -> tuple[int, ...]:
    await Emit(IdChanged(None, new))
    return await _written(dialect, dialect.profile.table["node_id"], new)


async def _written(
    dialect: Dialect,
    row: Register,
    raw: int,
    goals: tuple[Setpoint, ...] = (),
    *,
    timeout: TimeoutClass = TimeoutClass.REPLY,
) -> tuple[int, ...]:
    acknowledged: list[int] = []
    for extended in sorted(dialect.formats):
        answer = await _write(dialect, row, row.encode(raw), goals, timeout, extended)
        for reply in answer.replies:
            one = wire.decode_reply(reply.data)
            if one is not None and one.kind == "download" and _about(row, one):
                acknowledged.append(reply.lane)
    return tuple(dict.fromkeys(acknowledged))


def _write(
    dialect: Dialect,
    row: Register,
    data: bytes,
    goals: tuple[Setpoint, ...],
    timeout: TimeoutClass,
    extended: bool,
) -> Request[Response]:
    frame = wire.encode_download(
        wire.EVERYONE,
        row.address,
        row.subindex or 0,
        data,
        sized=dialect.sized == "yes",
        extended=extended,
    )
    priority = Priority.CONTROL if row.effect is Effect.MOTION else Priority.CONFIGURATION
    return Request(
        frame,
        ANY,
        lane=EVERY_LANE,
        priority=priority,
        effect=row.effect,
        setpoints=goals,
        reply_within=timeout,
    )
