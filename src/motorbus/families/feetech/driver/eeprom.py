"""Write registers that survive power-off: open the lock, torque off, write, read back, close the lock.

A servo that loses its supply for a moment comes back with its lock closed, and takes every later write without keeping
it. So the lock must still be open after the last write. Cells wear: equal values are not written again. Source: STS3215
memory table V3.6; feetech-cli, measured on hardware; recovery tools (an acknowledgement takes 21 ms).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from motorbus.core.register import RegisterMap
from motorbus.core.request import Effect, Precondition, Stops
from motorbus.core.steps import Exclusive, Guard, catch
from motorbus.errors import LinkError, MotorbusError, OutcomeUnknown, RequestError
from motorbus.families.feetech.driver.motion import disable_torque, enable_torque_unless, is_limp, limp
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.requests import STORE, Block, confirmed, read_block, verified

OPEN: Final = b"\0"
CLOSED: Final = b"\1"
ATTEMPTS: Final = 2


class Unlocked(Guard):
    """The EEPROM lock is open and torque off inside the block; then the lock is closed and read back.

    After an error the registers get their former values, also behind a lock that closed by itself: they would read as
    written until power-off.
    """

    def __init__(self, node: Node, table: RegisterMap) -> None:
        self.node = node
        self.lock = table["lock"].address
        self.before: list[Block] = []  # what the registers held that were written

    async def enter(self) -> None:
        await confirmed(self.node, Block(self.lock, OPEN, Effect.PERSISTENT), timeout=STORE)
        await disable_torque(self.node)

    async def write(self, block: Block, before: bytes) -> None:
        """Write a block and read it back; it gets these bytes again if the sequence fails."""
        block = block._replace(effect=Effect.PERSISTENT)  # nothing moves: torque is off
        self.before.append(block._replace(data=before))
        await confirmed(self.node, block, timeout=STORE)
        await verified(self.node, block, timeout=STORE)

    async def leave(self, error: BaseException | None) -> None:
        self.node.known.forget(written=True)
        if error is not None and self.before:
            if await catch(self.check_open()) is not None:  # it restarted, maybe with torque on
                await catch(disable_torque(self.node))
            for block in reversed(self.before):
                await catch(confirmed(self.node, block, timeout=STORE))
        for attempt in range(ATTEMPTS):
            try:
                await close_lock(self.node, self.lock)
                return
            except MotorbusError as failure:
                if attempt == ATTEMPTS - 1 or isinstance(failure, LinkError):
                    failure.add_note(f"the EEPROM lock of node {self.node.node} may be open: write(lock=1)")
                    raise

    async def check_open(self) -> None:
        """Raise OutcomeUnknown if the servo has restarted since the lock was opened."""
        if await read_block(self.node, self.lock, 1, bytes, timeout=STORE) != OPEN:
            raise OutcomeUnknown(
                f"node {self.node.node} has closed its EEPROM lock by itself",
                cause="it lost its supply for a moment; what was written may be gone at the next power-off",
                advice="check the supply, then write again",
                node=self.node.node,
            )


async def close_lock(node: Node, lock: int) -> None:
    """Close the EEPROM lock and read it back."""
    block = Block(lock, CLOSED, Effect.PERSISTENT)
    await confirmed(node, block, timeout=STORE)
    await verified(node, block, timeout=STORE)


async def store(
    node: Node,
    table: RegisterMap,
    blocks: Sequence[Block],
    *,
    force: bool = False,
    keep_torque: bool = False,
) -> bool:
    """Write these registers where they differ, with the bus reserved; whether anything was written.

    Torque is off afterwards if so; with `keep_torque` a servo that had torque gets it back, goal := present position,
    unless a stop came meanwhile; an error of that is raised. `force` writes equal values too: another program may have
    written them behind a closed lock, so that power-off loses them. Raises VerificationFailed, OutcomeUnknown.
    """
    return await Exclusive(_store(node, table, blocks, force, keep_torque))


async def _store(
    node: Node, table: RegisterMap, blocks: Sequence[Block], force: bool, keep_torque: bool
) -> bool:
    changes = []
    for block in blocks:
        found = await read_block(node, block.address, len(block.data), bytes, timeout=STORE)
        if force or found != block.data:
            changes.append((block, found))
    unlocked = Unlocked(node, table)
    if not changes:
        if await read_block(node, unlocked.lock, 1, bytes, timeout=STORE) == OPEN:
            await close_lock(node, unlocked.lock)
        return False
    unless = not_stopped(node) if keep_torque and not await is_limp(node) else None

    async def write_all() -> None:
        async with unlocked:
            if unless is not None:
                await confirmed(node, limp(node)._replace(unless=unless))  # counts the stops so far
            for block, before in changes:
                await unlocked.write(block, before)
            await unlocked.check_open()

    error = await catch(write_all())
    if unless is not None:
        failure = await catch(enable_torque_unless(node, unless))
        if failure is not None and error is None:
            failure.add_note("the registers are written; its torque is off")
            raise failure
    if error is not None:
        raise error
    return True


def not_stopped(node: Node) -> Precondition:
    """Refuses a request if a stop has left for this servo since the first request with it."""
    counts: list[int] = []

    def refusal(stops: Stops) -> MotorbusError | None:
        counts.append(stops(node.node))
        if counts[-1] == counts[0]:
            return None
        return RequestError(f"node {node.node} was stopped while its EEPROM was written", node=node.node)

    return refusal
