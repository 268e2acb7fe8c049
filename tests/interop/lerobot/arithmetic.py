"""Prints the largest differences between the values of the plugin and of LeRobot's own bus, for random joints."""

import json
import math
import random

from lerobot.motors import Motor, MotorCalibration, MotorNormMode
from lerobot.motors.feetech import FeetechMotorsBus
from motorbus.lerobot.units import unit_of
from motorbus.setup.calibrate import JointCalibration

MODES = {
    ("gripper", True): MotorNormMode.RANGE_0_100,
    ("elbow_flex", True): MotorNormMode.DEGREES,
    ("elbow_flex", False): MotorNormMode.RANGE_M100_100,
}
COUNT = math.tau / 4096

chance = random.Random(42)
worst = {"value": 0.0, "count": 0.0}
for _ in range(1000):
    (name, use_degrees), mode = chance.choice(list(MODES.items()))
    low, high = sorted(chance.sample(range(4096), 2))
    drive_mode = chance.choice((0, 1))
    bus = FeetechMotorsBus(
        "", {name: Motor(1, "sts3215", mode)}, {name: MotorCalibration(1, drive_mode, 0, low, high)}
    )
    unit = unit_of(name, JointCalibration(1, drive_mode, 0, low, high), use_degrees=use_degrees)
    count = chance.randint(low, high)
    ours = unit.value((count - (low + high) / 2) * COUNT)
    worst["value"] = max(worst["value"], abs(ours - bus._normalize({1: count})[1]))
    middle = (low + high) / 2
    goal = chance.uniform(unit.value((low - middle) * COUNT), unit.value((high - middle) * COUNT))
    position = unit.position(goal) / COUNT + middle
    worst["count"] = max(worst["count"], abs(position - bus._unnormalize({1: goal})[1]))
print(json.dumps(worst))
