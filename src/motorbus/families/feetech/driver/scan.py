"""Find servos: a broadcast PING, then a PING and a READ of each silent id.

Replies to a broadcast may collide and SCS do not answer it, so it only comes first. A board that lacks PING is found by
the READ. A servo at another rate is silent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from motorbus.core.family import Found, Identity
from motorbus.core.request import ANY, Priority, Request, Response, TimeoutClass
from motorbus.core.scan import BitrateRestored, set_or_skip
from motorbus.core.steps import Emit, Exclusive, Progress, SetBitrate, Sleep, catch
from motorbus.errors import LinkError, MotorbusError, NoReply, UnexpectedReply, WireError
from motorbus.families.feetech import protocol
from motorbus.families.feetech.driver.identity import ScanWarning, check_alone, identify, ping_request
from motorbus.families.feetech.driver.node import BusFacts, Node, as_nodes
from motorbus.families.feetech.driver.requests import read_block

DRAIN: Final = 0.02  # s of quiet at a new rate: a servo may answer what it has buffered (feetech-cli)
CHATTER: Final = 8  # ids answered in garbled bytes, and none in order: the line carries something else
ID: Final = 5  # register


async def scan(
    ids: Sequence[int] = (), rates: Sequence[int] = (), facts: BusFacts | None = None
) -> list[Found]:
    """All servos that answer, with their identity; () means all ids, or the present rate, which is restored.

    Reports `Found` when one answers, `Progress`, a `ScanWarning` where two servos seem to share an id, and `Skipped`
    for a rate that the adapter lacks. Writes nothing. Raises UnexpectedReply if all bytes are garbled.
    """
    nodes = [Node(node.node, facts) for node in as_nodes(ids or range(protocol.MAX_ID + 1))]
    if not rates:
        return await _scan_rate(nodes, await SetBitrate(0), broadcast=not ids)

    async def scan_each() -> list[Found]:
        found: list[Found] = []
        async with BitrateRestored():
            for rate in rates:
                if await set_or_skip(rate):
                    await Sleep(DRAIN)
                    found += await _scan_rate(nodes, rate, broadcast=not ids)
        return found

    return await Exclusive(scan_each())


async def _scan_rate(nodes: Sequence[Node], rate: int, *, broadcast: bool) -> list[Found]:
    present = await broadcast_ping() if broadcast else set()
    for id in sorted(present):
        await Emit(Found(id, rate, None))
    garbled: set[int] = set()
    for number, request in enumerate((_ping, _read_id)):
        for done, node in enumerate(nodes):
            if node.node not in present and await _answers(request(node), garbled):
                present.add(node.node)
                await Emit(Found(node.node, rate, None))
            if len(garbled) >= CHATTER and not present:
                raise UnexpectedReply(
                    f"the first {len(garbled)} ids at {rate} bit/s are answered in garbled bytes",
                    cause="the line carries something else: another rate, another program, noise",
                    advice="check the rate, and that no other program sends on this bus",
                )
            done += number * len(nodes) + 1
            await Emit(Progress(done, 2 * len(nodes), f"id {node.node} at {rate} bit/s"))
    return [
        found
        for node in nodes
        if node.node in present | garbled
        and (found := await _identify(node, rate, sure=node.node in present))
    ]


def _ping(node: Node) -> Request[None]:
    return ping_request(node, scanning=True)


def _read_id(node: Node) -> Request[bytes]:
    request = read_block(node, ID, 1, bytes, priority=Priority.CONFIGURATION)
    return replace(request, reply_within=TimeoutClass.SCAN)


async def broadcast_ping() -> set[int]:
    """The ids that answer a broadcast PING; replies may collide."""

    def decode(answer: Response) -> set[int]:
        return {reply.data[2] for reply in answer.replies}

    wire = protocol.ping(protocol.BROADCAST)
    return await Request(wire, ANY, decode)


async def _answers(request: Request[object], garbled: set[int]) -> bool:
    """Whether it is answered; bytes that are no reply may be noise."""
    try:
        await request
    except NoReply:
        return False
    except WireError as error:
        garbled.add(error.node if error.node is not None else request.expected[0].node)  # type: ignore[index]
        return False
    return True


async def _identify(node: Node, rate: int, *, sure: bool) -> Found | None:
    """What answers, None for nothing; reports a suspected second servo."""
    identity = await catch(identify(node))
    alone = await catch(check_alone(node))
    for result in (identity, alone):
        if isinstance(result, LinkError):
            raise result
    if isinstance(alone, MotorbusError) and not isinstance(alone, NoReply):
        await Emit(ScanWarning(node.node, rate, alone.summary))
    elif not sure and not isinstance(identity, Identity):
        return None
    return Found(node.node, rate, identity if isinstance(identity, Identity) else None)
