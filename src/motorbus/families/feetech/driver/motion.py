"""Holding, moving and standing still, such that nothing ever jumps.

What these servos do of their own accord decides the order of things: writing a goal position switches torque on
by itself; a servo that starts anew is limp and has forgotten its goal; a goal velocity of 0 means "as fast as you can"
or "not at all", as the phase register says; the moving flag drops also when the servo stands off its goal. Source:
STS3215 memory table V3.6; measured on hardware by feetech-cli and servolab.
"""

from __future__ import annotations

from enum import Enum
from functools import partial
from typing import Final, TypeVar

from motorbus.core.interrupted import Moving, stopped_if_interrupted
from motorbus.core.register import RegisterMap, is_number, shown
from motorbus.core.request import Effect
from motorbus.core.steps import Runnable, Sleep, catch
from motorbus.errors import LimitExceeded, MotorbusError, RequestError, VerificationFailed
from motorbus.families.feetech.driver.arrival import Move, arrive
from motorbus.families.feetech.driver.bound import ask_bound
from motorbus.families.feetech.driver.exchanges import Block
from motorbus.families.feetech.driver.feedback import position
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.orders import position_goal, speed_goal
from motorbus.families.feetech.driver.pace import burst, ramp_of
from motorbus.families.feetech.driver.rest import (
    asked_anew,
    at_rest,
    held,
    is_limp,
    not_turns_away,
    ordered,
    outside,
    surely_on,
    switched_on,
    torque_on_unless,
    unknown_mode,
)
from motorbus.families.feetech.table import Mode

T = TypeVar("T")

TOLERANCE: Final = 0.05
"""rad; 32 counts of STS. Under a load of 1.5 kg at 10 cm an STS3215 stays 20 to 30 counts off its goal (user
reports)."""
COUNTS: Final = 10
"""Counts of any servo within which it is in position, where these are more: one of SCS is 3.3 times one of STS, and an
angular resolution stretches each."""


class Promise(Enum):
    """What an acknowledged stop promises, and no more than that."""

    HOLD_ACCEPTED = "goal := present position accepted: it decelerates and holds; standstill was not verified"
    OUTSIDE_ACCEPTED = (
        "goal := present position accepted, outside its limits: it may go on to the nearer limit, as torque makes it; "
        "only torque off ends that"
    )
    LIMP = "it is limp, where torque could move it (outside its limits, or nobody knows): nothing was sent"
    ZERO_VELOCITY_ACCEPTED = "goal velocity := 0 accepted: it decelerates; standstill was not verified"
    ZERO_DUTY_ACCEPTED = "duty := 0 accepted: it runs out without holding; standstill was not verified"
    ZERO_CURRENT_ACCEPTED = "current := 0 accepted: it runs out without holding; standstill was not verified"
    TORQUE_OFF_ACCEPTED = "torque off accepted: it goes limp at once, and an arm sags or falls"


OLD: Final = 0.1
"""s from the reading of a position to the goal that is made of it. Nothing but the host lies between: milliseconds, a
few of ten on a machine that is busy. Within it a servo at 50 turns/min, as fast as an STS3215 is without load, comes
half a radian far; within the half second that the safety of motion bears, two and a half."""
SLEPT: Final = 0.5
"""s for question, reply, order and acknowledgement together. More than any line takes that is not retried, remote ones
included; what takes longer may be a host that slept before the reply was read, or before the order left."""
_TRIES: Final = 3
_AT_REST: Final = {
    Mode.VELOCITY: Promise.ZERO_VELOCITY_ACCEPTED,
    Mode.PWM: Promise.ZERO_DUTY_ACCEPTED,
    Mode.CURRENT: Promise.ZERO_CURRENT_ACCEPTED,
}

# -- hold and let go -----------------------------------------------------------------------------------------


