"""Torque, stop and move, without a jump.

What servos do by themselves decides the order of requests: a write of the goal position may switch torque on; a servo
that restarts is limp and has forgotten its goal; the moving flag also drops when a servo stands off its goal. So torque
switch and goal travel in one packet, and the switch is read back. Source: STS3215 memory table V3.6; feetech-cli and
servolab, measured on hardware.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from math import remainder
from typing import Any, Final

from motorbus.core import move as core_move
from motorbus.core.family import State
from motorbus.core.register import Register, RegisterMap, is_number, shown
from motorbus.core.request import Effect, Precondition, Priority
from motorbus.core.setpoint import Setpoint, torque_off, torque_on
from motorbus.core.steps import Procedure, Sleep, catch
from motorbus.errors import (
    LimitExceeded,
    MotionError,
    MotorbusError,
    RequestError,
    Stalled,
    VerificationFailed,
)
from motorbus.families.feetech.driver import diagnosis, feedback, goals
from motorbus.families.feetech.driver.identity import known, read_settings, writable
from motorbus.families.feetech.driver.node import MANY_TURNS, Node, Settings
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
COMMANDS: Final = 8  # bytes of registers 40 to 47: torque switch to goal velocity
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
    node.facts.epochs[node.node] += 1
    doubt: MotorbusError | None = None
    for _ in range(TRIES):
        request = write_block(node, limp(node), priority=Priority.STOP)
        try:
            await request
            if not request.expected:
                await verified(node, LIMP)
            return
        except (*DOUBTS, VerificationFailed) as error:
            doubt = error
    if isinstance(doubt, VerificationFailed):
        raise doubt
    await verified(node, LIMP, doubt)


async def enable_torque(node: Node, *, jump: float = 0.0) -> None:
    """Torque on without a jump: the goal becomes the present position; velocity, duty or current 0 in their modes.

    A servo that was turned beyond its limits by hand would move to the nearer one: LimitExceeded unless that is at most
    `jump` rad away. Raises RequestError where no order is known that would not move it (PWM mode of HLS, an unknown
    mode, SMCL without limits, many turns with a position within one); MotionError if its torque is off again at once or
    it has forgotten its turns.
    """
    await torque_on_unless(node, None, jump=jump)


async def torque_on_unless(node: Node, unless: Precondition | None, *, jump: float = 0.0) -> None:
    """`enable_torque`, with a reason not to send the packet that switches torque on."""
    if not (is_number(jump) and jump >= 0):
        raise node.refusal(f"cannot jump by {shown(jump)}", expected="a number of rad from 0 on")
    await read_settings(node)
    mode = goals.checked_mode(node)
    if mode is Mode.STEP:  # torque alone moves nothing there
        block = Block(TORQUE_ENABLE, ON, Effect.TORQUE, (torque_on(node.node),))
    elif mode is Mode.POSITION:
        block = await _hold_with_torque(node, jump)
    else:
        block = goals.rest_block(node)
        if mode is Mode.VELOCITY:
            settings = node.settings
            await read_bound(node)
            _check_same(node, settings)
            block = goals.with_bound(node, block)
        block = goals.with_torque(block, await _read_commands(node))
    await ordered(node, block._replace(unless=unless))
    if mode is Mode.POSITION:
        await _check_turn(node, block, jump)
    await check_torque(node)


async def _hold_with_torque(node: Node, jump: float) -> Block:
    """Torque on and goal := the present position, or the near limit; with the bound of the current.

    A goal velocity of 0 that means standstill becomes the maximum, or goals alone would move nothing.
    """
    limits, settings = goals.checked_limits(node), node.settings
    await read_bound(node)
    found = await _read_commands(node)
    raw = await _read_position(node, settings)
    _check_turn_is_known(node, raw, jump)
    there = _within_limits(node, raw, jump)
    block = goals.hold_block(node, there)
    if there != raw:  # it moves, so the gate judges it as any other goal
        block = block._replace(goals=(block.goals[0]._replace(low=limits[0], high=limits[1], stays=None),))
    speed = node.row("goal_velocity")
    at = speed.address - TORQUE_ENABLE
    stands = node.settings is not None and not node.settings.zero_is_maximum
    if stands and speed.decode(found[at : at + speed.size]) == 0:
        return goals.with_torque(
            block._replace(data=block.data + goals.behind_goal(node, goals.raw_speed(node, None))), found
        )
    return goals.with_torque(goals.with_bound(node, block), found)


def _within_limits(node: Node, raw: int, jump: float) -> int:
    row = node.row("goal_position")
    here = node.value(row, raw)
    low, high = goals.checked_limits(node)
    there = min(max(here, low), high)
    if abs(here - there) <= jump + row.scale / 2:
        return node.raw(row, there)
    what = f"node {node.node} stands at {here:.4g} rad, outside its limits {low:.4g} to {high:.4g} rad"
    fix = f"turn it inside by hand, or enable_torque(jump={abs(here - there) + 0.001:.3f})"
    raise LimitExceeded(f"{what}: it would jump to {there:.4g} rad", advice=fix, node=node.node)


def _check_turn_is_known(node: Node, raw: int, jump: float = 0.0) -> None:
    """Raise RequestError if goals count over many turns and this position within one: "here" may be turns away."""
    settings = node.settings
    assert settings is not None
    if settings.tells_turns or not settings.many_turns or not 0 <= raw < settings.turn:
        return
    if jump < goals.checked_limits(node)[1]:
        raise node.refusal(
            "counts its goals over many turns and its position within one, so 'here' may be turns away",
            "set_multi_turn(True), or move() to a goal you know, or disable_torque()",
        )


async def _check_turn(node: Node, block: Block, jump: float = 0.0) -> None:
    """See that a servo that counts turns is still on the turn where this order holds it.

    It forgets its turns with its supply, and is then on its way over many. Torque goes off, and MotionError is raised.
    """
    settings = node.settings
    if settings is None or not settings.tells_turns:
        return
    far = abs(float(node.value(node.row("goal_position"), settings.turn // 2))) + jump
    goal = block.goals[0].value
    if abs(await feedback.position(node) - goal) > far:
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
    row = node.row(node.traits.current) if node.traits.current else None
    at = -1 if row is None else row.address - block.address
    has_bound = 0 <= at < len(block.data)
    if has_bound:
        node.bound = None
    await confirmed(node, block)
    if row is not None and has_bound:
        node.bound = row.decode(block.data[at : at + row.size])
        node.has_force = node.bound != 0


async def read_bound(node: Node, current: float | None = None) -> None:
    """Read the goal torque of an HLS unless it is known or `current` sets it."""
    if node.traits.current and node.bound is None and current is None:
        row = node.row(node.traits.current)
        node.bound = await read_block(node, row.address, row.size, row.decode)
        node.has_force = node.bound != 0


async def _read_commands(node: Node) -> bytes:
    return await read_block(node, TORQUE_ENABLE, COMMANDS, bytes)


async def _read_position(node: Node, settings: Settings | None) -> int:
    """Raw present position. Raises RequestError if another task has changed these settings."""
    row = node.row("present_position")
    raw = await read_block(node, PRESENT, row.size, row.decode)
    _check_same(node, settings)
    return raw


def _check_same(node: Node, settings: Settings | None) -> None:
    if node.settings is not settings:
        raise outdated(node)


# -- stop ------------------------------------------------------------------------------------------------------


async def stop(node: Node) -> Promise:
    """Decelerate and hold: the goal becomes the present position; velocity, duty or current 0 in their modes.

    Mode and limits are read first. A limp STS begins to hold. A servo that is limp outside its limits is left alone
    (`LIMP`); one with torque there is on its way to the nearer limit (`OUTSIDE_ACCEPTED`). Raises RequestError where
    only torque off ends a movement: step mode, PWM mode of HLS, an unknown mode, and where `enable_torque` raises it.
    """
    node.facts.epochs[node.node] += 1
    await read_settings(node)
    for attempt in range(TRIES):
        try:
            return await _stop(node)
        except VerificationFailed:  # a lost packet at status return level 0
            if attempt == TRIES - 1:
                raise
    raise AssertionError


async def _stop(node: Node) -> Promise:
    mode = goals.checked_mode(node)
    if mode is Mode.STEP:
        raise node.refusal("is in step mode, where no goal means 'stay'", "use disable_torque()")
    if mode is not Mode.POSITION:
        await ordered(node, goals.rest_block(node))
        return _AT_REST[mode]
    here = await catch(_hold_here(node))
    inside = isinstance(here, Block) and not _is_outside(node, here)
    if not inside and isinstance(here, Block | RequestError) and await is_limp(node):
        return Promise.LIMP
    if isinstance(here, MotorbusError):
        raise here
    await ordered(node, here)
    await _check_turn(node, here)
    return Promise.HOLD_ACCEPTED if inside else Promise.OUTSIDE_ACCEPTED


async def _hold_here(node: Node) -> Block:
    goals.checked_limits(node)
    raw = await _read_position(node, node.settings)
    _check_turn_is_known(node, raw)
    return goals.hold_block(node, raw)


def _is_outside(node: Node, block: Block) -> bool:
    low, high = goals.checked_limits(node)
    here, slack = block.goals[0].value, node.row("goal_position").scale / 2
    return not low - slack <= here <= high + slack


async def _stop_move(node: Node) -> Promise | None:
    """As `stop`; a limp servo stays limp."""
    if await catch(is_limp(node)) is True:
        return None
    return await stop(node)


# -- move ------------------------------------------------------------------------------------------------------


@dataclass
class Motion(core_move.MoveLogic[Node]):
    """How a servo moves: at most at `velocity` (rad/s) and `acceleration` (rad/s²), with at most `current` (A).

    Where a position lies within one turn and goals do not, places are compared within a turn.
    """

    velocity: float | None = None
    acceleration: float | None = None
    current: float | None = None
    ends: dict[int, float] = field(default_factory=dict)

    async def check(self, device: Node, to: float) -> Setpoint:
        await writable(device)
        await read_bound(device, self.current)
        goal = self._block(device, to).goals[0]
        self.ends[device.node] = goal.value
        return goal

    async def send(self, device: Node, goal: Setpoint) -> None:
        await ordered(device, self._block(device, goal.value))
        if not device.traits.goal_switches_on:
            await check_torque(device)
        if self._turn(device):
            await Sleep(core_move.PERIOD)  # a goal whole turns away looks like this place until it moves

    async def sample(self, device: Node) -> State:
        state = await feedback.telemetry(device)
        turn, goal = self._turn(device), self.ends[device.node]
        if turn and state.position is not None:
            return state._replace(position=goal + remainder(state.position - goal, turn))
        return state

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

    def _turn(self, node: Node) -> float:
        """rad after which a position starts at 0 again, where goals do not; else 0."""
        settings = node.settings
        if settings is None or settings.tells_turns or not settings.many_turns:
            return 0.0
        return settings.turn * count_of(node)


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
    if _is_outside(node, block):
        what = f"node {node.node} stands outside its limits and would move to the nearer one"
        raise LimitExceeded(what, advice="disable_torque(), then enable_torque(jump=…)", node=node.node)
    await ordered(node, block)


async def cap_current(node: Node, current: float) -> None:
    """Bound the current (A, above 0) of an HLS until power-off or an order with another bound.

    Where it has no force its goal becomes its present position first.
    Raises RequestError for another servo, or in a mode where the register is no bound.
    """
    await read_settings(node)
    data = goals.bound_bytes(node, current)
    if node.known_mode not in (Mode.POSITION, Mode.VELOCITY):
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


async def travel(node: Node) -> tuple[float, float] | None:
    """Range (rad) of its encoder and registers, whatever its limits; None in another mode than position."""
    table: RegisterMap = await known(node)
    settings = node.settings
    if not node.is_writable or settings is None or settings.mode is not Mode.POSITION:
        return None
    count = table["goal_position"].scale * settings.factors["goal_position"]
    if settings.many_turns:
        return -MANY_TURNS * count, MANY_TURNS * count
    return 0.0, settings.turn * count
