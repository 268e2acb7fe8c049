"""Giving the present pose another name: the homing offset, worked out by the servo or by us, and always proven.

There are three ways, and a map has one or two of them: 128 written to the torque switch (the pose becomes the middle
of the turn), the instruction 0x0B (it becomes any position), and writing the offset itself. All of them end in one
register, so whatever was done is judged by two readings: the position must be what was asked for, and the offset must
have changed by as much as the position did.

Where others fail: a second calibration must first add the old offset back, or the servo is off by it; and the
distance must be the shortest around the turn, or it does not fit the register (lerobot#3370, lerobot#1296).
Whether 128 and 0x0B obey the EEPROM lock is not published, so the lock is open meanwhile.
Source: STS3215 memory table V3.6; FEETECH SDK, SMS_STS.h (CalibrationOfs) and hls.py (reOfsCal); feetech-cli and
servolab, measured on STS3215 (the offset is applied in position mode only).
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from motorbus.core.register import Register, RegisterMap, is_number, shown
from motorbus.core.request import Effect, Priority, TimeoutClass
from motorbus.errors import DeviceError, MotorbusError, RequestError, VerificationFailed
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver import eeprom
from motorbus.families.feetech.driver.exchanges import DOUBTS, Block, acknowledged, read_block
from motorbus.families.feetech.driver.identity import prepare, writable
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.torque import TORQUE_ENABLE, disable_torque
from motorbus.families.feetech.table import CONTROL, Middle, Mode

HOW: Final = ("auto", "switch", "instruction", "offset")
SLACK: Final = 0.03
"""rad by which a limp shaft may have turned between two readings; about 20 counts of 4096."""
_MIDDLE: Final = 128


class Pose(NamedTuple):
    """Raw position as the servo tells it, and the raw homing offset that is taken out of it."""

    position: int
    offset: int


class Calibration(NamedTuple):
    """What a calibration did. Angles are in rad; the offsets once more as raw counts, as register tables have them.

    `before` and `after` are the position that the same pose reads; `how` is the way that was gone; `note` says what
    is not as asked for, "" if everything is.
    """

    before: float
    after: float
    old_offset: float
    new_offset: float
    raw_old_offset: int
    raw_new_offset: int
    how: str
    note: str


class Zero(NamedTuple):
    """Where a servo has its zero: position and homing offset in rad, the offset in raw counts, its limits in rad."""

    position: float
    offset: float
    raw_offset: int
    limits: tuple[float, float] | None


class _Job(NamedTuple):
    """What is to be done, in raw counts, with the rows that it takes."""

    position: Register
    offset: Register
    turn: int
    goal: int
    how: str
    middle: Middle


class _Plan(NamedTuple):
    """How to get there from one pose: the way, the offset it ends in, and what the position reads then."""

    pose: Pose
    way: Middle
    offset: int
    reads: int


async def zero(node: Node) -> Zero:
    """Where this servo has its zero now; changes nothing. Raises RequestError where its map has no homing offset."""
    await prepare(node)
    table = await writable(node)
    position, offset = table["present_position"], _offset_row(node, table)
    pose = await _pose(node, position, offset)
    told = float(node.value(position, pose.position))
    return Zero(told, float(offset.to_value(pose.offset)), pose.offset, node.limits)


async def calibrate(node: Node, to: float | None = None, how: str = "auto") -> Calibration:
    """Make the present pose read `to` rad (None: the middle of the turn), for good; the servo goes limp and stays so.

    `how`: "switch" (128, for the middle only), "instruction" (0x0B), "offset" (the register itself), or "auto" for
    what its map has. Hold the shaft still: it is limp meanwhile. The limits of the servo stay as they are and mean
    other poses afterwards. Raises RequestError, with nothing changed, where its map has no homing offset, in other
    than position mode, when it has counted turns, and for an angle or a way that it cannot do; DeviceError when it
    does not obey, VerificationFailed when position or offset do not read as they must.
    """
    _sensible(node, to, how)
    await prepare(node)
    table = await writable(node)
    job = _job(node, table, to, how)
    pose = await _pose(node, job.position, job.offset)
    if not 0 <= pose.position < job.turn:
        raise _turned(node, job, pose)
    plan = _planned(node, job, pose)
    return await eeprom.unlocked(node, table, lambda: _renamed(node, job, plan, table["lock"].address))


def shortest(distance: int, turn: int) -> int:
    """The same way around a turn, as short as can be: from -turn/2 to turn/2 - 1."""
    return (distance + turn // 2) % turn - turn // 2


# -- what is to be done --------------------------------------------------------------------------------------


def _sensible(node: Node, to: float | None, how: str) -> None:
    if how not in HOW:
        raise RequestError(
            f"{how!r} is no way to calibrate",
            expected=", ".join(HOW),
            advice="nothing was sent",
            node=node.node,
        )
    if to is not None and not is_number(to):
        raise RequestError(
            f"{shown(to)} is no position", advice="give a number in rad; nothing was sent", node=node.node
        )


def _offset_row(node: Node, table: RegisterMap) -> Register:
    if "homing_offset" in table:
        return table["homing_offset"]
    assert node.identity is not None
    raise RequestError(
        f"node {node.node} is {node.identity.model}, whose register map {table.name} has no homing offset",
        cause="such a servo cannot keep a zero of its own",
        advice="keep the zero in the file of the machine that uses it; nothing was sent",
        node=node.node,
    )


def _job(node: Node, table: RegisterMap, to: float | None, how: str) -> _Job:
    control = CONTROL[table.name]
    offset, position = _offset_row(node, table), table["present_position"]
    if node.known_mode is not Mode.POSITION:
        raise RequestError(
            f"node {node.node} is not in position mode, and in other modes its position ignores the homing offset",
            advice="set_mode('position') first; nothing was sent",
            node=node.node,
        )
    if node.settings is not None and node.settings.factors[position.name] != 1:
        raise RequestError(
            f"node {node.node} has another angular resolution than 1, and nobody has published what its homing offset "
            "counts then",
            advice="write(angular_resolution=1), calibrate, and set it again; nothing was sent",
            node=node.node,
        )
    middle = control.turn // 2
    goal = middle if to is None else node.raw(position, to)
    if not 0 <= goal < control.turn:
        most = float(node.value(position, control.turn - 1))
        raise RequestError(
            f"node {node.node}: {to} rad is no position within one turn",
            expected=f"0 to {most:.4f} rad",
            advice="nothing was sent",
            node=node.node,
        )
    ways = {Middle.OFFSET.value, control.middle.value}
    if how != "auto" and how not in ways:
        raise _lacks(node, table.name, how, f"{', '.join(sorted(ways))}, or auto")
    if how == Middle.SWITCH.value and goal != middle:
        raise _lacks(node, table.name, "switch for any pose but the middle", "offset, or auto")
    return _Job(position, offset, control.turn, goal, how, control.middle)


def _lacks(node: Node, register_map: str, what: str, expected: str) -> RequestError:
    return RequestError(
        f"node {node.node}: the register map {register_map} has no way called {what}",
        expected=expected,
        advice="nothing was sent",
        node=node.node,
    )


def _planned(node: Node, job: _Job, pose: Pose) -> _Plan:
    """The old offset is added back first: the encoder counts, not the reading.

    An arc (SCS: 300 degrees) has ends and is not gone around; a whole turn is.
    """
    encoder = (pose.position + pose.offset) % job.turn
    offset = encoder - job.goal
    if _closes(job):
        offset = shortest(offset, job.turn)
    fits = min(max(offset, job.offset.low), job.offset.high)
    if abs(offset - fits) > 1:
        raise _too_far(node, job, offset)
    way = job.middle if job.how == "auto" else Middle(job.how)
    if way is Middle.SWITCH and (job.goal != job.turn // 2 or offset != fits):
        way = Middle.OFFSET  # at the one pose that does not fit, the servo's own sum would overflow
    return _Plan(pose, way, fits, (encoder - fits) % job.turn)


def _closes(job: _Job) -> bool:
    return math.isclose(job.position.scale * job.turn, math.tau)


def _too_far(node: Node, job: _Job, offset: int) -> RequestError:
    return RequestError(
        f"node {node.node}: this pose is {offset} counts from where it would have to be, and the homing offset of "
        f"this servo holds {job.offset.low} to {job.offset.high}",
        advice="turn the shaft nearer, or mount the horn another way; or keep the zero in the file of the machine; "
        "nothing was changed",
        node=node.node,
    )


def _turned(node: Node, job: _Job, pose: Pose) -> RequestError:
    """The refusal for a servo that tells a position beyond one turn."""
    counts = node.settings is not None and node.settings.accumulates
    return RequestError(
        f"node {node.node} tells the raw position {pose.position}, which is not within one turn of {job.turn} counts",
        cause="bit 4 of its phase register is set: it counts turns"
        if counts
        else "it was turned on in another mode",
        advice="forget the turns first, by a power cycle or clear_turns(); set_many_turns(False) lets it count within "
        "one turn again. Nothing was changed",
        node=node.node,
    )


# -- doing it ------------------------------------------------------------------------------------------------


async def _pose(node: Node, position: Register, offset: Register) -> Pose:
    def told(data: bytes) -> int:
        return _offset_told(node, offset, data)

    held = await read_block(node, offset.address, offset.size, told, timeout=TimeoutClass.STORE)
    here = await read_block(
        node, position.address, position.size, position.decode, timeout=TimeoutClass.STORE
    )
    return Pose(here, held)


def _offset_told(node: Node, row: Register, data: bytes) -> int:
    """The raw offset. Raises DeviceError for a number that the map of this servo cannot mean."""
    raw = row.decode(data)
    code = int.from_bytes(data, "little" if row.order == "little" else "big")
    if row.low <= raw <= row.high and (row.sign_bit is None or code >> row.sign_bit + 1 == 0):
        return raw
    raise DeviceError(
        f"node {node.node}: its homing offset is {code}, which register {row.address} cannot mean",
        received=data,
        expected=f"{row.low} to {row.high}, the sign at bit {row.sign_bit}",
        cause="another program wrote too great a number there, or newer firmware has another encoding",
        advice="factory_restore() sets the offset to 0; nothing was changed",
        node=node.node,
        register=row.name,
    )


async def _renamed(node: Node, job: _Job, plan: _Plan, lock: int) -> Calibration:
    now = await _pose(node, job.position, job.offset)
    if now != plan.pose:  # it gave way when it went limp
        plan = _planned(node, job, now)
    await eeprom.still_open(node, lock)
    doubt = await _ordered(node, job, plan)
    found = await _pose(node, job.position, job.offset)
    after = Pose(plan.reads, plan.offset)
    if found != after:
        _judge(node, job, plan, found, doubt)
        after = found
    note = ""
    if plan.reads != job.goal:
        note = (
            f"this pose reads {plan.reads - job.goal:+} count beside: its homing offset holds {job.offset.low} to "
            f"{job.offset.high} counts, and this pose needs one more"
        )
    before, held = plan.pose.position, plan.pose.offset
    return Calibration(
        before=float(node.value(job.position, before)),
        after=float(node.value(job.position, after.position)),
        old_offset=float(job.offset.to_value(held)),
        new_offset=float(job.offset.to_value(after.offset)),
        raw_old_offset=held,
        raw_new_offset=after.offset,
        how=plan.way.value,
        note=note,
    )


async def _ordered(node: Node, job: _Job, plan: _Plan) -> MotorbusError | None:
    """Give the order; the doubt that is left about whether it was heard. Saying it twice does no more than once."""
    if plan.way is Middle.OFFSET:
        data = job.offset.encode(plan.offset)
        await eeprom.stored(node, Block(job.offset.address, data, Effect.PERSISTENT))
        return None
    if plan.way is Middle.SWITCH:
        request = wire.write(node.node, TORQUE_ENABLE, bytes((_MIDDLE,)))
        block = Block(TORQUE_ENABLE, b"", Effect.TORQUE)
    else:
        request = wire.calibrate(node.node, job.position.encode(job.goal))
        block = Block(0, b"", Effect.PERSISTENT)
    doubt = None
    try:
        await acknowledged(node, request, block, priority=Priority.CONFIGURATION, timeout=TimeoutClass.STORE)
    except DOUBTS as error:
        doubt = error
    if plan.way is Middle.SWITCH:
        await disable_torque(node)  # what 128 leaves in the switch is not published
    return doubt


def _judge(node: Node, job: _Job, plan: _Plan, after: Pose, doubt: MotorbusError | None) -> None:
    """Raise unless the position is what it must be, but for a shaft that gave way a little, and the offset fits."""
    slack = round(SLACK / job.position.scale)
    beside = shortest(after.position - plan.reads, job.turn)
    moved = shortest(after.position + after.offset - plan.pose.position - plan.pose.offset, job.turn)
    if abs(beside) <= slack and abs(moved) <= slack:
        return
    if after.offset == plan.pose.offset:
        raise DeviceError(
            f"node {node.node} did not change its homing offset when it was told to ({plan.way.value})",
            received=f"position {after.position}, offset {after.offset} (raw)",
            expected=f"position {plan.reads}, offset {plan.offset}",
            cause="its firmware ignores this order, or its shaft was turned meanwhile",
            advice="calibrate(how='offset') writes the register itself",
            node=node.node,
            register=job.offset.name,
        ) from doubt
    raise VerificationFailed(
        f"node {node.node}: its position does not read as it must after the calibration",
        received=f"position {after.position}, offset {after.offset} (raw); before: {plan.pose.position}, "
        f"{plan.pose.offset}",
        expected=f"position {plan.reads}, offset {plan.offset}",
        cause="its shaft was turned meanwhile, or this firmware reckons another way",
        advice="hold the shaft still and calibrate again; the homing offset has been changed",
        node=node.node,
    ) from doubt
