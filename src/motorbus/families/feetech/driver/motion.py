"""Torque, stop and move, without a jump.

What servos do by themselves decides the order of requests: a write of the goal position may switch torque on; a servo
that restarts is limp and has forgotten its goal; the moving flag also drops when a servo stands off its goal. So torque
switch and goal travel in one packet where their registers lie side by side (all maps but STS), and the switch is read
back. Source: STS3215 memory table V3.6; feetech-cli and servolab, measured on hardware.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, Final

from motorbus.core import move as core_move
from motorbus.core.family import State
from motorbus.core.register import Register, is_number, shown
from motorbus.core.request import Effect, Precondition, Priority
from motorbus.core.setpoint import Setpoint, torque_off, torque_on
from motorbus.core.steps import Procedure, Runnable, catch
from motorbus.errors import LimitExceeded, MotionError, MotorbusError, Stalled
from motorbus.families.feetech.driver import diagnosis, feedback, goals
from motorbus.families.feetech.driver.identity import known, read_settings, writable
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.requests import (
    DOUBTS,
    ON,
    PRESENT,
    TORQUE_ENABLE,
    Block,
    confirmed,
    outdated,
    read_block,
    verified,
    write_block,
)
from motorbus.families.feetech.models import NO_LOAD
from motorbus.families.feetech.traits import Mode

TOLERANCE: Final = 0.05
"""rad. Under a load of 1.5 kg at 10 cm an STS3215 stays 20 to 30 counts off its goal (user reports)."""
COUNTS: Final = 10  # counts of a coarse servo within which it is in position
UNHURRIED: Final = 2.0  # rad/s that every servo reaches; the default timeout is computed with it # assumption
LIMP: Final = Block(TORQUE_ENABLE, b"\0", Effect.TORQUE)
TRIES: Final = 3


class Promise(Enum):
    """What an acknowledged stop promises."""

    HOLD_ACCEPTED = "goal := present position accepted: it decelerates and holds; standstill was not verified"
    OUTSIDE_ACCEPTED = (
        "goal := present position accepted, outside its limits: it may move to the nearer limit; only torque off "
        "ends that"
    )
    LIMP = "it is limp, where torque could move it: no order was sent"
    ZERO_VELOCITY_ACCEPTED = "goal velocity := 0 accepted: it decelerates; standstill was not verified"
    ZERO_DUTY_ACCEPTED = "duty := 0 accepted: it runs out without holding; standstill was not verified"
    ZERO_CURRENT_ACCEPTED = "current := 0 accepted: it runs out without holding; standstill was not verified"
    TORQUE_OFF_ACCEPTED = "torque off accepted: it goes limp at once, and an arm sags or falls"


_AT_REST: Final = {
    Mode.VELOCITY: Promise.ZERO_VELOCITY_ACCEPTED,
    Mode.PWM: Promise.ZERO_DUTY_ACCEPTED,
    Mode.CURRENT: Promise.ZERO_CURRENT_ACCEPTED,
}

# -- torque ----------------------------------------------------------------------------------------------------


def limp(node: Node) -> Block:
    """Torque off for this servo."""
    return LIMP._replace(goals=(torque_off(node.node),))


async def disable_torque(node: Node) -> None:
    """Torque off: the servo goes limp, whatever its alarms; sent up to three times until it is acknowledged.

    Raises OutcomeUnknown if nothing is answered, VerificationFailed if the torque is still on.
    """
    node.known.epoch += 1
    doubt: MotorbusError | None = None
    for _ in range(TRIES):
        try:
            await write_block(node, limp(node), priority=Priority.STOP)
            return
        except DOUBTS as error:
            doubt = error
    await verified(node, LIMP, doubt)


async def enable_torque(node: Node) -> None:
    """Torque on without a jump: the goal becomes the present position; velocity, duty or current 0 in their modes.

    A servo that was turned beyond its limits by hand would move to the nearer one: LimitExceeded. Raises RequestError
    where no order is known that would not move it (PWM mode of HLS, an unknown mode, SMCL without limits, many turns
    with a position within one); MotionError if its torque is off again at once or it has forgotten its turns.
    """
    await enable_torque_unless(node, None)


async def enable_torque_unless(node: Node, unless: Precondition | None) -> None:
    """`enable_torque`, with a reason not to send the packet that switches torque on."""
    await read_settings(node)
    mode, settings = goals.checked_mode(node), node.settings
    if mode is Mode.STEP:  # torque alone moves nothing there
        block = Block(TORQUE_ENABLE, ON, Effect.TORQUE, (torque_on(node.node),))
    else:
        found = await read_block(node, TORQUE_ENABLE, goals.COMMANDS, bytes)
        block = await _hold_here(node) if mode is Mode.POSITION else goals.rest_block(node)
        if mode is Mode.POSITION:
            check_inside(node, block)
        if node.settings is not settings:
            raise outdated(node.node)
        block = goals.with_torque(node, block, found)
    await ordered(node, block._replace(unless=unless))
    if mode is Mode.POSITION:
        await _check_turn(node, block)
    await check_torque(node)


async def _check_turn(node: Node, block: Block) -> None:
    """See that a servo that counts turns is still on the turn where this order holds it.

    It forgets its turns with its supply, and is then on its way over many. Torque goes off, and MotionError is raised.
    """
    settings = node.settings
    if settings is None or not settings.tells_turns:
        return
    half_turn = abs(float(node.value(node.row("goal_position"), settings.turn // 2)))
    goal = block.goals[0].value
    if abs(await feedback.position(node) - goal) > half_turn:
        await disable_torque(node)
        raise MotionError(
            f"node {node.node} has forgotten its turns while it was to stay at {goal:.4g} rad",
            cause="it has lost its supply for a moment",
            advice="check its supply, home it, then enable_torque(); it is limp",
            node=node.node,
        )


async def is_limp(node: Node) -> bool:
    """Whether its torque switch has any other value than 1."""
    return await read_block(node, TORQUE_ENABLE, 1, bytes) != ON


async def check_torque(node: Node) -> None:
    """Raise MotionError if the torque of a servo that has acknowledged torque on is off."""
    if await is_limp(node):
        raise MotionError(
            f"node {node.node} has acknowledged torque on, and its torque is off",
            expected="register 40 at 1",
            cause="it has lost its supply for a moment, as switching torque on may do; or an alarm, a stop or another "
            "program has switched it off",
            advice="check its supply and its alarms, then enable_torque(); it is limp",
            node=node.node,
        )


async def ordered(node: Node, block: Block) -> None:
    """Write an order and be sure of it; a bound of the current in it is known from then on."""
    node.known.bound, bound = None, node.known.bound
    await confirmed(node, block)
    node.known.bound = bound_in(node, block, bound)


def bound_in(node: Node, block: Block, other: int | None) -> int | None:
    """The goal torque of an HLS in this block; `other` if there is none."""
    if not node.traits.current:
        return None
    row = node.row(node.traits.current)
    at = row.address - block.address
    return row.decode(block.data[at : at + row.size]) if 0 <= at < len(block.data) else other


async def read_bound(node: Node, current: float | None = None) -> None:
    """Read the goal torque of an HLS unless it is known or `current` sets it."""
    if node.traits.current and node.known.bound is None and current is None:
        row = node.row(node.traits.current)
        node.known.bound = await read_block(node, row.address, row.size, row.decode)


# -- stop ------------------------------------------------------------------------------------------------------


async def stop(node: Node) -> Promise:
    """Decelerate and hold: the goal becomes the present position; velocity, duty or current 0 in their modes.

    Mode and limits are read first. A limp STS begins to hold. A servo that is limp outside its limits is left alone
    (`LIMP`); one with torque there is on its way to the nearer limit (`OUTSIDE_ACCEPTED`). Raises RequestError where
    only torque off ends a movement: step mode, PWM mode of HLS, an unknown mode, and where `enable_torque` raises it.
    """
    node.known.epoch += 1
    await read_settings(node)
    mode = goals.checked_mode(node)
    if mode is Mode.STEP:
        raise node.refusal("is in step mode, where no goal means 'stay'", "use disable_torque()")
    if mode is not Mode.POSITION:
        await ordered(node, goals.rest_block(node))
        return _AT_REST[mode]
    block = await _hold_here(node)
    outside = _is_outside(node, block)
    if outside and await is_limp(node):
        return Promise.LIMP
    await ordered(node, block)
    await _check_turn(node, block)
    return Promise.OUTSIDE_ACCEPTED if outside else Promise.HOLD_ACCEPTED


async def _hold_here(node: Node) -> Block:
    goals.checked_limits(node)
    settings, row = node.settings, node.row("present_position")
    raw = await read_block(node, PRESENT, row.size, row.decode)
    if node.settings is not settings:
        raise outdated(node.node)
    return goals.hold_block(node, raw)


def _is_outside(node: Node, block: Block) -> bool:
    low, high = goals.checked_limits(node)
    slack = node.row("goal_position").scale / 2
    return not low - slack <= block.goals[0].value <= high + slack


def check_inside(node: Node, block: Block) -> None:
    """Raise LimitExceeded if this order holds a servo outside its limits: it would move to the nearer one."""
    if _is_outside(node, block):
        low, high = goals.checked_limits(node)
        what = f"node {node.node} stands at {block.goals[0].value:.4g} rad, outside its limits"
        fix = "disable_torque(), then turn it inside by hand"
        what += f" {low:.4g} to {high:.4g} rad: it would jump to the nearer one"
        raise LimitExceeded(what, advice=fix, node=node.node)


async def _stop_move(node: Node) -> Promise | None:
    """As `stop`; a limp servo stays limp."""
    if await catch(is_limp(node)) is True:
        return None
    return await stop(node)


# -- move ------------------------------------------------------------------------------------------------------


@dataclass
class Motion(core_move.MoveLogic[Node]):
    """How a servo moves: at most at `velocity` (rad/s) and `acceleration` (rad/s²), with at most `current` (A)."""

    velocity: float | None = None
    acceleration: float | None = None
    current: float | None = None

    async def check(self, device: Node, to: float) -> Setpoint:
        await writable(device)
        await read_bound(device, self.current)
        return self._block(device, to).goals[0]

    async def send(self, device: Node, goal: Setpoint) -> None:
        await ordered(device, self._block(device, goal.value))
        if not device.traits.goal_switches_on:
            await check_torque(device)

    def sample(self, device: Node) -> Runnable[State]:
        return feedback.telemetry(device)

    def tolerance_of(self, device: Node) -> float:
        return max(TOLERANCE, COUNTS * count_of(device))

    def stall_time_of(self, device: Node) -> float:
        """A slow move takes its time for two counts."""
        slow = 2 * max(core_move.PROGRESS, count_of(device)) / self.velocity if self.velocity else 0.0
        return core_move.STALL_TIME + slow

    def stop(self, device: Node) -> Procedure[Promise | None]:
        return _stop_move(device)

    def timeout(self, distance: float) -> float:
        speed = min(self.velocity or UNHURRIED, UNHURRIED)
        ramps = speed / self.acceleration if self.acceleration else 0.0
        return 1.0 + 2.0 * (distance / speed + ramps)

    def _block(self, node: Node, to: float) -> Block:
        return goals.motion_block(node, to, self.velocity, self.acceleration, self.current)


def count_of(node: Node) -> float:
    """One count of its goal position (rad)."""
    return abs(float(node.value(node.row("goal_position"), 1)))


async def move(
    node: Node,
    to: float,
    *,
    velocity: float | None = None,
    acceleration: float | None = None,
    current: float | None = None,
    wait: bool = True,
    tolerance: float | None = None,
    timeout: float | None = None,
) -> None:
    """Move to `to` rad, at most at `velocity` rad/s and `acceleration` rad/s² (None: the servo's maximum).

    Torque is switched on. On HLS `current` (A) bounds the current; None keeps what is set. Returns when the servo is
    within `tolerance` rad (None: 0.05, or ten counts where these are more) and not moving, at once with `wait=False`.
    An interrupt of the wait stops it. Raises LimitExceeded, RequestError in another mode and for a bound without a
    register, Stalled, MotionError after `timeout` s (None: from distance and velocity) or if its torque is off at once.
    """
    logic = Motion(velocity, acceleration, current)
    await move_all(logic, {node: to}, wait=wait, tolerance=tolerance, timeout=timeout)


async def move_all(
    logic: core_move.MoveLogic[Node],
    to: Mapping[Node, float],
    *,
    wait: bool = True,
    tolerance: float | None = None,
    timeout: float | None = None,
    **further: Any,
) -> None:
    """`core.move.move`, with its further arguments; a stalled servo is asked for the reason."""
    try:
        await core_move.move(logic, to, wait=wait, tolerance=tolerance, timeout=timeout, **further)
    except Stalled as error:
        node = next(one for one in to if one.node == error.node)
        reasons = await catch(diagnosis.why_not_moving(node))
        if not isinstance(reasons, MotorbusError) and reasons:
            error.cause = "; ".join(reasons)
        error.advice = "clear the way; it still pushes towards its goal: stop() ends that"
        raise


# -- caps and limits -------------------------------------------------------------------------------------------


async def cap_torque(node: Node, fraction: float) -> None:
    """Limit the torque to this fraction of the stall torque, 0 to 1, until power-off.

    A limit of 0 releases the servo; before a greater one its goal becomes its present position. Raises RequestError for
    another number or a servo whose limit is in EEPROM, LimitExceeded for a released one outside its position limits.
    """
    if not (is_number(fraction) and 0 <= fraction <= 1):
        raise node.refusal(f"cannot limit its torque to {shown(fraction)}", expected="0 to 1")
    table = await writable(node)
    if not node.traits.limit:
        raise node.refusal("keeps its torque limit in EEPROM", "write(max_torque=…) sets it")
    row = table[node.traits.limit]
    if fraction:
        await calm_without_force(node, row)
    block = Block(row.address, row.encode(node.raw(row, fraction)), row.effect)
    await confirmed(node, block)
    await verified(node, block)


async def calm_without_force(node: Node, bound: Register) -> None:
    """Make a servo with torque, whose force this row bounds to 0, stay where it is when it gets its force back."""
    if await read_block(node, bound.address, bound.size, bound.decode):
        return
    await read_settings(node)
    if node.known_mode is Mode.STEP or await is_limp(node):
        return
    if goals.checked_mode(node) is not Mode.POSITION:
        await ordered(node, goals.rest_block(node))
        return
    block = await _hold_here(node)
    check_inside(node, block)
    await ordered(node, block)


async def cap_current(node: Node, current: float) -> None:
    """Bound the current (A, above 0) of an HLS until power-off or an order with another bound.

    Where it has no force its goal becomes its present position first.
    Raises RequestError for another servo, or in a mode where the register is no bound.
    """
    await read_settings(node)
    data = goals.bound_bytes(node, current)
    if node.known_mode not in goals.BOUNDED:
        what = f"is in operating mode {goals.shown_mode(node)}, where its goal torque bounds nothing"
        raise node.refusal(what, "set_mode('position')")
    row = node.row(node.traits.current)
    await calm_without_force(node, row)
    value, most = float(node.value(row, row.decode(data))), float(node.value(row, row.high))
    await ordered(node, Block(row.address, data, row.effect, (Setpoint(node.node, "cap", value, 0.0, most),)))


async def limits(node: Node) -> tuple[float, float]:
    """Lowest and highest position (rad); read if unknown. Raises RequestError where 0 and 0 have no known meaning."""
    await writable(node)
    return goals.checked_limits(node)


async def max_velocity(node: Node) -> float | None:
    """The velocity (rad/s) of its model without load; None where no source tells it."""
    await known(node)
    return NO_LOAD.get(node.identity.model) if node.identity else None
