"""Give a servo its id and its bit rate, from the first read to the check after the restart.

A new id or rate takes effect after a save, which has no reply, and a restart, which the user makes; power may fail at
any moment. So the state is always found by reading: a call after an interrupt continues from the present state, and
success is reported only when the servo has come back with the new values. Source: KST CAN protocol manual, commands 1
to 4.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, NamedTuple

from motorbus.core.family import IdChanged
from motorbus.core.register import is_number, shown
from motorbus.core.request import ANY, Priority, Request, Response
from motorbus.core.scan import BitrateRestored
from motorbus.core.steps import Emit, Exclusive, Progress, SetBitrate, Sleep
from motorbus.errors import NoReply, OutcomeUnknown, RequestError, VerificationFailed
from motorbus.families.kst.driver.broadcast import broadcast_ping
from motorbus.families.kst.driver.identity import identify, read_id
from motorbus.families.kst.driver.node import Node, checked_id, hexadecimal
from motorbus.families.kst.driver.requests import ask_presence, decoded, save, write_row
from motorbus.families.kst.profiles import bit_rate_code

TIMEOUT: Final = 120.0  # s to wait for the power cycle
PERIOD: Final = 0.1  # s between two reads while waiting
STEPS: Final = 4
ROUNDS: Final = 3  # of reads that look for a second servo


class PowerCycleNeeded(NamedTuple):
    """An event: the servo has received the save; the user must take its supply away and give it back now."""

    node: int
    new_id: int
    new_rate: int

    @property
    def text(self) -> str:
        """What the user must do now."""
        return (
            f"servo 0x{self.node:02X}: switch its supply off and on now; "
            f"it returns with id 0x{self.new_id:02X} at {self.new_rate} bit/s"
        )


class Provisioned(NamedTuple):
    """A servo that has this id and rate (bit/s) after its restart; `resumed`: it had them before the call."""

    node: int
    rate: int
    firmware: str
    resumed: bool


class Place(NamedTuple):
    """Where a servo answers: its id and its rate (bit/s)."""

    node: Node
    rate: int


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
    rate while other servos are on the bus; NoReply; VerificationFailed when it comes back beside another servo with its
    new id; OutcomeUnknown when it does not come back in time, or a servo still answers as before.
    """
    if new_id is None and new_rate is None:
        raise RequestError("nothing to provision", expected="new_id=, new_rate=, or both")
    if not (is_number(timeout) and timeout > 0):
        raise RequestError(
            f"timeout {shown(timeout)} is not a finite number above 0", expected="a number in s"
        )
    if new_rate is not None:
        bit_rate_code(new_rate)  # raises
    new = node if new_id is None or checked_id(new_id) == node.node else Node(new_id, node.settings)
    rate = await SetBitrate(0)  # 0 reads it
    goal = Place(new, new_rate or rate)
    await Emit(Progress(0, STEPS, "looking for the servo"))
    found = await Exclusive(_find(dict.fromkeys((node, new)), dict.fromkeys((rate, goal.rate))))
    if found != goal:
        await Exclusive(_write(found, goal))
        await Emit(PowerCycleNeeded(node.node, new.node, goal.rate))
        await _wait(found, goal, timeout)
    await Emit(Progress(STEPS - 1, STEPS, "it is back: verifying"))
    firmware = await Exclusive(_verify(goal))
    await Emit(Progress(STEPS, STEPS, "verified after the restart"))
    return Provisioned(new.node, goal.rate, firmware, resumed=found == goal)


async def _find(nodes: Iterable[Node], rates: Iterable[int]) -> Place:
    """The id and rate, of the old and the new ones, at which the servo answers now."""
    for rate in rates:
        async with BitrateRestored(rate):
            found = [node for node in nodes if await answers_alone(node)]
        if len(found) == 2:
            raise id_taken(*found)
        if found:
            return Place(found[0], rate)
    raise NoReply(
        f"no servo answers as {' or '.join(hexadecimal(node.node) for node in nodes)}",
        expected=f"one servo at {' or '.join(map(str, rates))} bit/s",
        cause="no power, a loose cable, another id, or another bit rate",
        advice="`motorbus scan BUS` lists the servos",
        node=next(iter(nodes)).node,
    )


async def _write(found: Place, goal: Place) -> None:
    """Write what is missing, read it back, save. A servo at another rate breaks the frames of the others."""
    node, new = found.node, goal.node.node
    async with BitrateRestored(found.rate):
        if found.rate != goal.rate:
            answering = await broadcast_ping(node.settings)
            if others := sorted(set(answering) - {node.node, new}):
                raise RequestError(
                    f"the servo is not alone: {', '.join(map(hexadecimal, others))} would stay at {found.rate} bit/s",
                    cause="servos at two rates on one bus break each other's frames",
                    advice="connect it alone; broadcast_write() of bit_rate_code and store changes all at once",
                    node=node.node,
                )
        await Emit(Progress(1, STEPS, f"writing to {hexadecimal(node.node)}"))
        if node.node != new or await read_id(node) not in (None, new):
            await write_node_id(node, new)
        if found.rate != goal.rate:
            await set_bit_rate(node, goal.rate)
        await Emit(Progress(2, STEPS, "saving"))
        await save(node)


