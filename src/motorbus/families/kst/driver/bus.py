"""The driver of one open bus: times, probe, stop, and what its devices can do.

All times come with their source; none was measured on hardware.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from motorbus.core.can_bits import least
from motorbus.core.can_frame import CanFrame
from motorbus.core.family import AxisDriver, Explanation, Family, Found, Identity, Receiver, Stop
from motorbus.core.register import changed
from motorbus.core.request import ANY, EVERY_LANE, Priority, Request, Response, TimeoutClass
from motorbus.core.steps import Procedure, Runnable
from motorbus.families.kst import decode, sdo
from motorbus.families.kst.driver import feedback, identity, motion, scan
from motorbus.families.kst.driver.node import ID_FORMATS, NMT, SIZED, BusSettings, Node, choice
from motorbus.families.kst.driver.requests import decoded, position_in, read_position, upload
from motorbus.families.kst.notifications import FrameReceiver
from motorbus.families.kst.profiles import PROFILES

STUFFING: Final = 1.1
"""Bits on the wire per bit of a frame: over all nodes and positions, frames of this protocol have 118 to 126 bits where
111 are without stuffing."""
REPLY_DELAY: Final = 0.030
"""s; a public autopilot driver gives up after 3 ms. Ten times that costs time only where a reply is missing."""
SCAN_DELAY: Final = 0.005
"""s for an id that probably has no servo; with the margin of the bus twice the 3 ms of that driver."""
BROADCAST_TIME: Final = 0.100
"""s in which all servos have answered a broadcast: a public demo driver collects until 100 ms pass without a reply."""
SAVE_TIME: Final = 0.170
"""s: 20 ms in which an acknowledgement or abort of a save is accepted (the manual says that neither comes), then 150 ms
of the write to flash, in which a public autopilot driver leaves a servo alone."""
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
    stream=motion.open_stream,
)


class KstDriver:
    """KST servos on one open bus; see `core.family.BusDriver`. Raises RequestError for an invalid setting."""

    window = 16
    """Four to ten nodes in flight fill any CAN bus."""
    full_duplex = False
    probe_after = 128

    def __init__(
        self,
        family: Family,
        profile: str = "kst",
        id_format: str = "std",
        sized: str = "no",
        nmt: str = "profile",
    ) -> None:
        self.family = family
        made = PROFILES[choice("profile", profile, PROFILES)]
        form = choice("nmt", nmt, NMT)
        self.settings = BusSettings(
            profile=made,
            extended=choice("id_format", id_format, ID_FORMATS) == "ext",
            sized=choice("sized", sized, SIZED) == "yes",
            must_start=(made.nmt if form == "profile" else form) == "standard",
        )

    def air_time(self, request: Request[Any], rate: int) -> float:
        """s on the wire for the request and all replies, with typical stuffing; a broadcast has up to 127 replies."""
        frame = request.wire
        assert isinstance(frame, CanFrame)
        if request.expected is ANY:
            lengths = [sdo.LENGTH] * (len(sdo.NODES) if request.lane == EVERY_LANE else 1)
        else:
            lengths = [expected.length for expected in request.expected]
        bits = sum(least(length, frame.extended) for length in (len(frame.data), *lengths))
        return bits * STUFFING / rate

    def turnaround(self, request: Request[Any]) -> float:
        """Maximum s before the reply; after a save the time to listen and the write to flash."""
        if request.reply_within is TimeoutClass.STORE:
            return SAVE_TIME
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
        """Read the node id, or a sub-index of it that no servo has, in turn.

        True if the reply names that object and, for the id, has a valid one (before a restart not that of the node).
        """
        servo = Node(node, self.settings)
        turn, absent = divmod(attempt, 2)
        row = changed(servo.table["node_id"], subindex=absent * (1 + turn % 254))

        def decode(answer: Response) -> bool:
            for reply in decoded(answer):
                if (reply.index, reply.subindex) == (row.address, row.subindex):
                    return bool(absent) or reply.kind == "abort" or reply.data[0] in sdo.NODES
            return False

        return upload(servo, row, decode)

    def stop(self, nodes: Mapping[int, Response | None]) -> Stop:
        """Target := position for each node whose position is known; the others are read first."""
        requests: list[Request[Any]] = []
        for node in (Node(number, self.settings) for number in sorted(nodes)):
            here = position_in(node.table["present_position"], nodes[node.node])
            if here is None:
                requests.append(read_position(node, int, priority=Priority.STOP))
            else:
                requests += motion.hold(node, here, Priority.STOP)
        return Stop(tuple(requests), motion.Promise.HOLD_REQUESTED.value)

    def identify(self, node: int) -> Runnable[Identity]:
        return identity.identify(Node(node, self.settings))

    def scan(self, ids: tuple[int, ...] = (), rates: tuple[int, ...] = ()) -> Procedure[list[Found]]:
        return scan.scan(self.settings, ids, rates)

    def axis(self, identity: Identity) -> AxisDriver:
        return _AXIS if identity.table in PROFILES else AxisDriver()

    def decode(self, data: bytes) -> list[Explanation]:
        return decode.decode(data, self.settings.profile)
