"""The driver of one open bus: times, probe, emergency stop, and what its servos can do.

All times come with their source; none was measured by this project. An emergency stop switches torque off, except on
the ids of `estop_hold`, for axes that would fall: those are read in the moment of the stop and held where they are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from motorbus.core import units
from motorbus.core.family import AxisDriver, Explanation, Family, Found, Identity, Receiver, Stop
from motorbus.core.half_duplex import HalfDuplexSerial
from motorbus.core.request import Expected, Priority, Request, Response, TimeoutClass
from motorbus.core.steps import Procedure, Runnable
from motorbus.errors import RequestError
from motorbus.families.feetech import protocol
from motorbus.families.feetech.driver import feedback, identity, modes, motion, stream
from motorbus.families.feetech.driver.goals import hold_block, rest_block
from motorbus.families.feetech.driver.group import disable_torque_everyone, limp_requests
from motorbus.families.feetech.driver.motion import LIMP, Promise
from motorbus.families.feetech.driver.node import IMAGE, BusFacts, Node, checked_id
from motorbus.families.feetech.driver.requests import DATA, PRESENT, TORQUE_ENABLE, Block, read_id
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.traits import TRAITS, Mode

RETURN_DELAY: Final = 254 * 2e-6
"""s; the longest delay that register 7 can ask for. Source: STS3215 memory table V3.6."""
PROCESSING: Final = 0.001
"""s to make a reply. With the margin of the bus about twice the 2 ms that users of python-st3215 found too short."""
STORE_DELAY: Final = 0.100  # s for flash: more than 21 ms measured by a recovery tool, 50 to 100 ms advised
DELAYS: Final = {
    TimeoutClass.REPLY: PROCESSING,
    TimeoutClass.SCAN: PROCESSING,  # servolab waits 10 ms; a late reply is noticed
    TimeoutClass.STORE: STORE_DELAY,
}
COLLISION: Final = 0.8  # s in which all servos have answered a broadcast PING at 1 Mbit/s (rustypot)
ADAPTER: Final = 0.016  # s; latency timer of an FTDI adapter as shipped (ROBOTIS-GIT/DynamixelSDK#330)
SCHEDULING: Final = 0.005  # s that a loaded host may run late between two bytes
AT_ONCE: Final = 60  # servos that one frame of a stop makes limp: 128 bytes
PROBES: Final = (3, 9, 10, 12, 13, 14, *range(16, 27))
"""Bytes that a probe reads from register 5 on: not 2, the length of its echo, and no length in common use."""
HELD: Final = PRESENT + 2  # bytes of registers 0 to 57, which decide how a servo is held

_AXIS: Final = AxisDriver(
    state=feedback.telemetry,
    position=feedback.position,
    health=feedback.health,
    enable_torque=motion.enable_torque,
    disable_torque=motion.disable_torque,
    move=motion.move,
    stop=motion.stop,
    limits=motion.limits,
    max_velocity=motion.max_velocity,
    cap_torque=motion.cap_torque,
    stream=stream.open_stream,
)
_POSITION_ONLY: Final = frozenset(("move", "limits", "stream"))


class FeetechDriver(HalfDuplexSerial):
    """FEETECH servos on one open bus; see `core.family.BusDriver`.

    `estop_hold`  ids that an emergency stop holds, as 1+4 or 1-3
    `arc`         degrees of all counts of SCS servos, where they are not those of the model, as 3:180+4:180
    `map`         register map by which bytes of unknown servos are explained; "" for none
    """

    delays = DELAYS
    delay_per_reply = RETURN_DELAY
    broadcast_delay = COLLISION
    broadcast_bytes = (protocol.MAX_ID + 1) * protocol.OVERHEAD
    longest_reply = protocol.MAX_LENGTH + 4
    longest_delay = RETURN_DELAY + 2 * ADAPTER + SCHEDULING
    ids = range(protocol.MAX_ID + 1)

    def __init__(self, family: Family, estop_hold: object = "", arc: object = "", map: str = "") -> None:
        super().__init__(family)
        self.hold: Final = parse_ids(estop_hold or "")
        self.facts: Final = BusFacts(parse_arcs(arc or ""))
        self.map: Final = map

    def echo_test(self) -> Request[Any]:
        return read_id(1, within=TimeoutClass.SCAN)

    def receiver(self) -> Receiver:
        return protocol.receiver()

    def probe(self, node: int, attempt: int) -> Request[bool]:
        """READ from the id register on, in a length that few other reads have; True if the id is right."""
        return read_id(node, PROBES[attempt % len(PROBES)])

    def stop(self, nodes: Mapping[int, Response | None]) -> Stop:
        """Torque off for all at once, then for each until it acknowledges; those of `estop_hold` are held."""
        limp = [stop_request(node, LIMP) for node in sorted(set(nodes) - self.hold)]
        if not self.hold:
            return Stop((disable_torque_everyone(), *limp), Promise.TORQUE_OFF_ACCEPTED.value)
        held = [hold_request(node, nodes.get(node)) for node in sorted(self.hold)]
        others = [node for node in self.ids if node not in self.hold and node not in nodes]
        requests = (
            *limp_requests(sorted(set(nodes) - self.hold), AT_ONCE),
            *limp,
            *held,
            *limp_requests(others, AT_ONCE),
        )
        return Stop(requests, f"{Promise.TORQUE_OFF_ACCEPTED.value}; held: {Promise.HOLD_ACCEPTED.value}")

    def identify(self, node: int) -> Runnable[Identity]:
        return identity.identify(Node(node, self.facts))

    def scan(self, ids: tuple[int, ...] = (), rates: tuple[int, ...] = ()) -> Procedure[list[Found]]:
        return identity.scan(ids, rates, self.facts)

    def axis(self, identity: Identity) -> AxisDriver:
        """By the register map, whatever the model; a servo in another mode than position has an axis of that kind."""
        if identity.table not in TABLES:
            return AxisDriver()
        names = _AXIS.names if TRAITS[identity.table].limit else _AXIS.names - {"cap_torque"}
        mode = identity.details.get("mode", Mode.POSITION.value)
        if mode != Mode.POSITION.value:
            names -= _POSITION_ONLY
        axis = AxisDriver(**{name: getattr(_AXIS, name) for name in names})
        if mode == Mode.VELOCITY.value:
            return replace(axis, jog=modes.jog, set_velocity=modes.set_velocity)
        return axis

    def decode(self, data: bytes) -> list[Explanation]:
        from motorbus.families.feetech.decode import decode

        return decode(data, self.facts.maps, self.map)


# -- stop ------------------------------------------------------------------------------------------------------


def stop_request(node: int, block: Block) -> Request[Response]:
    """Write this block with the priority of a stop."""
    return Request(
        protocol.write(node, block.address, block.data),
        (Expected(node, node, protocol.OVERHEAD),),
        priority=Priority.STOP,
        effect=block.effect,
        setpoints=block.goals,
        repeatable=True,
    )


def hold_request(node: int, answer: Response | None) -> Request[Response]:
    """Hold a servo that has just sent registers 0 to 57; read them of any other."""
    for reply in answer.replies if answer is not None else ():
        if reply.data[2] == node and len(reply.data) == protocol.OVERHEAD + HELD:
            return stop_request(node, held_block(node, reply.data[DATA : DATA + HELD]))
    return Request(
        protocol.read(node, 0, HELD),
        (Expected(node, node, protocol.OVERHEAD + HELD),),
        priority=Priority.STOP,
        repeatable=True,
        reports_position=True,
    )


def held_block(number: int, image: bytes) -> Block:
    """The order that keeps a servo with these registers where it is; torque off where none is known, and if limp."""
    node = Node(number)
    identity.learn(node, image[:IMAGE])
    table, settings = node.table, node.settings
    if image[TORQUE_ENABLE] == 0 or not node.is_writable or table is None or settings is None:
        return LIMP
    if settings.mode is Mode.VELOCITY:
        return rest_block(node)
    if settings.mode is not Mode.POSITION or (settings.many_turns and not settings.tells_turns):
        return LIMP
    row = table["goal_position"]
    raw = table["present_position"].decode(image[PRESENT:HELD])
    return hold_block(node, max(row.low, min(raw, row.high)))


# -- settings --------------------------------------------------------------------------------------------------


def parse_ids(text: object) -> frozenset[int]:
    """`1-3+7`, or ids -> these ids. Raises RequestError for anything else."""
    if not isinstance(text, str):
        return frozenset(checked_id(node) for node in text)  # type: ignore[attr-defined]
    found: set[int] = set()
    for part in text.split("+") if text else ():
        first, _, last = part.partition("-")
        try:
            ends = checked_id(units.whole(first)), checked_id(units.whole(last or first))
        except ValueError:
            raise RequestError(
                f"estop_hold={text}: {part!r} is not an id", expected="as 1+4 or 1-3"
            ) from None
        found.update(range(ends[0], ends[1] + 1))
    return frozenset(found)


def parse_arcs(text: object) -> Mapping[int, float]:
    """`3:180+4:180` -> degrees by id. Raises RequestError for anything else."""
    found = {}
    for part in str(text).split("+") if text else ():
        id, _, arc = part.partition(":")
        try:
            node, degrees = checked_id(units.whole(id)), units.real(arc)
            if not 0 < degrees <= 3600:
                raise ValueError
        except ValueError:
            raise RequestError(
                f"arc={text}: {part!r} is no arc", expected="id:degrees, as 3:180+4:180"
            ) from None
        found[node] = degrees
    return found
