"""Requests to node 0, which all servos carry out and answer, each under its own id.

The manual calls 0 a broadcast and does not say which requests it allows. A public demo driver reads so; whether a servo
acknowledges a broadcast write is not known, so silence is no error.
"""

from __future__ import annotations

from collections.abc import Sequence

from motorbus.core.family import IdChanged
from motorbus.core.register import Value
from motorbus.core.request import ANY, EVERY_LANE, Effect, Priority, Request, Response, TimeoutClass
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import Emit, Exclusive
from motorbus.errors import RequestError, UnexpectedReply
from motorbus.families.kst import sdo
from motorbus.families.kst.driver.motion import Started, target
from motorbus.families.kst.driver.node import BusSettings, Node, checked_id, checked_ids
from motorbus.families.kst.driver.requests import value_bytes
from motorbus.families.kst.notifications import encode_start
from motorbus.families.kst.profiles import SAVE, bit_rate_code


async def broadcast_read(name: str, settings: BusSettings) -> dict[int, Value]:
    """An object of all servos, in API units, by node. Raises RequestError for an unknown or write-only object.

    A servo is missing that refuses it, is silent, sends another size, or sends two values (two servos with one id).
    """
    row = settings.profile.table[name]
    if not row.readable:
        raise RequestError(f"{name} can only be written")
    # Reserve the bus: a reply to a broadcast looks like a reply to a request to that node.
    answer = await Exclusive(Request[Response](settings.upload(sdo.BROADCAST, row), ANY, lane=EVERY_LANE))
    values: dict[int, set[bytes]] = {}
    for reply in answer.replies:
        one = sdo.decode_reply(reply.data)
        if one and one.kind == "upload" and (one.index, one.subindex) == (row.address, row.subindex):
            try:
                values.setdefault(reply.lane, set()).add(value_bytes(Node(reply.lane, settings), row, one))
            except UnexpectedReply:
                continue
    return {node: row.to_value(row.decode(min(found))) for node, found in values.items() if len(found) == 1}


async def broadcast_position(to: float, nodes: Sequence[int], settings: BusSettings) -> tuple[int, ...]:
    """Send all servos to `to` rad; return the nodes that acknowledged. Errors and start rule as in `move`.

    `nodes` are the servos that the gate checks: name all on the bus, because all move.
    """
    checked = checked_ids(nodes)
    if not checked:
        raise RequestError(
            "a broadcast moves all servos, and none is named", expected="the ids of all servos"
        )
    row = settings.profile.table["goal_position"]
    raw = target(Node(checked[0], settings), to)
    value, low, high = (float(row.to_value(one)) for one in (raw, row.low, row.high))
    setpoints = tuple(Setpoint(node, "position", value, low, high) for node in checked)

    async def start_and_move() -> tuple[int, ...]:
        if settings.must_start:
            frame = settings.format(encode_start(settings.nmt, sdo.BROADCAST, True))
            priority, effect = Priority.CONTROL, Effect.MOTION
            await Request(frame, lane=EVERY_LANE, priority=priority, effect=effect, setpoints=setpoints)
            await Emit(Started(sdo.BROADCAST, frame))
        return await _write(settings, "goal_position", raw, setpoints)

    return await Exclusive(start_and_move())


async def broadcast_save(settings: BusSettings) -> tuple[int, ...]:
    """Let all servos save, and wait for their flash; return the nodes that acknowledged, by the manual none."""
    return await Exclusive(_write(settings, "store", SAVE))


async def broadcast_bit_rate(rate: int, settings: BusSettings) -> tuple[int, ...]:
    """Give all servos another bit rate (bit/s), see `set_bit_rate`; return the nodes that acknowledged."""
    return await Exclusive(_write(settings, "bit_rate_code", bit_rate_code(rate)))


async def broadcast_node_id(new: int, settings: BusSettings, *, force: bool = False) -> tuple[int, ...]:
    """Give all servos on the bus this id. Raises RequestError without `force`: several servos then have one id."""
    checked_id(new)
    if not force:
        raise RequestError(
            f"a broadcast would give every servo on this bus the id {new}",
            expected="force=True where that is meant; else connect one servo and use provision()",
        )
    await Emit(IdChanged(None, new))
    return await Exclusive(_write(settings, "node_id", new))


async def _write(
    settings: BusSettings, name: str, raw: int, setpoints: tuple[Setpoint, ...] = ()
) -> tuple[int, ...]:
    """Write an object of all servos; return the nodes that acknowledged."""
    row = settings.profile.table[name]
    answer = await Request[Response](
        settings.download(sdo.BROADCAST, row, raw),
        ANY,
        lane=EVERY_LANE,
        priority=Priority.CONTROL if row.effect is Effect.MOTION else Priority.CONFIGURATION,
        effect=row.effect,
        setpoints=setpoints,
        reply_within=TimeoutClass.STORE if name == "store" else TimeoutClass.REPLY,
    )
    acknowledgement = sdo.encode_download_reply(1, row.address, row.subindex or 0).data
    return tuple(dict.fromkeys(reply.lane for reply in answer.replies if reply.data == acknowledgement))
