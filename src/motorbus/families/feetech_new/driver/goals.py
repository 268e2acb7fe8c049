"""Blocks of goal registers, and what their values order. No I/O.

In these registers 0 is special: an acceleration of 0 is the maximum, a velocity of 0 the maximum or standstill, a goal
torque of 0 no force at all. A bound that a caller gives never becomes 0. Source: STS3215 memory table V3.6; HLS memory
table; FEETECH notes on special bytes.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, tau
from typing import Final

from motorbus.core.register import Register, is_number, shown
from motorbus.core.request import Effect
from motorbus.core.setpoint import Setpoint, Stays
from motorbus.errors import LimitExceeded, RequestError
from motorbus.families.feetech_new.driver.identity import check_map
from motorbus.families.feetech_new.driver.node import MANY_TURNS, Node
from motorbus.families.feetech_new.driver.requests import TORQUE_ENABLE, Block
from motorbus.families.feetech_new.traits import Mode

DUTY: Final = 0.001  # of one count. Source: STS3215 memory table V3.6; SCS memory table 1902
NO_LOAD: Final = 3400  # counts/s of an STS3215 without load. Source: STS3215 memory table V3.6
COUNT: Final = tau / 4096  # rad; a count of an STS3215
ROUNDING: Final = 1e-6  # units of a velocity
ON: Final = b"\1"
QUANTITY: Final = {Mode.VELOCITY: "velocity", Mode.PWM: "load", Mode.CURRENT: "current"}


# -- goals -----------------------------------------------------------------------------------------------------


def position_goal(node: Node, to: float) -> tuple[int, Setpoint]:
    """A goal position (rad): its raw value and setpoint; the gate judges the limits.

    Raises DeviceError for an unknown map, RequestError in another mode or without limits, LimitExceeded for no number
    and for what its register cannot hold.
    """
    check_mode(node, Mode.POSITION)
    if node.limits is None:
        raise no_limits(node)
    row = goal_row(node, "goal_position")
    raw = node.raw(row, to) if is_number(to) else row.high + 1
    if not row.low <= raw <= row.high:
        raise LimitExceeded(
            f"node {node.node}: {shown(to)} rad is no possible goal",
            expected=f"{node.value(row, row.low):.4g} to {node.value(row, row.high):.4g} rad",
            advice="nothing was sent",
            node=node.node,
        )
    return raw, Setpoint(node.node, "position", node.value(row, raw), *node.limits)


def setpoints(node: Node, row: Register, raw: int) -> Iterator[Setpoint]:
    """What this value of this row orders in the present mode."""
    value, mode = node.value(row, raw), node.known_mode
    if row.name == "goal_position" and mode is Mode.STEP:
        most = MANY_TURNS * row.scale
        yield Setpoint(node.node, "relative", value, -most, most)
    elif row.name == "goal_position":
        yield Setpoint(node.node, "position", value, *(node.limits or (None, None)))
    elif row.name == "goal_velocity":
        yield speed_setpoint(node, raw)
    elif row.name == node.traits.current:
        quantity = "current" if mode is Mode.CURRENT else "cap"
        yield Setpoint(node.node, quantity, value, node.value(row, row.low), node.value(row, row.high))
    elif row.name == "goal_time" and mode is Mode.PWM:
        yield Setpoint(node.node, "load", raw * DUTY, -1.0, 1.0)
    elif row.name == "goal_time":
        yield Setpoint(node.node, "time", raw / row.high, -1.0, 1.0)


def speed_setpoint(node: Node, raw: int) -> Setpoint:
    """What this goal velocity orders: to turn at it in velocity mode, else the speed of the way to the goal."""
    row = goal_row(node, "goal_velocity")
    low, high = float(node.value(row, row.low)), float(node.value(row, row.high))
    if node.known_mode is Mode.VELOCITY:
        return Setpoint(node.node, "velocity", float(node.value(row, raw)), low, high)
    if raw == 0 and (node.settings is None or node.settings.zero_is_maximum):
        return Setpoint(node.node, "speed", min(NO_LOAD * COUNT, high), low, high)
    return Setpoint(node.node, "speed", float(node.value(row, raw)), low, high)


def goal_row(node: Node, name: str) -> Register:
    """A goal register as the present mode codes it, of a servo whose map is known."""
    assert node.table is not None
    if node.known_mode is Mode.PWM and name == node.traits.duty:
        return node.traits.duty_row(node.table)
    return node.table[name]


# -- blocks ----------------------------------------------------------------------------------------------------


def motion_block(
    node: Node, to: float, velocity: float | None, acceleration: float | None, current: float | None
) -> Block:
    """A whole move: acceleration, goal, bound of the current or time, velocity, in registers 41 to 47.

    Where a goal is not known to switch torque on, the switch comes with it, in register 40. The time is 0, so that the
    velocity counts.
    """
    raw, order = position_goal(node, to)
    block = _goal_block(node, raw, order, velocity, acceleration, current)
    return block if node.traits.goal_switches_on else with_torque(block)


def step_block(node: Node, by: float, velocity: float | None, acceleration: float | None) -> Block:
    """A step of `by` rad; never sent twice. Raises LimitExceeded beyond 7.5 turns."""
    row = goal_row(node, "goal_position")
    raw = node.raw(row, by)
    most = float(node.value(row, MANY_TURNS))
    if abs(raw) > MANY_TURNS:
        raise LimitExceeded(
            f"node {node.node}: {by} rad is too far for one step",
            expected=f"{-most:.4g} to {most:.4g} rad",
            advice="nothing was sent",
            node=node.node,
        )
    goal = Setpoint(node.node, "relative", float(node.value(row, raw)), -most, most)
    return _goal_block(node, raw, goal, velocity, acceleration, None)._replace(repeatable=False)


def _goal_block(
    node: Node,
    raw: int,
    order: Setpoint,
    velocity: float | None,
    acceleration: float | None,
    current: float | None,
) -> Block:
    row = goal_row(node, "goal_position")
    speed = raw_speed(node, velocity)
    ramp = ramp_bytes(node, acceleration)
    data = ramp + row.encode(raw) + burst(node, speed, current)
    goals = (order, speed_setpoint(node, speed))
    return Block(row.address - len(ramp), data, Effect.MOTION, goals)


def burst(node: Node, speed: int, current: float | None = None) -> bytes:
    """The registers behind a goal: bound of the current or time, and the raw velocity."""
    check_current(node, current)
    if node.traits.current:
        row = goal_row(node, node.traits.current)
        between = row.encode(raw_bound(node, current))
    else:
        between = goal_row(node, node.traits.time).encode(0)
    return between + goal_row(node, "goal_velocity").encode(speed)


def with_torque(block: Block, found: bytes = bytes(8)) -> Block:
    """This block with the torque switch in the same packet; `found` are registers 40 to 47 as they are.

    SCS have no register 41: it gets what was read, or 0.
    """
    between = found[1 : block.address - TORQUE_ENABLE]
    goals = tuple(goal._replace(stays=Stays.ON) if goal.stays else goal for goal in block.goals)
    return block._replace(address=TORQUE_ENABLE, data=ON + between + block.data, goals=goals)


def hold_block(node: Node, raw: int) -> Block:
    """Goal := this present position."""
    row = goal_row(node, "goal_position")
    value = node.value(row, raw)
    still = Setpoint(node.node, "position", value, value, value, Stays.STILL)
    return Block(row.address, row.encode(raw), row.effect, (still,))


def rest_block(node: Node) -> Block:
    """Velocity, duty or current 0, by the mode. Raises RequestError where no register is known for it."""
    mode = known_mode(node)
    names = {
        Mode.VELOCITY: "goal_velocity",
        Mode.PWM: node.traits.duty,
        Mode.CURRENT: node.traits.current,
    }
    if not names[mode]:
        raise no_duty(node)
    row = goal_row(node, names[mode])
    still = Setpoint(node.node, QUANTITY[mode], 0.0, 0.0, 0.0, Stays.STILL)
    return Block(row.address, row.encode(0), row.effect, (still,))


def with_bound(node: Node, block: Block, current: float | None = None) -> Block:
    """This block of a goal position or velocity with the adjoining bound of the current, where the map has one."""
    if not node.traits.current:
        return block
    row = goal_row(node, node.traits.current)
    data = row.encode(raw_bound(node, current))
    if row.address < block.address:
        return block._replace(address=row.address, data=data + block.data)
    return block._replace(data=block.data + data)


# -- bounds ----------------------------------------------------------------------------------------------------


def raw_speed(node: Node, velocity: float | None) -> int:
    """Raw goal velocity; None: the maximum, which is a number where 0 means standstill."""
    row = goal_row(node, "goal_velocity")
    if velocity is None and node.settings is not None and not node.settings.zero_is_maximum:
        return max(1, node.raw(row, NO_LOAD * goal_row(node, "goal_position").scale))
    return _above_zero(node, row, velocity)


def speed_at_least(node: Node, velocity: float | None) -> int:
    """Raw goal velocity of a servo that follows goals and must not lag: rounded up."""
    row = goal_row(node, "goal_velocity")
    unit = float(node.value(row, 1))
    if velocity is None or velocity > unit * row.high:
        return raw_speed(node, None)
    return max(1, ceil(velocity / unit - ROUNDING))


def ramp_bytes(node: Node, acceleration: float | None) -> bytes:
    """The acceleration register, just before the goal; b"" where the map has none."""
    if node.traits.acceleration:
        row = goal_row(node, node.traits.acceleration)
        return row.encode(_above_zero(node, row, acceleration))
    if acceleration is None:
        return b""
    raise RequestError(
        f"node {node.node} has no acceleration register",
        expected="a servo of another map than SCS",
        advice="leave acceleration out; nothing was sent",
        node=node.node,
    )


def _above_zero(node: Node, row: Register, value: float | None) -> int:
    """Raw value of a bound; None: 0, no bound."""
    if value is None:
        return 0
    raw = node.raw(row, value)
    if raw > 0:
        return raw
    raise RequestError(
        f"{row.name}: {value} {row.unit} is less than the smallest value",
        expected=f"{node.value(row, 1):.4g} to {node.value(row, row.high):.4g} {row.unit}",
        advice="leave it out for the maximum; nothing was sent",
        node=node.node,
    )


def raw_bound(node: Node, current: float | None) -> int:
    """Raw goal torque of an order: `current` (A), else what is set, else the protection current.

    With 0 a servo acknowledges every order and never moves. Raises RequestError for that. Source: FEETECH SDK, hls.py.
    """
    row = goal_row(node, node.traits.current)
    if current is not None:
        raw = node.raw(row, current)
        if 0 < raw <= row.high:
            return raw
        raise RequestError(
            f"node {node.node}: {current} A is no bound of its current",
            expected=f"{row.scale:.4g} to {row.to_value(row.high):.4g} A",
            advice="leave it out to keep what is set; nothing was sent",
            node=node.node,
        )
    protection = node.settings.protection_current if node.settings else 0
    if raw := abs(node.bound or 0) or protection:
        return raw
    raise RequestError(
        f"node {node.node} has a goal torque of 0 and a protection current of 0: it would never move",
        advice="give current= in A, or write(protection_current=…); nothing was sent",
        node=node.node,
    )


# -- refusals --------------------------------------------------------------------------------------------------


def check_bounds(node: Node, *bounds: float | None) -> None:
    """Raise RequestError for a bound that is not a finite number from 0 on."""
    for bound in bounds:
        if bound is not None and not (is_number(bound) and bound >= 0):
            raise RequestError(
                f"node {node.node}: {shown(bound)} is not a finite number above 0",
                expected="velocity in rad/s, acceleration in rad/s², current in A",
                advice="nothing was sent",
                node=node.node,
            )


def check_current(node: Node, current: float | None) -> None:
    """Raise RequestError for a bound of the current where no register holds one."""
    if current is not None and not node.traits.current:
        raise RequestError(
            f"node {node.node} has no register that bounds its current",
            expected="an HLS servo",
            advice="leave current out; cap_torque() limits its torque; nothing was sent",
            node=node.node,
        )


def check_mode(node: Node, wanted: Mode) -> None:
    """Raise RequestError for an order that a servo in this mode does not obey, DeviceError for an unknown map."""
    check_map(node)
    if node.known_mode is wanted:
        return
    has = ", ".join(mode.value for mode in node.traits.has)
    raise RequestError(
        f"node {node.node} is in operating mode {shown_mode(node)}, not {wanted.value}",
        expected=f"operating mode {wanted.value}",
        advice=f"set_mode({wanted.value!r}) changes that; nothing was sent"
        if wanted in node.traits.has
        else f"servos of its map have {has} mode only; nothing was sent",
        node=node.node,
    )


def known_mode(node: Node) -> Mode:
    """Its mode. Raises RequestError for a number that no source explains."""
    if node.known_mode is not None:
        return node.known_mode
    raise RequestError(
        f"node {node.node} is in operating mode {shown_mode(node)}, which is not documented",
        expected=", ".join(f"{code} {mode.value}" for code, mode in node.traits.modes.items()),
        advice="set_mode('position') changes that; disable_torque() makes it limp",
        node=node.node,
    )


def shown_mode(node: Node) -> str:
    """Its mode as text, or the number that no source explains."""
    if node.known_mode is not None:
        return node.known_mode.value
    return str(node.settings.mode_code) if node.settings else "unknown"


def no_limits(node: Node) -> RequestError:
    """The error for limits that are both 0 in a map where that meaning is unknown."""
    return RequestError(
        f"both position limits of node {node.node} are 0, which has no known meaning in its map",
        expected="a greatest position above the least",
        advice="write(min_position_limit=…, max_position_limit=…), or disable_torque(); nothing was sent",
        node=node.node,
    )


def no_duty(node: Node) -> RequestError:
    """The error for PWM mode of HLS, whose duty register is unknown."""
    return RequestError(
        f"node {node.node}: the register of the duty in PWM mode is not published for its map",
        cause="the HLS memory table names the mode and no register; the SDK has no call for it",
        advice="use its current mode, or disable_torque(); nothing was sent",
        node=node.node,
    )
