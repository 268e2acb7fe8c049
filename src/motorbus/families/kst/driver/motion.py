"""Move and stop.

The one motion command is a target position that takes effect at once, at the servo's own speed. A stop makes the
present position the target; torque stays on. Some makers ignore targets until the servo is started. Source: KST CAN
protocol manual, command 5; the start rule: a public XQPOWER module.
"""

from __future__ import annotations

from enum import Enum
from functools import partial
from typing import Final, NamedTuple

from motorbus.core.arrival import wait_in_position
from motorbus.core.can_frame import CanFrame
from motorbus.core.family import State
from motorbus.core.interrupted import Moving, stopped_if_interrupted
from motorbus.core.register import Register, changed
from motorbus.core.request import Effect, Priority, Request, Response
from motorbus.core.setpoint import Setpoint, Stays, torque_on
from motorbus.core.steps import Emit, catch
from motorbus.errors import DeviceError, LimitExceeded, MotorbusError, RequestError, Stalled
from motorbus.families.kst.driver.feedback import position
from motorbus.families.kst.driver.node import Node, check_above_zero
from motorbus.families.kst.driver.requests import acknowledged, is_absent, read_register, write_register
from motorbus.families.kst.notifications import encode_start

TOLERANCE: Final = 0.02  # rad, about a degree; no source gives the error under load # assumption
SLOWEST: Final = 1.0
"""rad/s that each servo reaches; the default timeout of a move is computed with it. # assumption"""


class Promise(Enum):
    """What an acknowledged stop means."""

    HOLD_REQUESTED = (
        "target := last fresh position: requested of each node that acknowledged; it goes back or on to where it "
        "was then and holds there; standstill was not verified, and there is no way to switch its torque off"
    )


class Started(NamedTuple):
    """An event: this servo was started, because its maker's servos ignore positions before."""

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
    """Move to `to` rad at the servo's own speed; return when it is in position, at once with `wait=False`.

    In position: two readings in a row within `tolerance` rad. Raises LimitExceeded outside the range of the profile
    or the travel limits of the servo; Stalled; MotionError after `timeout` s (None: from the distance). Where the
    profile has a start rule, a start is sent first (`Started`). An interrupt of the wait stops the servo.
    """
    raw = target(node, to)
    check_above_zero("tolerance", tolerance, "rad", node=node.node)
    if timeout is not None:
        check_above_zero("timeout", timeout, "s", node=node.node)
    goal = await setpoint(node, raw)
    if not wait:
        node.last_move = None
        await send_target(node, goal)
        return

    async def send_and_wait() -> None:
        await send_target(node, goal)
        await wait_arrival(node, goal.value, tolerance, timeout)

    device = Moving(node, partial(stop, node), partial(position, node))
    await stopped_if_interrupted(send_and_wait(), device)


async def wait_arrival(
    node: Node, goal: float, tolerance: float = TOLERANCE, timeout: float | None = None
) -> None:
    """Wait until the servo is in position. Raises Stalled, or MotionError after `timeout` s."""

    async def sample() -> State:
        return State(position=await position(node), at=node.at)

    async def stalled(state: State) -> Stalled:
        here = state.position or 0.0
        alarm = f"; alarms: {', '.join(node.alarm)}" if node.alarm else ""
        return Stalled(
            f"node {node.node} stands at {here:.4g} rad, {abs(here - goal):.4g} rad off its goal{alarm}",
            expected=f"within {tolerance:.4g} rad",
            cause="an obstacle, a heavy load, a weak supply, or a make that must be started first",
            advice="clear the way, or start it (profile=xqpower, nmt=standard); it still pushes: stop() ends that",
            node=node.node,
        )

    def longest(distance: float) -> float:
        return 1.0 + 2.0 * distance / SLOWEST if timeout is None else timeout

    await wait_in_position(
        sample, goal, node=node.node, tolerance=tolerance, timeout=longest, stalled=stalled
    )


