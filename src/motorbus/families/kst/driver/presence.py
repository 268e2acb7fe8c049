"""Is one servo there, or two with one id, or none? Asked such that silence costs nothing and a second answer shows.

Two servos with one id answer in one of two ways. Not quite together, and two answers come; or in the same moment,
and then equal answers merge into one frame and unequal ones break each other. So they are asked several things that
two servos seldom agree upon, again and again, and bus errors meanwhile count as a second one. Most slcan adapters
tell of no bus errors: there, a position that never comes from somebody who always tells his id counts as one.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.core.request import Notification, Priority, Request, TimeoutClass
from motorbus.core.steps import SetBitrate, WaitFor, gather
from motorbus.errors import LinkError, LinkLost, NoReply, RequestError, WireError
from motorbus.families.kst import wire
from motorbus.families.kst.driver.dialect import Dialect
from motorbus.families.kst.driver.exchanges import NODE_ID, POSITION, decided, listening
from motorbus.families.kst.driver.line import FIRMWARE
from motorbus.families.kst.driver.listening import GLANCE, Heard, heard
from motorbus.families.kst.driver.node import Node, hexadecimal
from motorbus.families.kst.wire import SdoReply

ROUNDS: Final = 3
QUESTIONS: Final = (NODE_ID, POSITION, FIRMWARE)
"""Ids may be equal, positions and versions seldom are to the last bit."""
WATCH: Final = 0.5
"""s in which bus errors count; about as long as all questions take."""


class Presence(NamedTuple):
    """What came of asking: when (s), the most answers to one request, the id read back, bus errors meanwhile.

    `torn`: the id came every time and the position never, as when two answers that differ break each other.
    """

    at: float
    most: int
    reads_back: int | None = None
    errors: bool = False
    torn: bool = False

    @property
    def there(self) -> bool:
        """Somebody answered."""
        return self.most > 0

    @property
    def several(self) -> bool:
        """More than one answered, or some of the answers broke; where all broke, it may be the bit rate."""
        return self.most > 1 or self.torn or (self.errors and self.there)


def glance(node: Node, index: int = NODE_ID) -> Request[Presence]:
    """Ask once; silence is an answer too."""

    def take(replies: list[SdoReply], at: float) -> Presence:
        mine = [reply for reply in replies if reply.index in (index, 0)]
        told = [reply.data[0] for reply in mine if reply.kind == "upload" and index == NODE_ID]
        return Presence(at, len(mine), told[0] if told else None)

    frame = wire.encode_upload(node.node, index, extended=node.dialect.extended(node.node))
    return listening(node, frame, take, timeout=TimeoutClass.REPLY, priority=Priority.POLL)


async def survey(node: Node) -> Presence:
    """Ask several times and watch for bus errors meanwhile; nobody else must be addressed at the same time."""
    asked, error = await gather(_asked(node), WaitFor(_is_error, WATCH))
    assert isinstance(asked, Presence)
    return asked._replace(errors=error is not None)


async def _asked(node: Node) -> Presence:
    most, reads_back = 0, None
    answered = dict.fromkeys(QUESTIONS, 0)
    for index in QUESTIONS * ROUNDS:
        look = await glance(node, index)
        most = max(most, look.most)
        answered[index] += look.there
        reads_back = look.reads_back or reads_back
    torn = answered[NODE_ID] == ROUNDS and not answered[POSITION]
    return Presence(look.at, most, reads_back, torn=torn)


async def settle_format(node: Node) -> None:
    """Find out the id format where it may be either; where that is not to be had, 11 bits are used."""
    try:
        await decided(node)
    except (NoReply, WireError):
        return


async def glance_at(dialect: Dialect, rate: int) -> None:
    """Tune to a rate that the caller has named, after listening where the adapter can.

    Raises RequestError when errors show that the bus is in use at another rate.
    """
    try:
        said = await heard(dialect, rate, GLANCE)
    except LinkLost:
        raise
    except LinkError:
        said = Heard.SILENCE
    if said is Heard.ERRORS:
        raise RequestError(
            f"nothing is sent at {rate} bit/s: {said.value}",
            cause="other devices speak on this bus, and a frame at a wrong rate breaks theirs",
            advice="connect this servo alone, and call again; nothing was written",
        )
    await SetBitrate(rate)


async def single(node: Node) -> bool:
    """Is one servo there under this id? To be asked with the bus alone. Raises RequestError when there are two."""
    await settle_format(node)
    found = await survey(node)
    if found.several:
        raise _two(node, found)
    return found.there


def _two(node: Node, found: Presence) -> RequestError:
    signs = (
        "bus errors whenever it is asked" if found.errors else "its id comes every time, its position never"
    )
    if found.most > 1:
        signs = f"{found.most} answers to one request"
    return RequestError(
        f"two servos answer as {hexadecimal(node.node)}: {signs}",
        cause="servos are shipped with one id, and both obey what is sent to it; or the bus is disturbed",
        advice="connect one servo at a time, provision it, then the next; nothing was written",
        node=node.node,
    )


def _is_error(notice: Notification) -> bool:
    return notice.kind == "bus error"
