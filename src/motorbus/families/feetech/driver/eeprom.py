"""Writing what survives power-off: unlock, torque off, write, read back, and always lock again.

The lock comes first because it tells of a restart: a servo that loses its supply for a moment has it closed again, and
some begin with torque on. As long as it is found open, the torque that was switched off behind it is off. That is
looked at directly before every write that would move a servo with torque, and once more in the end; when anything has
gone wrong, the torque is switched off again.

A REG WRITE that waits survives all of this, and an ACTION, of whomever, would carry it out with the meaning that it has
afterwards. So one that waits is replaced by one that moves nothing: torque off.

An open lock makes every later write permanent without anybody noticing, so whatever happens in between (an error,
Ctrl-C, a cancelled task) the last thing this sequence says is "lock". The lock decides whether a write survives,
not whether it is taken; and flash takes time, so these exchanges may take TimeoutClass.STORE.

Cells wear, so what they hold already is not written again (`store`).

A caller that passes `Torque` gets the torque back that this sequence took: goal := present position and torque on, also
when the write has failed. It stays off when another stop has left for this servo meanwhile, or when it has restarted.
Source: STS3215 memory table V3.6; measured on hardware by feetech-cli (what the lock does) and by public recovery
tools (an acknowledgement may take more than 21 ms).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, TypeVar

from motorbus.core.register import Register, RegisterMap, Storage
from motorbus.core.request import Effect, Priority, Stops, TimeoutClass
from motorbus.core.setpoint import Deferred
from motorbus.core.steps import Emit, Exclusive, Procedure, catch, with_cleanup
from motorbus.errors import MotorbusError, OutcomeUnknown, RequestError
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
from motorbus.families.feetech.driver.rest import is_limp, torque_on_unless
from motorbus.families.feetech.driver.torque import LIMP, disable_torque, limp

T = TypeVar("T")


class TorqueAfterWrite(NamedTuple):
    """An event for `Emit`: a servo that had torque before a write to EEPROM has it again, or not, and why."""

    node: int
    on: bool
    why: str = ""

    def __str__(self) -> str:
        if self.on:
            return f"node {self.node}: torque is on again, goal := present position"
        return f"node {self.node}: torque was on before the write and is off now: {self.why}"


class Torque:
    """The torque that a guarded write takes and gives back.

    `stays_off`: why it must not be given back, "" where it may.
    """

    def __init__(self, stays_off: str = "") -> None:
        self.stays_off = stays_off
        self.was_on = False
        self.opened = False
        self._node = 0
        self._stops = -1

    async def taken(self, node: Node) -> None:
        """Torque off again, and remember how many stops have left for this servo. Refused when others left since."""
        self._node = node.node
        block = limp(node.node)._replace(refusal=self._count)
        await confirmed(node, block, priority=Priority.CONFIGURATION)

    def _count(self, stops: Stops) -> MotorbusError | None:
        if self._stops < 0:
            self._stops = stops(self._node)
        return self.refusal(stops)

    def refusal(self, stops: Stops) -> MotorbusError | None:
        """The error when another stop has left for this servo since its torque was taken."""
        if stops(self._node) <= self._stops:
            return None
        return RequestError(
            "it was stopped while its EEPROM was written",
            advice="enable_torque() switches its torque on",
            node=self._node,
        )


_STATUS_RETURN_LEVEL: Final = 8
_ATTEMPTS: Final = 2
_LIMITS: Final = ("min_position_limit", "max_position_limit")
_OPEN: Final = b"\0"
_IDLE: Final = b"\0"


class Change(NamedTuple):
    """Adjoining EEPROM registers that do not hold yet what they shall, and what they hold."""

    block: Block
    before: bytes


async def store(
    node: Node,
    table: RegisterMap,
    blocks: Sequence[Block],
    *,
    always: bool = False,
    torque: Torque | None = None,
) -> bool:
    """Make these EEPROM registers hold this for good, with nobody else on the bus meanwhile; gives whether it wrote.

    They are read first, and only those are written that hold something else; when none does, there is no unlock and no
    torque off either, and the lock is merely seen closed (and closed, if others have left it open).

    What reads back need not be what is kept: a write with the lock closed is obeyed and gone at power-off, and no
    register tells the two apart. So what this node wrote in a sequence that did not come to its end is written whatever
    it reads; what other programs wrote behind a closed lock cannot be known, and `always` is for whoever suspects that.

    With `torque` the servo gets back the torque that this takes from it, and `TorqueAfterWrite` is reported.
    """
    return await Exclusive(_stored_unlike(node, table, blocks, always, torque))


async def _stored_unlike(
    node: Node, table: RegisterMap, blocks: Sequence[Block], always: bool, torque: Torque | None
) -> bool:
    lock = table["lock"].address
    changes: list[Change] = []
    for block in blocks:
        changes += await _unlike(node, table, block, always)
    if not changes:
        if await read_block(node, lock, 1, bytes, timeout=TimeoutClass.STORE) == _OPEN:
            await _locked(node, lock, (), (), Torque())
        return False
    begun: list[Change] = []

    async def write() -> None:
        for change in changes:
            if moves(table, change.block):
                await still_open(node, lock)
            begun.append(change)
            block = change.block._replace(effect=Effect.PERSISTENT)  # it is limp: nothing can move
            await stored(node, block)

    if torque is not None:
        torque.was_on = not await is_limp(node)
    await _guarded(node, table, write, begun, torque or Torque())
    return True


async def _unlike(node: Node, table: RegisterMap, block: Block, always: bool) -> list[Change]:
    """The runs of whole registers in this block that are to be written; RAM, which wears nothing, as it is given."""
    rows = sorted(rows_in(table, block), key=lambda row: row.address)
    if not any(row.storage is Storage.EEPROM for row in rows):
        return [Change(block, b"")]
    found = await read_block(node, block.address, len(block.data), bytes, timeout=TimeoutClass.STORE)
    if always:
        return [Change(block, found)]
    runs: list[range] = []
    for row in rows:
        at = range(row.address - block.address, row.address - block.address + row.size)
        cells = slice(at.start, at.stop)
        sure = node.unsure.isdisjoint(range(row.address, row.address + row.size))
        if sure and block.data[cells] == found[cells]:
            continue
        if runs and runs[-1].stop == at.start:
            at = range(runs.pop().start, at.stop)
        runs.append(at)
    return [
        Change(
            block._replace(address=block.address + at.start, data=block.data[at.start : at.stop]),
            found[at.start : at.stop],
        )
        for at in runs
    ]


async def unlocked(node: Node, table: RegisterMap, work: Callable[[], Procedure[T]]) -> T:
    """Carry out `work` on a limp servo whose lock is open, with nobody else on the bus; the lock is closed again.

    Its settings are forgotten before anybody else has the bus again, so what others made by them meanwhile is refused.
    """
    return await Exclusive(_guarded(node, table, work, (), Torque()))


async def _guarded(
    node: Node, table: RegisterMap, work: Callable[[], Procedure[T]], begun: Sequence[Change], torque: Torque
) -> T:
    lock, pending = table["lock"].address, table["reg_write_pending"].address
    trouble: list[BaseException] = []
    doubted, node.unsure = node.unsure, set()
    try:
        done = await with_cleanup(
            _opened(node, lock, pending, work, trouble, torque),
            lambda: _locked(node, lock, trouble, begun, torque),
        )
        doubted, node.unsure = doubted - node.unsure, set()
        return done
    finally:
        node.unsure |= doubted
        node.forget_settings()


def rows_in(table: RegisterMap, block: Block) -> list[Register]:
    """The rows that begin in this block."""
    end = block.address + len(block.data)
    return [row for row in table.values() if block.address <= row.address < end]


def moves(table: RegisterMap, block: Block) -> bool:
    """Whether one of the registers of this block would move a servo that has torque, which goes back inside limits."""
    return any(row.effect is Effect.MOTION or row.name in _LIMITS for row in rows_in(table, block))


async def _opened(
    node: Node,
    lock: int,
    pending: int,
    work: Callable[[], Procedure[T]],
    trouble: list[BaseException],
    torque: Torque,
) -> T:
    try:
        await _put(node, _lock(lock, 0))
        torque.opened = True
        if not torque.was_on:
            await disable_torque(node)
        else:
            if await is_limp(node):
                torque.stays_off = "another caller has switched it off"
            await torque.taken(node)
        await _harmless(node, pending)
        done = await work()
        await still_open(node, lock)
        return done
    except BaseException as error:
        trouble.append(error)
        raise


async def _harmless(node: Node, pending: int) -> None:
    """See that no REG WRITE waits that would do more than switch torque off."""
    if await read_block(node, pending, 1, bytes, timeout=TimeoutClass.STORE) != _IDLE:
        request = wire.reg_write(node.node, LIMP.address, LIMP.data)
        block = Block(LIMP.address, LIMP.data)
        await acknowledged(node, request, block, priority=Priority.CONFIGURATION, later=Deferred(node.node))


async def still_open(node: Node, lock: int) -> None:
    """A servo that has lost its supply meanwhile comes back with its lock closed: it then takes every write, reads back
    right, and keeps none. Raises OutcomeUnknown, also when that cannot be found out."""
    try:
        found = await read_block(node, lock, 1, bytes, timeout=TimeoutClass.STORE)
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


async def stored(node: Node, block: Block) -> None:
    """Write one block while the lock is open (see `unlocked`), and read it back."""
    node.unsure.update(
        range(block.address, block.address + len(block.data))
    )  # until the lock was seen to the end
    await _put(node, block)
    if block.address <= _STATUS_RETURN_LEVEL < block.address + len(block.data):
        node.forget_settings()  # from now on it may acknowledge differently
    await verified(node, block, timeout=TimeoutClass.STORE)


async def _put(node: Node, block: Block) -> None:
    await confirmed(node, block, priority=Priority.CONFIGURATION, timeout=TimeoutClass.STORE)


async def _locked(
    node: Node, lock: int, trouble: Sequence[BaseException], begun: Sequence[Change], torque: Torque
) -> None:
    """Close the lock and see that it is closed. When something has gone wrong already, that is what is raised, and
    a lock that cannot be closed is told with it; whoever may have restarted with torque on is let go before, and what
    it took behind a lock that closed by itself is taken back."""
    if trouble:
        if torque.was_on:
            await _still_ours(node, lock, torque)
        is_off = torque.was_on and not torque.stays_off  # `taken` has just been acknowledged
        if (is_off or await catch(disable_torque(node)) is None) and begun:
            await catch(_taken_back(node, lock, begun))
    for _ in range(_ATTEMPTS):
        failure = await catch(_closed(node, lock))
        if failure is None:
            await _torque_restored(node, trouble, torque)
            return
    assert failure is not None
    torque.stays_off = torque.stays_off or "its EEPROM lock may be open"
    await _torque_restored(node, trouble or [failure], torque)
    if not trouble:
        raise failure
    trouble[0].add_note(
        f"the EEPROM lock of node {node.node} may still be open, which makes later writes permanent: "
        f"write(lock=1) closes it ({failure.summary})"
    )


async def _still_ours(node: Node, lock: int, torque: Torque) -> None:
    """After a failure: may the torque be given back? Not after a stop of another caller, nor after a restart."""
    stopped = await catch(torque.taken(node))
    if stopped is not None:
        torque.stays_off = torque.stays_off or stopped.summary
    if torque.opened:
        torque.opened = False  # this may run again after an interrupt, when the lock is closed
        found = await catch(read_block(node, lock, 1, bytes, timeout=TimeoutClass.STORE))
        if found != _OPEN:
            torque.stays_off = torque.stays_off or "it has restarted, or does not answer"


async def _torque_restored(node: Node, trouble: Sequence[BaseException], torque: Torque) -> None:
    """Goal := present position and torque on where the torque was on; the outcome is reported, or noted on an error."""
    if not torque.was_on:
        return
    why = torque.stays_off
    if not why:
        failure = await catch(torque_on_unless(node, torque.refusal))
        why = "" if failure is None else failure.summary
    event = TorqueAfterWrite(node.node, not why, why)
    if trouble:
        trouble[0].add_note(str(event))
    else:
        await Emit(event)


async def _taken_back(node: Node, lock: int, begun: Sequence[Change]) -> None:
    """Where the lock has closed by itself, registers that hold for now what they do not keep become what they were:
    or whoever applies the same again, another program as well, would find it there and write nothing."""
    if await read_block(node, lock, 1, bytes, timeout=TimeoutClass.STORE) == _OPEN:
        return
    for change in reversed([one for one in begun if one.before]):
        await _put(node, change.block._replace(data=change.before, effect=Effect.PERSISTENT))


async def _closed(node: Node, lock: int) -> None:
    await _put(node, _lock(lock, 1))
    await verified(node, _lock(lock, 1), timeout=TimeoutClass.STORE)


def _lock(address: int, value: int) -> Block:
    return Block(address, bytes((value,)), Effect.PERSISTENT)
