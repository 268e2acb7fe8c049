"""Verify an arm by hand: the joint that moves is the one that was named, and it moves in the named direction."""

from __future__ import annotations

from typing import Final

from motorbus.bus.blocking import Bus
from motorbus.core.steps import Sleep
from motorbus.families import feetech
from motorbus.setup.calibrate import RATE, TURN, group_of, read_counts, shortest
from motorbus.setup.engine import Live, Note, Row, Steps
from motorbus.setup.presets import Joint, Preset

MOVED: Final = round(15 / 360 * TURN)  # counts


def verify(bus: Bus, preset: Preset) -> Steps[dict[str, int]]:
    """The sign of each joint that was moved; Enter passes over one. All joints go limp."""
    for joint in preset.joints:
        feetech.Servo(bus, joint.id).disable_torque()
    group = group_of(bus, preset.joints)
    signs: dict[str, int] = {}
    for joint in preset.joints:
        while True:
            moved, distance = yield from _first_that_moves(bus, group, preset, joint)
            if moved is None:
                break
            if moved is joint:
                signs[joint.name] = 1 if distance > 0 else -1
                direction = "" if distance > 0 else ", against the count of its servo"
                yield Note(f"{joint.name} moves as named{direction}")
                break
            yield Note(
                f"{moved.name} (id {moved.id}) moved, not {joint.name}: their ids are exchanged,"
                " or another joint was moved",
                warning=True,
            )
    return signs


def _first_that_moves(
    bus: Bus, group: feetech.ServoGroup, preset: Preset, joint: Joint
) -> Steps[tuple[Joint | None, int]]:
    """The joint that moves first and its counts, (None, 0) for Enter."""
    starts = read_counts(bus, group)
    while True:
        now = read_counts(bus, group)
        ways = {id: shortest(now[id] - starts[id]) for id in now.keys() & starts.keys()}
        for one in preset.joints:
            if abs(ways.get(one.id, 0)) >= MOVED:
                return one, ways[one.id]
        rows = tuple(
            Row(one.name, (f"{ways.get(one.id, 0) * 360 / TURN:+.0f}",), "move this" * (one is joint))
            for one in preset.joints
        )
        live = Live(
            f"{joint.name}: {joint.positive}, or press Enter to pass over it", ("joint", "moved deg"), rows
        )
        if (yield live) is not None:
            return None, 0
        bus.run(Sleep(1 / RATE))
