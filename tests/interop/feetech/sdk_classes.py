"""The classes of the newer FEETECH SDK, `sms_sts` and `scscl`, each on servos of every kind.

A servo of another kind acknowledges what they write as well, so the steps state what it holds then.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from tests.interop.feetech.sdk import (
    ACCELERATION,
    GOAL,
    MIN_LIMIT,
    MODE,
    POSITION,
    SPEED,
    SUCCESS,
    TIME,
    TORQUE,
)
from tests.interop.feetech.steps import Call, Held, Memory, Step, Through
from tests.interop.feetech.twin import Kind

DONE: Final = [SUCCESS, 0]
MOVING, PENDING, STS_LOCK, SCS_LOCK = 66, 64, 55, 48
VELOCITY: Final = 500


def steps(kind: Kind) -> Iterator[Step]:
    """Both classes, as far as their effect can be seen on this kind."""
    yield from _sms_sts(kind)
    yield from _reads("sms_sts", kind, "little")
    yield from _scscl(kind)
    yield from _reads("scscl", kind, "big")


def _step(owner: str, name: str, *arguments: Any, gives: Any = DONE, **more: Any) -> Step:
    return Step((Call(owner, name, arguments, gives),), **more)


def _reads(owner: str, kind: Kind, order: str) -> Iterator[Step]:
    position = Held(1, POSITION) if kind.order == order else _swapped(order == "little")
    yield _step(owner, "ReadPos", 1, gives=[position, SUCCESS, 0])
    yield _step(owner, "ReadSpeed", 1, gives=[Held(1, POSITION + 2), SUCCESS, 0])
    yield _step(owner, "ReadPosSpeed", 1, gives=[position, 0, SUCCESS, 0])
    yield _step(owner, "ReadMoving", 1, gives=[Held(1, MOVING, 1), SUCCESS, 0])


def _swapped(signed: bool) -> Through:
    """The number of the same two bytes in the other order; that of `sms_sts` has a sign."""

    def convert(value: int) -> int:
        other = value >> 8 | (value & 255) << 8
        return 0x8000 - other if signed and other & 0x8000 else other

    return Through(convert, Held(1, POSITION))


def _burst(kind: Kind, goal: int, speed: int) -> Memory:
    """What `sms_sts` leaves from 41 on; an SCS has no 41."""
    data = [50, goal & 255, goal >> 8 & 255, 0, 0, speed & 255, speed >> 8 & 255]
    return {(1, GOAL): data[1:]} if kind.map == "scs" else {(1, ACCELERATION): data}


def _sms_sts(kind: Kind) -> Iterator[Step]:
    own = "sms_sts"
    goal = (1, kind.middle + 52, VELOCITY, 50)
    burst = _burst(kind, kind.middle + 52, VELOCITY)
    # With 0 at 44 an HLS may use 0 mA: it does not move, torque on or not.
    still = {"moving": False, "raw_position": kind.middle} if kind.map == "hls" else {}
    yield _step(own, "WritePosEx", *goal, before={(1, TORQUE): [1]}, after=burst, status=still)
    yield _step(own, "WritePosEx", 1, -40, VELOCITY, 50, after=_burst(kind, -40 & 0xFFFF, VELOCITY))
    yield _step(own, "WriteSpec", 1, -VELOCITY, 50, after=_burst(kind, 0, VELOCITY | 0x8000))
    yield from _together(own, "SyncWritePosEx", "RegWritePosEx", goal, burst)
    is_scs = kind.map == "scs"
    yield _step(own, "WheelMode", 1, after={(1, MODE): Held(1, MODE, 1, True) if is_scs else [1]})
    for name, value in (("unLockEprom", 0), ("LockEprom", 1)):
        yield _step(own, name, 1, after={(1, SCS_LOCK): [1]} if is_scs else {(1, STS_LOCK): [value]})


def _scscl(kind: Kind) -> Iterator[Step]:
    own = "scscl"
    goal = (1, 600, 20, VELOCITY)
    after: Memory = {(1, GOAL): [number >> shift & 255 for number in goal[1:] for shift in (8, 0)]}
    yield _step(own, "WritePos", *goal, after=after)
    yield from _together(own, "SyncWritePos", "RegWritePos", goal, after)
    yield _step(own, "PWMMode", 1, after={(1, MIN_LIMIT): [0, 0, 0, 0]})
    yield _step(own, "WritePWM", 1, -100, after={(1, TIME): [0x04, 0x64], (1, SPEED): [0, 0]})
    for name, value in (("unLockEprom", 0), ("LockEprom", 1)):
        yield _step(own, name, 1, after={(1, SCS_LOCK): [value]})


def _together(own: str, sync: str, buffered: str, goal: tuple[int, ...], after: Memory) -> Iterator[Step]:
    group = f"{own}.groupSyncWrite"
    yield Step(
        (
            Call(group, "clearParam", ()),
            Call(own, sync, goal, True),
            Call(group, "txPacket", (), SUCCESS),
        ),
        after=after,
    )
    later = (Call(own, buffered, goal, DONE), Call(own, "RegAction", (), SUCCESS))
    yield Step(later, after={**after, (1, PENDING): [0]})
