"""Orders for other modes than position: a velocity, a duty, a current, a way to go from here.

Each needs the mode it is for, which `set_mode` sets, and torque, which `enable_torque` switches on at rest. The mode is
read anew each time, for another program may have set it since, and a velocity there is a position here. All but a step
can be repeated without harm; a step that was not acknowledged is never sent again, for it would go twice.
Source: STS3215 memory table V3.6; FEETECH SDK headers; servolab, measured on STS3215.
"""

from __future__ import annotations

from motorbus.core.register import RegisterMap, is_number, shown
from motorbus.core.request import Effect
from motorbus.core.setpoint import Setpoint
from motorbus.errors import LimitExceeded, RequestError
from motorbus.families.feetech.driver.arrival import Move, arrive
from motorbus.families.feetech.driver.bound import ask_bound, refuse_current
from motorbus.families.feetech.driver.exchanges import PRESENT, Block, confirmed, read_block
from motorbus.families.feetech.driver.motion import finite, stops, way
from motorbus.families.feetech.driver.node import MANY_TURNS, Node
from motorbus.families.feetech.driver.orders import DUTY, speed_goal, unheeded
from motorbus.families.feetech.driver.pace import burst, ramp_of
from motorbus.families.feetech.driver.rest import ON, asked_anew, ordered, unpublished_duty, with_bound
from motorbus.families.feetech.table import Mode


async def set_velocity(
    node: Node, velocity: float, *, acceleration: float | None = None, current: float | None = None
) -> None:
    """Turn at `velocity` rad/s, whose sign is the direction; 0 stands still. For velocity mode.

    `acceleration` (rad/s²) and, on HLS, the bound of the current (A) stay as they are when left out; a bound of 0 is
    replaced and reported (`Powerless`). Raises RequestError in another mode, for what no register takes (SMCL takes no
    negative velocity, SCS have no velocity mode), LimitExceeded when it is no finite number.
    """
    _number(node, velocity, "velocity in rad/s")
    finite(node, 0.0, acceleration, current)
    table = await asked_anew(node)
    _heed(node, Mode.VELOCITY, "cannot be given a velocity")
    refuse_current(node, current)
    row = table["goal_velocity"]
    raw = node.raw(row, velocity)
    low, high = (float(node.value(row, bound)) for bound in (row.low, row.high))
    goal = Setpoint(node.node, "velocity", float(node.value(row, raw)), low, high)
    block = Block(row.address, row.encode(raw), row.effect, (goal,), under=node.settings)
    await ask_bound(node, table, current)
    if current is not None or not node.bound:
        block = with_bound(node, table, block, current)
    if acceleration is not None:
        ramp = ramp_of(node, table, acceleration)
        address = table["goal_position"].address - len(ramp)
        await confirmed(node, Block(address, ramp))
    await ordered(node, table, block)


async def set_duty(node: Node, duty: float) -> None:
    """Drive the bridge with this duty, -1 to 1, open loop: how fast that turns depends on the load. For PWM mode.

    A positive duty turned an STS3215 towards smaller angles, opposite to a positive velocity (servolab). Raises
    RequestError in another mode and on HLS, where nobody has published which register takes the duty; LimitExceeded
    when it is no number from -1 to 1.
    """
    _number(node, duty, "duty")
    if not -1 <= duty <= 1:
        raise LimitExceeded(
            f"node {node.node}: {duty} is no duty",
            expected="-1 to 1",
            advice="give a fraction; nothing was sent",
            node=node.node,
        )
    table = await asked_anew(node)
    if not node.control.duty:
        raise unpublished_duty(node)
    _heed(node, Mode.PWM, "cannot be given a duty")
    row = table[node.control.duty]
    raw = round(duty / DUTY)
    goal = Setpoint(node.node, "load", raw * DUTY, -1.0, 1.0)
    await ordered(node, table, Block(row.address, row.encode(raw), row.effect, (goal,)))