def target(node: Node, to: float) -> int:
    """The raw target, half a count away from zero. Raises LimitExceeded outside the range of the profile."""
    try:
        return node.raw(node.table["goal_position"], to)
    except RequestError as error:
        summary = f"node {node.node}: {error.summary}"
        raise LimitExceeded(summary, expected=error.expected, node=node.node) from None


async def setpoint(node: Node, raw: int) -> Setpoint:
    """This raw target as a setpoint, with the limits of the servo for the gate."""
    low, high = await limits(node)
    return Setpoint(node.node, "position", float(node.table["goal_position"].to_value(raw)), low, high)


async def send_target(node: Node, goal: Setpoint) -> None:
    """Send a target; before it the start, each time, because a servo forgets it when it loses its supply."""
    row = node.table["goal_position"]
    if node.settings.must_start:
        await start(node, goal)
    await write_register(node, row, node.raw(row, goal.value), (goal,))


async def start(node: Node, goal: Setpoint | None = None) -> None:
    """Start this servo and report it. With a `goal` the gate checks the start like that goal."""
    request = start_request(node, True, goal)
    await request
    assert isinstance(request.wire, CanFrame)
    await Emit(Started(node.node, request.wire))


def start_request(node: Node, on: bool, goal: Setpoint | None = None) -> Request[object]:
    """Start or stop, in the form of this bus; it has no reply. A start that lets a servo move counts as torque on."""
    form = node.settings.nmt
    frame = node.settings.format(encode_start(form, node.node, on))
    effect = Effect.NONE
    setpoints: tuple[Setpoint, ...] = ()
    if node.settings.must_start:
        effect = Effect.MOTION if goal else Effect.TORQUE
        setpoints = (goal or torque_on(node.node),) if on else ()
    return Request(frame, (), lane=node.node, priority=Priority.CONTROL, effect=effect, setpoints=setpoints)


async def stop(node: Node) -> Promise:
    """Make the present position the target. Torque stays on: these servos have no switch for it."""
    here = await read_register(node, node.table["present_position"], int, reports_position=True)
    requests = hold(node, here)
    try:
        await requests[-1]
    except DeviceError:
        if len(requests) == 1:
            raise
        await requests[0]
    return Promise.HOLD_REQUESTED


def hold(node: Node, here: int, priority: Priority = Priority.CONTROL) -> list[Request[Response]]:
    """The requests that make this position (raw) the target.

    A servo may refuse a position outside its range, so there the end of the range comes first.
    """
    limit, row = node.profile.limit, node.table["goal_position"]
    unlimited = changed(row, low=-0x8000, high=0x7FFF)
    requests = []
    for raw in dict.fromkeys((max(-limit, min(here, limit)), here)):
        value = float(row.to_value(raw))
        still = Setpoint(node.node, "position", value, value, value, Stays.STILL)
        request = write_register(node, unlimited, raw, (still,), priority=priority)
        requests.append(request.with_decoder(acknowledged(node, row)))
    return requests


async def limits(node: Node) -> tuple[float, float]:
    """Lowest and highest position (rad): the travel limits of the servo within the range of its profile; read once."""
    if node.limits is None:
        goal = node.table["goal_position"]
        low, high = goal.low, goal.high
        if "negative_limit" in node.table:
            low = max(low, await _limit(node, node.table["negative_limit"], low))
            high = min(high, await _limit(node, node.table["positive_limit"], high))
        node.limits = float(goal.to_value(low)), float(goal.to_value(high))
    return node.limits


async def _limit(node: Node, row: Register, absent: int) -> int:
    found = await catch(read_register(node, row, int))
    if isinstance(found, MotorbusError) and not is_absent(found):
        raise found
    return found if isinstance(found, int) else absent


async def travel(node: Node) -> tuple[float, float]:
    """Lowest and highest position of the profile (rad). Sends nothing."""
    row = node.table["goal_position"]
    return float(row.to_value(row.low)), float(row.to_value(row.high))
