"""Give a servo another id or baud rate, and end a change that was cut off.

One EEPROM cell changes. The servo is seen at its new address with all other registers as before and its lock still
open, then it is locked there: an acknowledgement may come from the old id, the new one or not at all. The journal has
the facts before the first write, so `recover` ends the change after a crash. It looks at the new address, the old one,
and where a servo with a torn cell starts (id 1, or a rate as shipped), unless another servo answered there before.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final, NamedTuple

from motorbus.core.family import Found, IdChanged
from motorbus.core.register import RegisterMap
from motorbus.core.request import Effect, Priority
from motorbus.core.scan import BitrateRestored
from motorbus.core.steps import (
    ASKED,
    INTENT,
    OUTCOME,
    REACHED,
    Emit,
    Exclusive,
    Guard,
    JournalEntry,
    SetBitrate,
    Sleep,
    with_cleanup,
)
from motorbus.errors import MotorbusError, NoReply, OutcomeUnknown, RequestError, WireError
from motorbus.families.feetech import protocol
from motorbus.families.feetech.driver.eeprom import Unlocked, close_lock
from motorbus.families.feetech.driver.identity import check_alone, learn, writable
from motorbus.families.feetech.driver.node import IMAGE, BusFacts, Node, checked_id
from motorbus.families.feetech.driver.requests import Block, read_block, unanswered
from motorbus.families.feetech.registers.codes import BAUD_CODES, BAUD_CODES_OF

ID, BAUD = 5, 6  # registers
SHIPPED_ID: Final = 1
SHIPPED_RATES: Final = (1_000_000, 115_200, 500_000)  # bit/s: STS and HLS, SMS, some SCS
CODES: Final = {rate: code for code, rate in BAUD_CODES.items()}
STORE_TIME: Final = 0.1  # s; a write to flash took more than 21 ms, feetech-cli waits 50 ms
ROUNDS: Final = 4
AWAKE: Final = 0.1  # s between two rounds: a servo that has just started is deaf for a while


class Address(NamedTuple):
    """Where a servo answers."""

    id: int
    rate: int  # bit/s


class AddressChange(NamedTuple):
    """A servo on its way from `old` to `new`. `image`: its registers 0 to 39 before; `taken`: addresses of others."""

    verb: str
    old: Address
    new: Address
    image: bytes = b""
    taken: tuple[Address, ...] = ()

    @property
    def cell(self) -> int:
        """The register that changes."""
        return ID if self.verb == "set_id" else BAUD

    @property
    def places(self) -> list[Address]:
        """Where the servo may be, once the change has begun."""
        torn = [Address(SHIPPED_ID, self.old.rate)]
        if self.cell == BAUD:
            torn = [Address(self.old.id, rate) for rate in SHIPPED_RATES]
        return [place for place in dict.fromkeys((self.new, self.old, *torn)) if place not in self.taken]

    @property
    def table(self) -> RegisterMap:
        """The register map of the servo."""
        table = known(self.old.id, self.image).table
        assert table is not None
        return table

    @property
    def second(self) -> int:
        """Address of the second id (HLS) if it is the old id, and so becomes the new one; else 0."""
        if self.cell != ID or "second_id" not in self.table:
            return 0
        address = self.table["second_id"].address
        return address if self.image[address] == self.old.id else 0

    def value(self, place: Address) -> bytes:
        """What the register holds for this address."""
        return bytes((place.id if self.cell == ID else CODES[place.rate],))

    def is_it(self, image: bytes) -> bool:
        """Whether these registers may be of the same servo: model and firmware.

        Settings written behind a closed lock go with the supply, so settings do not count.
        """
        return image[:ID] == self.image[:ID]

    def facts(self) -> dict[str, object]:
        """For the journal."""
        return {
            "node": self.old.id,
            "rate": self.old.rate,
            "new": self.new.id,
            "new_rate": self.new.rate,
            "registers": self.image.hex(),
            "taken": [list(place) for place in self.taken],
        }


def from_facts(verb: str, facts: Mapping[str, Any]) -> AddressChange:
    """The change of a journal entry. Raises RequestError for anything else."""
    try:
        old, new = Address(facts["node"], facts["rate"]), Address(facts["new"], facts["new_rate"])
        taken = tuple(Address(*place) for place in facts["taken"])
        change = AddressChange(verb, old, new, bytes.fromhex(facts["registers"]), taken)
        if verb not in ("set_id", "set_baud") or len(change.image) != IMAGE:
            raise ValueError(verb)
        change.value(old), change.value(new), known(old.id, change.image)
    except (KeyError, TypeError, ValueError) as error:
        raise RequestError(f"no facts of a set_id() or set_baud(): {error!r}") from error
    return change


async def set_id(node: Node, new: int) -> Found:
    """Give this servo the id `new` (0 to 253) permanently; it goes limp. Errors as `set_baud`."""
    rate = await SetBitrate(0)
    return await _change(node, "set_id", Address(checked_id(new), rate))


async def set_baud(node: Node, rate: int) -> Found:
    """Let this servo speak at `rate` bit/s permanently; it goes limp. The bus keeps its own rate.

    Raises RequestError (nothing was written) for a rate that its map lacks, an address that answers, two servos with
    the old id, an unfinished change on this bus; OutcomeUnknown or VerificationFailed with a note what became of it.
    """
    if rate not in CODES:
        raise node.refusal(f"cannot have {rate} bit/s", expected=", ".join(map(str, CODES)))
    table = await _writable(node)
    if CODES[rate] not in BAUD_CODES_OF[table.name]:
        raise node.refusal(f"has the map {table.name}, which has no code for {rate} bit/s")
    return await _change(node, "set_baud", Address(node.node, rate))


async def _change(node: Node, verb: str, new: Address) -> Found:
    await Emit(JournalEntry(verb, ASKED, {}))
    table = await _writable(node)
    assert node.identity is not None
    found = Found(new.id, new.rate, replace(node.identity, node=new.id))
    old = Address(node.node, await SetBitrate(0))
    if old == new:
        await Exclusive(close_lock(node, table["lock"].address))
    else:
        await Exclusive(_plan_and_move(node, AddressChange(verb, old, new)))
    return found


async def _writable(node: Node) -> RegisterMap:
    try:
        return await writable(node)
    except WireError:
        await check_alone(node)  # raises if the replies are those of two servos
        raise


async def _plan_and_move(node: Node, change: AddressChange) -> None:
    change = change._replace(image=await check_alone(node))
    async with BitrateRestored():
        taken = [place for place in change.places if place != change.old and await look(place)]
        for id, other in node.facts.servos.items() if change.cell == ID else ():
            if other.second_id == change.new.id and id != node.node:
                raise node.refusal(f"cannot move: servo {id} obeys {change.new.id} as its second id")
        if change.new in taken:
            raise node.refusal(f"cannot move: the id {change.new.id} is taken at {change.new.rate} bit/s")
    move = _Move(change._replace(taken=tuple(taken)), node.facts)
    try:
        async with move:
            await move_to(move.change, change.old, change.new, node.facts)
    except MotorbusError:
        if move.end != "new":
            raise
    finally:
        _forget(node.facts, change)


def _forget(facts: BusFacts, change: AddressChange) -> None:
    for id in (change.old.id, change.new.id):
        facts.servos[id].forget(written=True)


class _Move(Guard):
    """A change between its intent and its outcome in the journal; whatever happens, the servo is at one address."""

    def __init__(self, change: AddressChange, facts: BusFacts) -> None:
        self.change, self.facts = change, facts
        self.end = ""  # "new" or "old"

    async def enter(self) -> None:
        change = self.change
        if change.old.id != change.new.id:
            await Emit(IdChanged(change.old.id, change.new.id))
        await Emit(JournalEntry(change.verb, INTENT, change.facts()))

    async def leave(self, error: BaseException | None) -> None:
        change = self.change
        if error is None:
            await SetBitrate(change.old.rate)
            self.end = "new"
        else:
            self.end = await with_cleanup(settle(change, self.facts), lambda: SetBitrate(change.old.rate))
            error.add_note(f"the servo is at its {self.end} address, locked")
        await Emit(JournalEntry(change.verb, OUTCOME, {"outcome": self.end, "node": change.old.id}))


async def recover(node: Node, change: str, facts: Mapping[str, Any]) -> str:
    """End a change that was cut off, see the journal; "new" or "old", locked. May be called again.

    Raises NoReply if the servo is at none of its addresses: scan all rates; OutcomeUnknown if two servos could be it.
    """
    move = from_facts(change, facts)

    async def work() -> str:
        async with BitrateRestored():
            reached = {**move.facts(), REACHED: list(facts.get(REACHED, ()))}
            await Emit(JournalEntry(move.verb, "recovering", reached))
            end = await settle(move, node.facts)
        await Emit(JournalEntry(move.verb, OUTCOME, {"outcome": end, "node": move.old.id}))
        return end

    try:
        return await Exclusive(work())
    finally:
        _forget(node.facts, move)


async def settle(change: AddressChange, facts: BusFacts) -> str:
    """Find the servo, write the address that it is to have with the lock open, and lock it: "new" or "old"."""
    last: MotorbusError | None = None
    for _ in range(ROUNDS):
        try:
            found = [place for place in change.places if change.is_it(await look(place))]
            if len(found) > 1:
                where = " and ".join(f"id {place.id} at {place.rate} bit/s" for place in found)
                raise RequestError(
                    f"two servos could be the one that was {change.old.id}: {where}",
                    advice="connect one of them alone, then recover again",
                )
            for place in found:
                goal = change.new if place == change.new else change.old
                await move_to(change, place, goal, facts)
                return "new" if goal == change.new else "old"
        except (NoReply, WireError, OutcomeUnknown) as error:
            last = error
        await Sleep(AWAKE)
    what = f"the servo that was {change.old.id} is at neither address"
    raise last or NoReply(what, advice="scan all rates")


async def move_to(change: AddressChange, here: Address, there: Address, facts: BusFacts) -> None:
    """Unlock, torque off, write the cell, see the servo at `there` unchanged and still unlocked, lock it."""
    await SetBitrate(here.rate)
    # No `async with`: after a failure `settle` finds the servo at one of the addresses and locks it there.
    unlocked = Unlocked(known(here.id, change.image, facts), change.table)
    await unlocked.enter()
    wire = protocol.write(here.id, change.cell, change.value(there))
    await unanswered(wire, Effect.IDENTITY, priority=Priority.CONFIGURATION)
    await Sleep(STORE_TIME)
    unlocked.node = known(there.id, change.image, facts)
    image = await look(there)
    if not change.is_it(image) or image[change.cell : change.cell + 1] != change.value(there):
        what = f"node {change.old.id} is not seen unchanged at id {there.id}, {there.rate} bit/s"
        raise OutcomeUnknown(what, node=change.old.id)
    if change.second:  # or it would obey its former id
        await unlocked.write(Block(change.second, bytes((there.id,))), b"")
        await Sleep(STORE_TIME)
    await unlocked.check_open()
    await close_lock(unlocked.node, unlocked.lock)


async def look(place: Address) -> bytes:
    """Registers 0 to 39 of the servo at this address; b"" for silence."""
    await SetBitrate(place.rate)
    try:
        return await read_block(Node(place.id), 0, IMAGE, bytes)
    except NoReply:
        return b""


def known(id: int, image: bytes, facts: BusFacts | None = None) -> Node:
    """A servo of which these registers were read."""
    node = Node(id, facts)
    learn(node, image)
    return node
