"""What else both FEETECH SDKs have: groups for SYNC READ and SYNC WRITE, the port, the functions of the module."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from motorbus.families.feetech import wire
from motorbus.families.feetech.table import CONTROL
from tests.interop.feetech.sdk import (
    CORRUPT,
    PATIENCE,
    POSITION,
    SPEED,
    SUCCESS,
    TIMEOUT,
    UNAVAILABLE,
    Sdk,
)
from tests.interop.feetech.steps import Anything, Call, Held, Step, Through
from tests.interop.feetech.twin import ABSENT


def groups(sdk: Sdk) -> Iterator[Step]:
    """SYNC READ and SYNC WRITE, by the objects that collect ids and by the handler's own calls."""
    yield from _writing(sdk)
    if CONTROL[sdk.kind.map].sync_read:
        yield from _reading(sdk)
    else:
        yield from _unread(sdk)
    yield from _listing()


def _writing(sdk: Sdk) -> Iterator[Step]:
    word = sdk.kind.word
    both = {(1, SPEED): word(1000), (2, SPEED): word(1100)}
    add = tuple(Call("writer", "addParam", (node, data), True) for (node, _), data in both.items())
    clear = Call("writer", "clearParam", ())
    yield Step(
        (clear, *add, Call("writer", "txPacket", (), SUCCESS)), after=both, why="no-answer-to-sync-write"
    )
    yield Step(
        (
            clear,
            Call("writer", "txPacket", (), UNAVAILABLE),
            *add,
            Call("writer", "addParam", (1, word(900)), False),
            Call("writer", "addParam", (253, [1, 2, 3]), False),
            Call("writer", "changeParam", (1, word(900)), True),
            Call("writer", "changeParam", (253, word(900)), False),
            Call("writer", "removeParam", (2,)),
            Call("writer", "makeParam", ()),
            Call("writer", "txPacket", (), SUCCESS),
        ),
        after={(1, SPEED): word(900), (2, SPEED): word(0)},
    )
    listed = [1, *word(1000), 2, *word(1100)]
    yield sdk.step("syncWriteTxOnly", SPEED, 2, listed, len(listed), gives=SUCCESS, after=both)


def _collect(*ids: int) -> tuple[Call, ...]:
    add = (Call("reader", "addParam", (node,), True) for node in ids)
    return Call("reader", "clearParam", ()), *add


def _had(sdk: Sdk, node: int) -> tuple[Call, ...]:
    available = True if sdk.old else [True, 0]
    return (
        Call("reader", "isAvailable", (node, POSITION, 2), available),
        Call("reader", "getData", (node, POSITION, 2), Held(node, POSITION)),
    )


def _reading(sdk: Sdk) -> Iterator[Step]:
    good = (*_had(sdk, 1), *_had(sdk, 2))
    yield Step((*_collect(1, 2), Call("reader", "txRxPacket", (), SUCCESS), *good))
    halves = (Call("reader", "txPacket", (), SUCCESS), PATIENCE, Call("reader", "rxPacket", (), SUCCESS))
    yield Step((*_collect(2, 1), *halves, *good))
    lost = False if sdk.old else [False, 0]
    missing = Call("reader", "isAvailable", (ABSENT, POSITION, 2), lost)
    whole = Call("reader", "txRxPacket", (), TIMEOUT if sdk.old else SUCCESS)
    if sdk.old:
        gone: tuple[Call, ...] = (
            Call("reader", "isAvailable", (2, POSITION, 2), lost),
            Call("reader", "getData", (2, POSITION, 2), 0),
        )
        why = "first-silent"
    else:
        gone, why = _had(sdk, 2), "success-though-missing"
    yield Step((*_collect(1, ABSENT, 2), whole, *_had(sdk, 1), missing, *gone), why=why)
    one = sdk.call("syncReadTx", POSITION, 2, [1], 1, gives=SUCCESS)
    data = Held(1, POSITION, 2, True)
    if sdk.old:
        yield Step((one, PATIENCE, sdk.call("readRx", 1, 2, gives=[data, SUCCESS, 0])))
    else:
        yield Step((one, PATIENCE, sdk.call("readRx", 1, 2, gives=[data, SUCCESS, 0])))
        yield Step((one, sdk.call("syncReadRx", 2, 1, gives=[SUCCESS, _packet(1)])))
        packets = [0xFF, 0xFF, 1, 4, 5, 0, 8, 0xED]
        found = Call("reader", "readRx", (packets, 1, 2), [[5, 0, 8], SUCCESS])
        yield Step((found, Call("reader", "readRx", (packets, 2, 2), [None, CORRUPT])))


def _packet(node: int) -> Through:
    """The whole answer to a SYNC READ of the position."""
    held = Held(node, POSITION, 2, True)
    return Through(lambda data: list(wire.encode_status(node, 0, bytes(data))), held, "the packet")


