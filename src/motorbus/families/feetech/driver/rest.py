"""Orders that make nothing move: stay where it stands, no velocity, no duty, no current, as the mode asks for.

They are what torque goes on with, and what a stop says. Where no such order is known, that is said.

A servo that loses its supply for a moment (the inrush of its own motor may do it) forgets its goal, and whoever then
switches its torque on by itself sends it to wherever that register begins. So the switch never travels alone where a
goal is heeded: registers 40 to 47 adjoin in every map, and one packet carries both. The mode and the limits may be
another program's by now, so they are read again before anything is ordered.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.register import RegisterMap, is_number, shown
from motorbus.core.request import Effect, Precondition
from motorbus.core.setpoint import Setpoint, Stays, torque_on
from motorbus.errors import LimitExceeded, MotionError, RequestError
from motorbus.families.feetech.driver.bound import ask_bound, raw_bound
from motorbus.families.feetech.driver.exchanges import PRESENT, Block, confirmed, outdated, read_block
from motorbus.families.feetech.driver.identity import prepare, writable
from motorbus.families.feetech.driver.node import Node, Settings
from motorbus.families.feetech.driver.orders import no_limits, shown_mode
from motorbus.families.feetech.driver.pace import burst
from motorbus.families.feetech.driver.torque import TORQUE_ENABLE, disable_torque
from motorbus.families.feetech.table import Mode

_QUANTITY: Final = {Mode.VELOCITY: "velocity", Mode.PWM: "load", Mode.CURRENT: "current"}
_ON: Final = b"\1"
ON: Final = Block(TORQUE_ENABLE, b"\1", Effect.TORQUE)
_COMMANDS: Final = 8
"""Bytes from the torque switch to the goal velocity, registers 40 to 47 in every map."""
_HERE, _AWAY = "here", "away"


# -- what is so now ------------------------------------------------------------------------------------------


async def asked_anew(node: Node) -> RegisterMap:
    """The map of a servo whose mode, limits and units are read at this moment: another program may have set them.

    Costs one READ of registers 0 to 39. Raises DeviceError when the register map is not known.
    """
    await prepare(node)
    return await writable(node)


async def is_limp(node: Node) -> bool:
    """Whether its torque switch says anything but 'on'."""
    return await read_block(node, TORQUE_ENABLE, 1, bytes) != _ON


async def surely_on(node: Node) -> None:
    """Raise MotionError when the torque switch of a servo that has acknowledged 'on' says something else."""
    if await is_limp(node):
        raise MotionError(
            f"node {node.node} has taken the order to switch its torque on, and its torque is off",
            expected="register 40 at 1",
            cause="it has lost its supply for a moment, which switching the torque on may do; or an alarm let it drop; "
            "or a stop or another program has switched it off",
            advice="see to its supply and its alarms, then enable_torque(); it is limp",
            node=node.node,
        )


# -- torque on -----------------------------------------------------------------------------------------------


async def torque_on_unless(node: Node, refusal: Precondition | None, *, jump: float = 0.0) -> None:
    """`enable_torque`, with a further reason not to send the packet that switches the torque on."""
    checked_jump(node, jump)
    table = await asked_anew(node)
    mode = node.known_mode
    if mode is None:
        raise unknown_mode(node)
    if mode is Mode.STEP:
        await confirmed(node, ON._replace(goals=(torque_on(node.node),), refusal=refusal))
    else:
        block = await beginning(node, table, mode, jump)
        await ordered(node, table, block._replace(refusal=refusal))
        if mode is Mode.POSITION:
            await not_turns_away(node, table, block, jump)
    await surely_on(node)


async def beginning(node: Node, table: RegisterMap, mode: Mode, jump: float) -> Block:
    """The one packet with which torque comes on at rest, in any mode but step; errors as `held_within` and `at_rest`.

    What lies between the switch and the order keeps the value it has.
    """
    if mode is Mode.POSITION:
        return await held_within(node, table, jump)
    block = at_rest(node, table, mode)._replace(under=node.settings)
    if mode is Mode.VELOCITY:
        await ask_bound(node, table)
        block = with_bound(node, table, block)
    return switched_on(block, await _commands(node))


def switched_on(block: Block, found: bytes = bytes(_COMMANDS)) -> Block:
    """This order and the torque switch before it, in one packet; `found` are registers 40 to 47 as they are.

    SCS have no register 41: there it carries what was read, or 0, which is the maximum should it be the acceleration
    that some libraries (lerobot, rustypot) take it for. What real ones do with it is not known; a servo that refused
    the packet for it would stay limp.
    """
    between = found[1 : block.address - TORQUE_ENABLE]
    goals = tuple(goal._replace(stays=Stays.ON) if goal.stays else goal for goal in block.goals)
    return block._replace(address=TORQUE_ENABLE, data=_ON + between + block.data, goals=goals)


async def _commands(node: Node) -> bytes:
    return await read_block(node, TORQUE_ENABLE, _COMMANDS, bytes)


async def not_turns_away(node: Node, table: RegisterMap, block: Block, jump: float = 0.0) -> None:
    """See that a servo which counts its turns still stands on the turn on which this order would have it stay.

    It forgets them with its supply: lost between being asked where it stands and the order, "here" is turns away, and
    it is on its way there. Then its torque is switched off at once, and MotionError raised.
    """
    settings = node.settings
    if settings is None or not settings.accumulates:
        return
    row, goal = table["present_position"], block.goals[0].value
    far = abs(float(node.value(table["goal_position"], settings.turn // 2))) + jump

    def take(data: bytes) -> str:
        return _AWAY if abs(float(node.value(row, row.decode(data))) - goal) > far else _HERE

    if await read_block(node, PRESENT, row.size, take) != _HERE:
        await disable_torque(node)
        raise MotionError(
            f"node {node.node} has forgotten its turns while it was told to stay at {goal:.4g} rad",
            cause="it has lost its supply for a moment",
            advice="see to its supply, home it, then enable_torque(); it is limp",
            node=node.node,
        )


def checked_jump(node: Node, jump: float) -> None:
    """Raise RequestError for a jump that bounds nothing."""
    if not (is_number(jump) and jump >= 0):
        raise RequestError(
            f"node {node.node}: {shown(jump)} is no way that it may jump",
            expected="a finite number from 0 on, in rad",
            advice="leave it out to allow none; nothing was sent",
            node=node.node,
        )


async def ordered(node: Node, table: RegisterMap, block: Block) -> None:
    """Write an order and be sure of it; what it says of the bound of the current is known from then on."""
    row = table[node.control.current] if node.control.current else None
    told = row is not None and block.address <= row.address < block.address + len(block.data)
    if row is not None and told:
        node.bound = None
    await confirmed(node, block)
    if row is not None and told:
        at = row.address - block.address
        node.bound = row.decode(block.data[at : at + row.size])


# -- stay ----------------------------------------------------------------------------------------------------


async def held(node: Node, table: RegisterMap) -> Block:
    """Goal := the present position, wherever that is, for a servo that is under way or limp."""
    raw = await _stands(node, table)
    _know_the_turn(node, raw)
    return _hold(node, table, raw)


async def held_within(node: Node, table: RegisterMap, jump: float) -> Block:
    """Torque on, and goal := the present position, or the limit it would go for when that is at most `jump` rad away.

    With a bound of the current that lets it hold, where the map has one, and with a velocity when it would not go to
    the next goal without. Raises LimitExceeded when it would go farther.
    """
    if node.limits is None:
        raise no_limits(node)
    settings = node.settings
    await ask_bound(node, table)
    found = await _commands(node)
    _still(node, settings)
    raw = await _stands(node, table)
    _know_the_turn(node, raw, jump)
    there = _within(node, table, raw, jump)
    block = _hold(node, table, there)
    if there != raw:  # it goes there, so it is judged as any other that goes
        block = block._replace(goals=(Setpoint(node.node, "position", block.goals[0].value, *node.limits),))
    if _stays_put(node, table, found):
        return switched_on(block._replace(data=block.data + burst(node, table, None, None)), found)
    return switched_on(with_bound(node, table, block), found)


def _stays_put(node: Node, table: RegisterMap, found: bytes) -> bool:
    """Whether its goal velocity is 0 and means standstill, so that goals alone would move nothing."""
    if node.settings is None or node.settings.zero_is_maximum:
        return False
    row = table["goal_velocity"]
    return row.decode(found[row.address - TORQUE_ENABLE :][: row.size]) == 0


def outside(node: Node, table: RegisterMap, block: Block) -> bool:
    """Whether this order to stay lies outside the limits: a servo with torque goes for the nearer one then."""
    assert node.limits is not None
    here, slack = block.goals[0].value, table["goal_position"].scale / 2
    return not node.limits[0] - slack <= here <= node.limits[1] + slack


async def _stands(node: Node, table: RegisterMap) -> int:
    """Raw present position. Raises RequestError when no goal could be told to be within the limits."""
    if node.limits is None:
        raise no_limits(node)
    row, settings = table["present_position"], node.settings
    raw = await read_block(node, PRESENT, row.size, row.decode)
    _still(node, settings)
    return raw


def _still(node: Node, settings: Settings | None) -> None:
    """Raise RequestError when another task has changed the settings of this servo since."""
    if node.settings != settings:
        raise outdated(node)


def at_rest(node: Node, table: RegisterMap, mode: Mode) -> Block:
    """Velocity, duty or current 0, whichever this mode heeds; in velocity mode with what bounds the current."""
    name = {Mode.VELOCITY: "goal_velocity", Mode.PWM: node.control.duty, Mode.CURRENT: node.control.current}[
        mode
    ]
    if not name:
        raise unpublished_duty(node)
    row = table[name]
    goal = Setpoint(node.node, _QUANTITY[mode], 0.0, 0.0, 0.0, Stays.STILL)
    return Block(row.address, row.encode(0), row.effect, (goal,))


def with_bound(node: Node, table: RegisterMap, block: Block, current: float | None = None) -> Block:
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


def _hold(node: Node, table: RegisterMap, raw: int) -> Block:
    """Goal := this position. Staying where it stands is inside any limits, so the goal brings its own."""
    row = table["goal_position"]
    value = node.value(row, raw)
    goal = Setpoint(node.node, "position", value, value, value, Stays.STILL)
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


def _within(node: Node, table: RegisterMap, raw: int, jump: float) -> int:
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
