"""Operating modes, and orders in other modes than position: velocity, duty, current, step.

The mode is an EEPROM setting that takes effect at once, so it is changed while the servo is limp, and what the new mode
follows is set to 0 before torque comes on. SCS have no such register: both limits 0 make a motor of them. Source:
STS3215 memory table V3.6; FEETECH SDK, SCSCL.h and hls.py; feetech-cli and servolab, measured on STS3215.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import remainder

from motorbus.core.family import State
from motorbus.core.move import PERIOD
from motorbus.core.register import Register, RegisterMap, is_number, shown
from motorbus.core.request import Effect
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import Sleep, with_cleanup
from motorbus.errors import LimitExceeded, MotionError, RequestError
from motorbus.families.feetech.driver import feedback, goals
from motorbus.families.feetech.driver.eeprom import store
from motorbus.families.feetech.driver.identity import read_settings, writable
from motorbus.families.feetech.driver.motion import (
    Motion,
    Promise,
    count_of,
    disable_torque,
    move_all,
    ordered,
    read_bound,
    stop,
)
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.requests import ON, TORQUE_ENABLE, Block, confirmed
from motorbus.families.feetech.traits import Mode


async def mode(node: Node) -> Mode:
    """Its mode, read now. Raises DeviceError for an unknown map, RequestError for an unknown mode."""
    await read_settings(node)
    return goals.checked_mode(node)


async def set_mode(node: Node, mode: Mode | str, *, limits: tuple[float, float] | None = None) -> None:
    """Put the servo into a mode permanently; it is limp afterwards, and `enable_torque` begins at rest.

    On SCS PWM mode is both limits 0, and position mode needs `limits` (rad), unless this object set them to 0. An HLS
    that leaves current mode gets its protection current as bound. Raises RequestError for a mode or limits that its map
    lacks, and errors of `store`.
    """
    try:
        wanted = Mode(mode)
    except ValueError:
        modes = ", ".join(one.value for one in Mode)
        raise RequestError(f"{mode!r} is no mode", expected=modes) from None
    table = await read_settings(node)
    traits, settings = node.traits, node.settings
    if wanted not in traits.has:
        has = " or ".join(one.value for one in traits.has)
        raise node.refusal(f"has no {wanted.value} mode", expected=has)
    code = traits.code(wanted)
    if code is None:
        blocks = [_by_limits(node, table, wanted, limits)]
    elif limits is not None:
        raise node.refusal("has an operating mode, which limits do not change", "leave limits out")
    else:
        blocks = [_block(table["operating_mode"], code)]
    if traits.current and wanted is not Mode.CURRENT and node.known_mode in (Mode.CURRENT, None):
        protection = settings.protection_current if settings else 0
        blocks.append(_block(table[traits.current], protection))  # else its last current bounds the next mode
    if not await store(node, table, blocks):
        await disable_torque(node)
    await read_settings(node)
    if wanted in goals.QUANTITY:
        await ordered(node, goals.rest_block(node))


def _block(row: Register, raw: int, goal: Setpoint | None = None) -> Block:
    return Block(row.address, row.encode(raw), row.effect, (goal,) if goal else ())


def _by_limits(node: Node, table: RegisterMap, wanted: Mode, limits: tuple[float, float] | None) -> Block:
    """Both limits 0 for a motor; else limits, which only the caller or this bus object knows."""
    known = node.known
    if wanted is Mode.PWM:
        known.former_limits = node.limits or known.former_limits
        return limits_block(table, (0, 0))
    wished = limits or node.limits or known.former_limits
    if wished is None:
        raise node.refusal("needs limits for position mode", "give limits=(low, high) in rad")
    return limits_block(table, raw_limits(node, table, wished))


def raw_limits(node: Node, table: RegisterMap, limits: tuple[float, float]) -> tuple[int, int]:
    """Both position limits, raw. Raises RequestError for impossible ones."""
    low, high = table["min_position_limit"], table["max_position_limit"]
    raws = node.raw(low, limits[0]), node.raw(high, limits[1])
    if not (low.low <= raws[0] <= low.high and raws[1] <= high.high and raws[0] < raws[1]):
        least, most = float(node.value(low, low.low)), float(node.value(high, high.high))
        span = f"{least:.4g} to {most:.4g} rad, the lower one first"
        raise node.refusal(f"cannot have the limits {limits[0]} to {limits[1]} rad", expected=span)
    return raws


def limits_block(table: RegisterMap, raws: Sequence[int]) -> Block:
    """The block of both position limits."""
    low, high = table["min_position_limit"], table["max_position_limit"]
    return Block(low.address, low.encode(raws[0]) + high.encode(raws[1]))


# -- orders ----------------------------------------------------------------------------------------------------


async def set_velocity(node: Node, velocity: float, *, acceleration: float | None = None) -> None:
    """Turn at `velocity` rad/s, whose sign is the direction; 0 stands still. In velocity mode.

    `acceleration` (rad/s²) stays as it is when left out. Raises RequestError in another mode and for what no register
    takes (SMCL: no negative velocity).
    """
    _check_number(node, velocity, "velocity in rad/s")
    await writable(node)
    goals.check_mode(node, Mode.VELOCITY)
    await read_bound(node)
    row = node.row("goal_velocity")
    raw = node.raw(row, velocity)
    block = _block(row, raw, goals.speed_setpoint(node, raw))
    if node.traits.current and not node.known.bound:
        bound = goals.bound_bytes(node)  # the register before it
        block = block._replace(address=block.address - len(bound), data=bound + block.data)
    if acceleration is not None:
        ramp = goals.ramp_bytes(node, acceleration)
        await confirmed(node, Block(node.row("goal_position").address - len(ramp), ramp))
    await ordered(node, block)


async def set_duty(node: Node, duty: float) -> None:
    """Drive the bridge with this duty, -1 to 1, open loop. In PWM mode.

    A positive duty turned an STS3215 towards smaller angles (servolab). Raises RequestError in another mode and on HLS,
    whose duty register is unknown; LimitExceeded for another number.
    """
    _check_number(node, duty, "duty")
    if not -1 <= duty <= 1:
        raise LimitExceeded(f"node {node.node}: {duty} is no duty", expected="-1 to 1", node=node.node)
    await writable(node)
    if not node.traits.duty:
        raise goals.no_duty(node)
    goals.check_mode(node, Mode.PWM)
    raw = round(duty / goals.DUTY)
    goal = Setpoint(node.node, "load", raw * goals.DUTY, -1.0, 1.0)
    await ordered(node, _block(node.row(node.traits.duty), raw, goal))


async def set_current(node: Node, current: float) -> None:
    """Push with this phase current (A), whose sign is the direction. In current mode of HLS.

    Raises RequestError in another mode and on other maps, LimitExceeded for more than its register takes.
    """
    _check_number(node, current, "current in A")
    await writable(node)
    goals.check_mode(node, Mode.CURRENT)
    row = node.row(node.traits.current)
    raw = node.raw(row, current)
    low, high = float(row.to_value(row.low)), float(row.to_value(row.high))
    if not row.low <= raw <= row.high:
        what = f"node {node.node} cannot push with {current} A"
        raise LimitExceeded(what, expected=f"{low:.4g} to {high:.4g} A", node=node.node)
    await ordered(node, _block(row, raw, Setpoint(node.node, "current", float(row.to_value(raw)), low, high)))


async def jog(node: Node, velocity: float, seconds: float) -> None:
    """Turn at `velocity` rad/s for so many seconds, then decelerate. In velocity mode."""
    if not (is_number(seconds) and seconds >= 0):
        raise node.refusal(f"cannot turn for {shown(seconds)} s", expected="a number of seconds, 0 or more")

    async def turn() -> None:
        await set_velocity(node, velocity)
        await Sleep(seconds)

    await with_cleanup(turn(), lambda: stop(node))


@dataclass
class _Step(Motion):
    """A move of one servo by an angle, followed over the end of a turn."""

    by: float = 0.0
    here: float = field(default=0.0, init=False)

    async def check(self, device: Node, to: float) -> Setpoint:
        goal = goals.step_block(device, self.by, self.velocity, self.acceleration).goals[0]
        self.here = await feedback.position(device)
        return Setpoint(device.node, "position", self.here + goal.value)

    async def send(self, device: Node, goal: Setpoint) -> None:
        """Send the step; before it torque on, which moves nothing here, where a goal does not switch it on."""
        block = goals.step_block(device, self.by, self.velocity, self.acceleration)
        if not device.traits.goal_switches_on:
            await confirmed(device, Block(TORQUE_ENABLE, ON, Effect.TORQUE))
        await confirmed(device, block)
        await Sleep(PERIOD)  # a goal whole turns away looks like this place until it moves

    async def stop(self, device: Node) -> Promise:
        await disable_torque(device)
        return Promise.TORQUE_OFF_ACCEPTED

    async def sample(self, device: Node) -> State:
        state = await feedback.telemetry(device)
        settings, here = device.settings, state.position
        assert here is not None
        if settings is not None and not settings.tells_turns:
            here = self.here + remainder(here - self.here, settings.turn * count_of(device))
        self.here = here
        return state._replace(position=here)


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
    """Go `by` rad from here, over the end of a turn too. In step mode of STS and SMBL.

    Torque is switched on. Never sent twice: OutcomeUnknown if it was not acknowledged. An interrupt of the wait
    makes it limp, for no goal of step mode holds. Bounds, tolerance, errors as in `move`.
    """
    if not is_number(by):
        raise LimitExceeded(f"node {node.node}: {shown(by)} is no angle", node=node.node)
    await writable(node)
    goals.check_mode(node, Mode.STEP)
    logic = _Step(velocity, acceleration, by=by)
    try:
        await move_all(logic, {node: by}, wait=wait, tolerance=tolerance, timeout=timeout)
    except MotionError as error:
        error.advice = error.advice.replace("stop()", "disable_torque()")
        raise


def _check_number(node: Node, value: float, what: str) -> None:
    """Raise RequestError for no number, LimitExceeded for one that is not finite."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise node.refusal(f"cannot take {shown(value)}", expected=what)
    if not is_number(value):
        raise LimitExceeded(f"node {node.node} cannot take {shown(value)}", expected=what, node=node.node)
