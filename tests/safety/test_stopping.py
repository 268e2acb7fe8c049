"""The emergency stop of a machine: every bus by itself, whatever happens to the others."""

from __future__ import annotations

import asyncio
from threading import Thread

import pytest

from motorbus import AsyncRobot, Interrupted, Robot
from motorbus.session.stopping import estop, reset
from tests.support.machines import machine


def test_every_bus_is_stopped_and_tells_what_came_of_it() -> None:
    with machine(arm="1-3", can="0x25", lift=True) as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()
        found = robot.estop()
        assert {name: one.acknowledged for name, one in found.items()} == {
            "arm": (1, 2, 3),
            "can": (0x25,),
            "stage": (1,),
        }
        assert all(one.promise for one in found.values())
        assert sims["arm"][1].memory["torque_enable"] == 0
        with pytest.raises(Interrupted):
            robot.enable_torque()
        robot.reset()
        robot.enable_torque()
        assert sims["arm"][1].memory["torque_enable"] == 1


def test_a_bus_that_is_gone_keeps_no_other_from_being_stopped() -> None:
    with machine(arm="1-2", can="0x25") as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()
        robot["c1"].bus.close()
        found = estop(robot)
        assert found["arm"].acknowledged == (1, 2)
        assert found["can"].acknowledged == ()
        assert found["can"].silent == (0x25,)
        assert found["can"].promise.startswith("nothing: ")
        assert sims["arm"][2].memory["torque_enable"] == 0
        reset(robot)


def test_whatever_goes_wrong_on_a_bus_is_told_beside_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    with machine(arm="1-2", can="0x25") as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()

        def broken() -> None:
            raise OSError("the socket is gone")

        with monkeypatch.context() as patch:
            patch.setattr(robot.buses["can"], "estop", broken)
            found = robot.estop()
        assert found["can"].promise == "nothing: OSError: the socket is gone"
        assert found["can"].silent == (0x25,)
        assert sims["arm"][2].memory["torque_enable"] == 0


def test_a_silent_node_is_told() -> None:
    with machine(arm="1-3") as (made, sims), Robot.of(made) as robot:
        sims["arm"][2].unplug()
        assert robot.estop()["arm"].silent == (2,)


def test_it_goes_through_while_another_thread_moves() -> None:
    """On the real clock, where a movement waits and the stop does not."""
    with machine(arm="1-2", can="0x25", options=_real()) as (made, _), Robot.of(made) as robot:
        told: list[BaseException] = []

        def move() -> None:
            try:
                robot.move({"a1": 2.0, "c1": 0.8}, duration=30.0)
            except BaseException as error:
                told.append(error)

        thread = Thread(target=move)
        thread.start()
        while not robot["a1"].under_way and thread.is_alive():
            thread.join(0.01)
        robot.estop()
        thread.join(10.0)
        assert not thread.is_alive()
        assert isinstance(told[0], Interrupted), told
        robot.reset()


def _real() -> dict[str, dict[str, str]]:
    return {"arm": {"clock": "real"}, "can": {"clock": "real"}}


def test_it_is_a_plain_call_on_an_async_robot_too() -> None:
    async def main() -> None:
        with machine(arm="1-2") as (made, sims):
            async with AsyncRobot.of(made) as robot:
                await robot.enable_torque()
                assert robot.estop()["arm"].acknowledged == (1, 2)
                assert sims["arm"][1].memory["torque_enable"] == 0
                with pytest.raises(Interrupted):
                    await robot.enable_torque()
                robot.reset()
                await robot.enable_torque()

    asyncio.run(main())
