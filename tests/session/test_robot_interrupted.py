"""Wherever a Ctrl-C or a cancellation falls, and another soon after: what is to be limp is limp, every port free."""

from __future__ import annotations

import asyncio

import pytest

from motorbus import AsyncRobot, Robot
from motorbus.motion.machine import Machine
from motorbus.simulation.named import Simulation
from tests.motion.machines import Cut, Heard, machine
from tests.motion.tracing import Line, interrupted

GOALS = {"a1": 0.5, "a2": -0.5, "c1": 0.4}
HELD = {"c1": {"exit": "hold"}}


def limp(sims: dict[str, Simulation]) -> bool:
    return not any(sims["arm"][node].memory["torque_enable"] for node in (1, 2, 3))


@pytest.mark.parametrize("bus", ["arm", "can"])
@pytest.mark.parametrize("number", [*range(1, 40, 4), *range(40, 300, 65)])
def test_blocking(bus: str, number: int) -> None:
    with machine(arm="1-3", can="0x25", exit="torque_off", axes=HELD) as (made, sims):
        cut = sims[bus].line = Cut(number, number + 2)
        try:
            _moved(made)
        except KeyboardInterrupt:
            assert number not in cut.numbers
        assert limp(sims)
        sims[bus].line = Heard()
        with Robot.of(made) as robot:
            assert len(robot.axes) == 4


def _moved(made: Machine) -> None:
    with Robot.of(made) as robot:
        robot.enable_torque()
        robot.move(GOALS)


@pytest.mark.parametrize("again", [0, 1, 5])
@pytest.mark.parametrize("steps", [*range(1, 60, 7), *range(60, 600, 130)])
def test_async(steps: int, again: int) -> None:
    async def work(made: Machine) -> None:
        async with AsyncRobot.of(made) as robot:
            await robot.enable_torque()
            await robot.move(GOALS)

    async def main() -> None:
        with machine(arm="1-3", can="0x25", exit="torque_off", axes=HELD) as (made, sims):
            task = asyncio.create_task(work(made))
            for count in (steps, again):
                for _ in range(count):
                    await asyncio.sleep(0)
                if count:
                    task.cancel()
            (done,) = await asyncio.gather(task, return_exceptions=True)
            assert done is None or isinstance(done, asyncio.CancelledError), done
            assert limp(sims)
            async with AsyncRobot.of(made) as robot:
                assert len(robot.axes) == 4

    asyncio.run(main())


FILES = ("session/robot.py", "motion/leaving.py", "motion/conductor.py")


def test_ctrl_c_at_any_line_of_leaving_keeps_no_axis_from_letting_go_and_no_port_from_being_free() -> None:
    tried: set[Line] = set()
    left = 0
    while True:
        with machine(arm="1-2", lift=True, exit="torque_off", axes={"lift": {"exit": "hold"}}) as (
            made,
            sims,
        ):
            robot = Robot.of(made)
            robot.enable_torque()
            where = interrupted(robot.close, FILES, tried)
            robot.close()  # as what fell before anything had begun
            assert not any(sims["arm"][node].memory["torque_enable"] for node in (1, 2)), where
            with Robot.of(made) as again:
                assert len(again.axes) == 3
        if where is None:
            break
        left += 1
    assert left > 40
