"""Holding, moving and standing still, such that nothing ever jumps.

What these servos do of their own accord decides the order of things: writing a goal position switches torque on
by itself; a goal velocity of 0 means "as fast as you can" or "not at all", as the phase register says; the moving
flag drops also when the servo stands off its goal. Source: STS3215 memory table V3.6; measured on hardware by
feetech-cli and servolab.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import Final

from motorbus.core.entry import Entry, Table
from motorbus.core.operation import Effect, Goal, Operation
from motorbus.errors import LimitExceeded, RequestError
from motorbus.families.feetech.driver.arrival import Move, arrive
from motorbus.families.feetech.driver.exchanges import PRESENT, Block, confirmed, read_block
from motorbus.families.feetech.driver.identity import prepare, refuse_unless_writable, writable
from motorbus.families.feetech.driver.node import POSITION, PWM, STEP, VELOCITY, Node
from motorbus.families.feetech.driver.orders import position_goal
from motorbus.families.feetech.driver.torque import TORQUE_ENABLE

TOLERANCE: Final = 0.05
"""rad; 32 counts. Under a load of 1.5 kg at 10 cm an STS3215 stays 20 to 30 counts off its goal (user reports)."""
NO_LOAD: Final = 3400
"""Counts/s of an STS3215 without load. Source: STS3215 memory table V3.6."""


class Promise(Enum):
    """What an acknowledged stop promises, and no more than that."""

    HOLD_ACCEPTED = "goal := present position accepted: it decelerates and holds; standstill was not verified"
    ZERO_VELOCITY_ACCEPTED = "goal velocity := 0 accepted: it decelerates; standstill was not verified"
    ZERO_DUTY_ACCEPTED = "duty := 0 accepted: it runs out without holding; standstill was not verified"
    TORQUE_OFF_ACCEPTED = "torque off accepted: it goes limp at once, and an arm sags or falls"


# -- hold and let go -----------------------------------------------------------------------------------------


def enable_torque(node: Node, *, jump: float = 0.0) -> Operation[None]:
    """Torque on without a jump: the goal becomes the present position first (velocity or duty 0 in those modes).

    A servo that was turned by hand beyond its limits would go for the nearer limit as soon as it holds; that is
    refused with LimitExceeded unless the way is at most `jump` (rad).
    """
    yield from prepare(node)
    table = yield from writable(node)
    if node.mode == POSITION:
        stands = yield from _stands(node, table)
        yield from confirmed(node, _hold(node, table, _within(node, table, stands, jump)))
    elif node.mode in (VELOCITY, PWM):
        yield from confirmed(node, _rest(node, table))
    elif node.mode != STEP:  # where torque alone moves nothing
        raise _unknown_mode(node)
    yield from confirmed(node, Block(TORQUE_ENABLE, b"\1", Effect.TORQUE))


def stop(node: Node) -> Operation[Promise]:
    """Decelerate and stay: the goal becomes the position of this moment (velocity or duty 0 in those modes).

    Returns what was promised. A limp servo begins to hold. Raises RequestError in step mode, where a goal is a
    way to go and nothing is known to end it but torque off.
    """
    table = yield from writable(node)
    if node.mode == POSITION:
        stands = yield from _stands(node, table)
        yield from confirmed(node, _hold(node, table, stands))
        return Promise.HOLD_ACCEPTED
    if node.mode == STEP:
        raise RequestError(
            f"node {node.node} is in step mode, where no goal means 'stay'",
            advice="use disable_torque(), after which it is limp; nothing was sent",
            node=node.node,
        )
    if node.mode not in (VELOCITY, PWM):
        raise _unknown_mode(node)
    yield from confirmed(node, _rest(node, table))
    return Promise.ZERO_DUTY_ACCEPTED if node.mode == PWM else Promise.ZERO_VELOCITY_ACCEPTED


def _stands(node: Node, table: Table) -> Operation[int]:
    """Raw present position."""
    row = table["present_position"]
    return (yield from read_block(node, PRESENT, row.size, row.decode))


def _hold(node: Node, table: Table, raw: int) -> Block:
    """Goal := this position. Staying where it stands is inside any limits, so the goal brings its own."""
    row = table["goal_position"]
    value = node.value(row, raw)
    return Block(
        row.address, row.encode(raw), row.effect, (Goal(node.node, "position", value, value, value),)
    )


def _rest(node: Node, table: Table) -> Block:
    """Velocity 0 or duty 0, as the mode asks for."""
    row, quantity = table["goal_velocity"], "velocity"
    if node.mode == PWM:
        row, quantity = table["goal_time"], "load"
    return Block(row.address, row.encode(0), row.effect, (Goal(node.node, quantity, 0.0, 0.0, 0.0),))


def _unknown_mode(node: Node) -> RequestError:
    return RequestError(
        f"node {node.node} is in operating mode {node.mode}, which is not documented",
        expected="0 position, 1 velocity, 2 PWM, 3 step",
        advice="write(operating_mode=0) puts it into position mode; disable_torque() lets it go limp",
        node=node.node,
    )


def _within(node: Node, table: Table, raw: int, jump: float) -> int:
    """Where the servo will hold: here, or at the limit it would go for, when that is near enough."""
    row = table["goal_position"]
    here = node.value(row, raw)
    assert node.limits is not None
    low, high = node.limits
    there = min(max(here, low), high)
    if abs(here - there) > jump + row.scale / 2:
        raise LimitExceeded(
            f"node {node.node} stands at {here:.4g} rad, outside its limits {low:.4g} to {high:.4g} rad: "
            f"with torque on it would jump to {there:.4g} rad",
            advice=f"turn it inside by hand, or say enable_torque(jump={abs(here - there) + 0.001:.3f})",
            node=node.node,
        )
    return node.raw(row, there)


# -- move ----------------------------------------------------------------------------------------------------


def move(
    node: Node,
    to: float,
    *,
    velocity: float | None = None,
    acceleration: float | None = None,
    wait: bool = True,
    tolerance: float = TOLERANCE,
    timeout: float | None = None,
) -> Operation[None]:
    """Move to `to` rad, at most at `velocity` rad/s and `acceleration` rad/s² (None: the servo's maximum).

    Goal, velocity and acceleration leave in one packet. Torque goes on by itself. Returns when the servo is in
    position within `tolerance` rad and no longer moves; at once with `wait=False`. Raises LimitExceeded when `to`
    is not a finite number (and the gate does outside the limits), RequestError in other than position mode,
    Stalled when it stays off its goal, MotionError after `timeout` seconds (None: from the way and the velocity).
    """
    _finite(node, to, velocity, acceleration, tolerance, timeout)
    table = yield from writable(node)
    block = move_block(node, table, to, velocity, acceleration)
    yield from confirmed(node, block)
    if wait:
        goal = block.goals[0].value
        yield from arrive(node, table, Move(goal, velocity, acceleration, tolerance, timeout))


def move_block(
    node: Node, table: Table, to: float, velocity: float | None = None, acceleration: float | None = None
) -> Block:
    """Registers 41 to 47 at once: acceleration, goal position, goal time, goal velocity.

    Raises DeviceError for a servo whose map is not commanded here: on HLS the 0 for the time would be a torque of 0.
    """
    refuse_unless_writable(node)
    goal, time, speed, ramp = (
        table[name] for name in ("goal_position", "goal_time", "goal_velocity", "acceleration")
    )
    raw, order = position_goal(node, goal, to)
    data = ramp.encode(_positive(node, ramp, acceleration)) + goal.encode(raw) + time.encode(0)
    return Block(ramp.address, data + speed.encode(_speed(node, speed, velocity)), goal.effect, (order,))


def _speed(node: Node, row: Entry, velocity: float | None) -> int:
    """Raw goal velocity. Where 0 means standstill, the maximum has to be said as a number."""
    if velocity is None and node.settings is not None and not node.settings.zero_is_maximum:
        return max(1, node.raw(row, NO_LOAD * row.scale))
    return _positive(node, row, velocity)


def _positive(node: Node, row: Entry, value: float | None) -> int:
    """Raw value of a bound that must not become 0, for 0 means 'no bound' (None says that)."""
    if value is None:
        return 0
    raw = node.raw(row, value)
    if raw > 0:
        return raw
    raise RequestError(
        f"{row.name}: {value} {row.unit} is not above 0, or is less than this servo can be told",
        expected=f"{node.value(row, 1):.4g} to {node.value(row, row.high):.4g} {row.unit}",
        advice="leave it out for the maximum; nothing was sent",
        node=node.node,
    )


def _finite(node: Node, to: float, *bounds: float | None) -> None:
    if not math.isfinite(to):
        raise LimitExceeded(
            f"node {node.node}: {to} is no position",
            advice="give a number in rad; nothing was sent",
            node=node.node,
        )
    for bound in bounds:
        if (bound is not None and not bound >= 0) or bound == math.inf:
            raise RequestError(
                f"node {node.node}: {bound} is not a finite number above 0",
                advice="velocity in rad/s, acceleration in rad/s², tolerance in rad, timeout in s; nothing was sent",
                node=node.node,
            )
