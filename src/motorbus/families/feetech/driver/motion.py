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

from motorbus.core.entry import Table
from motorbus.core.operation import Effect, Operation
from motorbus.errors import LimitExceeded, RequestError
from motorbus.families.feetech.driver.arrival import Move, arrive
from motorbus.families.feetech.driver.bound import ask_bound
from motorbus.families.feetech.driver.exchanges import Block, confirmed
from motorbus.families.feetech.driver.identity import prepare, writable
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.orders import position_goal
from motorbus.families.feetech.driver.pace import burst, ramp_of
from motorbus.families.feetech.driver.rest import at_rest, held, held_within, unknown_mode, with_bound
from motorbus.families.feetech.driver.torque import TORQUE_ENABLE
from motorbus.families.feetech.table import Mode

TOLERANCE: Final = 0.05
"""rad; 32 counts of STS. Under a load of 1.5 kg at 10 cm an STS3215 stays 20 to 30 counts off its goal (user
reports)."""
COUNTS: Final = 10
"""Counts of any servo within which it is in position, where these are more: one of SCS is 3.3 times one of STS, and an
angular resolution stretches each."""


class Promise(Enum):
    """What an acknowledged stop promises, and no more than that."""

    HOLD_ACCEPTED = "goal := present position accepted: it decelerates and holds; standstill was not verified"
    ZERO_VELOCITY_ACCEPTED = "goal velocity := 0 accepted: it decelerates; standstill was not verified"
    ZERO_DUTY_ACCEPTED = "duty := 0 accepted: it runs out without holding; standstill was not verified"
    ZERO_CURRENT_ACCEPTED = "current := 0 accepted: it runs out without holding; standstill was not verified"
    TORQUE_OFF_ACCEPTED = "torque off accepted: it goes limp at once, and an arm sags or falls"


ON: Final = Block(TORQUE_ENABLE, b"\1", Effect.TORQUE)
_AT_REST: Final = {
    Mode.VELOCITY: Promise.ZERO_VELOCITY_ACCEPTED,
    Mode.PWM: Promise.ZERO_DUTY_ACCEPTED,
    Mode.CURRENT: Promise.ZERO_CURRENT_ACCEPTED,
}

# -- hold and let go -----------------------------------------------------------------------------------------


def enable_torque(node: Node, *, jump: float = 0.0) -> Operation[None]:
    """Torque on without a jump: the goal becomes the present position first (velocity, duty or current 0 there).

    Where a goal velocity of 0 means standstill and nothing else is set, that becomes the maximum, so that goals which
    come without a velocity are gone to.

    A servo that was turned by hand beyond its limits would go for the nearer limit as soon as it holds; that is
    refused with LimitExceeded unless the way is at most `jump` (rad). Raises RequestError where no order is known that
    would not move it: in PWM mode of HLS, in a mode that no source explains, on SMCL with both limits 0, and on a servo
    of many turns that tells its position within one (there `jump` must be as much as all of them).
    """
    yield from prepare(node)
    table = yield from writable(node)
    mode = node.known_mode
    if mode is None:
        raise unknown_mode(node)
    if mode is Mode.POSITION:
        yield from ordered(node, table, (yield from held_within(node, table, jump)))
    elif mode is Mode.VELOCITY:
        yield from ask_bound(node, table)
        yield from ordered(node, table, with_bound(node, table, at_rest(node, table, mode)))
    elif mode is not Mode.STEP:  # where torque alone moves nothing
        yield from ordered(node, table, at_rest(node, table, mode))
    yield from confirmed(node, ON)


def stop(node: Node) -> Operation[Promise]:
    """Decelerate and stay: the goal becomes the position of this moment (velocity, duty or current 0 in those modes).

    Returns what was promised. A limp STS servo begins to hold, a limp one of another map may stay limp. Raises
    RequestError where nothing is known to end a movement but torque off: in step mode, where a goal is a way to go; in
    PWM mode of HLS; in a mode that no source explains; on a servo of many turns that tells its position within one.
    """
    table = yield from writable(node)
    mode = node.known_mode
    if mode is None:
        raise unknown_mode(node)
    if mode is Mode.STEP:
        raise RequestError(
            f"node {node.node} is in step mode, where no goal means 'stay'",
            advice="use disable_torque(), after which it is limp; nothing was sent",
            node=node.node,
        )
    if mode is Mode.POSITION:
        yield from ordered(node, table, (yield from held(node, table)))
        return Promise.HOLD_ACCEPTED
    yield from ordered(node, table, at_rest(node, table, mode))
    return _AT_REST[mode]