async def enable_torque(node: Node, *, jump: float = 0.0) -> None:
    """Torque on without a jump: the goal becomes the present position with it (velocity, duty or current 0 there).

    One packet carries both, so that a servo which starts anew in between is limp and nothing else; the switch is read
    back. In step mode, where a goal is a way to go and torque alone moves nothing, the switch goes by itself.
    Where a goal velocity of 0 means standstill and nothing else is set, that becomes the maximum, so that goals which
    come without a velocity are gone to.

    A servo that was turned by hand beyond its limits would go for the nearer limit as soon as it holds; that is
    refused with LimitExceeded unless the way is at most `jump` (rad). Raises RequestError where no order is known that
    would not move it: in PWM mode of HLS, in a mode that no source explains, on SMCL with both limits 0, and on a servo
    of many turns that tells its position within one (there `jump` must be as much as all of them); for a `jump` that
    is no finite number from 0 on; MotionError when its torque is off again at once, or it has forgotten its turns.
    """
    await torque_on_unless(node, None, jump=jump)


async def stop(node: Node) -> Promise:
    """Decelerate and stay: the goal becomes the position of this moment (velocity, duty or current 0 in those modes).

    Mode and limits are read anew, for another program may have changed them. Returns what was promised. A limp STS
    servo begins to hold, a limp one of another map may stay limp. Outside its limits a servo goes for the nearer one
    as soon as it has torque: one that is limp there is left alone (`LIMP`), one with torque is on its way already, and
    whether the goal ends that is not known (`OUTSIDE_ACCEPTED`).

    Raises RequestError where nothing is known to end a movement but torque off: in step mode, where a goal is a way to
    go; in PWM mode of HLS; in a mode that no source explains; and with torque on SMCL with both limits 0, and on a
    servo of many turns that tells its position within one. Raises MotionError, with the servo limp, when it has
    forgotten its turns meanwhile; VerificationFailed when it reads back something else three times.
    """
    table = await asked_anew(node)
    mode = node.known_mode
    if mode is None:
        raise unknown_mode(node)
    if mode is Mode.STEP:
        raise RequestError(
            f"node {node.node} is in step mode, where no goal means 'stay'",
            advice="use disable_torque(), after which it is limp; nothing was sent",
            node=node.node,
        )
    for again in reversed(range(_TRIES)):
        try:
            if mode is Mode.POSITION:
                return await _stay(node, table)
            await ordered(node, table, at_rest(node, table, mode))
            break
        except VerificationFailed:  # where no acknowledgement is due, this is how a lost packet shows
            if not again:
                raise
    return _AT_REST[mode]


async def _stay(node: Node, table: RegisterMap) -> Promise:
    """Goal := here, unless that could set a limp servo into motion.

    A host that sleeps between the reading and the goal would send it back to where it was. So a reading that is too old
    is taken anew before it is sent, and what turns out to have slept on its way is said again from where it is then;
    three times at most, for a stop is sent whatever happens.
    """
    for again in reversed(range(_TRIES)):
        asked = await Sleep(0.0)
        here = await catch(held(node, table))
        told = node.at
        doubtful = isinstance(here, RequestError) or (isinstance(here, Block) and outside(node, table, here))
        if doubtful and await is_limp(node):
            return Promise.LIMP
        if isinstance(here, MotorbusError):
            raise here
        waited = await Sleep(0.0) - told
        if again and (waited > OLD or told - asked > SLEPT):
            continue
        await ordered(node, table, here)
        if not again or await Sleep(0.0) - asked <= SLEPT:
            await not_turns_away(node, table, here)
            break
    return Promise.OUTSIDE_ACCEPTED if doubtful else Promise.HOLD_ACCEPTED


async def calmed(node: Node, table: RegisterMap) -> None:
    """What a servo that has torque and no force would go for becomes where it is, or no velocity, duty or current.

    For whoever is about to give it its force back. Does nothing to a limp one, and in step mode, where nothing waits.
    Raises LimitExceeded when it stands outside its limits, to which it would go; errors as enable_torque() otherwise.
    """
    mode = node.known_mode
    if mode is Mode.STEP or await is_limp(node):
        return
    if mode is None:
        raise unknown_mode(node)
    if mode is not Mode.POSITION:
        await ordered(node, table, at_rest(node, table, mode))
        return
    block = await held(node, table)
    if outside(node, table, block):
        raise LimitExceeded(
            f"node {node.node} stands outside its limits: with its force back it would go for the nearer one",
            expected="a position within its limits",
            advice="disable_torque() first, then enable_torque(jump=…) bounds that way; nothing was sent",
            node=node.node,
        )
    await ordered(node, table, block)


