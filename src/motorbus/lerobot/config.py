"""The options `--robot.…` and `--teleop.…`."""

from __future__ import annotations

from dataclasses import dataclass, field

from lerobot.cameras import CameraConfig
from lerobot.robots.config import RobotConfig
from lerobot.teleoperators.config import TeleoperatorConfig


@RobotConfig.register_subclass("motorbus_follower")
@dataclass(kw_only=True)
class MotorbusFollowerConfig(RobotConfig):
    """A follower arm.

    `port` is a serial port, or an address as `feetech:socket://pi:4000`; `max_relative_target` in degrees, for all
    joints or by name; `max_velocity` in deg/s.
    """

    port: str
    preset: str = "so101"
    use_degrees: bool = True
    max_relative_target: float | dict[str, float] | None = None
    max_velocity: float = 720.0
    disable_torque_on_disconnect: bool = True
    cameras: dict[str, CameraConfig] = field(default_factory=dict)


@TeleoperatorConfig.register_subclass("motorbus_leader")
@dataclass(kw_only=True)
class MotorbusLeaderConfig(TeleoperatorConfig):
    """A leader arm, moved by hand."""

    port: str
    preset: str = "so101"
    use_degrees: bool = True