def ordered(node: Node, table: Table, block: Block) -> Operation[None]:
    """Write an order and be sure of it; what it says of the bound of the current is known from then on."""
    row = table[node.control.current] if node.control.current else None
    told = row is not None and block.address <= row.address < block.address + len(block.data)
    if row is not None and told:
        node.bound = None
    yield from confirmed(node, block)
    if row is not None and told:
        at = row.address - block.address
        node.bound = row.decode(block.data[at : at + row.size])


# -- move ----------------------------------------------------------------------------------------------------


def move(
    node: Node,
    to: float,
    *,
    velocity: float | None = None,
    acceleration: float | None = None,
    current: float | None = None,
    wait: bool = True,
    tolerance: float | None = None,
    timeout: float | None = None,
) -> Operation[None]:
    """Move to `to` rad, at most at `velocity` rad/s and `acceleration` rad/s² (None: the servo's maximum).

    Goal, velocity and acceleration leave in one packet. Torque goes on: on STS by itself, on other maps, of which
    nobody has said that, by a packet that follows. On HLS the first packet also bounds the current: by `current` (A),
    or as it was; 0 is never sent, and a servo that was found with 0 is reported (`Powerless`). Returns when the servo
    is in position within `tolerance` rad (None: 0.05, or ten counts where these are more) and no longer moves; at once
    with `wait=False`. A servo of many turns that tells its position within one is judged within that.

    Raises LimitExceeded when `to` is not a finite number (and the gate does outside the limits), RequestError in other
    than position mode, for an acceleration where the map has no register for it (SCS) or a current where it has none
    (all but HLS), Stalled when it stays off its goal, MotionError after `timeout` seconds (None: by way and velocity).
    """
    finite(node, to, velocity, acceleration, current, tolerance, timeout)
    table = yield from writable(node)
    yield from ask_bound(node, table, current)
    block = move_block(node, table, to, velocity, acceleration, current)
    yield from ordered(node, table, block)
    if not node.control.goal_switches_on:
        yield from confirmed(node, ON)
    if wait:
        goal = block.goals[0].value
        yield from arrive(node, table, way(node, table, goal, velocity, acceleration, tolerance, timeout))


def way(
    node: Node,
    table: Table,
    goal: float,
    velocity: float | None = None,
    acceleration: float | None = None,
    tolerance: float | None = None,
    timeout: float | None = None,
) -> Move:
    """The move that was ordered, for `arrive` to judge; as `move` says."""
    count = abs(float(node.value(table["goal_position"], 1)))
    within = max(TOLERANCE, COUNTS * count) if tolerance is None else tolerance
    settings = node.settings
    wraps = settings is not None and settings.many_turns and not settings.accumulates
    turn = settings.turn * count if settings is not None and wraps else None
    return Move(goal, velocity, acceleration, within, timeout, resolution=count, turn=turn)


def move_block(
    node: Node,
    table: Table,
    to: float,
    velocity: float | None = None,
    acceleration: float | None = None,
    current: float | None = None,
) -> Block:
    """All that a move says, in one block: acceleration, goal position, bound of the current or time, velocity.

    Registers 41 to 47; on SCS, which have no acceleration, 42 to 47. The time is 0, so that the velocity counts. Raises
    RequestError when a bound of the current is needed and not known (see `ask_bound`).
    """
    raw, order = position_goal(node, table["goal_position"], to)
    data = table["goal_position"].encode(raw) + burst(node, table, velocity, current)
    ramp = ramp_of(node, table, acceleration)
    return Block(table["goal_position"].address - len(ramp), ramp + data, Effect.MOTION, (order,))


def finite(node: Node, to: float, *bounds: float | None) -> None:
    """Raise LimitExceeded for a goal that is no number, RequestError for bounds that are none above 0."""
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
