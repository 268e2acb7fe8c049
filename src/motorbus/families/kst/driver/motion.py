"""Moving and standing still.

These servos know one thing: a target position, at which they go by themselves, at once and at their own speed. They
have no torque switch, and standing still is a target too: the position of this moment. Some makes ignore every
target until they were started. Source: KST CAN protocol manual, command 5; the start rule is from a public XQPOWER
module.
"""

from __future__ import annotations

from enum import Enum
from functools import partial
from typing import Final, NamedTuple

from motorbus.core.can_frame import CanFrame
from motorbus.core.interrupted import Moving, stopped_if_interrupted
from motorbus.core.register import Register, changed
from motorbus.core.request import Effect, Priority, Request
from motorbus.core.setpoint import Setpoint, Stays, torque_on
from motorbus.core.steps import Emit
from motorbus.errors import DeviceError, LimitExceeded, RequestError
from motorbus.families.kst import wire
from motorbus.families.kst.driver.arrival import Move, arrive
from motorbus.families.kst.driver.exchanges import ABSENT, decided, meant, order, upload_row
from motorbus.families.kst.driver.feedback import position
from motorbus.families.kst.driver.node import Node
from motorbus.families.kst.driver.refusals import above_zero

TOLERANCE: Final = 0.02
"""rad, a little more than a degree: under load a servo stays off its target, by how much no source tells."""
TOO_FAR: Final = frozenset((0x0609_0030, 0x0609_0031, 0x0609_0032))
"""Refusals of a position beyond the range."""


class Promise(Enum):
    """What an acknowledged stop promises, and no more than that."""

    HOLD_REQUESTED = (
        "target := last fresh position: requested of each node that acknowledged; it goes back or on to where it "
        "was then and holds there; standstill was not verified, and there is no way to switch its torque off"
    )


class Started(NamedTuple):
    """An event: this servo was started, because its make ignores positions before that."""

    node: int
    frame: CanFrame


async def move(
    node: Node,
    to: float,
    *,
    wait: bool = True,
    tolerance: float = TOLERANCE,
    timeout: float | None = None,
) -> None:
    """Move to `to` rad, at the servo's own speed; returns when it is in position, at once with `wait=False`.

    In position is: two looks in a row within `tolerance` rad. Raises LimitExceeded when `to` is not a finite number,
    is outside the profile's range (nothing is sent then) or outside the travel limits of the servo, Stalled when it
    stays off its target, MotionError after `timeout` seconds (None: from the way). Where the profile has a start rule,
    the start is sent first and reported as `Started`. When the wait is interrupted or cancelled the servo stops and
    holds, and a note of the interruption says where; with `wait=False` it goes to its target.
    """
    raw = counts(node, to)
    _checked_waiting(node, tolerance, timeout)
    goal = await goal_of(node, raw)
    if not wait:
        node.last_move = None
        await send_goal(node, goal)
        return
    order = Move(goal.value, tolerance, timeout)
    device = Moving(node, partial(stop, node), partial(position, node))
    await stopped_if_interrupted(_gone(node, goal, order), device)


async def _gone(node: Node, goal: Setpoint, order: Move) -> None:
    await send_goal(node, goal)
    await arrive(node, order)


async def goal_of(node: Node, raw: int) -> Setpoint:
    """What this raw target orders, with the limits for the gate: those of the servo, else those of the profile."""
    known = await limits(node)
    return Setpoint(node.node, "position", float(node.table["goal_position"].to_value(raw)), *known)


async def limits(node: Node) -> tuple[float, float]:
    """Lowest and highest position it goes to, rad: its travel limits inside the range of its profile; read once."""
    if node.limits is None:
        node.limits = await _limits(node)
    return node.limits


async def travel(node: Node) -> tuple[float, float]:
    """Lowest and highest position of its profile, rad; nothing is sent."""
    row = node.table["goal_position"]
    return float(row.to_value(row.low)), float(row.to_value(row.high))


