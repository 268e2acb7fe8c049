"""Writing what survives power-off: unlock, torque off, write, read back, and always lock again.

The lock comes first because it tells of a restart: a servo that loses its supply for a moment has it closed again, and
some begin with torque on. As long as it is found open, the torque that was switched off behind it is off. That is
looked at directly before every write that would move a servo with torque, and once more in the end; when anything has
gone wrong, the torque is switched off again.

A REG WRITE that waits survives all of this, and an ACTION, of whomever, would carry it out with the meaning that it has
afterwards. So one that waits is replaced by one that moves nothing: torque off.

An open lock makes every later write permanent without anybody noticing, so whatever happens in between (an error,
Ctrl-C, a cancelled task) the last thing this sequence says is "lock". The lock decides whether a write survives,
not whether it is taken; and flash takes time, so these exchanges may take Timeout.STORE.
Source: STS3215 memory table V3.6; measured on hardware by feetech-cli (what the lock does) and by public recovery
tools (an acknowledgement may take more than 21 ms).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, TypeVar

from motorbus.core.entry import Table
from motorbus.core.goal import Later
from motorbus.core.operation import Alone, Effect, Operation, Rank, Timeout, afterwards, outcome
from motorbus.errors import OutcomeUnknown
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.exchanges import (
    DOUBTS,
    Block,
    acknowledged,
    confirmed,
    read_block,
    unread,
    verified,
)
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.torque import LIMP, disable_torque

T = TypeVar("T")

_STATUS_RETURN_LEVEL: Final = 8
_ATTEMPTS: Final = 2
_LIMITS: Final = ("min_position_limit", "max_position_limit")
_OPEN: Final = b"\0"
_IDLE: Final = b"\0"


def store(node: Node, table: Table, blocks: Sequence[Block]) -> Operation[None]:
    """Write these blocks of EEPROM registers for good, with nobody else on the bus meanwhile."""

    lock = table["lock"].address

    def write() -> Operation[None]:
        for block in blocks:
            if moves(table, block):
                yield from still_open(node, lock)
            yield from stored(node, block._replace(effect=Effect.PERSISTENT))  # it is limp: nothing can move

    yield from unlocked(node, table, write)


def unlocked(node: Node, table: Table, work: Callable[[], Operation[T]]) -> Operation[T]:
    """Carry out `work` on a limp servo whose lock is open, with nobody else on the bus; the lock is closed again.

    Its settings are forgotten before anybody else has the bus again, so what others made by them meanwhile is refused.
    """
    lock, pending = table["lock"].address, table["reg_write_pending"].address
    return (yield from Alone(_alone(node, lock, pending, work)))


def _alone(node: Node, lock: int, pending: int, work: Callable[[], Operation[T]]) -> Operation[T]:
    trouble: list[BaseException] = []
    try:
        return (
            yield from afterwards(
                _opened(node, lock, pending, work, trouble), lambda: _locked(node, lock, trouble)
            )
        )
    finally:
        node.forget_settings()


def moves(table: Table, block: Block) -> bool:
    """Whether one of the registers of this block would move a servo that has torque, which goes back inside limits."""
    end = block.address + len(block.data)
    rows = [row for row in table.values() if block.address <= row.address < end]
    return any(row.effect is Effect.MOTION or row.name in _LIMITS for row in rows)


def _opened(
    node: Node, lock: int, pending: int, work: Callable[[], Operation[T]], trouble: list[BaseException]
) -> Operation[T]:
    try:
        yield from _put(node, _lock(lock, 0))
        yield from disable_torque(node)
        yield from _harmless(node, pending)
        done = yield from work()
        yield from still_open(node, lock)
        return done
    except BaseException as error:
        trouble.append(error)
        raise


def _harmless(node: Node, pending: int) -> Operation[None]:
    """See that no REG WRITE waits that would do more than switch torque off."""
    if (yield from read_block(node, pending, 1, bytes, timeout=Timeout.STORE)) != _IDLE:
        request = wire.reg_write(node.node, LIMP.address, LIMP.data)
        block = Block(LIMP.address, LIMP.data)
        yield from acknowledged(node, request, block, rank=Rank.CONFIGURATION, later=Later(node.node))


def still_open(node: Node, lock: int) -> Operation[None]:
    """A servo that has lost its supply meanwhile comes back with its lock closed: it then takes every write, reads back
    right, and keeps none. Raises OutcomeUnknown, also when that cannot be found out."""
    try:
        found = yield from read_block(node, lock, 1, bytes, timeout=Timeout.STORE)
    except DOUBTS as error:
        raise unread(node, error) from error
    if found != _OPEN:
        raise OutcomeUnknown(
            f"node {node.node} has closed its EEPROM lock by itself while it was written to",
            received=found,
            expected="an open lock, 0",
            cause="it has lost its supply for a moment, so that what was written may be gone at the next power-off",
            advice="see that its supply stays on, then write it again",
            node=node.node,
        )


def stored(node: Node, block: Block) -> Operation[None]:
    """Write one block while the lock is open (see `unlocked`), and read it back."""
    yield from _put(node, block)
    if block.address <= _STATUS_RETURN_LEVEL < block.address + len(block.data):
        node.forget_settings()  # from now on it may acknowledge differently
    yield from verified(node, block, timeout=Timeout.STORE)


def _put(node: Node, block: Block) -> Operation[None]:
    yield from confirmed(node, block, rank=Rank.CONFIGURATION, timeout=Timeout.STORE)


def _locked(node: Node, lock: int, trouble: Sequence[BaseException]) -> Operation[None]:
    """Close the lock and see that it is closed. When something has gone wrong already, that is what is raised, and
    a lock that cannot be closed is told with it; whoever may have restarted with torque on is let go before."""
    if trouble:
        yield from outcome(disable_torque(node))
    for _ in range(_ATTEMPTS):
        failure = yield from outcome(_closed(node, lock))
        if failure is None:
            return
    assert failure is not None
    if not trouble:
        raise failure
    trouble[0].add_note(
        f"the EEPROM lock of node {node.node} may still be open, which makes later writes permanent: "
        f"write(lock=1) closes it ({failure.summary})"
    )


def _closed(node: Node, lock: int) -> Operation[None]:
    yield from _put(node, _lock(lock, 1))
    yield from verified(node, _lock(lock, 1), timeout=Timeout.STORE)


def _lock(address: int, value: int) -> Block:
    return Block(address, bytes((value,)), Effect.PERSISTENT)
