"""Writing what survives power-off: torque off, unlock, write, read back, and always lock again.

An open lock makes every later write permanent without anybody noticing, so whatever happens in between (an error,
Ctrl-C, a cancelled task) the last thing this sequence says is "lock". The lock decides whether a write survives,
not whether it is taken; and flash takes time, so these exchanges may take Timeout.STORE.
Source: STS3215 memory table V3.6; measured on hardware by feetech-cli (what the lock does) and by public recovery
tools (an acknowledgement may take more than 21 ms).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from motorbus.core.entry import Table
from motorbus.core.operation import Alone, Effect, Operation, Rank, Timeout
from motorbus.errors import MotorbusError
from motorbus.families.feetech.driver.exchanges import Block, confirmed, verified, write_block
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.torque import disable_torque

_STATUS_RETURN_LEVEL: Final = 8
_ATTEMPTS: Final = 2


def store(node: Node, table: Table, blocks: Sequence[Block]) -> Operation[None]:
    """Write these blocks of EEPROM registers for good, with nobody else on the bus meanwhile."""
    try:
        yield from Alone(_guarded(node, table["lock"].address, blocks))
    finally:
        node.forget_settings()


def _guarded(node: Node, lock: int, blocks: Sequence[Block]) -> Operation[None]:
    try:
        yield from disable_torque(node)
        yield from _put(node, _lock(lock, 0))
        for block in blocks:
            yield from _stored(node, block._replace(effect=Effect.PERSISTENT))  # it is limp: nothing can move
        yield from _put(node, _lock(lock, 1))
        yield from verified(node, _lock(lock, 1), timeout=Timeout.STORE)
    except GeneratorExit:  # thrown away by whoever carried it out: nothing can be sent any more
        raise
    except BaseException as error:
        yield from _relock(node, lock, error)
        raise


def _stored(node: Node, block: Block) -> Operation[None]:
    yield from _put(node, block)
    if block.address <= _STATUS_RETURN_LEVEL < block.address + len(block.data):
        node.forget_settings()  # from now on it may acknowledge differently
    yield from verified(node, block, timeout=Timeout.STORE)


def _put(node: Node, block: Block) -> Operation[None]:
    yield from confirmed(node, block, rank=Rank.CONFIGURATION, timeout=Timeout.STORE)


def _relock(node: Node, lock: int, error: BaseException) -> Operation[None]:
    """Close the lock on the way out; that it could not be closed is added to the error already on its way."""
    trouble: BaseException | None = None
    for _ in range(_ATTEMPTS):
        try:
            yield from write_block(node, _lock(lock, 1), rank=Rank.CONFIGURATION, timeout=Timeout.STORE)
        except GeneratorExit:
            raise
        except BaseException as failure:  # a second Ctrl-C too: it must be said all the same
            trouble = failure
        else:
            return
    summary = trouble.summary if isinstance(trouble, MotorbusError) else repr(trouble)
    error.add_note(
        f"the EEPROM lock of node {node.node} may still be open, which makes later writes permanent: "
        f"write(lock=1) closes it ({summary})"
    )


def _lock(address: int, value: int) -> Block:
    return Block(address, bytes((value,)), Effect.PERSISTENT)
