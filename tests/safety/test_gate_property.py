"""Random commands and raw writes on servos of two families: no goal outside the limits leaves the host.

Witnesses on both wires decode each goal from its bytes, without the drivers.
"""

from __future__ import annotations

from itertools import islice
from math import inf, nan, pi, radians
from random import Random
from typing import Any, cast

import pytest

from motorbus import Robot
from motorbus.errors import MotorbusError
from motorbus.families.feetech import Servo, ServoGroup, action_all
from motorbus.motion.commands import (
    ClearFault,
    Jog,
    Move,
    RobotCommand,
    Stop,
    Torque,
    WriteRegisters,
)
from tests.conftest import Figures, Rounds
from tests.safety.decoders import COUNT, FeetechWitness, KstWitness, Witness
from tests.support.machines import machine, wait

LIMIT = radians(60)
NEAR = radians(40)  # of the CAN axes
KEYS: dict[str, Any] = {"low": "-60 deg", "high": "60 deg", "max_velocity": "120 deg/s"}
CAN_KEYS = {name: {"low": "-40 deg", "high": "40 deg", "max_step": "200 deg"} for name in ("c1", "c2")}
ARRIVED = radians(3)
CALLS = 60  # on one machine


def check(witnesses: dict[str, Witness]) -> int:
    """Each goal is inside the limits, or not farther outside than its device stood; gives the number of goals."""
    count = 0
    for bus, witness in witnesses.items():
        most = LIMIT if bus == "arm" else NEAR
        for target in witness.targets:
            place = target.to - (pi if bus == "arm" else 0.0)
            inside = abs(place) <= most + 2 * COUNT
            stays = target.heard is not None and abs(target.to - target.heard) <= 2 * COUNT
            assert inside or stays, (bus, target)
            count += 1
        witness.forget()
    return count


def draw_command(draw: Random, robot: Robot) -> RobotCommand:
    """A command with values that may be anything."""
    name, other = draw.sample(list(robot.axes), 2)
    odd = [draw.uniform(-1.2, 1.2), draw.uniform(-5, 5), nan, inf, 1e9, -0.0]
    value = draw.choice([draw.uniform(-0.65, 0.65)] * 8 + odd)
    commands: list[RobotCommand] = [
        Move({name: value, other: draw.uniform(-0.65, 0.65)}, speed=draw.choice([1, 0.3, 2])),
        Move({name: value}, relative=True),
        Move({name: value}, kind="minimum_jerk", duration=draw.choice([None, 1.0, 0.001])),
        Jog(name, draw.choice([1.0, -2.0, 0.3, 9.0]), 0.3),
        Torque(on=draw.random() < 0.7, names=None if draw.random() < 0.5 else (name,)),
        Stop(),
        WriteRegisters(name, {"goal_position": value + (pi if name[0] == "a" else 0.0)}),
    ]
    return draw.choice([*commands[:3] * 2, *commands])


def carry_out(draw: Random, robot: Robot, sims: Any) -> str:
    """One command, loop, raw call or power cycle."""
    bus, node = robot.buses["arm"], draw.randint(1, 3)
    servo, value = Servo(bus, node), draw.choice([draw.uniform(-1.2, 1.2), nan, inf, 7.0])
    kind = draw.randrange(12)
    if robot.faults and draw.random() < 0.4:
        robot.execute(ClearFault())
    if kind == 0:
        servo.move(value + pi, velocity=draw.choice([0.5, 1.5, 9]), wait=False)
    elif kind == 1:
        servo.reg_write(goal_position=value + pi)
        bus.run(action_all([servo]))
    elif kind == 2:
        bus.run(ServoGroup([servo]).write("goal_position")([value + pi]))
    elif kind < 5:
        name = draw.choice(list(robot.axes))
        policy = cast("Any", draw.choice(["clamp", "reject"]))
        with robot.loop(100, name, policy=policy, direct=draw.random() < 0.3) as loop:
            for _ in islice(loop, draw.randint(1, 20)):
                loop.set_target(name, value)
    elif kind == 5 and draw.random() < 0.3:
        sims["arm"][node].power_cycle()
        wait(robot, draw.choice([0.0, 1.0]))
    else:
        command = draw_command(draw, robot)
        result = robot.execute(command)
        if isinstance(command, Move):
            for name, axis in result.axes.items():
                assert abs(axis.position - axis.goal) < ARRIVED, (name, axis)
            return "moved"
    return "done"


@pytest.mark.timeout(0)
def test_no_goal_outside_the_limits_leaves(rounds: Rounds, figures: Figures) -> None:
    goals = seed = 0
    counts = {"moved": 0, "done": 0, "refused": 0}
    most = rounds(1_000_000, 10_000)
    while goals < most:
        draw = Random(seed)
        seed += 1
        with (
            machine("1-3", "0x25-0x26", axes=CAN_KEYS, **KEYS) as (config, sims),
            Robot(config) as robot,
        ):
            witnesses: dict[str, Witness] = {"arm": FeetechWitness(), "can": KstWitness(0x25, 0x26)}
            for bus, witness in witnesses.items():
                sims[bus].line = witness
            for _ in range(CALLS):
                try:
                    counts[carry_out(draw, robot, sims)] += 1
                except (MotorbusError, ValueError):
                    counts["refused"] += 1
                goals += check(witnesses)
    figures(f"random goals at the gate, {counts}", goals=goals)
    assert min(counts.values()) > seed * CALLS / 20