# -- move ----------------------------------------------------------------------------------------------------


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

    Mode and limits are read first, each time: another program may have changed them (a loop that cannot spare that
    runs `sync_write_positions`, which asks nobody). Goal, velocity and acceleration leave in one packet. Torque goes
    on: on STS by itself, on other maps, of which nobody has said that, by the switch in the same packet, which is read
    back. On HLS the packet also bounds the current: by `current` (A), or as it was; 0 is never sent, and a servo that
    was found with 0 is reported (`Powerless`). Returns when the servo is in position within `tolerance` rad (None:
    0.05, or ten counts where these are more) and no longer moves; at once with `wait=False`. A servo of many turns
    that tells its position within one is judged within that. When the wait is interrupted or cancelled the servo stops
    and holds, and a note of the interruption says where; with `wait=False` it goes to its goal.

    Raises LimitExceeded when `to` is not a finite number (and the gate does outside the limits), RequestError in other
    than position mode, for an acceleration where the map has no register for it (SCS) or a current where it has none
    (all but HLS), Stalled when it stays off its goal, MotionError after `timeout` seconds (None: by way and velocity),
    MotionError when its torque is off again at once.
    """
    finite(node, to, velocity, acceleration, current, tolerance, timeout)
    table = await asked_anew(node)
    await ask_bound(node, table, current)
    block = move_block(node, table, to, velocity, acceleration, current)
    if not wait:
        node.last_move = None
        await _sent(node, table, block)
        return
    order = way(node, table, block.goals[0].value, velocity, acceleration, tolerance, timeout)
    await stops(_gone(node, table, block, order), node)


async def stops(move: Runnable[T], *nodes: Node) -> T:
    """Order a move and wait for it; when that is interrupted the servos stop and hold. A limp one stays limp."""
    devices = [Moving(node, partial(_stopped, node), partial(position, node)) for node in nodes]
    return await stopped_if_interrupted(move, *devices)


async def _stopped(node: Node) -> Promise | None:
    if await catch(is_limp(node)) is True:
        return None
    return await stop(node)


async def _gone(node: Node, table: RegisterMap, block: Block, order: Move) -> None:
    await _sent(node, table, block)
    await arrive(node, table, order)


async def _sent(node: Node, table: RegisterMap, block: Block) -> None:
    await ordered(node, table, block)
    if not node.control.goal_switches_on:
        await surely_on(node)


def way(
    node: Node,
    table: RegisterMap,
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
    table: RegisterMap,
    to: float,
    velocity: float | None = None,
    acceleration: float | None = None,
    current: float | None = None,
) -> Block:
    """All that a move says, in one block: acceleration, goal position, bound of the current or time, velocity.

    Registers 41 to 47 where the goal switches torque on; elsewhere 40 to 47, the switch with them. The time is 0, so
    that the velocity counts. Raises RequestError when a bound of the current is needed and not known (see `ask_bound`).
    """
    raw, order = position_goal(node, table["goal_position"], to)
    row, more = table["goal_velocity"], burst(node, table, velocity, current)
    data = table["goal_position"].encode(raw) + more
    ramp = ramp_of(node, table, acceleration)
    goals = (order, speed_goal(node, row, row.decode(more[-row.size :])))
    block = Block(table["goal_position"].address - len(ramp), ramp + data, Effect.MOTION, goals)
    return block if node.control.goal_switches_on else switched_on(block)


def finite(node: Node, to: float, *bounds: float | None) -> None:
    """Raise LimitExceeded for a goal that is no number, RequestError for bounds that are none above 0."""
    if not is_number(to):
        raise LimitExceeded(
            f"node {node.node}: {shown(to)} is no position",
            advice="give a number in rad; nothing was sent",
            node=node.node,
        )
    for bound in bounds:
        if bound is not None and not (is_number(bound) and bound >= 0):
            raise RequestError(
                f"node {node.node}: {shown(bound)} is not a finite number above 0",
                advice="velocity in rad/s, acceleration in rad/s², tolerance in rad, timeout in s; nothing was sent",
                node=node.node,
            )
