"""Arms that are known: their joints, ids, settings and directions.

Sources: LeRobot `so_follower.py` and `so_leader.py` (joints, ids, gains, settings of the gripper, a whole turn of
wrist_roll), SO-ARM100 assembly guide (directions), its URDF of the SO-101 (frames; zero is the middle of the range).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from msgspec import Struct

from motorbus.errors import RequestError


class Joint(Struct, frozen=True):
    """A joint: name, id, the movement that raises its position, its rows for the sketch, its own settings."""

    name: str
    id: int
    positive: str
    parent: str | None = None
    frame: str | None = None
    tip: str | None = None
    full_turn: bool = False
    settings: Mapping[str, float] = {}
    max_torque: float | None = None  # share of the full torque, in the machine file


class Preset(Struct, frozen=True):
    """An arm of FEETECH servos."""

    name: str
    joints: tuple[Joint, ...]
    rate: int = 1_000_000  # bit/s
    settings: Mapping[str, float] = {}
    max_velocity: str = "180 deg/s"

    def joint(self, name: str) -> Joint:
        """A joint by its name. Raises RequestError."""
        for joint in self.joints:
            if joint.name == name:
                return joint
        names = ", ".join(joint.name for joint in self.joints)
        raise RequestError(f"{self.name} has no joint {name!r}", expected=names)


_GRIPPER: Final = {
    "max_torque": 0.5,
    "protection_current": 250 * 0.0065,  # A
    "overload_torque": 0.25,
}
# fmt: off
_JOINTS: Final = (
    Joint("shoulder_pan", 1, "turn the arm to its right", None, "38.8 0 62.4 mm, 180 0 -180 deg"),
    Joint("shoulder_lift", 2, "swing the upper arm forwards", "shoulder_pan", "-30.4 -18.3 -54.2 mm, -90 -90 0 deg"),
    Joint("elbow_flex", 3, "fold the forearm down", "shoulder_lift", "-112.6 -28 0 mm, 0 0 90 deg"),
    Joint("wrist_flex", 4, "bend the hand down", "elbow_flex", "-134.9 5.2 0 mm, 0 0 -90 deg"),
    Joint("wrist_roll", 5, "roll the hand clockwise, seen from the arm", "wrist_flex",
          "0 -61.1 18.1 mm, 90 2.8 180 deg", "0 0 -98 mm", full_turn=True),
    Joint("gripper", 6, "open the gripper", "wrist_roll", "20.2 18.8 -23.4 mm, 90 0 0 deg", "0 -90 0 mm",
          settings=_GRIPPER, max_torque=0.5),
)
# fmt: on
_SETTINGS: Final = {"return_delay": 0.0, "position_p": 16, "position_i": 0, "position_d": 32}

PRESETS: Final = {name: Preset(name, _JOINTS, settings=_SETTINGS) for name in ("so101", "so100")}


def preset(name: str) -> Preset:
    """A preset by its name. Raises RequestError."""
    try:
        return PRESETS[name]
    except KeyError:
        raise RequestError(f"no preset {name!r}", expected=", ".join(PRESETS)) from None
