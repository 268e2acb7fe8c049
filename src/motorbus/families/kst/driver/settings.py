"""Settings that survive power-off, and reports.

A save has no reply, requests during the write to flash are lost or answered with transitional values, and some writes
fail or are undone. So a value is written, read back, saved, and read back again; that it is saved shows after a restart
only. Source: KST CAN protocol manual, command 3; a public flight-controller driver for the wait and the reading back.
The manual has none of these settings; a profile without one raises RequestError and names those that have it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Final

from motorbus.core import verify
from motorbus.core.register import Register
from motorbus.core.request import ANY, Effect, Priority, Request, Response, TimeoutClass
from motorbus.core.steps import Exclusive, Sleep
from motorbus.errors import DeviceError, RequestError, VerificationFailed
from motorbus.families.kst.driver.feedback import position
from motorbus.families.kst.driver.motion import start_request
from motorbus.families.kst.driver.node import Node, feature_row
from motorbus.families.kst.driver.requests import decoded, is_absent, read_register, refused, write_register
from motorbus.families.kst.profiles import REVERSED, SAVE

LISTEN: Final = 0.020
"""s after a save in which an acknowledgement or an abort is accepted; the manual says that neither comes."""


def save(node: Node) -> Request[None]:
    """Store node id, bit rate, travel limits and function bits; never the target position.

    The request holds the lane of the node until flash is written. No reply is expected; an abort raises DeviceError.
    """
    row = node.table["store"]

    def decode(answer: Response) -> None:
        node.at = answer.at
        for reply in decoded(answer):
            if reply.kind == "abort" and reply.index in (row.address, 0):
                raise refused(node, row, reply)

    return Request(
        node.settings.download(node.node, row, SAVE),
        ANY,
        decode,
        lane=node.node,
        priority=Priority.CONFIGURATION,
        effect=Effect.PERSISTENT,
        reply_within=TimeoutClass.STORE,
    )


async def store(node: Node, values: Sequence[tuple[Register, int]]) -> None:
    """Write these rows, read them back, save, and read them back again, with the bus reserved.

    Nothing is written if all rows read so already; values that this node has saved before are not saved again, because
    flash wears. Raises VerificationFailed when a row reads back different after three tries, or after the save.
    """
    wanted = {row.name: raw for row, raw in values}
    reads = [partial(read_register, node, row, int) for row, _ in values]

    async def check_all() -> None:
        for read, (row, raw) in zip(reads, values, strict=True):
            differs = partial(_differs, node, row, raw)
            await verify.check(read, raw, node=node.node, what=row.name, differs=differs)

    async def read_equal() -> bool:
        for read, raw in zip(reads, wanted.values(), strict=True):
            if await read() != raw:
                return False
        return True

    async def write_and_save() -> None:
        node.limits = None
        if await read_equal():
            if wanted.items() <= node.saved.items():
                return
        else:
            for read, (row, raw) in zip(reads, values, strict=True):
                write = partial(write_register, node, row, raw, priority=Priority.CONFIGURATION)
                differs = partial(_differs, node, row, raw)
                await verify.write_verified(write, read, raw, node=node.node, what=row.name, differs=differs)
            await check_all()  # one may have changed another
        for name in wanted:
            node.saved.pop(name, None)
        await save(node)
        await check_all()
        node.saved |= wanted

    await Exclusive(write_and_save())


def _differs(node: Node, row: Register, raw: int, found: int) -> VerificationFailed:
    cause = "the servo does not take this value, or a write failed, which is known of these servos"
    if row.name.endswith("_limit"):
        cause = (
            "while the sense of rotation is reversed a change of one travel limit changes the other too: "
            "set_reversed(False) first, or give symmetric limits"
        )
    return VerificationFailed(
        f"node {node.node}: {row.name} reads back {found}, not {raw}", cause=cause, node=node.node
    )


async def set_mid_point(node: Node) -> float:
    """Make the present position the zero and save it; return the position (rad) read afterwards, about 0.

    Nothing is written if the servo reads 0 and this node has saved its mid point: flash wears. No source says whether
    the servo then moves to its old target: keep clear, and send a target next. The request is never repeated:
    OutcomeUnknown says that the servo may have received it.
    """
    row, profile = feature_row(node, "mid_point", "mid point"), node.profile

    async def write_and_save() -> float:
        if await position(node) == 0 and row.name in node.saved:
            return 0.0
        node.limits = None
        node.saved.pop(row.name, None)
        await write_register(node, row, profile.mid_point_value, priority=Priority.CONFIGURATION)
        await save(node)
        await Sleep(max(0.0, profile.mid_point_wait - profile.flash_wait))  # `save` has waited for the flash
        node.saved[row.name] = profile.mid_point_value
        return await position(node)

    return await Exclusive(write_and_save())


def _limit_rows(node: Node) -> tuple[Register, Register]:
    names = "negative_limit", "positive_limit"
    return feature_row(node, names[0], "travel limits"), feature_row(node, names[1], "travel limits")


async def travel_limits(node: Node) -> tuple[float, float]:
    """Lowest and highest position (rad) in the settings of the servo."""
    low, high = _limit_rows(node)
    return (
        float(low.to_value(await read_register(node, low, int))),
        float(high.to_value(await read_register(node, high, int))),
    )


async def set_travel_limits(node: Node, low: float, high: float) -> None:
    """Limit the travel to `low` (at most 0) and `high` (at least 0) rad; see `store`.

    While the sense of rotation is reversed, a change of one limit changes the other too: set_reversed(False) first, or
    give symmetric limits. Raises RequestError for impossible or equal limits.
    """
    values = [(row, node.raw(row, value)) for row, value in zip(_limit_rows(node), (low, high), strict=True)]
    if values[0][1] == values[1][1]:
        raise RequestError(
            f"node {node.node}: between limits {low} and {high} rad it cannot move",
            expected="a low limit below 0, or a high one above",
            node=node.node,
        )
    await store(node, values)


async def reversed_(node: Node) -> bool:
    """Whether the sense of rotation is reversed."""
    row = feature_row(node, "function_enable", "reverse bit")
    return bool(await read_register(node, row, int) >> REVERSED & 1)


async def set_reversed(node: Node, on: bool) -> None:
    """Reverse the sense of rotation, or not; the other bits of that object, which are unknown, are kept.

    A restart may undo it: read reversed() after one. No source says whether the servo moves to its old target: keep
    clear.
    """
    row, bit = feature_row(node, "function_enable", "reverse bit"), 1 << REVERSED

    async def read_modify_write() -> None:
        raw = await read_register(node, row, int)
        await store(node, [(row, raw | bit if on else raw & ~bit)])

    await Exclusive(read_modify_write())


async def start_reports(node: Node, interval: float | None = None) -> None:
    """Let the servo report its position every `interval` s (None: as it is set); it does not acknowledge that.

    Where the profile has a start rule, this start also lets it move. Raises RequestError for an interval out of range.
    """
    row = _report_row(node)
    if interval is not None:
        try:
            await write_register(node, row, node.raw(row, interval))
        except DeviceError as error:
            if is_absent(error):
                error.advice = "leave out the interval: this firmware reports at its own"
            raise
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
