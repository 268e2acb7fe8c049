"""Groups of both FEETECH SDKs for SYNC READ and SYNC WRITE."""

from __future__ import annotations

from collections.abc import Iterator

from motorbus.families.feetech import protocol
from motorbus.families.feetech.traits import TRAITS
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
from tests.interop.feetech.steps import Call, Held, Step, Through
from tests.interop.feetech.twin import ABSENT


def groups(sdk: Sdk) -> Iterator[Step]:
    """SYNC READ and SYNC WRITE, by the objects that collect ids and by the handler's own calls."""
    yield from _writing(sdk)
    if TRAITS[sdk.kind.map].sync_read:
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
    return Through(lambda data: list(protocol.frame(node, 0, bytes(data))), held, "the packet")


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
