"""Looking for devices: a part of the driver that has a file of its own, so that none gets long.

A room that outgrows one file may also become a folder of its name. Silence is an answer here, and costs little; what
is found is reported at once, for a scan of all rates takes long.
"""

from __future__ import annotations

from motorbus.core.family import Found
from motorbus.core.request import TimeoutClass
from motorbus.core.steps import Emit, Exclusive, Progress, SetBitrate, catch, gather, with_cleanup
from motorbus.errors import MotorbusError

from . import driver, wire


async def scan(ids: tuple[int, ...] = (), rates: tuple[int, ...] = ()) -> list[Found]:
    """Ask every id, two at a time because each has a lane of its own; the present rate is set again in the end."""
    asked = ids or tuple(wire.NODES)
    present = await SetBitrate(0)
    if not rates:
        return await _everyone(asked, present)
    return await Exclusive(with_cleanup(_at_all_rates(asked, rates), lambda: SetBitrate(present)))


async def _at_all_rates(nodes: tuple[int, ...], rates: tuple[int, ...]) -> list[Found]:
    found: list[Found] = []
    for rate in rates:
        await SetBitrate(rate)
        found += await _everyone(nodes, rate)
    return found


async def _everyone(nodes: tuple[int, ...], rate: int) -> list[Found]:
    """Whoever is silent is asked once more, for the first frame after power-up may be missed."""
    found: dict[int, Found] = {}
    for turn in range(2):
        silent = [node for node in nodes if node not in found]
        looks = await gather(*[_look(driver.Node(node), rate) for node in silent])
        found |= {one.node: one for one in looks if one is not None}
        await Emit(Progress((turn + 1) * len(nodes), 2 * len(nodes), f"{rate} bit/s"))
    return [found[node] for node in nodes if node in found]


async def _look(node: driver.Node, rate: int) -> Found | None:
    heard = await catch(driver.proof(node, reply_within=TimeoutClass.SCAN))
    if heard is not True:
        return None
    identity = await catch(driver.identify(node))
    found = Found(node.node, rate, None if isinstance(identity, MotorbusError) else identity)
    await Emit(found)
    return found
