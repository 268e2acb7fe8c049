"""Orders that make nothing move: stay where it stands, no velocity, no duty, no current, as the mode asks for.

They are what comes before torque goes on, and what a stop says. Where no such order is known, that is said.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.entry import Table
from motorbus.core.operation import Goal, Operation
from motorbus.errors import LimitExceeded, RequestError
from motorbus.families.feetech.driver.bound import ask_bound, raw_bound
from motorbus.families.feetech.driver.exchanges import PRESENT, Block, read_block
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.orders import no_limits, shown_mode
from motorbus.families.feetech.driver.pace import burst
from motorbus.families.feetech.table import Mode

_QUANTITY: Final = {Mode.VELOCITY: "velocity", Mode.PWM: "load", Mode.CURRENT: "current"}


def held(node: Node, table: Table) -> Operation[Block]:
    """Goal := the present position, wherever that is, for a servo that is under way or limp."""
    raw = yield from _stands(node, table)
    _know_the_turn(node, raw)
    return _hold(node, table, raw)


def held_within(node: Node, table: Table, jump: float) -> Operation[Block]:
    """Goal := the present position, or the limit it would go for when that is at most `jump` rad away.

    With a bound of the current that lets it hold, where the map has one, and with a velocity when it would not go to
    the next goal without. Raises LimitExceeded when it would go farther.
    """
    if node.limits is None:
        raise no_limits(node)
    yield from ask_bound(node, table)
    still = yield from _stays_put(node, table)
    raw = yield from _stands(node, table)
    _know_the_turn(node, raw, jump)
    block = _hold(node, table, _within(node, table, raw, jump))
    if still:
        return block._replace(data=block.data + burst(node, table, None, None))
    return with_bound(node, table, block)


def _stays_put(node: Node, table: Table) -> Operation[bool]:
    """Whether its goal velocity is 0 and means standstill, so that goals alone would move nothing."""
    if node.settings is None or node.settings.zero_is_maximum:
        return False
    row = table["goal_velocity"]
    return (yield from read_block(node, row.address, row.size, row.decode)) == 0


def _stands(node: Node, table: Table) -> Operation[int]:
    """Raw present position. Raises RequestError when no goal could be told to be within the limits."""
    if node.limits is None:
        raise no_limits(node)
    row = table["present_position"]
    return (yield from read_block(node, PRESENT, row.size, row.decode))


def at_rest(node: Node, table: Table, mode: Mode) -> Block:
    """Velocity, duty or current 0, whichever this mode heeds; in velocity mode with what bounds the current."""
    name = {Mode.VELOCITY: "goal_velocity", Mode.PWM: node.control.duty, Mode.CURRENT: node.control.current}[
        mode
    ]
    if not name:
        raise unpublished_duty(node)
    row = table[name]
    goal = Goal(node.node, _QUANTITY[mode], 0.0, 0.0, 0.0)
    return Block(row.address, row.encode(0), row.effect, (goal,))


def with_bound(node: Node, table: Table, block: Block, current: float | None = None) -> Block:
    """This block with the bound of the current before or behind it, where the map has one; the two adjoin."""
    if not node.control.current:
        return block
    row = table[node.control.current]
    data = row.encode(raw_bound(node, row, current))
    if row.address < block.address:
        return block._replace(address=row.address, data=data + block.data)
    return block._replace(data=block.data + data)


def unpublished_duty(node: Node) -> RequestError:
    """The error for PWM mode on HLS: nobody has published which register takes the duty."""
    return RequestError(
        f"node {node.node}: nobody has published which register takes the duty in PWM mode on "
        f"{node.identity.table if node.identity else 'its map'}",
        cause="the HLS memory table names the mode and no register; the SDK has no call for it",
        advice="use its current mode, or disable_torque() to let it go limp; nothing was sent",
        node=node.node,
    )


def unknown_mode(node: Node) -> RequestError:
    """The error for a mode number that no source explains."""
    known = ", ".join(f"{code} {mode.value}" for code, mode in node.control.modes.items())
    return RequestError(
        f"node {node.node} is in operating mode {shown_mode(node)}, which is not documented",
        expected=known,
        advice="set_mode('position') puts it into position mode; disable_torque() lets it go limp",
        node=node.node,
    )


def _hold(node: Node, table: Table, raw: int) -> Block:
    """Goal := this position. Staying where it stands is inside any limits, so the goal brings its own."""
    row = table["goal_position"]
    value = node.value(row, raw)
    goal = Goal(node.node, "position", value, value, value)
    return Block(row.address, row.encode(raw), row.effect, (goal,))


def _know_the_turn(node: Node, raw: int, jump: float = 0.0) -> None:
    """Raise RequestError when goals count over many turns and this position over one: "here" may be turns away."""
    settings = node.settings
    assert settings is not None
    assert node.limits is not None
    told = settings.accumulates or not settings.many_turns or not 0 <= raw < settings.turn
    if told or jump >= node.limits[1]:
        return
    raise RequestError(
        f"node {node.node} counts its goals over many turns and tells its position within one (bit 4 of phase is "
        "clear), so nobody knows on which turn it stands, and a goal 'here' may be turns away",
        advice="set_many_turns(True) makes it tell its turns; or move() it to a goal you know, or let it go limp by "
        "disable_torque(); nothing was sent",
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
