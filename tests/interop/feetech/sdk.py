"""Every call of the two FEETECH SDKs on the package index, as steps for a servo of any kind.

Both are C in Python's clothes: a call gives (data, result of the transmission, error byte). In 1.0.0 of
feetech-servo-sdk each call takes the port and the byte order is a global of the module; in 2.0.1 of ftservo-python-sdk
handlers hold both, and there are classes for STS and SCS. The wheel has no class for HLS and neither 0x0A nor 0x0B.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

from tests.interop.feetech.peer import NEW_SDK, OLD_SDK, Library, Peer, kept
from tests.interop.feetech.steps import Call, Held, Step
from tests.interop.feetech.twin import ABSENT, Kind

BROADCAST: Final = 254
SUCCESS, BUSY, TX_ERROR, TIMEOUT, CORRUPT, UNAVAILABLE = 0, -1, -4, -6, -7, -9
GAIN, SPEED, TIME, MIN_LIMIT, MODE, TORQUE, ACCELERATION, GOAL, POSITION = 21, 46, 44, 9, 33, 40, 41, 42, 56
ALARMS: Final = {(1, 14): [30], (1, 13): [20]}
"""Highest voltage 3.0 V and highest temperature 20 °C: a servo at rest then raises both alarms."""
BOTH: Final = 0x05
PATIENCE: Final = Call("port", "setPacketTimeoutMillis", (2000,))
"""What their user may do between asking and listening: 34 ms are little on a busy machine."""
PING: Final = [0xFF, 0xFF, 1, 2, 1, 0xFB]
PONG: Final = [0xFF, 0xFF, 1, 2, 0, 0xFC]


class Sdk(NamedTuple):
    """One of the two, at a servo of one kind: `old` takes the port with every call."""

    peer: Library
    kind: Kind

    @property
    def old(self) -> bool:
        return self.peer is OLD_SDK

    @property
    def end(self) -> int:
        """The byte order as both count it."""
        return int(self.kind.order == "big")

    def call(self, name: str, *arguments: Any, gives: Any = None, at: str = "handler") -> Call:
        """A call of a packet handler."""
        port = (kept("port"),) if self.old else ()
        return Call(at, name, (*port, *arguments), gives)

    def step(self, name: str, *arguments: Any, gives: Any = None, **more: Any) -> Step:
        """A step of that one call."""
        return Step((self.call(name, *arguments, gives=gives),), **more)


def prepare(peer: Peer, sdk: Sdk, port: str) -> None:
    """Open the port and make what the steps use."""
    peer.new("port", "PortHandler", port)
    assert peer.call("port", "setBaudRate", 1_000_000)
    if sdk.old:
        peer.new("handler", "PacketHandler", sdk.end)
    else:
        peer.new("handler", "protocol_packet_handler", kept("port"), sdk.end)
        for name in ("sms_sts", "scscl"):
            peer.new(name, name, kept("port"))
    first = (kept("port"), kept("handler")) if sdk.old else (kept("handler"),)
    peer.new("reader", "GroupSyncRead", *first, POSITION, 2)
    peer.new("writer", "GroupSyncWrite", *first, SPEED, 2)


def handler(sdk: Sdk) -> Iterator[Step]:
    """The packet handler: every call but the one that only the new SDK has."""
    yield from _words(sdk)
    yield from _packets(sdk)
    yield from _reads(sdk)
    yield from _writes(sdk)
    yield from _buffered(sdk)


def _words(sdk: Sdk) -> Iterator[Step]:
    prefix = "RxPacketError" if sdk.old else "ServoStatus"
    texts = (
        (SUCCESS, "Communication success!"),
        (BUSY, "Port is in use!"),
        (TIMEOUT, "There is no status packet!"),
        (CORRUPT, "Incorrect status packet!"),
    )
    yield Step((Call("handler", "getProtocolVersion", (), 1.0),))
    yield Step(
        tuple(Call("handler", "getTxRxResult", (code,), f"[TxRxResult] {text}") for code, text in texts)
    )
    yield Step(
        (
            Call("handler", "getRxPacketError", (BOTH,), f"[{prefix}] Input voltage error!"),
            Call("handler", "getRxPacketError", (0x2C,), f"[{prefix}] Overheat error!"),
        ),
        why="first-alarm",
    )
    yield Step((Call("handler", "getRxPacketError", (0x10,), ""),), why="bit-4")
    yield Step((Call("handler", "getRxPacketError", (0,), ""),))


def _packets(sdk: Sdk) -> Iterator[Step]:
    bare = [0, 0, 1, 2, 1, 0]
    yield Step(
        (
            PATIENCE,
            sdk.call("txPacket", bare, gives=SUCCESS),
            sdk.call("txPacket", bare, gives=BUSY),
            sdk.call("rxPacket", gives=[PONG, SUCCESS]),
        ),
        why="sticky-port",
    )
    yield sdk.step("txPacket", [0, 0, 1, 247, 3, *[0] * 246], gives=TX_ERROR, why="frame-of-250")
    yield sdk.step("txRxPacket", bare, gives=[PONG, SUCCESS, 0])
    yield sdk.step("ping", 1, gives=[sdk.kind.number, SUCCESS, 0], why="ping-reads")
    yield sdk.step("ping", 253, gives=[sdk.kind.number, SUCCESS, 0], why="max-id")
    yield sdk.step("ping", ABSENT, gives=[0, TIMEOUT, 0])
    yield sdk.step("ping", 1, gives=[sdk.kind.number, SUCCESS, BOTH], before=ALARMS)
    yield sdk.step("ping", BROADCAST, gives=[0, UNAVAILABLE, 0], why="broadcast-ping-sdk")


def _reads(sdk: Sdk) -> Iterator[Step]:
    first = Held(1, 0, 5, True)
    for data, value, count, address in (
        (first, first, 5, 0),
        (Held(1, GAIN, 1, True), Held(1, GAIN, 1), 1, GAIN),
        (Held(1, 24, 2, True), Held(1, 24), 2, 24),
    ):
        if count == 5:
            yield sdk.step("readTxRx", 1, address, count, gives=[data, SUCCESS, 0])
            yield Step(
                (
                    sdk.call("readTx", 1, address, count, gives=SUCCESS),
                    PATIENCE,
                    sdk.call("readRx", 1, count, gives=[data, SUCCESS, 0]),
                )
            )
            continue
        yield sdk.step(f"read{count}ByteTxRx", 1, address, gives=[value, SUCCESS, 0])
        yield Step(
            (
                sdk.call(f"read{count}ByteTx", 1, address, gives=SUCCESS),
                PATIENCE,
                sdk.call(f"read{count}ByteRx", 1, gives=[value, SUCCESS, 0]),
            )
        )
    yield from _longs(sdk)
    yield sdk.step("read2ByteTxRx", 1, POSITION, gives=[Held(1, POSITION), SUCCESS, BOTH], before=ALARMS)
    yield sdk.step("read2ByteTxRx", ABSENT, POSITION, gives=[0, TIMEOUT, 0], why="zero-for-nothing")
    yield sdk.step("readTxRx", BROADCAST, 0, 5, gives=[[], UNAVAILABLE, 0])


def _longs(sdk: Sdk) -> Iterator[Step]:
    """Four bytes are two words, the first the low one: no register has four (manual, 1.1)."""
    both = sdk.kind.word(50) + sdk.kind.word(1000)
    before, value = {(1, TIME): both}, 50 | 1000 << 16
    more: dict[str, Any] = {"before": before, "why": "four-bytes"}
    yield sdk.step("read4ByteTxRx", 1, TIME, gives=[value, SUCCESS, 0], **more)
    yield Step(
        (
            sdk.call("read4ByteTx", 1, TIME, gives=SUCCESS),
            PATIENCE,
            sdk.call("read4ByteRx", 1, gives=[value, SUCCESS, 0]),
        ),
        **more,
    )
    for name, gives in (("write4ByteTxRx", [SUCCESS, 0]), ("write4ByteTxOnly", SUCCESS)):
        yield sdk.step(name, 1, TIME, value, gives=gives, after=before, why="four-bytes")


def _writes(sdk: Sdk) -> Iterator[Step]:
    speed = {(1, SPEED): sdk.kind.word(1000)}
    gains = {(1, GAIN): [33, 31]}
    for suffix, gives, why in (("TxRx", [SUCCESS, 0], ""), ("TxOnly", SUCCESS, "unread-answer")):
        yield sdk.step(f"write{suffix}", 1, GAIN, 2, [33, 31], gives=gives, after=gains, why=why)
        yield sdk.step(f"write1Byte{suffix}", 1, GAIN, 33, gives=gives, after={(1, GAIN): [33]}, why=why)
        yield sdk.step(f"write2Byte{suffix}", 1, SPEED, 1000, gives=gives, after=speed, why=why)
    everyone = {(node, GAIN): [35] for node in (1, 2, 253)}
    yield sdk.step("write1ByteTxRx", BROADCAST, GAIN, 35, gives=[SUCCESS, 0], after=everyone)
    yield sdk.step("write1ByteTxRx", ABSENT, GAIN, 35, gives=[TIMEOUT, 0])
    yield sdk.step(
        "write1ByteTxRx", 1, GAIN, 33, gives=[SUCCESS, BOTH], before=ALARMS, after={(1, GAIN): [33]}
    )
    yield sdk.step(
        "write1ByteTxRx", 1, 3, 33, gives=[SUCCESS, 0], after={(1, 3): Held(1, 3, 1, True)}, why="no-refusal"
    )


def _buffered(sdk: Sdk) -> Iterator[Step]:
    waiting = {(1, 64): [1], (1, GAIN): [33]}
    done = {(1, 64): [0], (1, GAIN): [33]}
    for name, gives in (("regWriteTxRx", [SUCCESS, 0]), ("regWriteTxOnly", SUCCESS)):
        before = {(1, GAIN): [31]}
        why = "" if name == "regWriteTxRx" else "unread-answer"
        write = sdk.call(name, 1, GAIN, 1, [33], gives=gives)
        yield Step((write,), before=before, after={**waiting, (1, GAIN): [31]}, why=why)
        for node in (1, BROADCAST):
            yield Step((write, sdk.call("action", node, gives=SUCCESS)), before=before, after=done, why=why)
    yield sdk.step("action", ABSENT, gives=TIMEOUT)


SDKS: Final = (OLD_SDK, NEW_SDK)