async def set_current(node: Node, current: float) -> None:
    """Push with this current in A, whose sign is the direction, whatever that turns. For current mode, which HLS have.

    It is the current of the motor's phase. Raises RequestError in another mode and on other maps, LimitExceeded when it
    is no finite number or more than the register takes (13.3 A).
    """
    _number(node, current, "current in A")
    table = await asked_anew(node)
    _heed(node, Mode.CURRENT, "cannot be given a current")
    row = table[node.control.current]
    raw = node.raw(row, current)
    low, high = float(row.to_value(row.low)), float(row.to_value(row.high))
    if not row.low <= raw <= row.high:
        raise LimitExceeded(
            f"node {node.node}: {current} A is more than it can be told",
            expected=f"{low:.4g} to {high:.4g} A",
            advice="nothing was sent",
            node=node.node,
        )
    goal = Setpoint(node.node, "current", float(row.to_value(raw)), low, high)
    await ordered(node, table, Block(row.address, row.encode(raw), row.effect, (goal,)))


async def step(
    node: Node,
    by: float,
    *,
    velocity: float | None = None,
    acceleration: float | None = None,
    wait: bool = True,
    tolerance: float | None = None,
    timeout: float | None = None,
) -> None:
    """Go `by` rad from where it is, over the end of a turn if need be. For step mode, which STS and SMBL have.

    Torque goes on: on STS by itself, on SMBL by a packet that goes before. Never sent twice, for the servo would go
    twice as far: raises OutcomeUnknown when it was not acknowledged, and where it stands tells whether it went. With
    `wait` it returns when the servo has arrived, and the way is followed turn by turn; bounds, tolerance and errors as
    in `move`. The limits of the servo should be 0 in this mode; what they do otherwise is not published. When the wait
    is interrupted the servo keeps moving, since no goal of step mode holds: a note says so; disable_torque() ends it.
    """
    finite(node, by, velocity, acceleration, tolerance, timeout)
    table = await asked_anew(node)
    _heed(node, Mode.STEP, "cannot step")
    block = _step_block(node, table, by, velocity, acceleration)._replace(under=node.settings)
    goal = block.goals[0].value
    if not node.control.goal_switches_on:
        await confirmed(node, ON)  # which alone moves nothing in step mode
    if not wait:
        await confirmed(node, block)
        return
    row = table["present_position"]
    raw = await read_block(node, PRESENT, row.size, row.decode)
    start = float(node.value(row, raw))
    move = way(node, table, start + goal, velocity, acceleration, tolerance, timeout)
    settings = node.settings
    turn = settings.turn * move.resolution if settings is not None and not settings.accumulates else None
    await stops(_stepped(node, table, block, move._replace(start=start, turn=turn)), node)


async def _stepped(node: Node, table: RegisterMap, block: Block, move: Move) -> None:
    await confirmed(node, block)
    await arrive(node, table, move)


def _step_block(
    node: Node, table: RegisterMap, by: float, velocity: float | None, acceleration: float | None
) -> Block:
    row = table["goal_position"]
    raw = node.raw(row, by)
    most = float(node.value(row, MANY_TURNS))
    if abs(raw) > MANY_TURNS:
        raise LimitExceeded(
            f"node {node.node}: {by} rad is too far for one step",
            expected=f"{-most:.4g} to {most:.4g} rad",
            advice="nothing was sent",
            node=node.node,
        )
    ramp = ramp_of(node, table, acceleration)
    more = burst(node, table, velocity, None)
    goal = Setpoint(node.node, "relative", float(node.value(row, raw)), -most, most)
    speed = table["goal_velocity"]
    goals = (goal, speed_goal(node, speed, speed.decode(more[-speed.size :])))
    return Block(
        row.address - len(ramp), ramp + row.encode(raw) + more, Effect.MOTION, goals, repeatable=False
    )


def _heed(node: Node, wanted: Mode, complaint: str) -> None:
    if node.known_mode is not wanted:
        raise unheeded(node, wanted, complaint)


def _number(node: Node, value: float, what: str) -> None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise RequestError(
            f"{shown(value)} is no {what}", advice="give a number; nothing was sent", node=node.node
        )
    if not is_number(value):
        raise LimitExceeded(
            f"node {node.node}: {shown(value)} is no {what}",
            advice="give a number; nothing was sent",
            node=node.node,
        )
