"""Looking for servos: PING by unicast, id by id, at one rate or at several.

Silence is an answer here, so nothing waits long for it; but the first packet after power-up may be missed, so the
silent ids are asked once more. A broadcast PING would be quicker and is not used: the replies collide, and the
protocol manual V1.01 forbids it with more than one servo. A servo at another rate cannot make out a packet and is
silent, so whatever answers in bytes that are no answer may be two servos with one id: it is asked again, at length.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from motorbus.core.family import Found, Identity
from motorbus.core.steps import Emit, Exclusive, Progress, SetBitrate, Sleep, catch, with_cleanup
from motorbus.errors import LinkLost, MotorbusError, NoReply, UnexpectedReply, WireError
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.identity import identify, ping_exchange
from motorbus.families.feetech.driver.node import Node, as_nodes
from motorbus.families.feetech.driver.sharing import ScanWarning, duplicates

DRAIN: Final = 0.02
"""s of quiet at a new rate: one that was busy may answer what it has buffered in a burst. Source: feetech-cli."""
GLANCE: Final = 8
"""Reads that show two servos on one id in passing, where 4 of 10 are garbled (servolab): 98 times of 100."""

CHATTER: Final = 8
"""Ids that are answered in garbled bytes, and none in order: the line carries something else."""


class Skipped(NamedTuple):
    """An event: nothing was asked at this rate (bit/s), and why."""

    rate: int
    why: str


async def scan(ids: Sequence[int] = (), rates: Sequence[int] = (), *, polls: int = 0) -> list[Found]:
    """Every servo that answers, with what it is; `ids` () means 0 to 253, `rates` () the present rate alone.

    The present rate of the bus is set again at the end, whatever happens. Reports `Found` as soon as one answers
    (its identity is asked afterwards), `Progress`, a `ScanWarning` where two servos seem to share an id, and `Skipped`
    for a rate that the link does not have. Each that is found is asked `polls` times whether it is alone; one whose
    answers are garbled in any case, and it counts as found, without an identity, when they stay so. Writes nothing.
    Raises UnexpectedReply when the first ids are all answered in garbled bytes.
    """
    asked = [node.node for node in as_nodes(ids or range(wire.MAX_ID + 1))]
    present = await SetBitrate(0)
    if not rates:
        return await _at_one_rate(asked, present, 0, 1, polls)
    return await Exclusive(with_cleanup(_at_all_rates(asked, rates, polls), lambda: SetBitrate(present)))


async def _at_all_rates(ids: Sequence[int], rates: Sequence[int], polls: int) -> list[Found]:
    found: list[Found] = []
    for index, rate in enumerate(rates):
        refusal = await catch(SetBitrate(rate))
        if isinstance(refusal, LinkLost):
            raise refusal
        if isinstance(refusal, MotorbusError):
            await Emit(Skipped(rate, refusal.summary))
            continue
        await Sleep(DRAIN)
        found += await _at_one_rate(ids, rate, index, len(rates), polls)
    return found


async def _at_one_rate(ids: Sequence[int], rate: int, index: int, of: int, polls: int) -> list[Found]:
    """Two passes over the ids, the second over the silent ones, then ask those who are there what they are."""
    there: list[int] = []
    garbled: set[int] = set()
    for number in range(2):
        begun = (2 * index + number) * len(ids)
        for done, id in enumerate(ids):
            if id not in there and await _answers(id, garbled):
                there.append(id)
                await Emit(Found(id, rate, None))
            if len(garbled) >= CHATTER and not there:
                raise UnexpectedReply(
                    f"the first {len(garbled)} ids at {rate} bit/s are answered in garbled bytes",
                    cause="the line carries something else: another baud rate, another program, electrical noise",
                    advice="check the baud rate and that no other program sends on this bus",
                )
            await Emit(Progress(begun + done + 1, 2 * of * len(ids), f"id {id} at {rate} bit/s"))
    found: list[Found] = []
    for id in sorted({*there, *garbled}):
        identity = await catch(identify(Node(id)))
        if isinstance(identity, WireError):
            garbled.add(id)
        shared = await _shared(id, max(polls, GLANCE) if id in garbled else polls)
        if id in there or shared:
            found.append(Found(id, rate, identity if isinstance(identity, Identity) else None))
    return found


async def _answers(id: int, garbled: set[int]) -> bool:
    """Is it there? Bytes that are no answer may be noise, so they do not count yet."""
    try:
        await ping_exchange(Node(id), scanning=True)
    except NoReply:
        return False
    except WireError:
        garbled.add(id)
        return False
    return True


async def _shared(id: int, polls: int) -> bool:
    """Do two servos seem to have this id? Says so if they do."""
    seen = await catch(_asked(id, polls))
    if isinstance(seen, LinkLost):
        raise seen
    if not isinstance(seen, ScanWarning) or not seen.suspected:
        return False
    await Emit(seen)
    return True


async def _asked(id: int, polls: int) -> ScanWarning | None:
    """As `duplicates`, without its progress: that of the scan goes on."""
    if polls:
        return await duplicates(Node(id), polls, quiet=True)
    return None
