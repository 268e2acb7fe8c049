"""Move, stop, start.

The one motion command is a target position that takes effect at once, at the servo's own speed. A stop makes the
present position the target; torque stays on. Some makers ignore targets until the servo is started. Source: KST CAN
protocol manual, command 5; the start rule: a public XQPOWER module.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from math import inf
from typing import Final

from motorbus.core import move as core
from motorbus.core.family import State
from motorbus.core.register import Value, changed
from motorbus.core.request import Effect, Precondition, Priority, Request, Response
from motorbus.core.setpoint import Setpoint, Stays, torque_on
from motorbus.core.steps import gather
from motorbus.core.stream import PositionStream, read_positions
from motorbus.errors import DeviceError, LimitExceeded, MotorbusError, RequestError, Stalled
from motorbus.families.kst.driver import feedback
from motorbus.families.kst.driver.node import Node
from motorbus.families.kst.driver.requests import (
    ask_presence,
    is_absent,
    read_position,
    read_row,
    write_row,
)
from motorbus.families.kst.notifications import encode_start

TOLERANCE: Final = 0.02  # rad, about a degree; no source gives the error under load # assumption
SLOWEST: Final = 1.0
"""rad/s that each servo reaches; the default timeout of a move is computed with it. # assumption"""


class Promise(Enum):
    """What an acknowledged stop means."""

    HOLD_REQUESTED = (
        "target := last measured position, acknowledged: it holds there; standstill was not verified, its torque "
        "cannot be switched off"
    )


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
    profile has a start rule, a start is sent first. An interrupt of the wait stops the servo.
    """
    await core.move(MOVE, {node: to}, wait=wait, tolerance=tolerance, timeout=timeout)


class Move(core.MoveLogic[Node]):
    """How these servos move, see `core.move`."""

    tolerance, slowest = TOLERANCE, SLOWEST

    async def check(self, node: Node, to: float) -> Setpoint:
        value = node.table["goal_position"].to_value(target(node, to))
        return Setpoint(node.node, "position", float(value), *await limits(node))

    async def send(self, node: Node, goal: Setpoint) -> None:
        """Send the start, each time, because a servo forgets it when it loses its supply; then the target."""
        row = node.table["goal_position"]
        if node.settings.must_start:
            await start(node, goal)
        await write_row(node, row, node.raw(row, goal.value), (goal,))

    async def sample(self, node: Node) -> State:
        return State(position=await feedback.position(node), at=node.at)

    async def stop(self, node: Node) -> Promise:
        return await stop(node)

    def stalled(self, node: Node, state: State, goal: float) -> MotorbusError:
        here = state.position or 0.0
        alarm = f"; alarms: {', '.join(node.alarm)}" if node.alarm else ""
        return Stalled(
            f"node {node.node} stands at {here:.4g} rad, {abs(here - goal):.4g} rad off its goal{alarm}",
            cause="an obstacle, a heavy load, a weak supply, or a make that must be started first",
            advice="clear the way, or start it (profile=xqpower, nmt=standard); it still pushes: stop() ends that",
            node=node.node,
        )


MOVE: Final = Move()


def target(node: Node, to: Value) -> int:
    """The raw target, half a count away from zero. Raises LimitExceeded outside the range of the profile."""
    try:
        return node.raw(node.table["goal_position"], to)
    except RequestError as error:
        summary = f"node {node.node}: {error.summary}"
        raise LimitExceeded(summary, expected=error.expected, node=node.node) from None


async def limits(node: Node) -> tuple[float, float]:
    """Lowest and highest position (rad): the travel limits of the servo within the range of its profile; read once."""
    if node.limits is None:
        low, high = await travel(node)
        if "negative_limit" in node.table:
            low = max(low, await _limit(node, "negative_limit", low))
            high = min(high, await _limit(node, "positive_limit", high))
        node.limits = low, high
    return node.limits


async def _limit(node: Node, name: str, absent: float) -> float:
    row = node.table[name]
    try:
        return await read_row(node, row, lambda raw: float(row.to_value(raw)))
    except DeviceError as error:
        if not is_absent(error):
            raise
        return absent


async def travel(node: Node) -> tuple[float, float]:
    """Lowest and highest position of the profile (rad). Sends nothing."""
    row = node.table["goal_position"]
    return float(row.to_value(row.low)), float(row.to_value(row.high))


# -- stop ------------------------------------------------------------------------------------------------------


async def stop(node: Node) -> Promise:
    """Make the present position the target. Torque stays on: these servos have no switch for it."""
    requests = hold(node, await read_position(node, int))
    try:
        await requests[-1]
    except DeviceError:
        if len(requests) == 1:
            raise
        await requests[0]
    return Promise.HOLD_REQUESTED


def hold(node: Node, here: int, priority: Priority = Priority.CONTROL) -> list[Request[None]]:
    """The requests that make this position (raw) the target.

    A servo may refuse a position outside its range, so there the end of the range comes first.
    """
    limit, row = node.profile.limit, node.table["goal_position"]
    unlimited = changed(row, low=-0x8000, high=0x7FFF)
    requests = []
    for raw in dict.fromkeys((max(-limit, min(here, limit)), here)):
        value = float(row.to_value(raw))
        still = Setpoint(node.node, "position", value, value, value, Stays.STILL)
        requests.append(write_row(node, unlimited, raw, (still,), priority))
    return requests


# -- start -----------------------------------------------------------------------------------------------------


def start(node: Node, goal: Setpoint | None = None) -> Request[Response]:
    """Start this servo; it has no reply. With a `goal` the gate checks the start like that goal."""
    frame = node.settings.format(encode_start(node.node))
    effect, setpoint = (Effect.MOTION, goal) if goal else (Effect.TORQUE, torque_on(node.node))
    return Request(frame, lane=node.node, priority=Priority.CONTROL, effect=effect, setpoints=(setpoint,))


# -- control loop ----------------------------------------------------------------------------------------------


async def open_stream(servos: Sequence[Node], *, rate: int) -> PositionStream[Node]:
    """These servos for a control loop. Reads their limits and writes nothing; `rate` (bit/s) has no effect here.

    A target is checked against these limits. After a change of limits, mid point or sense of rotation it means
    something else and is refused. `start` makes the present position the target; the servos have no speed setting.
    Raises RequestError for no servo or a repeated one; else the first error of a servo.
    """

    async def read_limits(node: Node) -> tuple[float, float]:
        found = await limits(node)
        if node.at == -inf:  # the profile has no limits to read
            await ask_presence(node)
        return found

    found = await gather(*[read_limits(node) for node in servos])
    known = dict(zip(servos, found, strict=True))

    def goal(node: Node, to: float, precondition: Precondition) -> Request[None]:
        row, raw = node.table["goal_position"], target(node, to)
        setpoint = Setpoint(node.node, "position", float(row.to_value(raw)), *known[node])
        return write_row(node, row, raw, (setpoint,), precondition=precondition)

    async def start_one(node: Node, speed: float | None) -> None:
        if node.settings.must_start:
            await start(node)
        await stop(node)

    positions = [read_positions(node.node, feedback.position(node)) for node in servos]
    return PositionStream(servos, positions, goal, start_one, lambda node: node.limits != known[node])