def _unread(sdk: Sdk) -> Iterator[Step]:
    """A servo without SYNC READ says nothing to it."""
    why = "no-sync-read"
    lost = False if sdk.old else [False, 0]
    none = Call("reader", "isAvailable", (1, POSITION, 2), lost)
    read = Call("reader", "txRxPacket", (), TIMEOUT)
    nothing = (Call("reader", "getData", (1, POSITION, 2), 0),) if sdk.old else ()
    yield Step((*_collect(1, 2), read, none, *nothing), why=why)
    halves = (Call("reader", "txPacket", (), SUCCESS), Call("reader", "rxPacket", (), TIMEOUT))
    yield Step((*_collect(1, 2), *halves), why=why)
    one = sdk.call("syncReadTx", POSITION, 2, [1], 1, gives=SUCCESS)
    if sdk.old:
        yield Step((one, sdk.call("readRx", 1, 2, gives=[[], TIMEOUT, 0])), why=why)
    else:
        yield Step((one, sdk.call("syncReadRx", 2, 1, gives=[TIMEOUT, []])), why=why)


def _listing() -> Iterator[Step]:
    yield Step(
        (
            *_collect(1, 2),
            Call("reader", "addParam", (1,), False),
            Call("reader", "removeParam", (1,)),
            Call("reader", "removeParam", (2,)),
            Call("reader", "makeParam", ()),
            Call("reader", "txPacket", (), UNAVAILABLE),
            Call("reader", "rxPacket", (), UNAVAILABLE),
        )
    )


def port(sdk: Sdk, name: str) -> Iterator[Step]:
    """The port handler; `name` is that of the terminal."""
    ours, answer = Call("port", "writePort", ([0xFF, 0xFF, 1, 2, 1, 0xFB],), 6), Anything("bytes waiting")
    yield Step((Call("port", "getPortName", (), name), Call("port", "setPortName", (name,))))
    yield Step((ours, Call("port", "getBytesAvailable", (), answer), Call("port", "readPort", (6,), answer)))
    yield Step((Call("port", "clearPort", ()),), why="clear-flushes-output")
    yield Step(
        (
            Call("port", "closePort", ()),
            Call("port", "openPort", (), True),
            Call("port", "getBaudRate", (), 1_000_000),
            Call("port", "setBaudRate", (500_000,), True),
            Call("port", "getBaudRate", (), 500_000),
            sdk.call("ping", 1, gives=[0, TIMEOUT, 0]),
            Call("port", "setBaudRate", (1_000_000,), True),
            sdk.call("ping", 1, gives=[sdk.kind.number, SUCCESS, 0]),
        )
    )
    yield Step(
        (
            Call("port", "setupPort", (1_000_000,), True),
            sdk.call("ping", 1, gives=[sdk.kind.number, SUCCESS, 0]),
        )
    )
    yield Step(
        (Call("port", "setBaudRate", (76_800,), False), Call("port", "getCFlagBaud", (76_800,), -1)),
        why="no-76800",
    )
    yield Step((Call("port", "getCFlagBaud", (57_600,), 57_600),))
    now = Anything("time in ms")
    yield Step(
        (
            Call("port", "setPacketTimeout", (6,)),
            Call("port", "isPacketTimeout", (), Anything("by the clock")),
            Call("port", "setPacketTimeoutMillis", (0,)),
            Call("port", "getCurrentTime", (), now),
            Call("port", "getTimeSinceStart", (), now),
        ),
        why="wall-clock",
    )


def numbers(sdk: Sdk) -> Iterator[Step]:
    """Bits and bytes: functions of the module, or of the handler in the newer SDK."""

    def call(name: str, *arguments: int, gives: Any = None) -> Call:
        return (
            Call("", f"SCS_{name}".upper(), arguments, gives)
            if sdk.old
            else Call("handler", f"scs_{name}", arguments, gives)
        )

    little = sdk.end == 0
    low, high = (0x34, 0x12) if little else (0x12, 0x34)
    yield Step(
        (call("getend", gives=sdk.end), call("setend", sdk.end)), why="global-order" if sdk.old else ""
    )
    yield Step(
        (
            call("tohost", 0x8005, 15, gives=-5),
            call("tohost", 5, 15, gives=5),
            call("toscs", -5, 15, gives=0x8005),
        )
    )
    yield Step((call("toscs", -40_000, 15, gives=0x9C40),), why="spill")
    yield Step((call("makeword", low, high, gives=0x1234), call("makedword", 1, 2, gives=0x20001)))
    yield Step((call("loword", 0x20001, gives=1), call("hiword", 0x20001, gives=2)))
    yield Step((call("lobyte", 0x1234, gives=low), call("hibyte", 0x1234, gives=high)))
    if sdk.old:
        other = Call("", "PacketHandler", (1 - sdk.end,), Anything("another handler"))
        swapped = sdk.kind.number >> 8 | (sdk.kind.number & 0xFF) << 8
        back = Call("", "PacketHandler", (sdk.end,), Anything("another handler"))
        yield Step((other, sdk.call("ping", 1, gives=[swapped, SUCCESS, 0]), back), why="global-order")
