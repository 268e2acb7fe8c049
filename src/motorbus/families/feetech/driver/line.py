"""What the bus must know of FEETECH lines: how long things take, what proves that a node is in step, how to stop.

All figures come with their source; none is measured by this project.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cache
from typing import Final

from motorbus.core.family import Stop
from motorbus.core.request import Expected, Priority, Request, Response, TimeoutClass
from motorbus.core.setpoint import torque_off
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.holding import PROMISE, holds
from motorbus.families.feetech.driver.motion import Promise
from motorbus.families.feetech.driver.torque import LIMP

RETURN_DELAY: Final = 254 * 2e-6
"""s; the longest pause before a reply that register 7 can ask for. Source: STS3215 memory table V3.6."""
PROCESSING: Final = 0.001
"""s a servo may take to make up a reply. With adapter and margin, which the bus adds, a unicast reply may take
about twice the 2 ms that python-st3215 gives and that users found too short."""
SCAN: Final = 0.010
"""s to wait for an id that is probably not there. Source: servolab."""
STORE: Final = 0.100
"""s for a write to flash: more than 21 ms were measured by a public recovery tool; 50 to 100 ms are advised."""
COLLISION: Final = 0.8
"""s in which all servos have answered a broadcast PING at 1 Mbaud. Source: rustypot."""

DELAYS: Final = {
    TimeoutClass.REPLY: PROCESSING,
    TimeoutClass.SCAN: SCAN - RETURN_DELAY,
    TimeoutClass.STORE: STORE,
}
"""s between request and reply, without the return delay of each reply."""
BROADCAST_BYTES: Final = (wire.MAX_ID + 1) * wire.OVERHEAD
LONGEST: Final = wire.MAX_LENGTH + 4
"""Bytes of the longest reply."""
_ADAPTER: Final = 0.016
"""s; latency timer of an FTDI adapter as shipped. Source: ROBOTIS-GIT/DynamixelSDK#330."""
_SCHEDULING: Final = 0.005
"""s; how late a loaded host may run between two bytes that belong together."""

LONGEST_GAP: Final = RETURN_DELAY + 2 * _ADAPTER + _SCHEDULING
"""s: a return delay, the latency timer of the adapter both ways, and a margin for the host."""

AT_ONCE: Final = 60
"""Servos that one frame of a stop lets go: 128 bytes, so that what comes next never waits long."""
ID: Final = 5
PROBES: Final = (3, 9, 10, 12, 13, 14, *range(16, 27))
"""Bytes a probe reads from register 5 on. Never 2, whose reply is as long as the echo of its request, and none
of the lengths in common use: 1, 2, 4, 5 (identify), 6, 7 (commands), 8, 11, 15 (feedback), 40 (settings)."""


def echo_test() -> Request[None]:
    """READ of one byte, the id of node 1: the echo has eight bytes and an answer seven."""
    return Request(
        wire.read(1, ID, 1),
        (Expected(1, 1, wire.OVERHEAD + 1),),
        _nothing,
        reply_within=TimeoutClass.SCAN,
        repeatable=True,
    )


def probe(node: int, attempt: int) -> Request[bool]:
    """READ that begins with the id register, in a length that few other reads have; True when the id is right."""
    return _probe(node, PROBES[attempt % len(PROBES)])


@cache
def _probe(node: int, count: int) -> Request[bool]:
    """Kept, for there are few: of a servo that stays silent many are looked at each time."""

    def read(answer: Response) -> bool:
        return bool(answer.replies) and answer.replies[0].data[5] == node

    return Request(
        wire.read(node, ID, count), (Expected(node, node, wire.OVERHEAD + count),), read, repeatable=True
    )


def stop(nodes: Mapping[int, Response | None], hold: Collection[int] = ()) -> Stop:
    """Torque off for everyone at once, then for each node until it acknowledges: an arm goes limp.

    Those of `hold` keep their torque and are held where they are, known or not: see `holding`.
    """
    others = sorted(set(nodes) - set(hold))
    if not hold:
        return Stop((_everyone(), *map(_limp, others)), Promise.TORQUE_OFF_ACCEPTED.value)
    rest = [node for node in range(wire.MAX_ID + 1) if node not in hold and node not in nodes]
    frames = (*_at_once(others), *map(_limp, others), *holds(nodes, hold), *_at_once(rest))
    return Stop(frames, f"{Promise.TORQUE_OFF_ACCEPTED.value}; {PROMISE}")


def _everyone() -> Request[Response]:
    return Request(
        wire.write(wire.BROADCAST, LIMP.address, LIMP.data),
        (),
        priority=Priority.STOP,
        effect=LIMP.effect,
        repeatable=True,
    )


def _at_once(nodes: Sequence[int]) -> Iterator[Request[Response]]:
    """Torque off to these and to nobody else, as many frames as that takes; nobody answers."""
    for start in range(0, len(nodes), AT_ONCE):
        ids = nodes[start : start + AT_ONCE]
        yield Request(
            wire.sync_write(LIMP.address, [(node, LIMP.data) for node in ids]),
            (),
            priority=Priority.STOP,
            effect=LIMP.effect,
            setpoints=tuple(map(torque_off, ids)),
            repeatable=True,
        )


def _limp(node: int) -> Request[Response]:
    return Request(
        wire.write(node, LIMP.address, LIMP.data),
        (Expected(node, node, wire.OVERHEAD),),
        priority=Priority.STOP,
        effect=LIMP.effect,
        repeatable=True,
    )


def _nothing(_: Response) -> None:
    return None
