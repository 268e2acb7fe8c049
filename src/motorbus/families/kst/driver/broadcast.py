"""Requests to node 0, which all servos carry out and answer, each under its own id.

The manual calls 0 a broadcast and does not say which requests it allows. A public demo driver reads so; whether a servo
acknowledges a broadcast write is not known, so silence is no error.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from motorbus.core.family import IdChanged
from motorbus.core.register import Value
from motorbus.core.request import ANY, EVERY_LANE, Effect, Priority, Request, Response, TimeoutClass
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import Emit, Exclusive
from motorbus.errors import RequestError
from motorbus.families.kst import sdo
from motorbus.families.kst.driver.motion import target
from motorbus.families.kst.driver.node import BusSettings, Node, checked_id
from motorbus.families.kst.driver.requests import decoded, effect_of
from motorbus.families.kst.notifications import encode_start


def broadcast_ping(settings: BusSettings) -> Request[tuple[int, ...]]:
    """The nodes that answer a read of the node id of all servos; an abort is an answer."""
    row = settings.profile.table["node_id"]

    def decode(answer: Response) -> tuple[int, ...]:
        replies = zip(answer.replies, decoded(answer), strict=True)
        places = (row.address, 0)  # 0: some aborts name no object
        return tuple(dict.fromkeys(reply.lane for reply, one in replies if one.index in places))

    return Request(settings.upload(sdo.BROADCAST, row), ANY, decode, lane=EVERY_LANE)


async def broadcast_write(
    name: str, value: Value, settings: BusSettings, *, nodes: Sequence[int] = (), force: bool = False
) -> tuple[int, ...]:
    """Write an object of all servos, in API units; return the nodes that acknowledged.

    A target moves all servos on the bus: `nodes` names them for the gate. The start rule is that of `move`. A node id
    needs `force`: several servos then have one id. A save (`store`) waits for the flash; by the manual it has no reply.
    Raises RequestError, or LimitExceeded for a target out of range.
    """
    row = settings.profile.table[name]
    if not row.writable:
        raise RequestError(f"{name} can only be read")
    if name == "node_id" and not force:
        raise RequestError(
            f"a broadcast would give every servo on this bus the id {value}",
            expected="force=True where that is meant; else connect one servo and use set_id()",
        )
    setpoints = _setpoints(value, nodes, settings) if row.effect is Effect.MOTION else ()
    raw = target(Node(nodes[0], settings), value) if setpoints else row.to_raw(value)
    common: dict[str, Any] = {
        "lane": EVERY_LANE,
        "priority": Priority.CONTROL if setpoints else Priority.CONFIGURATION,
        "effect": effect_of(row),
        "setpoints": setpoints,
    }
    within = TimeoutClass.STORE if name == "store" else TimeoutClass.REPLY
    frame = settings.download(sdo.BROADCAST, row, raw)
    request = Request[Response](frame, ANY, reply_within=within, **common)

    async def start_and_write() -> Response:
        if setpoints and settings.must_start:
            start = settings.format(encode_start(sdo.BROADCAST))
            await Request(start, **common)
        if name == "node_id":
            await Emit(IdChanged(None, raw))
        return await request

    answer = await Exclusive(start_and_write())
    acknowledgement = sdo.encode_download_reply(1, row.address, row.subindex or 0).data
    return tuple(dict.fromkeys(reply.lane for reply in answer.replies if reply.data == acknowledgement))


def _setpoints(to: Value, nodes: Sequence[int], settings: BusSettings) -> tuple[Setpoint, ...]:
    """This target for each of these servos, within the range of the profile."""
    if not nodes:
        raise RequestError("a broadcast moves all servos", expected="nodes=: the ids of all servos")
    row = settings.profile.table["goal_position"]
    raws = target(Node(nodes[0], settings), to), row.low, row.high
    value, low, high = (float(row.to_value(raw)) for raw in raws)
    return tuple(Setpoint(checked_id(node), "position", value, low, high) for node in dict.fromkeys(nodes))
