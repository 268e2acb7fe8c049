"""Settings of newer firmware: reports, mid point, travel limits, sense of rotation.

The manual has none of these; a profile without them raises RequestError and names those that have them. Sources: the
rows.
"""

from __future__ import annotations

from motorbus.core.register import Register
from motorbus.core.request import Priority
from motorbus.core.steps import Exclusive, Sleep
from motorbus.errors import RequestError
from motorbus.families.kst.driver.feedback import position
from motorbus.families.kst.driver.motion import start_request
from motorbus.families.kst.driver.node import Node, feature_row
from motorbus.families.kst.driver.requests import read_register, write_register
from motorbus.families.kst.driver.storage import save, store
from motorbus.families.kst.profiles import REVERSED


async def start_reports(node: Node, interval: float | None = None) -> None:
    """Let the servo report its position every `interval` s (None: as it is set); it does not acknowledge that.

    Where the profile has a start rule, this start also lets it move. Raises RequestError where the profile has no
    reports, or for an interval out of range.
    """
    row = _report_row(node)
    if interval is not None:
        await write_register(node, row, node.raw(row, interval))
    await start_request(node, True)


async def stop_reports(node: Node) -> None:
    """End the reports. Where the profile has a start rule, the servo then ignores positions until the next start."""
    _report_row(node)
    await start_request(node, False)


def _report_row(node: Node) -> Register:
    row = feature_row(node, "report_interval", "reports")
    if node.settings.nmt == "none":
        raise RequestError(
            f"node {node.node}: this bus has no form of start and stop",
            expected="nmt=profile, nmt=vendor or nmt=standard",
            node=node.node,
        )
    return row


async def set_mid_point(node: Node) -> float:
    """Make the present position the zero and save it; return the position (rad) read afterwards, about 0.

    If the servo reads 0 already and this node has no unsaved mid point, nothing is written, because flash wears. No
    source says whether the servo then moves to its old target: keep clear, and send a target next. A latched stop
    refuses the request; it is never repeated, so OutcomeUnknown says that the servo may have received it.
    """
    row, profile = feature_row(node, "mid_point", "mid point"), node.profile

    async def write_and_save() -> float:
        if row.name not in node.unsaved and not await position(node):
            return 0.0
        node.limits = None
        node.unsaved.add(row.name)
        await write_register(node, row, profile.mid_point_value, priority=Priority.CONFIGURATION)
        await save(node)
        await Sleep(max(0.0, profile.mid_point_wait - profile.flash_wait))
        node.unsaved.discard(row.name)
        return await position(node)

    return await Exclusive(write_and_save())


async def travel_limits(node: Node) -> tuple[float, float]:
    """Lowest and highest position (rad) in the settings of the servo."""
    low, high = _limit_rows(node)
    raws = await read_register(node, low, int), await read_register(node, high, int)
    return float(low.to_value(raws[0])), float(high.to_value(raws[1]))


async def set_travel_limits(node: Node, low: float, high: float) -> None:
    """Limit the travel to `low` (at most 0) and `high` (at least 0) rad; see `storage.store`.

    While the sense of rotation is reversed, a change of one limit changes the other too: VerificationFailed says so
    unless they are symmetric; use set_reversed(False) first. Raises RequestError for impossible or equal limits.
    """
    values = [(row, node.raw(row, value)) for row, value in zip(_limit_rows(node), (low, high), strict=True)]
    if values[0][1] == values[1][1]:
        raise RequestError(
            f"node {node.node}: between limits {low} and {high} rad it cannot move",
            expected="a low limit below 0, or a high one above",
            node=node.node,
        )
    await store(node, values)


def _limit_rows(node: Node) -> tuple[Register, Register]:
    return feature_row(node, "negative_limit", "travel limits"), feature_row(
        node, "positive_limit", "travel limits"
    )


async def reversed_(node: Node) -> bool:
    """Whether the sense of rotation is reversed."""
    row = feature_row(node, "function_enable", "reverse bit")
    return bool(await read_register(node, row, int) >> REVERSED & 1)


async def set_reversed(node: Node, on: bool) -> None:
    """Reverse the sense of rotation, or not; the other bits of that object, which are unknown, are kept.

    See `storage.store`. A restart may undo it: read reversed() after one. No source says whether the servo moves to its
    old target then: keep clear. A latched stop refuses the request.
    """
    row, bit = feature_row(node, "function_enable", "reverse bit"), 1 << REVERSED

    async def read_modify_write() -> None:
        raw = await read_register(node, row, int)
        await store(node, [(row, raw | bit if on else raw & ~bit)])

    await Exclusive(read_modify_write())