async def send_goal(node: Node, goal: Setpoint) -> None:
    """Order a target, with the start first where the profile has that rule; it is sent each time, for a servo that
    lost its supply has forgotten it, and it costs a short frame."""
    row = node.table["goal_position"]
    if node.dialect.must_start:
        await started(node, goal)
    await order(node, row, node.raw(row, goal.value), (goal,))


async def started(node: Node, goal: Setpoint | None = None) -> None:
    """Start this servo and say so; where that is for a goal, the start is refused if the goal would be."""
    request = start_exchange(node, True, goal)
    assert isinstance(request.wire, CanFrame)
    await request
    await Emit(Started(node.node, request.wire))


def start_exchange(node: Node, on: bool, goal: Setpoint | None = None) -> Request[None]:
    """Start or stop, in the form of this bus; nobody answers. Where it lets a servo move, it counts as torque; with the
    `goal` that it is started for, as motion."""
    form = node.dialect.nmt
    frame = wire.encode_start(form, node.node, on, extended=node.dialect.extended(node.node))
    effect = Effect.NONE if form != "standard" else Effect.MOTION if goal else Effect.TORQUE
    goals = () if form != "standard" or not on else (goal or torque_on(node.node),)
    return Request(
        frame, (), lambda _: None, lane=node.node, priority=Priority.CONTROL, effect=effect, setpoints=goals
    )


async def stop(node: Node) -> Promise:
    """Stay: the target becomes the position of this moment. Returns what was promised.

    The servo comes back to where it was when it was asked. Its torque stays on: these servos have no switch for it.
    """
    await decided(node)
    here = await upload_row(node, node.table["present_position"], int, reports_position=True)
    row = node.table["goal_position"]
    try:
        await _hold(node, row, here)
    except DeviceError as refusal:
        if meant(refusal.code) not in TOO_FAR or abs(here) <= node.profile.limit:
            raise
        await _hold(node, row, max(-node.profile.limit, min(here, node.profile.limit)))
    return Promise.HOLD_REQUESTED


async def _hold(node: Node, row: Register, raw: int) -> None:
    """Target := this place, also when it lies beyond the range, for there it stands; the goal brings its own limits."""
    value = float(row.to_value(raw))
    goal = Setpoint(node.node, "position", value, value, value, Stays.STILL)
    await order(node, beyond(row), raw, (goal,))


def beyond(row: Register) -> Register:
    """The same row with all that its bytes can say for its range."""
    reach = 1 << 8 * row.size - 1
    return changed(row, low=-reach, high=reach - 1)


async def _limits(node: Node) -> tuple[float, float]:
    """The servo's travel limits where it has and tells them, inside the range of its profile."""
    goal = node.table["goal_position"]
    low, high = goal.low, goal.high
    await decided(node)
    for name in ("negative_limit", "positive_limit"):
        if name in node.table:
            raw = await _if_there(node, node.table[name])
            low, high = (max(low, raw), high) if name == "negative_limit" else (low, min(high, raw))
    return float(goal.to_value(low)), float(goal.to_value(high))


async def _if_there(node: Node, row: Register) -> int:
    """Its raw value; where the servo lacks it, the row's own outer bound."""
    try:
        return await upload_row(node, row, int)
    except DeviceError as refusal:
        if meant(refusal.code) not in ABSENT:
            raise
        return row.low or row.high


def counts(node: Node, to: float) -> int:
    """The raw target, halves away from zero. Raises LimitExceeded for what is no finite angle within the profile."""
    row = node.table["goal_position"]
    try:
        return node.raw(row, to)
    except RequestError as refusal:
        if isinstance(to, bool) or not isinstance(to, int | float):
            raise
        raise LimitExceeded(
            f"node {node.node}: {refusal.summary}",
            expected=refusal.expected,
            advice=refusal.advice,
            node=node.node,
        ) from None


def _checked_waiting(node: Node, tolerance: float, timeout: float | None) -> None:
    above_zero("tolerance", tolerance, "rad", node=node.node)
    if timeout is not None:
        above_zero("timeout", timeout, "s", node=node.node)
