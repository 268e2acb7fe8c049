"""Calibrate an arm by hand: sweep each joint, then put the middle of its travel at the middle of the encoder.

Positions are counted as the encoder turns, over the end of its range, so the seam may lie inside of the travel. The
homing offset is written after the sweep (lerobot#1296), then the limits; both are read back.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

from msgspec import Struct

from motorbus.bus.blocking import Bus
from motorbus.core.steps import Sleep
from motorbus.errors import NoReply, RequestError
from motorbus.families import feetech
from motorbus.setup.engine import Live, Note, Row, Steps, ask
from motorbus.setup.presets import Joint, Preset

TURN: Final = 4096  # counts
MIDDLE: Final = TURN // 2
COUNT: Final = math.tau / TURN  # rad
LARGEST_OFFSET: Final = 2047  # counts
SMALLEST_TRAVEL: Final = 20 / 360 * TURN  # counts; less was not a sweep # assumption
START_MARGIN: Final = 5 / 360 * TURN  # counts from the start pose to both ends # assumption
RATE: Final = 50.0  # Hz
SILENCE: Final = 0.3  # s


class JointCalibration(Struct, frozen=True):
    """A joint as in a calibration file of LeRobot; positions are counts with the offset in place."""

    id: int
    drive_mode: int
    homing_offset: int
    range_min: int
    range_max: int


class Sweep:
    """The encoder of one joint, in counts without end, while it is moved."""

    def __init__(self, start: int) -> None:
        self.start = self.now = self.low = self.high = start

    def take(self, encoder: int) -> None:
        """A reading within one turn; the joint moved less than half a turn since the last one."""
        self.now += shortest(encoder - self.now)
        self.low = min(self.low, self.now)
        self.high = max(self.high, self.now)

    @property
    def travel(self) -> int:
        """Counts between the ends."""
        return self.high - self.low


def shortest(distance: int) -> int:
    """This distance around the turn, in counts from -2048 to 2047."""
    return (distance + MIDDLE) % TURN - MIDDLE


def judge(joint: Joint, sweep: Sweep) -> str:
    """Why this sweep gives no calibration; "" if it does."""
    degrees = sweep.travel * 360 / TURN
    if joint.full_turn:
        return ""
    if sweep.travel < SMALLEST_TRAVEL:
        return f"{joint.name} moved {degrees:.0f} deg only: move it from end to end"
    if sweep.travel >= TURN:
        return (
            f"{joint.name} moved {degrees:.0f} deg, a whole turn or more: its horn slips, or it has no ends"
        )
    if min(sweep.start - sweep.low, sweep.high - sweep.start) < START_MARGIN:
        return f"{joint.name} started at an end of its travel: start in the middle pose"
    return ""


def solve(joint: Joint, sweep: Sweep, drive_mode: int = 0) -> JointCalibration:
    """The calibration after a sweep that `judge` accepts."""
    middle = sweep.start if joint.full_turn else (sweep.low + sweep.high) // 2
    offset = shortest(middle - MIDDLE)
    offset = max(-LARGEST_OFFSET, min(LARGEST_OFFSET, offset))
    if joint.full_turn:
        return JointCalibration(joint.id, drive_mode, offset, 0, TURN - 1)
    low = (sweep.low - offset) % TURN
    return JointCalibration(joint.id, drive_mode, offset, low, low + sweep.travel)


# -- on a bus --------------------------------------------------------------------------------------------------


def calibrate(bus: Bus, preset: Preset, names: Sequence[str] = ()) -> Steps[dict[str, JointCalibration]]:
    """Sweep these joints by hand (() means all), and write their offsets and limits; they go limp.

    Raises NoReply for a joint that is silent, RequestError for an unknown name.
    """
    found = yield from measure(bus, preset, names)
    yield from write(bus, found)
    return found


def measure(bus: Bus, preset: Preset, names: Sequence[str] = ()) -> Steps[dict[str, JointCalibration]]:
    """Sweep these joints by hand; they go limp, nothing else is written. Raises as `calibrate`."""
    joints = [preset.joint(name) for name in names] or list(preset.joints)
    for joint in joints:
        feetech.Servo(bus, joint.id).disable_torque()
    while True:
        yield from ask("put the arm in the middle pose: each joint near the middle of its travel", "go")
        sweeps = yield from _sweep(bus, joints)
        problems = [problem for joint in joints if (problem := judge(joint, sweeps[joint.name]))]
        if not problems:
            return {joint.name: solve(joint, sweeps[joint.name]) for joint in joints}
        for problem in problems:
            yield Note(problem, warning=True)


def write(bus: Bus, calibration: Mapping[str, JointCalibration]) -> Steps[None]:
    """Write offsets and limits of these joints to their servos."""
    for name, one in calibration.items():
        apply(bus, one)
        yield Note(f"{name}: offset {one.homing_offset}, {one.range_min} to {one.range_max}")


def _sweep(bus: Bus, joints: Sequence[Joint]) -> Steps[dict[str, Sweep]]:
    offsets = {joint.id: offset_of(bus, joint) for joint in joints}
    group = group_of(bus, joints)
    sweeps: dict[str, Sweep] = {}
    names = {joint.id: joint.name for joint in joints}
    last = dict.fromkeys(names, bus.now())
    while True:
        for id, position in read_counts(bus, group).items():
            encoder = position + offsets[id]
            sweeps.setdefault(names[id], Sweep(encoder)).take(encoder)
            last[id] = bus.now()
        silent = [names[id] for id, at in last.items() if bus.now() - at > SILENCE]
        if silent:
            raise NoReply(f"{', '.join(silent)}: no reply while the arm was moved", advice="check the cable")
        if (yield _table(joints, sweeps)) is not None and len(sweeps) == len(joints):
            return sweeps
        bus.run(Sleep(1 / RATE))


def _table(joints: Sequence[Joint], sweeps: Mapping[str, Sweep]) -> Live:
    rows = []
    for joint in joints:
        sweep = sweeps.get(joint.name)
        if sweep is not None:
            values = tuple(f"{shown * 360 / TURN:.0f}" for shown in (sweep.low, sweep.now, sweep.high))
            rows.append(Row(joint.name, (*values, f"{sweep.travel * 360 / TURN:.0f}"), judge(joint, sweep)))
    text = "move each joint from end to end, then press Enter"
    return Live(text, ("joint", "min deg", "now deg", "max deg", "travel deg"), tuple(rows))


def group_of(bus: Bus, joints: Sequence[Joint]) -> feetech.ServoGroup:
    """The servos of these joints, identified. Raises NoReply for one that is silent."""
    servos = [feetech.Servo(bus, joint.id) for joint in joints]
    for servo in servos:
        servo.prepare()
    return feetech.ServoGroup(servos)


def read_counts(bus: Bus, group: feetech.ServoGroup) -> dict[int, int]:
    """Present positions in counts by id, of the servos that answer."""
    return {id: round(position / COUNT) for id, position in bus.run(group.positions).values.items()}


def offset_of(bus: Bus, joint: Joint) -> int:
    """The homing offset of a servo, in counts."""
    return feetech.Servo(bus, joint.id).zero().raw_offset


def check(calibration: JointCalibration, joint: str) -> None:
    """Raise RequestError, which names the joint, for a range or an offset that a servo cannot hold."""
    if not 0 <= calibration.range_min < calibration.range_max < TURN:
        raise RequestError(
            f"{joint} has the range {calibration.range_min} to {calibration.range_max}",
            expected=f"0 to {TURN - 1}, the lower one first",
        )
    if abs(calibration.homing_offset) > LARGEST_OFFSET:
        raise RequestError(
            f"{joint} has the homing offset {calibration.homing_offset}",
            expected=f"-{LARGEST_OFFSET} to {LARGEST_OFFSET}",
            advice="calibrate it again: its register cannot hold this",
        )


def apply(bus: Bus, calibration: JointCalibration) -> None:
    """Write offset and limits of a joint to its servo, and read them back; it goes limp."""
    check(calibration, f"id {calibration.id}")
    servo = feetech.Servo(bus, calibration.id)
    servo.disable_torque()
    servo.write(
        homing_offset=calibration.homing_offset * COUNT,
        min_position_limit=min(calibration.range_min, TURN - 2) * COUNT,
        max_position_limit=calibration.range_max * COUNT,
    )


def read_calibration(bus: Bus, joint: Joint, drive_mode: int = 0) -> JointCalibration:
    """The calibration that a servo holds."""
    raws = feetech.Servo(bus, joint.id).read_raw("homing_offset", "limits")
    return JointCalibration(
        joint.id,
        drive_mode,
        raws["homing_offset"],
        raws["min_position_limit"],
        raws["max_position_limit"],
    )
