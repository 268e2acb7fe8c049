"""Give a servo its id and its bit rate, from the first read to the check after the restart.

A new id or rate takes effect after a save and a restart; the save has no reply; no command restarts a servo, so the
user does; two servos with one id cannot be distinguished afterwards; power may fail at any moment. So the state is
always found by reading: a call after an interrupt continues from the present state. "Saved" is reported only when the
servo has come back with the new values. Source: KST CAN protocol manual, commands 1 to 4.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final, NamedTuple, TypeVar

from motorbus.core.request import Priority
from motorbus.core.scan import BitrateRestored
from motorbus.core.steps import Emit, Exclusive, Procedure, Progress, SetBitrate, Sleep
from motorbus.errors import MotorbusError, NoReply, OutcomeUnknown, RequestError, VerificationFailed
from motorbus.families.kst.driver.identity import (
    Presence,
    answers_alone,
    id_taken,
    identify,
    look,
    survey,
    write_node_id,
)
from motorbus.families.kst.driver.node import Node, check_above_zero, checked_id, hexadecimal
from motorbus.families.kst.driver.requests import write_register
from motorbus.families.kst.driver.scan import broadcast_ids, set_named_rate
from motorbus.families.kst.driver.storage import save
from motorbus.families.kst.profiles import bit_rate_code

T = TypeVar("T")

TIMEOUT: Final = 120.0
"""s to wait for the power cycle."""
PERIOD: Final = 0.1
"""s between two reads while waiting."""
SILENT_READS: Final = 3
"""Reads without a reply in a row that count as a loss of power; a single one may be a lost frame."""
STEPS: Final = 4


class PowerCycleNeeded(NamedTuple):
    """An event: the servo has received the save; the user must take its supply away and give it back now."""

    node: int
    new_id: int
    new_rate: int


class Provisioned(NamedTuple):
    """A servo that has this id and rate (bit/s) after its restart; `resumed`: it had them when it was asked."""

    node: int
    rate: int
    firmware: str
    resumed: bool


class _Place(NamedTuple):
    """Where the servo answered, and the id that it read back when everything was written."""

    node: Node
    rate: int
    reads_back: int | None = None


async def set_id(node: Node, new: int, *, timeout: float = TIMEOUT) -> Provisioned:
    """Give this servo the id `new`, see `provision`."""
    return await provision(node, new_id=new, timeout=timeout)


async def set_baud(node: Node, rate: int, *, timeout: float = TIMEOUT) -> Provisioned:
    """Give this servo the bit rate `rate` (bit/s), see `provision`. The bus keeps its own rate."""
    return await provision(node, new_rate=rate, timeout=timeout)


async def provision(
    node: Node, *, new_id: int | None = None, new_rate: int | None = None, timeout: float = TIMEOUT
) -> Provisioned:
    """Give this servo another id, another bit rate (bit/s), or both, and wait until it comes back with them.

    Checks that one servo answers alone and that the new id is free; writes, reads back, saves; reports
    `PowerCycleNeeded`; waits at most `timeout` s; verifies. It may be called again at any point. At a new rate the
    adapter listens first.

    Raises RequestError (nothing is written) for an invalid id or rate, an id in use, two servos with one id, or
    another rate while other servos are on the bus; NoReply; VerificationFailed when it comes back with the old
    values, or beside another servo with its new id; OutcomeUnknown when it does not come back in time, or answers to
    both ids.
    """
    if new_id is None and new_rate is None:
        raise RequestError(
            "what shall it become?", expected="new_id=, new_rate=, or both", advice="nothing was sent"
        )
    check_above_zero("timeout", timeout, "s", node=node.node)
    new = node if new_id is None else Node(checked_id(new_id), node.settings)
    if new_rate is not None:
        bit_rate_code(new_rate)
    rate = await SetBitrate(0)
    change = _Change(node, new, rate, rate if new_rate is None else new_rate)
    place = await Exclusive(_at_own_rate(change.write))
    if place is not None:
        await Emit(PowerCycleNeeded(node.node, new.node, change.new_rate))
        await change.wait(place, timeout)
    await Emit(Progress(STEPS - 1, STEPS, "it is back: verifying"))
    return await Exclusive(_at_own_rate(partial(change.verify, place)))


async def _at_own_rate(procedure: Callable[[], Procedure[T]]) -> T:
    async with BitrateRestored():
        return await procedure()


class _Change:
    """The servo `old` at `rate` is to become `new` at `new_rate`."""

    def __init__(self, old: Node, new: Node, rate: int, new_rate: int) -> None:
        self.old = old
        self.new = new
        self.rate = rate
        self.new_rate = new_rate

    # -- write ---------------------------------------------------------------------------------------------------

    async def write(self) -> _Place | None:
        """Find the servo, write what is missing, save. None: it has everything already, nothing was written."""
        await Emit(Progress(0, STEPS, "looking who is there"))
        place = await self._find()
        before = await look(place.node)
        if (place.node.node, place.rate) == (self.new.node, self.new_rate):
            return None
        if place.rate != self.new_rate:
            await self._check_alone(place)
        await Emit(Progress(1, STEPS, f"writing to {hexadecimal(place.node.node)}"))
        if place.node.node != self.new.node or before.reads_back not in (None, self.new.node):
            await write_node_id(place.node, self.new.node)
        if place.rate != self.new_rate:
            row = place.node.table["bit_rate_code"]
            code = bit_rate_code(self.new_rate)
            await write_register(place.node, row, code, priority=Priority.CONFIGURATION)
        written = await look(place.node)
        await Emit(Progress(2, STEPS, "saving"))
        await save(place.node)
        return place._replace(reads_back=written.reads_back)

    async def _find(self) -> _Place:
        """The id and rate, of the old and the new ones, at which the servo answers now."""
        rates = dict.fromkeys((self.rate, self.new_rate))
        for rate in rates:
            if rate != self.rate:
                await set_named_rate(self.old.settings, rate)
            old = await answers_alone(self.old)
            new = old if self.new.node == self.old.node else await answers_alone(self.new)
            if old and new and self.new.node != self.old.node:
                raise id_taken(self.old.node, self.new.node)
            if old or new:
                return _Place(self.old if old else self.new, rate)
        ids = " or ".join(hexadecimal(node) for node in dict.fromkeys((self.old.node, self.new.node)))
        raise NoReply(
            f"no servo answers as {ids}",
            expected=f"one servo at {' or '.join(map(str, rates))} bit/s",
            cause="no power, a loose cable, another id, or another bit rate",
            advice="`motorbus scan BUS` lists who answers; nothing was written",
            node=self.old.node,
        )

    async def _check_alone(self, place: _Place) -> None:
        """A servo at another rate breaks the frames of the others."""
        answer = await broadcast_ids(self.old.settings.extended, Priority.POLL)
        others = sorted({reply.lane for reply in answer.replies} - {self.old.node, self.new.node})
        if others:
            raise RequestError(
                f"{hexadecimal(place.node.node)} is not alone: {', '.join(map(hexadecimal, others))} would stay at "
                f"{place.rate} bit/s",
                expected="this servo alone, where its bit rate changes",
                cause="servos at two rates on one bus break each other's frames",
                advice="connect it alone; all at once are changed by broadcast_bit_rate() and broadcast_save(); "
                "nothing was written",
                node=place.node.node,
            )

    # -- wait for the power cycle --------------------------------------------------------------------------------

    async def wait(self, place: _Place, timeout: float) -> None:
        """Read at the old place and the new one in turn until the servo answers at the new one only."""
        begun: float | None = None
        silent = 0
        while True:
            now = await self._look(place.node, place.rate)
            begun = now.at if begun is None else begun
            came_back = silent >= SILENT_READS and now.answered and not self._has_new_id_pending(place, now)
            silent = 0 if now.answered else silent + 1
            arrived = await self._has_arrived(place, now)
            if arrived and not now.answered:
                return
            if now.answered and (came_back or self._has_forgotten(place, now)):
                raise self._answers_at_both(place) if arrived else self._unchanged(place)
            if now.at - begun > timeout:
                raise self._not_back(timeout)
            await Sleep(PERIOD)

    async def _has_arrived(self, place: _Place, now: Presence) -> bool:
        """Whether it answers at the new place. Another rate is tried only while it is silent at the old one."""
        if now.answered and place.rate != self.new_rate:
            return False
        try:
            return (await self._look(self.new, self.new_rate)).answered
        except RequestError:
            return False

    async def _look(self, node: Node, rate: int) -> Presence:
        """Read the id once; at another rate than that of the bus with the bus reserved."""
        if rate == self.rate:
            return await look(node)

        async def at_other_rate() -> Presence:
            await set_named_rate(node.settings, rate)
            return await look(node)

        return await Exclusive(_at_own_rate(at_other_rate))

    def _has_new_id_pending(self, place: _Place, now: Presence) -> bool:
        """It answers to the old id and reads back the new one: it was silent, and has not restarted."""
        return now.reads_back == self.new.node != place.node.node

    def _has_forgotten(self, place: _Place, now: Presence) -> bool:
        """It read back the new id and reads back the old one: it has restarted without it."""
        return place.reads_back == self.new.node != place.node.node and now.reads_back == place.node.node

    # -- verify --------------------------------------------------------------------------------------------------

    async def verify(self, place: _Place | None) -> Provisioned:
        """Check that one servo answers at the new place, and none at the old one."""
        if self.new_rate != self.rate:
            await SetBitrate(self.new_rate)
        moved = place is not None and place.rate == self.new_rate and place.node.node != self.new.node
        if place is not None and moved and (await look(place.node)).answered:
            raise self._answers_at_both(place)
        if (await survey(self.new)).several:
            raise VerificationFailed(
                f"two servos answer as {hexadecimal(self.new.node)} after the restart, or the bus is disturbed",
                expected="one servo",
                cause="a servo that had this id already was silent before, and has joined the bus since",
                advice="take one of them off the bus, then provision the other one to a free id",
                node=self.new.node,
            )
        identity = await identify(self.new)
        found = identity.details["reads_back_id"]
        if found not in (None, self.new.node):
            raise VerificationFailed(
                f"it answers as {hexadecimal(self.new.node)} and reads back the id {found}",
                expected=str(self.new.node),
                cause="another id was written to it since, which the next restart may bring into force",
                advice=f"set_node_id({self.new.node}) and save() correct it; then power-cycle it, and call this again",
                node=self.new.node,
            )
        await Emit(Progress(STEPS, STEPS, "verified after the restart"))
        return Provisioned(self.new.node, self.new_rate, identity.firmware, resumed=place is None)

    def _answers_at_both(self, place: _Place) -> MotorbusError:
        return OutcomeUnknown(
            f"{hexadecimal(self.new.node)} answers, and {hexadecimal(place.node.node)} does too: which of them is the "
            "servo that was provisioned is not known",
            expected=f"{hexadecimal(self.new.node)} alone",
            cause="another servo has joined the bus meanwhile, or this one has not restarted",
            advice="take one of them off the bus, then call provision again: it finds out where things stand",
            node=self.new.node,
        )

    def _unchanged(self, place: _Place) -> MotorbusError:
        return VerificationFailed(
            f"{hexadecimal(place.node.node)} came back as it was, at {place.rate} bit/s: the change was not saved",
            expected=f"{hexadecimal(self.new.node)} at {self.new_rate} bit/s",
            cause="its supply went before its flash was written, or it did not receive the save, which has no reply",
            advice="call provision again, and keep its supply on until the power cycle is asked for",
            node=place.node.node,
        )

    def _not_back(self, timeout: float) -> MotorbusError:
        return OutcomeUnknown(
            f"{hexadecimal(self.old.node)} was set to {hexadecimal(self.new.node)} at {self.new_rate} bit/s "
            f"and saved; it did not come back within {timeout:g} s",
            cause="its supply has not been taken away and given back yet, and there is no other way to restart it",
            advice="power-cycle it, then call provision again with the same arguments: it finds out where things stand",
            node=self.old.node,
        )
