"""The driver of one open bus: times, probe, stop, and what its devices can do.

All times come with their source; none was measured on hardware.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from motorbus.core.can_bits import least
from motorbus.core.can_frame import CanFrame
from motorbus.core.family import AxisDriver, Explanation, Family, Found, Identity, Receiver, Stop
from motorbus.core.register import changed
from motorbus.core.request import ANY, EVERY_LANE, Priority, Request, Response, TimeoutClass
from motorbus.core.steps import Procedure, Runnable
from motorbus.families.kst import sdo
from motorbus.families.kst.driver import feedback, identity, motion
from motorbus.families.kst.driver.motion import Promise, hold
from motorbus.families.kst.driver.node import DEFAULT, Node
from motorbus.families.kst.driver.requests import acknowledged, decoded, upload
from motorbus.families.kst.driver.scan import scan
from motorbus.families.kst.driver.settings import LISTEN
from motorbus.families.kst.driver.stream import open_stream
from motorbus.families.kst.notifications import BusState, FrameReceiver
from motorbus.families.kst.profiles import PROFILES

STUFFING: Final = 1.1
"""Bits on the wire per bit of a frame: over all nodes and positions, frames of this protocol have 118 to 126 bits where
111 are without stuffing."""
REPLY_DELAY: Final = 0.030
"""s; a public flight-controller driver gives up after 3 ms. Ten times that costs time only where a reply is missing."""
SCAN_DELAY: Final = 0.005
"""s for an id that probably has no servo; with the margin of the bus twice the 3 ms of that driver."""
BROADCAST_TIME: Final = 0.100
"""s in which all servos have answered a broadcast: a public demo driver collects until 100 ms pass without a reply."""
QUIET: Final = 0.020
"""s beside the frames that may still be on their way; as long as the bus waits for a late reply."""
FRAMES_IN_ADAPTER: Final = 5  # frames of one node that an adapter may hold # assumption


_AXIS: Final = AxisDriver(
    state=feedback.telemetry,
    position=feedback.position,
    health=feedback.health,
    move=motion.move,
    stop=motion.stop,
    limits=motion.limits,
    travel=motion.travel,
    stream=open_stream,
)


class KstDriver:
    """KST servos on one open bus; see `core.family.BusDriver`. The keywords are those of `BusSettings`."""

    window = 16
    """Four to ten nodes in flight fill any CAN bus."""
    full_duplex = False
    probe_after = 128

    def __init__(self, family: Family, **settings: object) -> None:
        self.family = family
        self.settings = DEFAULT.replace(state=BusState(), **settings)

    def air_time(self, request: Request[Any], rate: int) -> float:
        """s on the wire for the request and all replies, with typical stuffing; a broadcast has up to 127 replies."""
        frame = request.wire
        assert isinstance(frame, CanFrame)
        bits = least(len(frame.data), frame.extended)
        if request.expected is ANY:
            bits += (len(sdo.NODES) if request.lane == EVERY_LANE else 1) * least(sdo.LENGTH, frame.extended)
        else:
            bits += sum(least(expected.length, frame.extended) for expected in request.expected)
        return bits * STUFFING / rate

    def turnaround(self, request: Request[Any]) -> float:
        """Maximum s before the reply; after a save the time to listen and the write to flash."""
        if request.reply_within is TimeoutClass.STORE:
            return LISTEN + self.settings.profile.flash_wait
        if request.lane == EVERY_LANE:
            return BROADCAST_TIME
        return SCAN_DELAY if request.reply_within is TimeoutClass.SCAN else REPLY_DELAY

    def quiet_time(self, rate: int) -> float:
        """s after which no reply to an earlier request can still arrive."""
        return QUIET + FRAMES_IN_ADAPTER * least(sdo.LENGTH, True) * STUFFING / rate

    def echo_test(self) -> None:
        """None: a CAN controller does not receive its own frames."""

    def receiver(self) -> Receiver:
        return FrameReceiver(self.settings.extended, self.settings.state)

    def probe(self, node: int, attempt: int) -> Request[bool]:
        """Read the node id, the version, or a sub-index of the node id that no servo has, in turn.

        True if the reply names that object and, for the id, has a valid one (before a restart not that of the node).
        """
        servo = Node(node, self.settings)
        turn, kind = divmod(attempt, 3)
        node_id = servo.table["node_id"]
        rows = node_id, servo.table["firmware_version"], changed(node_id, subindex=1 + turn % 254)
        row = rows[kind]

        def decode(answer: Response) -> bool:
            for reply in decoded(answer):
                if (reply.index, reply.subindex) == (row.address, row.subindex) and reply.kind != "download":
                    return kind != 0 or reply.kind != "upload" or reply.data[0] in sdo.NODES
            return False

        return upload(servo, row, decode)

    def stop(self, nodes: Mapping[int, Response | None]) -> Stop:
        """Target := position for each node whose position is known; the others are read first."""
        requests: list[Request[Response]] = []
        for node in (Node(number, self.settings) for number in sorted(nodes)):
            row, answer = node.table["present_position"], nodes[node.node]
            replies = decoded(answer) if answer is not None else []
            here = [
                reply.data[: row.size]
                for reply in replies
                if reply.kind == "upload" and reply.index == row.address and len(reply.data) >= row.size
            ]
            if here:
                requests += hold(node, row.decode(here[0]), Priority.STOP)
            else:
                decode = acknowledged(node, row)
                requests.append(upload(node, row, decode, priority=Priority.STOP, reports_position=True))
        return Stop(tuple(requests), Promise.HOLD_REQUESTED.value)

    def identify(self, node: int) -> Runnable[Identity]:
        return identity.identify(Node(node, self.settings))

    def scan(self, ids: tuple[int, ...] = (), rates: tuple[int, ...] = ()) -> Procedure[list[Found]]:
        return scan(self.settings, ids, rates)

    def axis(self, identity: Identity) -> AxisDriver:
        profile = PROFILES.get(identity.table)
        if profile is None:
            return AxisDriver()
        if profile.status_row is None:
            return _AXIS
        return replace(_AXIS, current=feedback.current, temperature=feedback.temperature)

    def decode(self, data: bytes) -> list[Explanation]:
        from motorbus.families.kst.decode import decode

        return decode(data, self.settings.profile)
