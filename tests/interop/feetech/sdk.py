"""Calls of the two FEETECH SDKs on the package index, as steps for a servo of any kind.

A call returns (data, result of the transmission, error byte). In feetech-servo-sdk 1.0.0 each call takes the port and
the byte order is a global of the module; in ftservo-python-sdk 2.0.1 handlers hold both, and there are classes for STS
and SCS. The wheel has no class for HLS and neither 0x0A nor 0x0B.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

from motorbus.families.feetech.traits import TRAITS
from tests.interop.feetech.peer import OLD_SDK, Library, Peer, kept
from tests.interop.feetech.steps import Call, Held, Step
from tests.interop.feetech.twin import ABSENT, Kind

BROADCAST: Final = 254
SUCCESS, TX_ERROR, TIMEOUT, CORRUPT, UNAVAILABLE = 0, -4, -6, -7, -9
GAIN, SPEED, TIME, MIN_LIMIT, MODE, TORQUE, ACCELERATION, GOAL, POSITION = 21, 46, 44, 9, 33, 40, 41, 42, 56
ALARMS: Final = {(1, 14): [30], (1, 13): [20]}
"""Highest voltage 3.0 V and highest temperature 20 °C: a servo at rest then raises both alarms."""
BOTH: Final = 0x05
WAIT: Final = Call("port", "setPacketTimeoutMillis", (2000,))
"""Between a request and its reply: 34 ms are short on a busy machine."""


class Sdk(NamedTuple):
    """One of the two, at a servo of one kind: `old` takes the port with every call."""

    peer: Library
    kind: Kind

    @property
    def old(self) -> bool:
        return self.peer is OLD_SDK

    def call(self, name: str, *arguments: Any, gives: Any = None) -> Call:
        """A call of the packet handler."""
        port = (kept("port"),) if self.old else ()
        return Call("handler", name, (*port, *arguments), gives)

    def step(self, name: str, *arguments: Any, gives: Any = None, **more: Any) -> Step:
        """A step of that one call."""
        return Step((self.call(name, *arguments, gives=gives),), **more)


def prepare(peer: Peer, sdk: Sdk, port: str) -> None:
    """Open the port and make what the steps use."""
    big = int(sdk.kind.order == "big")
    peer.new("port", "PortHandler", port)
    assert peer.call("port", "setBaudRate", 1_000_000)
    if sdk.old:
        peer.new("handler", "PacketHandler", big)
    else:
        peer.new("handler", "protocol_packet_handler", kept("port"), big)
        for name in ("sms_sts", "scscl"):
            peer.new(name, name, kept("port"))
    first = (kept("port"), kept("handler")) if sdk.old else (kept("handler"),)
    peer.new("reader", "GroupSyncRead", *first, POSITION, 2)
    peer.new("writer", "GroupSyncWrite", *first, SPEED, 2)


def steps(sdk: Sdk) -> Iterator[Step]:
    """The packet handler and the groups."""
    yield from _packets(sdk)
    yield from _reads(sdk)
    yield from _writes(sdk)
    yield from _buffered(sdk)
    yield from _groups(sdk)


def _packets(sdk: Sdk) -> Iterator[Step]:
    bare = [0, 0, 1, 2, 1, 0]
    yield sdk.step("txRxPacket", bare, gives=[[0xFF, 0xFF, 1, 2, 0, 0xFC], SUCCESS, 0])
    yield sdk.step("txPacket", [0, 0, 1, 247, 3, *[0] * 246], gives=TX_ERROR)
    for node in (1, 253):
        yield sdk.step("ping", node, gives=[sdk.kind.number, SUCCESS, 0])
    yield sdk.step("ping", ABSENT, gives=[0, TIMEOUT, 0])
    yield sdk.step("ping", 1, gives=[sdk.kind.number, SUCCESS, BOTH], before=ALARMS)


def _reads(sdk: Sdk) -> Iterator[Step]:
    both = sdk.kind.word(50) + sdk.kind.word(1000)
    before, long = {(1, TIME): both}, 50 | 1000 << 16  # four bytes are two words, the first the low one
    yield sdk.step("readTxRx", 1, 0, 5, gives=[Held(1, 0, 5, True), SUCCESS, 0])
    yield sdk.step("read1ByteTxRx", 1, GAIN, gives=[Held(1, GAIN, 1), SUCCESS, 0])
    yield sdk.step("read2ByteTxRx", 1, 24, gives=[Held(1, 24), SUCCESS, 0])
    yield sdk.step("read4ByteTxRx", 1, TIME, gives=[long, SUCCESS, 0], before=before)
    yield Step(
        (
            sdk.call("readTx", 1, 0, 5, gives=SUCCESS),
            WAIT,
            sdk.call("readRx", 1, 5, gives=[Held(1, 0, 5, True), SUCCESS, 0]),
        )
    )
    yield sdk.step("read2ByteTxRx", 1, POSITION, gives=[Held(1, POSITION), SUCCESS, BOTH], before=ALARMS)
    yield sdk.step("read2ByteTxRx", ABSENT, POSITION, gives=[0, TIMEOUT, 0])
    for name, gives in (("write4ByteTxRx", [SUCCESS, 0]), ("write4ByteTxOnly", SUCCESS)):
        yield sdk.step(name, 1, TIME, long, gives=gives, after=before)


def _writes(sdk: Sdk) -> Iterator[Step]:
    speed = {(1, SPEED): sdk.kind.word(1000)}
    gain = {(1, GAIN): [33]}
    for suffix, gives in (("TxRx", [SUCCESS, 0]), ("TxOnly", SUCCESS)):
        yield sdk.step(f"write{suffix}", 1, GAIN, 2, [33, 31], gives=gives, after={(1, GAIN): [33, 31]})
        yield sdk.step(f"write1Byte{suffix}", 1, GAIN, 33, gives=gives, after=gain)
        yield sdk.step(f"write2Byte{suffix}", 1, SPEED, 1000, gives=gives, after=speed)
    everyone = {(node, GAIN): [35] for node in (1, 2, 253)}
    yield sdk.step("write1ByteTxRx", BROADCAST, GAIN, 35, gives=[SUCCESS, 0], after=everyone)
    yield sdk.step("write1ByteTxRx", ABSENT, GAIN, 35, gives=[TIMEOUT, 0])
    yield sdk.step("write1ByteTxRx", 1, GAIN, 33, gives=[SUCCESS, BOTH], before=ALARMS, after=gain)
    yield sdk.step("write1ByteTxRx", 1, 3, 33, gives=[SUCCESS, 0], after={(1, 3): Held(1, 3, 1, True)})


def _buffered(sdk: Sdk) -> Iterator[Step]:
    before = {(1, GAIN): [31]}
    for name, gives in (("regWriteTxRx", [SUCCESS, 0]), ("regWriteTxOnly", SUCCESS)):
        write = sdk.call(name, 1, GAIN, 1, [33], gives=gives)
        yield Step((write,), before=before, after={(1, 64): [1], (1, GAIN): [31]})
        for node in (1, BROADCAST):
            action = sdk.call("action", node, gives=SUCCESS)
            yield Step((write, action), before=before, after={(1, 64): [0], (1, GAIN): [33]})
    yield sdk.step("action", ABSENT, gives=TIMEOUT)


def _groups(sdk: Sdk) -> Iterator[Step]:
    word = sdk.kind.word
    both = {(1, SPEED): word(1000), (2, SPEED): word(1100)}
    add = tuple(Call("writer", "addParam", (node, data), True) for (node, _), data in both.items())
    send = Call("writer", "txPacket", (), SUCCESS)
    yield Step((Call("writer", "clearParam", ()), *add, send), after=both)
    listed = [1, *word(1000), 2, *word(1100)]
    yield sdk.step(
        "syncWriteTxOnly",
        SPEED,
        2,
        listed,
        len(listed),
        gives=SUCCESS,
        after={**both, (2, SPEED): word(1100)},
    )
    lost = False if sdk.old else [False, 0]
    one = sdk.call("syncReadTx", POSITION, 2, [1], 1, gives=SUCCESS)
    if not TRAITS[sdk.kind.map].sync_read:  # such a servo does not reply
        read = Call("reader", "txRxPacket", (), TIMEOUT)
        yield Step((*_collect(1, 2), read, Call("reader", "isAvailable", (1, POSITION, 2), lost)))
        return
    good = (*_available(sdk, 1), *_available(sdk, 2))
    yield Step((*_collect(1, 2), Call("reader", "txRxPacket", (), SUCCESS), *good))
    missing = Call("reader", "isAvailable", (ABSENT, POSITION, 2), lost)
    behind: tuple[Call, ...]
    if sdk.old:  # all behind the first silent servo are lost
        result, behind = TIMEOUT, (Call("reader", "isAvailable", (2, POSITION, 2), lost),)
    else:
        result, behind = SUCCESS, _available(sdk, 2)
    whole = Call("reader", "txRxPacket", (), result)
    yield Step((*_collect(1, ABSENT, 2), whole, *_available(sdk, 1), missing, *behind))
    yield Step((one, WAIT, sdk.call("readRx", 1, 2, gives=[Held(1, POSITION, 2, True), SUCCESS, 0])))


def _collect(*ids: int) -> tuple[Call, ...]:
    add = (Call("reader", "addParam", (node,), True) for node in ids)
    return Call("reader", "clearParam", ()), *add


def _available(sdk: Sdk, node: int) -> tuple[Call, ...]:
    available = True if sdk.old else [True, 0]
    return (
        Call("reader", "isAvailable", (node, POSITION, 2), available),
        Call("reader", "getData", (node, POSITION, 2), Held(node, POSITION)),
    )
