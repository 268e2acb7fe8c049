"""Give a servo its id and its bit rate, from the first read to the check after the restart.

A new id or rate takes effect after a save, which has no reply, and a restart, which the user makes; power may fail at
any moment. So the state is always found by reading: a call after an interrupt continues from the present state, and
success is reported only when the servo has come back with the new values. Source: KST CAN protocol manual, commands 1
to 4.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Final, NamedTuple

from motorbus.core.request import Priority
from motorbus.core.scan import BitrateRestored
from motorbus.core.steps import Emit, Exclusive, Progress, SetBitrate, Sleep
from motorbus.errors import NoReply, OutcomeUnknown, RequestError, VerificationFailed
from motorbus.families.kst.driver.identity import (
    ReplyCount,
    answers_alone,
    count_replies,
    id_taken,
    identify,
    set_bit_rate,
    survey,
    write_node_id,
)
from motorbus.families.kst.driver.node import Node, check_above_zero, checked_id, hexadecimal
from motorbus.families.kst.driver.scan import broadcast_ids, set_named_rate
from motorbus.families.kst.driver.settings import save
from motorbus.families.kst.profiles import bit_rate_code

TIMEOUT: Final = 120.0  # s to wait for the power cycle
PERIOD: Final = 0.1  # s between two reads while waiting
SILENT_READS: Final = 3
"""Reads without a reply in a row that count as a loss of power; a single one may be a lost frame."""
STEPS: Final = 4


class PowerCycleNeeded(NamedTuple):
    """An event: the servo has received the save; the user must take its supply away and give it back now."""

    node: int
    new_id: int
    new_rate: int


class Provisioned(NamedTuple):
    """A servo that has this id and rate (bit/s) after its restart; `resumed`: it had them before the call."""

    node: int
    rate: int
    firmware: str
    resumed: bool


class Place(NamedTuple):
    """Where the servo answered (bit/s), and the id that it read back when everything was written."""

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
    `PowerCycleNeeded`; waits at most `timeout` s; verifies. It may be called again at any point.

    Raises RequestError (nothing is written) for an invalid id or rate, an id in use, two servos with one id, or a new
    rate while other servos are on the bus; NoReply; VerificationFailed when it comes back with the old values, or
    beside another servo with its new id; OutcomeUnknown when it does not come back in time, or answers to both ids.
    """
    if new_id is None and new_rate is None:
        raise RequestError("nothing to provision", expected="new_id=, new_rate=, or both")
    check_above_zero("timeout", timeout, "s", node=node.node)
    new = node
    if new_id is not None and checked_id(new_id) != node.node:
        new = Node(new_id, node.settings)
    if new_rate is not None:
        bit_rate_code(new_rate)
    rate = await SetBitrate(0)
    change = Change(node, new, rate, rate if new_rate is None else new_rate)
    place = await Exclusive(change.write())
    if place is not None:
        await Emit(PowerCycleNeeded(node.node, new.node, change.new_rate))
        await change.wait(place, timeout)
    await Emit(Progress(STEPS - 1, STEPS, "it is back: verifying"))
    firmware = await Exclusive(change.verify(place))
    await Emit(Progress(STEPS, STEPS, "verified after the restart"))
    return Provisioned(new.node, change.new_rate, firmware, resumed=place is None)


