"""What goes along with a goal position, in the registers before and behind it: how fast, how briskly, how hard.

In all of them 0 is a special number: of the acceleration it means the maximum, of the velocity the maximum or
standstill, of the bound of the current no force at all. So a bound that somebody gives never becomes 0.
Source: STS3215 memory table V3.6; HLS memory table; FEETECH notes on special bytes.
"""

from __future__ import annotations

from math import ceil
from typing import Final

from motorbus.core.register import Register, RegisterMap
from motorbus.errors import RequestError
from motorbus.families.feetech.driver.bound import raw_bound, refuse_current
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.orders import NO_LOAD

ROUNDING: Final = 1e-6
"""Units of a velocity that are noise of binary arithmetic."""


def burst(node: Node, table: RegisterMap, velocity: float | None, current: float | None) -> bytes:
    """What follows the goal in the registers of every map: bound of the current or time, and the velocity."""
    control = node.control
    refuse_current(node, current)
    if control.current:
        row = table[control.current]
        between = row.encode(raw_bound(node, row, current))
    else:
        between = table[control.time].encode(0)
    return between + table["goal_velocity"].encode(_speed(node, table, velocity))


def ramp_of(node: Node, table: RegisterMap, acceleration: float | None) -> bytes:
    """The acceleration, whose register comes just before the goal; nothing where the map has none.

    Raises RequestError when one is asked for there.
    """
    if node.control.acceleration:
        row = table[node.control.acceleration]
        return row.encode(_positive(node, row, acceleration))
    if acceleration is None:
        return b""
    raise RequestError(
        f"node {node.node} has no acceleration register: {table.name} servos accelerate as they like",
        expected="a servo of another map; register 41 is none of SCS",
        advice="leave acceleration out; nothing was sent",
        node=node.node,
    )


def speed_at_least(node: Node, table: RegisterMap, velocity: float | None) -> int:
    """Raw goal velocity for one who follows goals and must not lag: rounded up; None and beyond: the maximum."""
    row = table["goal_velocity"]
    unit = float(node.value(row, 1))
    if velocity is None or velocity > unit * row.high:
        return _speed(node, table, None)
    return max(1, ceil(velocity / unit - ROUNDING))


def _speed(node: Node, table: RegisterMap, velocity: float | None) -> int:
    """Raw goal velocity. Where 0 means standstill, the maximum has to be said as a number."""
    row = table["goal_velocity"]
    if velocity is None and node.settings is not None and not node.settings.zero_is_maximum:
        return max(1, node.raw(row, NO_LOAD * table["goal_position"].scale))
    return _positive(node, row, velocity)


def _positive(node: Node, row: Register, value: float | None) -> int:
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
