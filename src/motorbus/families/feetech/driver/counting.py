"""Counting over many turns as one setting: goals and position both, or neither.

Two things must agree, and a servo lets them disagree. Both position limits 0 make goals count over many turns (7.5 to
either side); bit 4 of the phase register makes the present position be told over many. With the first alone, as after
writing 0 to the limits of a shipped STS3215, nobody can say "stay where you are": the position names no turn.

The phase register belongs to one servo: its other bits are its direction, its bridge, its units, and the value of
another servo has ruined some (iotdesignshop/Feetech-tuna#2). So nobody can write it by name, and here it is read twice,
one bit of it is set or cleared, and the whole byte is read back; whatever goes wrong, what was there is put back. The
order of the two writes is such that a supply which fails between them never leaves the first without the second.

The turns themselves are RAM: a power cycle loses them, and the machine has to be homed again.
Source: FEETECH notes on special bytes of STS and HLS servos (bit 4: angle feedback over one turn or in full; that SMBL
has the same is taken from its map, which is laid out alike); STS3215 memory table V3.6 (both limits 0, ±30719, count
lost at power-off); lerobot#3373 (which clears that bit on STS3215 before it calibrates).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from motorbus.core.register import RegisterMap
from motorbus.core.request import Effect, Priority, Request, TimeoutClass
from motorbus.core.steps import catch, with_cleanup
from motorbus.errors import RequestError, VerificationFailed
from motorbus.families.feetech.driver import eeprom
from motorbus.families.feetech.driver.exchanges import PRESENT, Block, confirmed, read_block
from motorbus.families.feetech.driver.identity import learn, writable
from motorbus.families.feetech.driver.node import IMAGE, Node
from motorbus.families.feetech.driver.orders import unheeded
from motorbus.families.feetech.driver.torque import disable_torque
from motorbus.families.feetech.table import CONTROL, Mode
from motorbus.families.feetech.table.phase import many_turns_are_told, with_many_turns_told

_FORGETS: Final = "it forgets its turns whenever its supply goes: home the machine after every power-up"


class ManyTurns(NamedTuple):
    """How a servo counts.

    `goals`      its goals count over many turns: both its limits are 0
    `told`       its position is told over many turns: bit 4 of its phase register is set
    `limits`     lowest and highest position that it can be sent to, in rad
    `position`   where it stands, in rad, as it tells it
    `raw_phase`  its phase register
    """

    goals: bool
    told: bool
    limits: tuple[float, float] | None
    position: float
    raw_phase: int

    @property
    def on(self) -> bool:
        """Both count over many turns."""
        return self.goals and self.told

    @property
    def off(self) -> bool:
        """Neither does."""
        return not self.goals and not self.told


class Recounted(NamedTuple):
    """What `set_many_turns` did: how the servo counted before and after, and what is to be done about it now."""

    before: ManyTurns
    after: ManyTurns
    note: str


class _Change(NamedTuple):
    """Registers that are to be changed: what they hold, and what they shall hold."""

    address: int
    before: bytes
    after: bytes


async def many_turns(node: Node) -> ManyTurns:
    """How this servo counts, asked anew; changes nothing. Raises RequestError where its map has one turn only."""
    image = await _image(node)
    table = await writable(node)
    _refuse_one_turn(node, table)
    return await _counts(node, table, image)


async def set_many_turns(node: Node, on: bool, limits: tuple[float, float] | None = None) -> Recounted:
    """Let goals and position count over many turns, for good, or within one; the servo goes limp and stays so.

    On: both position limits become 0 and bit 4 of its own phase register is set, the other bits staying as they are.
    Off: the bit is cleared, and `limits` (rad, the lower one first) hold again; they may be left out where it has
    limits. Afterwards `enable_torque` begins where it stands. It forgets its turns at power-off: home it again.

    Raises RequestError, with nothing changed, for maps of one turn only (SMCL, SCS), in other than position mode, for
    limits it cannot have, and off without limits where it has none. When something goes wrong on the way it is put
    back as it was, and a note of the error says whether that has succeeded: VerificationFailed when a register reads
    back different, OutcomeUnknown when the servo has lost its supply meanwhile, NoReply when it is silent.
    """
    if not isinstance(on, bool):
        raise RequestError(f"{on!r} is neither True nor False", advice="nothing was sent", node=node.node)
    image = await _image(node)
    table = await writable(node)
    _refuse_one_turn(node, table)
    if node.known_mode is not Mode.POSITION:
        raise unheeded(node, Mode.POSITION, "cannot be told over how many turns it counts")
    before = await _counts(node, table, image)
    raws = _limits(node, table, on, limits, before)
    await eeprom.unlocked(node, table, lambda: _recounted(node, table, on, raws, image))
    after = await _counts(node, table, await _image(node))
    return Recounted(before, after, f"it is limp now; {_FORGETS}" if on else "it is limp now")


def _image(node: Node) -> Request[bytes]:
    """Registers 0 to 39, from which the node learns what it is and how it is set."""

    def take(image: bytes) -> bytes:
        learn(node, image)
        return image

    return read_block(node, 0, IMAGE, take)


def _counts(node: Node, table: RegisterMap, image: bytes) -> Request[ManyTurns]:
    row, position = table["phase"], table["present_position"]

    def take(data: bytes) -> ManyTurns:
        assert node.settings is not None
        phase = row.decode(image[row.address : row.address + row.size])
        here = float(node.value(position, position.decode(data)))
        told = many_turns_are_told(phase, table.name)
        return ManyTurns(node.settings.many_turns, told, node.limits, here, phase)

    return read_block(node, PRESENT, position.size, take)


# -- what is to be done --------------------------------------------------------------------------------------


def _limits(
    node: Node, table: RegisterMap, on: bool, limits: tuple[float, float] | None, before: ManyTurns
) -> tuple[int, int]:
    """Both limits as they shall be, raw. They count as goals do, whatever the angular resolution."""
    if on:
        if limits is not None:
            raise RequestError(
                f"node {node.node} is to count over many turns, which limits of 0 say: it can have no others",
                advice="leave limits out; nothing was sent",
                node=node.node,
            )
        return 0, 0
    wished = limits if limits is not None else before.limits
    if wished is None or (limits is None and before.goals):
        raise _limits_wanted(node, table)
    low, high = table["min_position_limit"], table["max_position_limit"]
    goal = table["goal_position"]
    raws = node.raw(goal, wished[0]), node.raw(goal, wished[1])
    if not (low.low <= raws[0] <= low.high and raws[1] <= high.high and raws[0] < raws[1]):
        raise _no_limits(node, table, wished)
    return raws


def _refuse_one_turn(node: Node, table: RegisterMap) -> None:
    if node.control.many_turns:
        return
    raise RequestError(
        f"node {node.node} counts within one turn: no servo with the register map {table.name} is known to count more",
        expected=f"a servo with one of the maps {', '.join(n for n, c in CONTROL.items() if c.many_turns)}",
        advice="nothing was sent",
        node=node.node,
    )


def _limits_wanted(node: Node, table: RegisterMap) -> RequestError:
    return RequestError(
        f"node {node.node} counts over many turns, so it has no limits, and nobody here knows which it shall have",
        expected=f"limits=(low, high), in rad; {_widest(node, table)}",
        advice="give limits that what it moves can bear; nothing was sent",
        node=node.node,
    )


def _no_limits(node: Node, table: RegisterMap, wished: tuple[float, float]) -> RequestError:
    return RequestError(
        f"node {node.node}: limits {wished[0]} to {wished[1]} rad are none",
        expected=f"the lower one first; {_widest(node, table)}",
        advice="nothing was sent",
        node=node.node,
    )


def _widest(node: Node, table: RegisterMap) -> str:
    """The limits it ships with, or the widest it can have where that has not been published."""
    rows = table["min_position_limit"], table["max_position_limit"]
    defaults = [row.default for row in rows if row.default is not None]
    raws = defaults if len(defaults) == len(rows) else [rows[0].low, rows[1].high]
    low, high = (float(node.value(table["goal_position"], raw)) for raw in raws)
    return f"{'shipped' if raws is defaults else 'the widest'} are {low:.4g} to {high:.4g}"


# -- doing it ------------------------------------------------------------------------------------------------


async def _recounted(node: Node, table: RegisterMap, on: bool, limits: tuple[int, int], image: bytes) -> None:
    row, low, high = (table[name] for name in ("phase", "min_position_limit", "max_position_limit"))
    seen = image[low.address : row.address + row.size]
    again = await read_block(node, low.address, len(seen), bytes, timeout=TimeoutClass.STORE)
    if again != seen:
        raise _unsteady(node, low.address, seen, again)
    phase = image[row.address]
    bit = _Change(row.address, row.encode(phase), row.encode(with_many_turns_told(phase, on)))
    wide = low.size + high.size
    bounds = _Change(low.address, seen[:wide], low.encode(limits[0]) + high.encode(limits[1]))
    await _changed(node, table["lock"].address, (bit, bounds) if on else (bounds, bit))


async def _changed(node: Node, lock: int, changes: Sequence[_Change]) -> None:
    """All of these while the lock is open, each read back; or none of them."""
    begun: list[_Change] = []
    trouble: list[BaseException] = []
    await with_cleanup(
        _attempt(node, lock, changes, begun, trouble), lambda: _put_back(node, lock, begun, trouble)
    )


async def _attempt(
    node: Node, lock: int, changes: Sequence[_Change], begun: list[_Change], trouble: list[BaseException]
) -> None:
    try:
        for change in changes:
            await eeprom.still_open(node, lock)
            begun.append(change)
            await eeprom.stored(node, Block(change.address, change.after, Effect.PERSISTENT))
        await eeprom.still_open(node, lock)
        begun.clear()
    except BaseException as error:
        trouble.append(error)
        raise


async def _put_back(node: Node, lock: int, begun: list[_Change], trouble: Sequence[BaseException]) -> None:
    """What was there before, where something has gone wrong: the last one first, and each is tried."""
    if not begun:
        return
    restored = True
    for change in reversed(begun):
        restored &= await catch(_restored(node, lock, change)) is None
    if restored:
        told = "its limits and its phase register are as they were"
    else:
        were = ", ".join(f"{one.before.hex(' ')} from register {one.address} on" for one in begun)
        told = f"it could not be put back as it was: {were} (hex); many_turns() tells what it has now"
    for error in trouble[:1]:
        error.add_note(told)


async def _restored(node: Node, lock: int, change: _Change) -> None:
    """Open the lock again, for whoever has lost its supply has closed it, let it go limp once more, for it may have
    begun with torque on, and write what was there."""
    opened = Block(lock, b"\0", Effect.PERSISTENT)
    await confirmed(node, opened, priority=Priority.CONFIGURATION, timeout=TimeoutClass.STORE)
    await disable_torque(node)
    await eeprom.stored(node, Block(change.address, change.before, Effect.PERSISTENT))


def _unsteady(node: Node, address: int, seen: bytes, again: bytes) -> VerificationFailed:
    return VerificationFailed(
        f"node {node.node}: registers {address} to {address + len(seen) - 1} read different the second time",
        received=f"{seen.hex(' ')}, then {again.hex(' ')}",
        expected="the same twice, for all other bits of its phase register are to stay as they are",
        cause="another program writes to this servo, or two servos answer to this id",
        advice="connect one servo and close other programs on this bus; nothing was changed",
        node=node.node,
    )
