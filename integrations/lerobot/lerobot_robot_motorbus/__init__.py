"""Registers the motorbus follower and leader with LeRobot, which imports packages of this name by itself."""

from motorbus.lerobot import (
    MotorbusFollower,
    MotorbusFollowerConfig,
    MotorbusLeader,
    MotorbusLeaderConfig,
)

__all__ = ["MotorbusFollower", "MotorbusFollowerConfig", "MotorbusLeader", "MotorbusLeaderConfig"]
