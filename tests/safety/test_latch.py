"""An emergency stop is latched on every bus until `reset`: no spelling of a motion or torque request leaves."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from motorbus import AsyncRobot, Interrupted, Robot, feetech, kst
from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data, Effect, Request
from motorbus.core.setpoint import Setpoint
from motorbus.errors import MotorbusError, RequestError
from motorbus.motion.commands import Move, Torque, WriteRegisters
from tests.support.machines import asks, listen, machine, sent

ROOT = Path(__file__).parents[2]


def moves(data: Data) -> bool:
    """Whether this could set something in motion or give it torque: not a question, torque off, a stop, or an edit of
    a project, which moves nothing until that is started (4E, 03 0A to 0C, 03 0F)."""
    if asks(data):
        return False
    if isinstance(data, CanFrame):
        return True
    if data[:2] == b"\xff\xff":
        lets_go = data[4] in (3, 0x83) and data[5] == 40 and data[-2] == 0
        takes_back = data[4] == 4 and data[5] == 55  # a REG WRITE of the lock in the place of one that waits
        return not (lets_go or takes_back)
    return data[2] == 0x4E or (data[2] == 3 and data[3] in (0x0A, 0x0B, 0x0C, 0x0F))


def raw(bus: Any, node: int) -> object:
    goal = Setpoint(node, "position", 3.1, 0.0, 6.0)
    return bus.run(Request(bytes.fromhex("ffff01052a0008c7"), (), effect=Effect.MOTION, setpoints=(goal,)))


FACES: dict[str, Callable[[Robot], object]] = {
    "move": lambda robot: robot.move({"a1": 0.1, "c1": 0.1}),
    "relative": lambda robot: robot.move({"c1": 0.1}, relative=True),
    "pose": lambda robot: robot.pose("ready"),
    "jog": lambda robot: robot.jog("a2", 0.2, 0.5),
    "torque": lambda robot: robot.enable_torque(),
    "lift jog": lambda robot: robot.jog("lift", 0.01, 0.5),
    "lift home": lambda robot: robot.home("lift", timeout=1.0),
    "lift program": lambda robot: robot.run("lift", 1),
    "loop": lambda robot: _loop(robot),
    "command": lambda robot: robot.execute(Torque(on=True)),
    "register": lambda robot: robot.execute(WriteRegisters("a1", {"goal_position": 3.0})),
    "servo move": lambda robot: robot["a1"].device.move(3.0, velocity=0.5),
    "servo torque": lambda robot: robot["a1"].device.enable_torque(),
    "servo write": lambda robot: robot["a1"].device.write(goal_position=3.0),
    "servo reg_write": lambda robot: robot["a1"].device.reg_write(goal_position=3.0),
    "servo action": lambda robot: robot["a1"].device.action(),
    "can move": lambda robot: robot["c1"].device.move(0.1),
    "sync write": lambda robot: _on(
        robot, "arm", feetech.ServoGroup([robot["a1"].device]).write("goal_position")([3.14])
    ),
    "reg write all": lambda robot: _on(
        robot, "arm", feetech.reg_write_all({robot["a1"].device: {"goal_position": 3.1}})
    ),
    "action all": lambda robot: _on(robot, "arm", feetech.action_all([robot["a1"].device])),
    "broadcast": lambda robot: _on(
        robot, "can", kst.broadcast_write("goal_position", 0.1, kst.BusSettings(), nodes=[robot["c1"].device])
    ),
    "start project": lambda robot: robot["lift"].device.start_project(1),
    "stepper jog": lambda robot: robot["lift"].device.jog_forward(0.2),
    "raw": lambda robot: raw(robot.buses["arm"], 1),
}


def _on(robot: Robot, bus: str, operation: Any) -> object:
    return robot.buses[bus].run(operation)


def _loop(robot: Robot) -> None:
    with robot.loop(50, "a1") as loop:
        loop.set_target("a1", 0.1)
        for state in loop:
            if state.number > 5:
                break


PARTS: dict[str, Any] = {
    "arm": "1-2",
    "can": "0x25",
    "lift": True,
    "extra": {"pose": {"ready": {"a1": "0.1 rad", "c1": "0.1 rad"}}},
}


@pytest.mark.parametrize("face", FACES)
def test_06_nothing_leaves_while_it_is_latched(face: str) -> None:
    with machine(**PARTS) as (config, sims), Robot(config) as robot:
        with robot.attended():
            robot.set_position("lift", 0.02)
            robot.enable_torque()
            robot.estop()
            listen(sims)
            with pytest.raises(MotorbusError):
                FACES[face](robot)
            assert [data for data in sent(sims) if moves(data)] == []
        assert [data for data in sent(sims) if moves(data)] == []


@pytest.mark.parametrize("face", ["move", "lift jog", "servo move", "sync write", "start project", "raw"])
def test_06_each_of_these_moves_after_a_reset(face: str) -> None:
    with machine(**PARTS) as (config, sims), Robot(config) as robot, robot.attended():
        robot.set_position("lift", 0.02)
        robot.enable_torque()
        robot.estop()
        robot.reset()
        listen(sims)
        with suppress(MotorbusError):
            FACES[face](robot)
        assert [data for data in sent(sims) if moves(data)]


def test_06_an_async_robot_stays_latched_until_reset() -> None:
    async def run() -> None:
        with machine(arm="1-2", can="0x25") as (config, sims):
            robot = AsyncRobot(config)
            async with robot:
                await robot.enable_torque()
                robot.estop()
                listen(sims)
                for command in (Torque(on=True), Move({"c1": 0.1})):
                    with pytest.raises(Interrupted):
                        await robot.execute(command)
                assert [data for data in sent(sims) if not asks(data)] == []
                robot.reset()
                await robot.enable_torque()
            with pytest.raises(RequestError, match="closed"):
                await robot.__aenter__()

    asyncio.run(run())


def test_06_from_several_threads() -> None:
    with machine(arm="1-3", can="0x25", lift=True, options=_real()) as (config, sims), Robot(config) as robot:
        robot.enable_torque()
        found: list[Any] = []
        threads = [Thread(target=lambda: found.append(robot.estop())) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(30.0)
        assert len(found) == 4
        assert all(bus.latched for bus in robot.buses.values())
        assert [sims["arm"][node].memory["torque_enable"] for node in (1, 2, 3)] == [0, 0, 0]
        robot.reset()
        robot.enable_torque()


def _real() -> dict[str, dict[str, str]]:
    return {bus: {"clock": "real"} for bus in ("arm", "can", "stage")}


def test_06_without_threads_every_bus_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    with machine(arm="1-2", can="0x25") as (config, sims), Robot(config) as robot:
        robot.enable_torque()

        def exhausted(self: Thread) -> None:
            raise RuntimeError("can't start new thread")

        with monkeypatch.context() as patch:
            patch.setattr(Thread, "start", exhausted)
            found = robot.estop()
        assert found["arm"].acknowledged == (1, 2)
        assert found["can"].acknowledged == (0x25,)
        assert sims["arm"][1].memory["torque_enable"] == 0


PROGRAM = """
import signal, sys
from motorbus import Interrupted, Robot
from tests.support.machines import asks, listen, machine, sent

real = {"arm": {"clock": "real"}, "can": {"clock": "real"}}
with machine(arm="1-2", can="0x25", options=real) as (config, sims), Robot(config) as robot:
    signal.signal(signal.SIGUSR1, lambda *_: robot.trigger_estop())
    robot.enable_torque()
    print("ready", flush=True)
    try:
        robot.move({"a1": 2.0, "c1": 0.8}, duration=60.0)
    except Interrupted:
        print("interrupted")
    for again in range(2):
        try:
            robot.move({"a1": 0.1})
        except Interrupted:
            print("latched")
    print([sims["arm"][node].memory["torque_enable"] for node in (1, 2)])
"""


def test_06_from_a_signal_handler_in_the_middle_of_a_move() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "src")])},
        stdout=subprocess.PIPE,
        text=True,
    ) as program:
        assert program.stdout is not None
        assert program.stdout.readline() == "ready\n"
        program.send_signal(signal.SIGUSR1)
        told, _ = program.communicate(timeout=60)
    assert told == "interrupted\nlatched\nlatched\n[0, 0]\n"
