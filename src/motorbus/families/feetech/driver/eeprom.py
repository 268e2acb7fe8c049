"""Write registers that survive power-off: open the lock, torque off, write, read back, close the lock.

A servo that loses its supply for a moment comes back with its lock closed, and takes every later write without keeping
it. So the lock must still be open after the last write. Cells wear: equal values are not written again. Source: STS3215
memory table V3.6; feetech-cli, measured on hardware; recovery tools (an acknowledgement takes 21 ms).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from motorbus.core.register import RegisterMap
from motorbus.core.request import Effect, Stops
from motorbus.core.steps import Emit, Exclusive, Guard, catch
from motorbus.errors import LinkError, MotorbusError, OutcomeUnknown, RequestError
from motorbus.families.feetech.driver.motion import disable_torque, is_limp, limp, torque_on_unless
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.requests import STORE, Block, confirmed, read_block, verified

OPEN: Final = b"\0"
CLOSED: Final = b"\1"
ATTEMPTS: Final = 2


class TorqueAfterWrite(NamedTuple):
    """An event: a servo that had torque before a write to EEPROM has it again, or not, and why."""

    node: int
    on: bool
    why: str = ""


class Unlocked(Guard):
    """The EEPROM lock is open and torque off inside the block; then the lock is closed and read back.

    After an error the registers get their former values, also behind a lock that closed by itself: they would read as
    written until power-off.
    """

    def __init__(self, node: Node, table: RegisterMap) -> None:
        self.node = node
        self.lock = table["lock"].address
        self.before: list[Block] = []  # what the registers held that were written
        self.stops: int | None = None

    async def enter(self) -> None:
        await confirmed(self.node, Block(self.lock, OPEN, Effect.PERSISTENT), timeout=STORE)
        await disable_torque(self.node)

    async def leave(self, error: BaseException | None) -> None:
        self.node.forget_settings(written=True)
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
        found = await read_block(self.node, self.lock, 1, bytes, timeout=STORE)
        if found != OPEN:
            raise OutcomeUnknown(
                f"node {self.node.node} has closed its EEPROM lock by itself",
                cause="it lost its supply for a moment; what was written may be gone at the next power-off",
                advice="check the supply, then write again",
                node=self.node.node,
            )

    def stopped(self, stops: Stops) -> MotorbusError | None:
        """The error if a stop has left for this servo since the first call."""
        now = stops(self.node.node)
        if self.stops is None:
            self.stops = now
        if now == self.stops:
            return None
        return RequestError("it was stopped while its EEPROM was written", node=self.node.node)


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
    unless a stop came meanwhile, and `TorqueAfterWrite` is reported. `force` writes equal values too: another program
    may have written them behind a closed lock, so that power-off loses them. Raises VerificationFailed, OutcomeUnknown.
    """
    return await Exclusive(_store(node, table, blocks, force, keep_torque))


async def _store(
    node: Node, table: RegisterMap, blocks: Sequence[Block], force: bool, keep_torque: bool
) -> bool:
    changes = []
    for block in blocks:
        found = await read_block(node, block.address, len(block.data), bytes, timeout=STORE)
        if force or found != block.data:
            block = block._replace(effect=Effect.PERSISTENT)  # nothing moves: torque is off
            changes.append((block, block._replace(data=found)))
    unlocked = Unlocked(node, table)
    if not changes:
        if await read_block(node, unlocked.lock, 1, bytes, timeout=STORE) == OPEN:
            await close_lock(node, unlocked.lock)
        return False
    held = keep_torque and not await is_limp(node)
    level = table["status_return_level"].address

    async def write_all() -> None:
        async with unlocked:
            if held:
                await confirmed(node, limp(node)._replace(unless=unlocked.stopped))  # counts the stops so far
            for block, before in changes:
                unlocked.before.append(before)
                await confirmed(node, block, timeout=STORE)
                if block.address <= level < block.address + len(block.data):
                    node.forget_answers()
                await verified(node, block, timeout=STORE)
            await unlocked.check_open()

    error = await catch(write_all())
    if held:
        failure = await catch(torque_on_unless(node, unlocked.stopped))
        await Emit(TorqueAfterWrite(node.node, failure is None, failure.summary if failure else ""))
    if error is not None:
        raise error
    return True
