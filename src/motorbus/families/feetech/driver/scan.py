"""Find servos: a READ of each id in order, for every servo answers READ, and boards exist that lack PING.

A broadcast PING is not used: the replies of servos with one return delay collide, SCS do not answer it, and its window
is 0.8 s. A silent id is asked once. A reply that comes late disturbs the request to the next id, so both are identified
then, with the normal time-out. A servo at another rate is silent.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Final

from motorbus.core.family import Found, Identity
from motorbus.core.request import TimeoutClass
from motorbus.core.scan import scan_rates
from motorbus.core.steps import Emit, Exclusive, Progress, SetBitrate, Sleep, catch
from motorbus.errors import LinkError, NoReply, RequestError, WireError
from motorbus.families.feetech import protocol
from motorbus.families.feetech.driver.identity import ScanWarning, check_alone, identify
from motorbus.families.feetech.driver.node import BusFacts, Node, as_nodes
from motorbus.families.feetech.driver.requests import read_id

DRAIN: Final = 0.02  # s of quiet at a new rate: a servo may answer what it has buffered (feetech-cli)


async def scan(
    ids: Sequence[int] = (), rates: Sequence[int] = (), facts: BusFacts | None = None
) -> list[Found]:
    """All servos that answer, with their identity; () means all ids, or the present rate, which is restored.

    Reports `Found` when one answers, `Progress`, a `ScanWarning` where two servos seem to share an id, and `Skipped`
    for a rate that the adapter lacks. Writes nothing.
    """
    nodes = [Node(node.node, facts) for node in as_nodes(ids or range(protocol.MAX_ID + 1))]
    if rates:
        return await Exclusive(scan_rates(rates, partial(_scan_rate, nodes)))
    return await _scan_rate(nodes, await SetBitrate(0))


async def _scan_rate(nodes: Sequence[Node], rate: int) -> list[Found]:
    await Sleep(DRAIN)
    answering: set[int] = set()
    doubtful: set[int] = set()
    for done, node in enumerate(nodes, 1):
        try:
            await read_id(node.node, within=TimeoutClass.SCAN)
        except NoReply:
            pass
        except WireError:
            doubtful |= {node.node, node.node - 1}
        else:
            answering.add(node.node)
            await Emit(Found(node.node, rate, None))
        await Emit(Progress(done, len(nodes), f"id {node.node} at {rate} bit/s"))
    suspects = [node for node in nodes if node.node in answering | doubtful]
    found = [await _identify(node, rate, sure=node.node in answering) for node in suspects]
    return [one for one in found if one is not None]


async def _identify(node: Node, rate: int, *, sure: bool) -> Found | None:
    """What answers, None for nothing; reports a suspected second servo."""
    identity = await catch(identify(node))
    if isinstance(identity, NoReply) and not sure:
        return None
    alone = await catch(check_alone(node))
    for result in (identity, alone):
        if isinstance(result, LinkError):
            raise result
    if isinstance(alone, RequestError):
        await Emit(ScanWarning(node.node, rate, alone.summary))
    return Found(node.node, rate, identity if isinstance(identity, Identity) else None)
