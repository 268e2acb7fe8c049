"""Blocks of goal registers, and what their values order. Nothing is sent here.

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
from motorbus.families.feetech.driver.identity import check_map
from motorbus.families.feetech.driver.node import MANY_TURNS, Node
from motorbus.families.feetech.driver.requests import ON, TORQUE_ENABLE, Block
from motorbus.families.feetech.traits import Mode

DUTY: Final = 0.001  # of one count. Source: STS3215 memory table V3.6; SCS memory table 1902
NO_LOAD: Final = 3400  # counts/s of an STS3215 without load. Source: STS3215 memory table V3.6
COUNT: Final = tau / 4096  # rad; a count of an STS3215
FAR: Final = 1e6  # rad, beyond any position
ROUNDING: Final = 1e-6  # units of a velocity
COMMANDS: Final = 8  # bytes of registers 40 to 47: torque switch to goal velocity
BOUNDED: Final = (Mode.POSITION, Mode.VELOCITY)  # modes in which the goal torque of an HLS bounds the current
QUANTITY: Final = {Mode.VELOCITY: "velocity", Mode.PWM: "load", Mode.CURRENT: "current"}

# -- setpoints -------------------------------------------------------------------------------------------------


def position_goal(node: Node, to: float) -> tuple[int, Setpoint]:
    """A goal position (rad): its raw value and setpoint; the gate judges the limits.

    Raises DeviceError for an unknown map, RequestError in another mode or without limits, LimitExceeded for no number
    and for what its register cannot hold.
    """
    check_mode(node, Mode.POSITION)
    low, high = checked_limits(node)
    row = node.row("goal_position")
    raw = node.raw(row, to) if is_number(to) and abs(to) < FAR else row.high + 1
    if not row.low <= raw <= row.high:
        raise LimitExceeded(
            f"node {node.node}: {shown(to)} rad is no possible goal",
            expected=f"{node.value(row, row.low):.4g} to {node.value(row, row.high):.4g} rad",
            node=node.node,
        )
    return raw, Setpoint(node.node, "position", node.value(row, raw), low, high)


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
    row = node.row("goal_velocity")
    value, low, high = (float(node.value(row, one)) for one in (raw, row.low, row.high))
    if node.known_mode is Mode.VELOCITY:
        return Setpoint(node.node, "velocity", value, low, high)
    if raw == 0 and (node.settings is None or node.settings.zero_is_maximum):
        value = min(NO_LOAD * COUNT, high)
    return Setpoint(node.node, "speed", value, low, high)


# -- blocks ----------------------------------------------------------------------------------------------------


def motion_block(
    node: Node, to: float, velocity: float | None, acceleration: float | None, current: float | None
) -> Block:
    """A whole move, in registers 41 to 47.

    Where a goal is not known to switch torque on, the switch comes with it, in register 40.
    """
    raw, order = position_goal(node, to)
    block = _goal_block(node, raw, order, velocity, acceleration, current)
    return block if node.traits.goal_switches_on else with_torque(node, block, bytes(COMMANDS))


def step_block(node: Node, by: float, velocity: float | None, acceleration: float | None) -> Block:
    """A step of `by` rad; never sent twice. Raises LimitExceeded beyond 7.5 turns."""
    row = node.row("goal_position")
    raw = node.raw(row, by)
    most = float(node.value(row, MANY_TURNS))
    if abs(raw) > MANY_TURNS:
        what = f"node {node.node}: {by} rad is too far for one step"
        raise LimitExceeded(what, expected=f"{-most:.4g} to {most:.4g} rad", node=node.node)
    order = Setpoint(node.node, "relative", float(node.value(row, raw)), -most, most)
    return _goal_block(node, raw, order, velocity, acceleration)._replace(repeatable=False)


def _goal_block(
    node: Node,
    raw: int,
    order: Setpoint,
    velocity: float | None,
    acceleration: float | None,
    current: float | None = None,
) -> Block:
    """Acceleration, goal, bound of the current or time, velocity. The time is 0, so that the velocity counts."""
    row, speed = node.row("goal_position"), raw_speed(node, velocity)
    ramp = ramp_bytes(node, acceleration)
    between = bound_bytes(node, current) or node.row(node.traits.time).encode(0)
    data = ramp + row.encode(raw) + between + node.row("goal_velocity").encode(speed)
    return Block(row.address - len(ramp), data, Effect.MOTION, (order, speed_setpoint(node, speed)))


def with_torque(node: Node, block: Block, found: bytes) -> Block:
    """This block with the torque switch in one packet; `found` are registers 40 to 47 as they are.

    A bound of 0 and, for a position, a velocity of 0 that means standstill would let no goal move the servo.
    """
    data, used = bytearray(found), 0

    def put(address: int, part: bytes) -> None:
        nonlocal used
        at = address - TORQUE_ENABLE
        data[at : at + len(part)] = part
        used = max(used, at + len(part))

    put(TORQUE_ENABLE, ON)
    put(block.address, block.data)
    if node.traits.current and node.known_mode in BOUNDED:
        row = node.row(node.traits.current)
        node.known.bound = row.decode(bytes(data[row.address - TORQUE_ENABLE :][: row.size]))
        put(row.address, bound_bytes(node))
    row, maximum = node.row("goal_velocity"), raw_speed(node, None)
    if maximum and node.known_mode is Mode.POSITION and not any(data[row.address - TORQUE_ENABLE :]):
        put(row.address, row.encode(maximum))
    goals = tuple(goal._replace(stays=Stays.ON) if goal.stays else goal for goal in block.goals)
    return block._replace(address=TORQUE_ENABLE, data=bytes(data[:used]), goals=goals)


def hold_block(node: Node, raw: int) -> Block:
    """Goal := this present position."""
    row = node.row("goal_position")
    value = node.value(row, raw)
    still = Setpoint(node.node, "position", value, value, value, Stays.STILL)
    return Block(row.address, row.encode(raw), row.effect, (still,))


def rest_block(node: Node) -> Block:
    """Velocity, duty or current 0, by the mode. Raises RequestError where no register is known for it."""
    mode, traits = checked_mode(node), node.traits
    names = {Mode.VELOCITY: "goal_velocity", Mode.PWM: traits.duty, Mode.CURRENT: traits.current}
    if not names[mode]:
        raise no_duty(node)
    row = node.row(names[mode])
    still = Setpoint(node.node, QUANTITY[mode], 0.0, 0.0, 0.0, Stays.STILL)
    return Block(row.address, row.encode(0), row.effect, (still,))


# -- bounds ----------------------------------------------------------------------------------------------------


def raw_speed(node: Node, velocity: float | None) -> int:
    """Raw goal velocity; None: the maximum, which is a number where 0 means standstill."""
    row = node.row("goal_velocity")
    if velocity is None and node.settings is not None and not node.settings.zero_is_maximum:
        return max(1, node.raw(row, NO_LOAD * node.row("goal_position").scale))
    return _above_zero(node, row, velocity)


def speed_at_least(node: Node, velocity: float | None) -> int:
    """Raw goal velocity of a servo that follows goals and must not lag: rounded up."""
    row = node.row("goal_velocity")
    unit = float(node.value(row, 1))
    if velocity is None or velocity > unit * row.high:
        return raw_speed(node, None)
    return max(1, ceil(velocity / unit - ROUNDING))


def ramp_bytes(node: Node, acceleration: float | None) -> bytes:
    """The acceleration register, just before the goal; b"" where the map has none."""
    if node.traits.acceleration:
        row = node.row(node.traits.acceleration)
        return row.encode(_above_zero(node, row, acceleration))
    if acceleration is None:
        return b""
    raise node.refusal("is an SCS servo, which has no acceleration register", "leave acceleration out")


def _above_zero(node: Node, row: Register, value: float | None) -> int:
    """Raw value of a bound; None: 0, no bound."""
    if value is None:
        return 0
    raw = node.raw(row, value)
    if raw > 0:
        return raw
    span = f"{node.value(row, 1):.4g} to {node.value(row, row.high):.4g} {row.unit}"
    raise node.refusal(f"cannot take {row.name} {value}", "leave it out for the maximum", expected=span)


def bound_bytes(node: Node, current: float | None = None) -> bytes:
    """The goal torque of an order: `current` (A), else what is set, else the protection current; b"" without one.

    With 0 a servo acknowledges every order and never moves: RequestError. Source: FEETECH SDK, hls.py.
    """
    if not node.traits.current:
        if current is None:
            return b""
        raise node.refusal("has no register that bounds its current", "leave current out: cap_torque()")
    row = node.row(node.traits.current)
    protection = node.settings.protection_current if node.settings else 0
    raw = (abs(node.known.bound or 0) or protection) if current is None else node.raw(row, current)
    if 0 < raw <= row.high:
        return row.encode(raw)
    if current is None:
        raise node.refusal(
            "has a goal torque of 0 and a protection current of 0: it would never move",
            "give current= in A, or write(protection_current=…)",
        )
    span = f"{row.scale:.4g} to {row.to_value(row.high):.4g} A"
    raise node.refusal(f"cannot bound its current to {current} A", expected=span)


# -- refusals --------------------------------------------------------------------------------------------------


def check_mode(node: Node, wanted: Mode) -> None:
    """Raise RequestError for an order that a servo in this mode does not obey, DeviceError for an unknown map."""
    check_map(node)
    if node.known_mode is wanted:
        return
    has = ", ".join(mode.value for mode in node.traits.has)
    fix = f"set_mode({wanted.value!r})" if wanted in node.traits.has else f"servos of its map have {has} mode"
    raise node.refusal(f"is in operating mode {shown_mode(node)}, not {wanted.value}", fix)


def checked_mode(node: Node) -> Mode:
    """Its mode. Raises RequestError for a number that no source explains."""
    if node.known_mode is not None:
        return node.known_mode
    known = ", ".join(f"{code} {mode.value}" for code, mode in node.traits.modes.items())
    what = f"is in operating mode {shown_mode(node)}, which is not documented"
    raise node.refusal(what, "set_mode('position'), or disable_torque()", expected=known)


def shown_mode(node: Node) -> str:
    """Its mode as text, or the number that no source explains."""
    if node.known_mode is not None:
        return node.known_mode.value
    return str(node.settings.mode_code) if node.settings else "unknown"


def checked_limits(node: Node) -> tuple[float, float]:
    """Its limits (rad). Raises RequestError for both 0 where that has no known meaning.

    Goals then count over many turns only in maps that do, and with the phase bit that lets positions count so too.
    """
    settings = node.settings
    if settings is None or settings.limits is None:
        fix = "write(min_position_limit=…, max_position_limit=…), or disable_torque()"
        raise node.refusal("has position limits of 0 and 0, which has no known meaning in its map", fix)
    if settings.many_turns and not settings.tells_turns:
        what = "counts its goals over many turns and its position within one, so a goal may be turns away"
        raise node.refusal(what, "set_multi_turn(True), or disable_torque()")
    return settings.limits


def no_duty(node: Node) -> RequestError:
    """The error for PWM mode of HLS: the HLS memory table names the mode and no register, the SDK has no call."""
    fix = "disable_torque(), then set_mode('position'), 'velocity' or 'current'"
    return node.refusal("is an HLS servo, whose duty register is not published", fix)
