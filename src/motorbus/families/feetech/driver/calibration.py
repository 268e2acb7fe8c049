"""Give the present pose another position: calibrate, zero, multi-turn counting.

HLS have an instruction for it (0x0B); of the others the homing offset register is written, as LeRobot does. Either way
both readings must fit: the position is what was asked for, and the offset changed by as much as the position did. The
old offset is added back first, and the shortest distance around the turn is taken (lerobot#3370, lerobot#1296). Source:
STS3215 memory table V3.6; FEETECH SDK, hls.py (reOfsCal); feetech-cli, servolab: the offset acts in position mode only.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from motorbus.core.register import Register, RegisterMap, is_number, shown
from motorbus.core.request import Effect
from motorbus.core.steps import Exclusive
from motorbus.errors import DeviceError, MotorbusError, VerificationFailed
from motorbus.families.feetech import protocol
from motorbus.families.feetech.driver.eeprom import Unlocked, store
from motorbus.families.feetech.driver.goals import check_mode
from motorbus.families.feetech.driver.identity import check_alone, learn, read_settings
from motorbus.families.feetech.driver.modes import limits_block, raw_limits
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.requests import PRESENT, STORE, Block, instruct, read_block
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.traits import TRAITS, TURNS_BIT, Mode

SLACK: Final = 0.03  # rad by which a limp shaft may turn between two readings


class Pose(NamedTuple):
    """Raw position as the servo tells it, and the raw homing offset in it."""

    position: int
    offset: int


class Calibration(NamedTuple):
    """What a calibration did; angles in rad, offsets as raw counts too. `before` and `after`: what the pose reads."""

    before: float
    after: float
    old_offset: float
    new_offset: float
    raw_old_offset: int
    raw_new_offset: int


class Zero(NamedTuple):
    """Position, homing offset and limits in rad, the offset in counts too."""

    position: float
    offset: float
    raw_offset: int
    limits: tuple[float, float] | None


async def zero(node: Node) -> Zero:
    """Where this servo has its zero; reads only. Raises RequestError where its map has no homing offset."""
    table = await read_settings(node)
    row = _offset_row(node, table)
    pose = await _read_pose(node, row)
    position = float(node.value(table["present_position"], pose.position))
    return Zero(position, float(row.to_value(pose.offset)), pose.offset, node.limits)


async def calibrate(node: Node, to: float | None = None) -> Calibration:
    """Make the present pose read `to` rad (None: the middle of the turn) permanently; the servo goes limp.

    Hold the shaft still. The limits keep their values and mean other poses afterwards. At the end of the range of the
    offset register the pose may read one count beside. Raises RequestError, with nothing changed, without a homing
    offset, in another mode, with counted turns, another resolution, or an impossible angle; DeviceError if it does not
    obey; VerificationFailed if a reading does not fit.
    """
    if to is not None and not is_number(to):
        raise node.refusal(f"cannot be at {shown(to)}", expected="a number of rad")
    table = await read_settings(node)
    offset, position = _offset_row(node, table), table["present_position"]
    check_mode(node, Mode.POSITION)
    settings = node.settings
    assert settings is not None
    if "angular_resolution" in table and settings.factors[position.name] != 1:
        fix = "write(angular_resolution=1), calibrate, and set it again"
        raise node.refusal("has another angular resolution than 1, where its offset has no known unit", fix)
    goal = settings.turn // 2 if to is None else node.raw(position, to)
    if not 0 <= goal < settings.turn:
        most = float(node.value(position, settings.turn - 1))
        raise node.refusal(f"cannot be at {to} rad within one turn", expected=f"0 to {most:.4f} rad")
    _plan(node, offset, await _read_pose(node, offset), goal)
    before, found = await Exclusive(_calibrate(node, table, offset, goal))
    return Calibration(
        before=float(node.value(position, before.position)),
        after=float(node.value(position, found.position)),
        old_offset=float(offset.to_value(before.offset)),
        new_offset=float(offset.to_value(found.offset)),
        raw_old_offset=before.offset,
        raw_new_offset=found.offset,
    )


async def _calibrate(node: Node, table: RegisterMap, row: Register, goal: int) -> tuple[Pose, Pose]:
    async with Unlocked(node, table) as unlocked:
        before = await _read_pose(node, row)  # it may have moved when it went limp
        planned = _plan(node, row, before, goal)
        await unlocked.check_open()
        block, old = Block(row.address, row.encode(planned.offset)), row.encode(before.offset)
        doubt = None
        if node.traits.calibrates == "offset":
            await unlocked.write(block, old)
        else:
            unlocked.before.append(block._replace(data=old, effect=Effect.PERSISTENT))
            wire = protocol.calibrate(node.node, table["present_position"].encode(goal))
            doubt = await instruct(node, wire)  # repeated: twice has the effect of once
        found = await _read_pose(node, row)
        _check_pose(node, before, planned, found, doubt)
        await unlocked.check_open()
    return before, found


def _plan(node: Node, row: Register, pose: Pose, goal: int) -> Pose:
    """What this pose will read, and its offset. Raises RequestError if that does not fit."""
    assert node.settings is not None
    turn = node.settings.turn
    if not 0 <= pose.position < turn:
        raise node.refusal(
            f"tells the raw position {pose.position}, not within one turn of {turn} counts: it counts turns",
            "clear_turns() or a power cycle; set_multi_turn(False)",
        )
    encoder = (pose.position + pose.offset) % turn
    offset = encoder - goal
    if math.isclose(row.scale * turn, math.tau):  # the arc of an SCS has ends
        offset = _shortest(offset, turn)
    fits = min(max(offset, row.low), row.high)
    if abs(offset - fits) > 1:
        what = f"needs a homing offset of {offset} counts for this pose"
        fix = "turn the shaft nearer, or mount the horn another way"
        raise node.refusal(what, fix, expected=f"{row.low} to {row.high}")
    return Pose((encoder - fits) % turn, fits)


def _shortest(distance: int, turn: int) -> int:
    return (distance + turn // 2) % turn - turn // 2


def _check_pose(node: Node, before: Pose, planned: Pose, found: Pose, doubt: MotorbusError | None) -> None:
    """Raise unless the readings fit, but for a shaft that moved a little."""
    assert node.settings is not None
    turn, slack = node.settings.turn, round(SLACK / node.row("present_position").scale)
    beside = _shortest(found.position - planned.position, turn)
    moved = _shortest(found.position + found.offset - before.position - before.offset, turn)
    if abs(beside) <= slack and abs(moved) <= slack:
        return
    ignored = found.offset == before.offset
    kind = DeviceError if ignored else VerificationFailed
    what = "did not change its homing offset" if ignored else "does not read as it must after the calibration"
    raise kind(
        f"node {node.node} {what}",
        received=f"position {found.position}, offset {found.offset} (raw)",
        expected=f"position {planned.position}, offset {planned.offset}",
        cause="its firmware ignores this order, or its shaft was turned meanwhile",
        advice="hold the shaft still and calibrate again",
        node=node.node,
    ) from doubt


def _offset_row(node: Node, table: RegisterMap) -> Register:
    if "homing_offset" in table:
        return table["homing_offset"]
    what = f"has the map {table.name}, which has no homing offset"
    raise node.refusal(what, "keep the zero in the machine file")


async def _read_pose(node: Node, row: Register) -> Pose:
    offset = await read_block(node, row.address, row.size, row.decode, timeout=STORE)
    position = node.row("present_position")
    return Pose(await read_block(node, PRESENT, position.size, position.decode, timeout=STORE), offset)


# -- many turns ------------------------------------------------------------------------------------------------


async def set_multi_turn(node: Node, on: bool, limits: tuple[float, float] | None = None) -> None:
    """Count goals and position over many turns, permanently, or within one; the servo goes limp and stays so.

    On: both position limits become 0, and bit 4 of its own phase register is set. Off: the bit is cleared and `limits`
    (rad) hold again. It forgets its turns at power-off: home it after every power-up. Raises RequestError for maps of
    one turn (SMCL, SCS), in another mode, for impossible limits, and off without limits. Source: FEETECH notes on
    special bytes; STS3215 memory table V3.6; lerobot#3373.
    """
    table = await read_settings(node)
    if not node.traits.many_turns:
        maps = ", ".join(name for name in TABLES if TRAITS[name].many_turns)
        raise node.refusal(f"has the map {table.name}, which counts within one turn", expected=maps)
    check_mode(node, Mode.POSITION)
    assert node.settings is not None
    wished = limits if limits is not None or node.settings.many_turns else node.limits
    if (on and limits is not None) or (not on and wished is None):
        fix = "give limits=(low, high) in rad, in the shell --low 0deg --high 300deg"
        raise node.refusal("has no limits over many turns, and needs limits within one", fix)
    image = await check_alone(node)  # the other bits of its phase belong to this servo
    learn(node, image)
    row = table["phase"]
    byte = image[row.address]
    phase = Block(row.address, bytes((byte | TURNS_BIT if on else byte & ~TURNS_BIT,)))
    bounds = limits_block(table, (0, 0) if on or wished is None else raw_limits(node, table, wished))
    # Never limits of 0 without the bit: then no position would tell the turn.
    await store(node, table, [phase, bounds] if on else [bounds, phase])
    await read_settings(node)
