"""The classes that only the newer FEETECH SDK has: `sms_sts` and `scscl`, each on servos of every kind.

What one of them writes to a servo of another family is acknowledged like anything else, so what the servo holds then
is the point.
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
    Sdk,
)
from tests.interop.feetech.steps import Call, Held, Memory, Step, Through
from tests.interop.feetech.twin import Kind

DONE: Final = [SUCCESS, 0]
MOVING, PENDING, STS_LOCK, SCS_LOCK = 66, 64, 55, 48
VELOCITY: Final = 500


def classes(sdk: Sdk) -> Iterator[Step]:
    """Both, as far as what they do can be seen on this kind."""
    yield from _sms_sts(sdk.kind)
    yield from _reads("sms_sts", sdk.kind, "little")
    yield from _scscl(sdk.kind)
    yield from _reads("scscl", sdk.kind, "big")


def _on(owner: str, why: str, name: str, *arguments: Any, gives: Any = DONE, **more: Any) -> Step:
    return Step((Call(owner, name, arguments, gives),), why=why, **more)


def _reads(owner: str, kind: Kind, order: str) -> Iterator[Step]:
    why = "" if kind.order == order else "wrong-class"
    place = Held(1, POSITION) if kind.order == order else _swapped(order == "little")
    yield _on(owner, why, "ReadPos", 1, gives=[place, SUCCESS, 0])
    yield _on(owner, why, "ReadSpeed", 1, gives=[Held(1, POSITION + 2), SUCCESS, 0])
    yield _on(owner, why, "ReadPosSpeed", 1, gives=[place, 0, SUCCESS, 0])
    yield _on(owner, why, "ReadMoving", 1, gives=[Held(1, MOVING, 1), SUCCESS, 0])


def _swapped(signed: bool) -> Through:
    """The number of the same two bytes in the other order; that of `sms_sts` has a sign."""

    def convert(value: int) -> int:
        other = value >> 8 | (value & 255) << 8
        return 0x8000 - other if signed and other & 0x8000 else other

    return Through(convert, Held(1, POSITION), "held, bytes swapped")


def _burst(kind: Kind, goal: int, speed: int) -> Memory:
    """What `sms_sts` leaves from 41 on, of which an SCS has no 41."""
    data = [50, goal & 255, goal >> 8 & 255, 0, 0, speed & 255, speed >> 8 & 255]
    return {(1, GOAL): data[1:]} if kind.map == "scs" else {(1, ACCELERATION): data}


def _sms_sts(kind: Kind) -> Iterator[Step]:
    own = "sms_sts"
    wrong = "wrong-class" if kind.map == "scs" else ""
    why = "zero-torque" if kind.map == "hls" else wrong
    goal = kind.middle + 52
    order = (1, goal, VELOCITY, 50)
    burst = _burst(kind, goal, VELOCITY)
    # With 0 at 44 an HLS may use 0 mA: it stays where it is, torque on or not.
    stays = {"moving": False, "raw_position": kind.middle} if kind.map == "hls" else {}
    yield _on(own, why, "WritePosEx", *order, before={(1, TORQUE): [1]}, after=burst, status=stays)
    negative = _burst(kind, -40 & 0xFFFF, VELOCITY)
    yield _on(own, f"{why} twos-complement", "WritePosEx", 1, -40, VELOCITY, 50, after=negative)
    yield _on(own, why, "WriteSpec", 1, -VELOCITY, 50, after=_burst(kind, 0, VELOCITY | 0x8000))
    yield from _together(own, "SyncWritePosEx", "RegWritePosEx", order, burst, why)
    mode = Held(1, MODE, 1, True) if kind.map == "scs" else [1]
    yield _on(own, wrong, "WheelMode", 1, after={(1, MODE): mode})
    for name, value in (("unLockEprom", 0), ("LockEprom", 1)):
        lock: Memory = {(1, SCS_LOCK): [1]} if wrong else {(1, STS_LOCK): [value]}
        yield _on(own, wrong, name, 1, after=lock)


def _scscl(kind: Kind) -> Iterator[Step]:
    own = "scscl"
    why = "" if kind.map == "scs" else "wrong-class"
    order = (1, 600, 20, VELOCITY)
    words = [number >> shift & 255 for number in order[1:] for shift in (8, 0)]
    after: Memory = {(1, GOAL): words}
    yield _on(own, why, "WritePos", *order, after=after)
    yield from _together(own, "SyncWritePos", "RegWritePos", order, after, why)
    yield _on(own, why, "PWMMode", 1, after={(1, MIN_LIMIT): [0, 0, 0, 0]})
    yield _on(own, why, "WritePWM", 1, -100, after={(1, TIME): [0x04, 0x64], (1, SPEED): [0, 0]})
    for name, value in (("unLockEprom", 0), ("LockEprom", 1)):
        yield _on(own, why, name, 1, after={(1, SCS_LOCK): [value]})


def _together(
    own: str, sync: str, buffered: str, order: tuple[int, ...], after: Memory, why: str
) -> Iterator[Step]:
    group = f"{own}.groupSyncWrite"
    calls = (
        Call(group, "clearParam", ()),
        Call(own, sync, order, True),
        Call(group, "txPacket", (), SUCCESS),
    )
    yield Step(calls, after=after, why=why)
    later = (Call(own, buffered, order, DONE), Call(own, "RegAction", (), SUCCESS))
    yield Step(later, after={**after, (1, PENDING): [0]}, why=why)
