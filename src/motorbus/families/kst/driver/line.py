"""What the bus must know of these servos: how long things take, what proves that a node is in step, how to stop.

All figures come with their source; none is measured on hardware by this project.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from motorbus.core.can_bits import least
from motorbus.core.can_frame import CanFrame
from motorbus.core.family import Stop
from motorbus.core.request import ANY, EVERY_LANE, Effect, Priority, Request, Response, TimeoutClass
from motorbus.families.kst import wire
from motorbus.families.kst.driver.dialect import Dialect
from motorbus.families.kst.driver.exchanges import (
    GOAL,
    NODE_ID,
    POSITION,
    UNSIZED_REFUSED,
    meant,
    refused,
)
from motorbus.families.kst.driver.keeping import LISTEN
from motorbus.families.kst.driver.motion import Promise
from motorbus.families.kst.driver.node import Node

STUFFING: Final = 1.1
"""Bits on the wire for each bit of a frame: counted over all nodes and positions, frames of this protocol have 118 to
126 where 111 are without stuffing."""
REPLY: Final = 0.030
"""s a servo may think. A public flight-controller driver gives up after 3 ms; ten times that costs time only where a
reply is missing, and a reply that comes late costs a quiet time."""
SCAN: Final = 0.005
"""s to wait for an id that is probably not there; with the margin of the bus twice the 3 ms of that driver. Who is
slower is found in the second pass, or by the broadcast."""
EVERYONE: Final = 0.100
"""s in which all have answered a broadcast: a public demo driver collects until 100 ms pass without an answer."""
QUIET: Final = 0.020
"""s; as long as the bus waits for a late reply, on top of the frames that may still be under way."""
IN_QUEUE: Final = 5
"""Frames of a node that may be in an adapter."""
FIRMWARE: Final = 0x100A


def air_time(exchange: Request[Any], rate: int) -> float:
    """s on the wire for the request and all replies due, with typical stuffing; a broadcast has up to 127 replies."""
    request = exchange.wire
    extended = isinstance(request, CanFrame) and request.extended
    bits = least(len(request.data if isinstance(request, CanFrame) else request), extended)
    if exchange.expected is ANY:
        several = len(wire.NODES) if exchange.lane == EVERY_LANE else 1
        bits += several * least(wire.LENGTH, extended)
    else:
        for _, _, length in exchange.expected:
            bits += least(length, extended)
    return bits * STUFFING / rate


def turnaround(exchange: Request[Any], flash_wait: float) -> float:
    """s that servos may think; after a save, the listening time and the write to flash."""
    if exchange.reply_within is TimeoutClass.STORE:
        return LISTEN + flash_wait
    if exchange.lane == EVERY_LANE:
        return EVERYONE
    return SCAN if exchange.reply_within is TimeoutClass.SCAN else REPLY


def quiet_time(rate: int) -> float:
    """s after which nothing of an old exchange can still be under way."""
    return QUIET + IN_QUEUE * least(wire.LENGTH, True) * STUFFING / rate


def probe(node: Node, attempt: int) -> Request[bool]:
    """Read the node id, the version, or a sub-index of the node id that no servo has, in turn.

    True when the answer names exactly that object and, for the id, says a possible one (before a restart it may be
    another than the node's); so two of three attempts have an answer in data, whatever a refusal repeats.
    """
    turn, kind = divmod(attempt, 3)
    index, subindex = ((NODE_ID, 0), (FIRMWARE, 0), (NODE_ID, 1 + turn % 254))[kind]

    def read(answer: Response) -> bool:
        reply = wire.decode_reply(answer.replies[0].data) if answer.replies else None
        if reply is None or (reply.index, reply.subindex) != (index, subindex):
            return False
        if reply.kind == "upload" and (index, subindex) == (NODE_ID, 0):
            return reply.data[0] in wire.NODES
        return reply.kind in ("upload", "upload-start", "abort")

    return Request(
        wire.encode_upload(node.node, index, subindex, extended=node.dialect.extended(node.node)),
        (wire.upload_due(node.node, index, subindex),),
        read,
        lane=node.node,
        repeatable=True,
    )


def stop(nodes: Mapping[int, Response | None], dialect: Dialect) -> Stop:
    """Each node whose position is known holds there; each other one is asked for it, and can be held then.

    A node of which nobody knows the id format is addressed in both.
    """
    requests: list[Request[Response]] = []
    for node in (Node(number, dialect) for number in sorted(nodes)):
        here = _told(nodes[node.node])
        undecided = dialect.undecided(node.node)
        for extended in (False, True) if undecided else (dialect.extended(node.node),):
            wanted = (_ask(node, extended),) if here is None else _holds(node, here, extended)
            requests += wanted
    return Stop(tuple(requests), Promise.HOLD_REQUESTED.value)


def _ask(node: Node, extended: bool) -> Request[Response]:
    return Request(
        wire.encode_upload(node.node, POSITION, extended=extended),
        (wire.upload_due(node.node, POSITION),),
        _unrefused(node, POSITION),
        lane=node.node,
        priority=Priority.STOP,
        repeatable=True,
        reports_position=True,
    )


def _holds(node: Node, here: bytes, extended: bool) -> tuple[Request[Response], ...]:
    """Hold here. Beyond the range, where that may be refused, the end of the range is ordered first."""
    raw = int.from_bytes(here, "little", signed=True)
    end = max(-node.profile.limit, min(raw, node.profile.limit))
    return tuple(_hold(node, place, extended) for place in dict.fromkeys((end, raw)))


def _hold(node: Node, raw: int, extended: bool) -> Request[Response]:
    states_length = node.dialect.states_length(node.node)
    here = raw.to_bytes(2, "little", signed=True)
    return Request(
        wire.encode_download(node.node, GOAL, 0, here, sized=states_length, extended=extended),
        (wire.download_due(node.node, GOAL),),
        _unrefused(node, GOAL),
        lane=node.node,
        priority=Priority.STOP,
        effect=Effect.MOTION,
        repeatable=True,
    )


def _told(answer: Response | None) -> bytes | None:
    """The two bytes of the position in an answer; None when it was refused."""
    if answer is None or not answer.replies:
        return None
    reply = wire.decode_reply(answer.replies[0].data)
    told = reply is not None and reply.kind == "upload" and reply.index == POSITION and len(reply.data) >= 2
    return reply.data[:2] if reply is not None and told else None


def _unrefused(node: Node, index: int) -> Any:
    """The answer as it came; a refusal is no acknowledgement and raises DeviceError.

    One that may mean "state the length" is heeded by the next round.
    """

    def read(answer: Response) -> Response:
        reply = wire.decode_reply(answer.replies[0].data) if answer.replies else None
        if reply is not None and reply.kind == "abort":
            if index == GOAL and node.dialect.sized == "auto" and meant(reply.code) in UNSIZED_REFUSED:
                node.dialect.learn_sized(node.node)
            raise refused(node, reply, index, 0)
        return answer

    return read