async def _wait(old: Place, goal: Place, timeout: float) -> None:
    """Read until the servo answers at the new place and not at the old one. Raises OutcomeUnknown after `timeout` s.

    The new rate is tried only while the servo is silent at the old one.
    """

    async def answers(place: Place) -> bool:
        async with BitrateRestored(place.rate):
            return await count_replies(place.node) > 0

    begun = await Sleep(0)  # the time
    while await Exclusive(answers(old)) or not await Exclusive(answers(goal)):
        if await Sleep(PERIOD) - begun > timeout:
            raise OutcomeUnknown(
                f"{hexadecimal(old.node.node)} was set to {hexadecimal(goal.node.node)} at {goal.rate} bit/s and "
                f"saved; it did not come back within {timeout:g} s",
                cause="its supply was not taken away and given back yet, it went before the flash was written, or "
                "another servo answers as before",
                advice="power-cycle it, then call provision again: it continues from the present state",
                node=old.node.node,
            )


async def _verify(goal: Place) -> str:
    """Check that one servo answers with the new id, and reads it back. Returns its firmware version."""
    node, new = goal.node, goal.node.node
    async with BitrateRestored(goal.rate):
        second, identity = await second_servo(node), await identify(node)
    if second:
        raise VerificationFailed(
            f"two servos answer as {hexadecimal(new)} after the restart: {second}",
            cause="a servo that had this id already has joined the bus, or the bus is disturbed",
            advice="take one of them off the bus, then provision the other one to a free id",
            node=new,
        )
    found = identity.details["reads_back_id"]
    if found not in (None, new):
        raise VerificationFailed(
            f"it answers as {hexadecimal(new)} and reads back the id {found}",
            cause="another id was written to it since, which the next restart may bring into force",
            advice=f"set_node_id({new}) and save(), power-cycle it, then call this again",
            node=new,
        )
    return identity.firmware


# -- one servo or two ------------------------------------------------------------------------------------------


def count_replies(node: Node, name: str = "node_id") -> Request[int]:
    """Read an object once; the number of replies, 0 for silence."""
    row = node.table[name]

    def decode(answer: Response) -> int:
        return sum(reply.index in (row.address, 0) for reply in decoded(answer))  # 0: some aborts

    return Request(node.settings.upload(node.node, row), ANY, decode, lane=node.node)


async def second_servo(node: Node) -> str | None:
    """The evidence that two servos answer to this id, "" for one, None for none.

    Two servos with one id send two replies. If both begin at the same time, equal replies merge into one and unequal
    ones destroy each other. So the id, which is equal, and the position, which seldom is, are read several times.
    """
    counts: list[int] = []
    for _ in range(ROUNDS):
        counts += [await count_replies(node, name) for name in ("node_id", "present_position")]
        if not any(counts):
            return None
    if max(counts) > 1:
        return f"{max(counts)} answers to one request"
    return "" if any(counts[1::2]) else "every read of its id is answered, no read of its position"


async def answers_alone(node: Node) -> bool:
    """Whether a servo answers to this id. Raises RequestError when two do. Run it with the bus reserved."""
    second = await second_servo(node)
    if second:
        raise RequestError(
            f"two servos answer as {hexadecimal(node.node)}: {second}",
            cause="servos are shipped with one id, and both obey what is sent to it; or the bus is disturbed",
            advice="connect one servo at a time, provision it, then the next",
            node=node.node,
        )
    return second is not None


# -- single commands of the manual -----------------------------------------------------------------------------


async def set_node_id(node: Node, new: int) -> None:
    """Give it another id, 1 to 127. It takes effect after save() and a restart; without a save, a restart discards it.

    Raises RequestError (nothing is written) for an impossible id, two servos with this id, or an id in use; NoReply;
    VerificationFailed when it reads back neither the old nor the new id. To swap two ids, use a third one.
    """
    other = Node(new, node.settings)
    if not await Exclusive(answers_alone(node)):
        await ask_presence(node)  # raises NoReply
    if new != node.node and await count_replies(other):
        raise id_taken(node, other)
    await write_node_id(node, new)


def id_taken(old: Node, new: Node) -> RequestError:
    """The error for a new id at which a servo answers."""
    return RequestError(
        f"the id {hexadecimal(new.node)} is taken: a servo answers as it beside {hexadecimal(old.node)}",
        advice="choose a free id, or take that servo off the bus",
        node=new.node,
    )


async def write_node_id(node: Node, new: int) -> None:
    """As `set_node_id`, without the checks of both ids."""
    await Emit(IdChanged(node.node, new))
    await write_row(node, node.table["node_id"], new, priority=Priority.CONFIGURATION)
    found = await read_id(node)
    if found not in (None, new, node.node):  # some servos read back the id in force
        raise VerificationFailed(
            f"node {node.node} was set to {new} and reads back {found}",
            cause="two servos with one id, or another program",
            advice="do not save; restart it, and the old id is in force again",
            node=node.node,
        )


def set_bit_rate(node: Node, rate: int) -> Request[None]:
    """Give it another bit rate (bit/s). It takes effect after save() and a restart; without a save it is discarded.

    Raises RequestError for a rate that no servo has.
    """
    row = node.table["bit_rate_code"]
    return write_row(node, row, bit_rate_code(rate), priority=Priority.CONFIGURATION)
