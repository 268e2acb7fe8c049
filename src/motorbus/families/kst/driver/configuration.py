"""What newer firmware lets one set: reports, the mid point, travel limits, the sense of rotation.

None of this is in the manual; a profile that lacks it refuses, and names those that have it. What is kept is read
back, saved and read back again (`keeping.py`). Source of each object: its row in the table.
"""

from __future__ import annotations

from motorbus.core.register import Register
from motorbus.core.request import Priority
from motorbus.core.steps import Exclusive
from motorbus.errors import RequestError
from motorbus.families.kst.driver.exchanges import decided, order, upload_row
from motorbus.families.kst.driver.feedback import position_exchange
from motorbus.families.kst.driver.keeping import keep, save, settled
from motorbus.families.kst.driver.motion import start_exchange
from motorbus.families.kst.driver.node import Node
from motorbus.families.kst.driver.refusals import lacking
from motorbus.families.kst.table import REVERSED


async def start_reports(node: Node, interval: float | None = None) -> None:
    """Let it report its position by itself, every `interval` seconds (None: as it is set); nobody answers that.

    Where the profile has a start rule, this is the start that lets it move, too. Raises RequestError where the profile
    has no reports or the interval is out of range.
    """
    row = _row(node, "report_interval", "reports")
    _startable(node)
    raw = None if interval is None else node.raw(row, interval)
    if raw is not None:
        row.encode(raw)
    await decided(node)
    if raw is not None:
        await order(node, row, raw)
    await start_exchange(node, True)


async def stop_reports(node: Node) -> None:
    """Let it report no more. Where the profile has a start rule, it then ignores positions until the next start."""
    _row(node, "report_interval", "reports")
    _startable(node)
    await decided(node)
    await start_exchange(node, False)


async def set_mid_point(node: Node) -> float:
    """Make the present position the zero, and save; returns the position (rad) that it tells afterwards, about 0.

    A servo that tells 0 already is left as it is, for flash wears, unless this node has set its mid point and not come
    to the save. Whether somebody else's zero was saved nobody can tell: save() keeps it.

    No source tells what becomes of the old target, which now lies elsewhere: keep clear, and order a target next. It
    is refused while a stop is latched, and never repeated in silence: OutcomeUnknown says that it may have been heard.
    """
    row = _row(node, "mid_point", "mid point")
    await decided(node)
    return await Exclusive(_mid_point(node, row))


async def _mid_point(node: Node, row: Register) -> float:
    present = node.table["present_position"]
    if row.name not in node.unsaved and not await upload_row(node, present, int, reports_position=True):
        return 0.0
    node.limits = None
    node.unsaved.add(row.name)
    await order(node, row, node.profile.mid_point_value, priority=Priority.CONFIGURATION)
    await save(node)
    await settled(node)
    node.unsaved.discard(row.name)
    return await position_exchange(node)


async def travel_limits(node: Node) -> tuple[float, float]:
    """Lowest and highest position, rad, as the servo is set."""
    low, high = _limits(node)
    await decided(node)
    raws = await upload_row(node, low, int), await upload_row(node, high, int)
    return float(low.to_value(raws[0])), float(high.to_value(raws[1]))


async def set_travel_limits(node: Node, low: float, high: float) -> None:
    """Keep it between `low` (at most 0) and `high` (at least 0), rad; read back, saved, and read back again.

    Limits that it has already are neither written nor saved again (see `keep` for what that cannot know).

    While the sense of rotation is reversed, a change of one limit changes the other too: VerificationFailed tells so
    unless they are symmetric; set_reversed(False) first, as a public flight-controller driver does. Raises
    RequestError for limits that are impossible or leave no way at all.
    """
    orders = [(row, node.raw(row, value)) for row, value in zip(_limits(node), (low, high), strict=True)]
    for row, raw in orders:
        row.encode(raw)
    if orders[0][1] == orders[1][1]:
        raise RequestError(
            f"node {node.node}: limits {low} and {high} rad leave no way to go",
            advice="give a low limit below 0, or a high one above; nothing was sent",
            node=node.node,
        )
    await keep(node, orders)


async def reversed_(node: Node) -> bool:
    """Whether its sense of rotation is reversed."""
    row = _row(node, "function_enable", "reverse bit")
    await decided(node)
    return bool(await upload_row(node, row, int) >> REVERSED & 1)


async def set_reversed(node: Node, on: bool) -> None:
    """Reverse its sense of rotation, or not; the other bits of that object, which nobody knows, stay as they are.

    Read, changed, written, read back (three tries), saved and read back again. In the reversed state a change of one
    travel limit changes the other too, and the write may be undone by a restart: read reversed() after one. No source
    tells what becomes of the old target, so keep clear; it is refused while a stop is latched.
    """
    row = _row(node, "function_enable", "reverse bit")
    await decided(node)
    await Exclusive(_turned(node, row, on))


async def _turned(node: Node, row: Register, on: bool) -> None:
    raw = await upload_row(node, row, int)
    bit = 1 << REVERSED
    await keep(node, [(row, raw | bit if on else raw & ~bit)])


def _limits(node: Node) -> tuple[Register, Register]:
    return _row(node, "negative_limit", "travel limits"), _row(node, "positive_limit", "travel limits")


def _row(node: Node, name: str, what: str) -> Register:
    if name not in node.table:
        raise lacking(node, what, name)
    return node.table[name]


def _startable(node: Node) -> None:
    if node.dialect.nmt == "none":
        raise RequestError(
            f"node {node.node}: this bus has no form of start and stop",
            expected="nmt=vendor or nmt=standard",
            advice="leave nmt at `profile`; nothing was sent",
            node=node.node,
        )