class Change:
    """The servo `old` at `rate` is to become `new` at `new_rate`."""

    def __init__(self, old: Node, new: Node, rate: int, new_rate: int) -> None:
        self.old = old
        self.new = new
        self.rate = rate
        self.new_rate = new_rate

    async def write(self) -> Place | None:
        """Find the servo, write what is missing, save. None: it has everything already, nothing was written."""
        async with BitrateRestored():
            await Emit(Progress(0, STEPS, "looking for the servo"))
            node, rate, _ = await self._find()
            before = await count_replies(node)
            if (node, rate) == (self.new, self.new_rate):
                return None
            if rate != self.new_rate:
                await self._check_no_other(rate)
            await Emit(Progress(1, STEPS, f"writing to {hexadecimal(node.node)}"))
            if node is not self.new or before.reads_back not in (None, node.node):
                await write_node_id(node, self.new.node)
            if rate != self.new_rate:
                await set_bit_rate(node, self.new_rate)
            written = await count_replies(node)
            await Emit(Progress(2, STEPS, "saving"))
            await save(node)
            return Place(node, rate, written.reads_back)

    async def _find(self) -> Place:
        """The id and rate, of the old and the new ones, at which the servo answers now."""
        nodes = dict.fromkeys((self.old, self.new))
        rates = dict.fromkeys((self.rate, self.new_rate))
        for rate in rates:
            if rate != self.rate:
                await set_named_rate(self.old.settings, rate)
            found = [node for node in nodes if await answers_alone(node)]
            if len(found) == 2:
                raise id_taken(self.old.node, self.new.node)
            if found:
                return Place(found[0], rate)
        raise NoReply(
            f"no servo answers as {' or '.join(hexadecimal(node.node) for node in nodes)}",
            expected=f"one servo at {' or '.join(map(str, rates))} bit/s",
            cause="no power, a loose cable, another id, or another bit rate",
            advice="`motorbus scan BUS` lists the servos",
            node=self.old.node,
        )

    async def _check_no_other(self, rate: int) -> None:
        """A servo at another rate breaks the frames of the others."""
        answer = await broadcast_ids(self.old.settings, Priority.POLL)
        others = sorted({reply.lane for reply in answer.replies} - {self.old.node, self.new.node})
        if others:
            raise RequestError(
                f"the servo is not alone: {', '.join(map(hexadecimal, others))} would stay at {rate} bit/s",
                cause="servos at two rates on one bus break each other's frames",
                advice="connect it alone; broadcast_bit_rate() and broadcast_save() change all at once",
                node=self.old.node,
            )

    async def wait(self, place: Place, timeout: float) -> None:
        """Read at the old place and the new one in turn until the servo answers at the new one only.

        Another rate is tried only while the servo is silent at the old one. Raises VerificationFailed if it comes back
        unchanged, OutcomeUnknown after `timeout` s or if a servo answers at both places.
        """
        old, new = place.node.node, self.new.node
        begun = await Sleep(0)  # the time
        silent = 0
        while True:
            now = await self._count_replies(place.node, place.rate)
            arrived = False
            if not now.replies or place.rate == self.new_rate:
                with suppress(RequestError):  # the bus is in use at the old rate
                    arrived = (await self._count_replies(self.new, self.new_rate)).replies > 0
            if arrived and not now.replies:
                return
            pending = new != old and now.reads_back == new  # it has not restarted
            forgotten = (
                new != old and place.reads_back == new and now.reads_back == old
            )  # it has, without the new id
            if now.replies and (forgotten or (silent >= SILENT_READS and not pending)):
                if arrived:
                    raise self._answers_at_both(old)
                raise VerificationFailed(
                    f"{hexadecimal(old)} came back as it was, at {place.rate} bit/s: the change was not saved",
                    cause="its supply went before its flash was written, or it did not receive the save",
                    advice="call provision again, and keep its supply on until the power cycle is needed",
                    node=old,
                )
            silent = 0 if now.replies else silent + 1
            if now.at - begun > timeout:
                raise OutcomeUnknown(
                    f"{hexadecimal(self.old.node)} was set to {hexadecimal(new)} at {self.new_rate} bit/s and saved; "
                    f"it did not come back within {timeout:g} s",
                    cause="its supply has not been taken away and given back yet",
                    advice="power-cycle it, then call provision again: it continues from the present state",
                    node=self.old.node,
                )
            await Sleep(PERIOD)

    async def _count_replies(self, node: Node, rate: int) -> ReplyCount:
        """Read the id once; at another rate than that of the bus with the bus reserved."""

        async def at_other_rate() -> ReplyCount:
            async with BitrateRestored():
                await set_named_rate(node.settings, rate)
                return await count_replies(node)

        return await (count_replies(node) if rate == self.rate else Exclusive(at_other_rate()))

    async def verify(self, place: Place | None) -> str:
        """Check that one servo answers with the new id, and none with the old one. Returns its firmware version."""
        new = self.new.node
        async with BitrateRestored():
            if self.new_rate != self.rate:
                await SetBitrate(self.new_rate)
            old = place.node if place is not None and place.rate == self.new_rate else self.new
            if old is not self.new and (await count_replies(old)).replies:
                raise self._answers_at_both(old.node)
            _, second = await survey(self.new)
            if second:
                raise VerificationFailed(
                    f"two servos answer as {hexadecimal(new)} after the restart: {second}",
                    cause="a servo that had this id already has joined the bus, or the bus is disturbed",
                    advice="take one of them off the bus, then provision the other one to a free id",
                    node=new,
                )
            identity = await identify(self.new)
            found = identity.details["reads_back_id"]
            if found not in (None, new):
                raise VerificationFailed(
                    f"it answers as {hexadecimal(new)} and reads back the id {found}",
                    cause="another id was written to it since, which the next restart may bring into force",
                    advice=f"set_node_id({new}) and save(), power-cycle it, then call this again",
                    node=new,
                )
            return identity.firmware

    def _answers_at_both(self, old: int) -> OutcomeUnknown:
        new = hexadecimal(self.new.node)
        return OutcomeUnknown(
            f"{new} answers, and {hexadecimal(old)} does too: which of them is the servo that was provisioned is not "
            "known",
            cause="another servo has joined the bus meanwhile, or this one has not restarted",
            advice="take one of them off the bus, then call provision again: it continues from the present state",
            node=self.new.node,
        )
