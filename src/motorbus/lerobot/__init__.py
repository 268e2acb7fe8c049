"""The LeRobot robot and teleoperator; the distribution `lerobot_robot_motorbus` registers them. Imports lerobot."""

from motorbus.lerobot.config import MotorbusFollowerConfig, MotorbusLeaderConfig
from motorbus.lerobot.devices import MotorbusFollower, MotorbusLeader

__all__ = ["MotorbusFollower", "MotorbusFollowerConfig", "MotorbusLeader", "MotorbusLeaderConfig"]
