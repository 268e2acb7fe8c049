"""The robot as the service of every face: commands as JSON, states, subscriptions, threads, asyncio, signals."""

from __future__ import annotations

import asyncio
import time
from itertools import pairwise
from threading import Thread
from typing import Any

import msgspec
import pytest

import motorbus
from motorbus.errors import Interrupted, LimitExceeded, MotorbusError, NoReply, Refused, RequestError
from motorbus.motion import commands
from motorbus.motion.commands import RobotCommand
from motorbus.motion.machine import MachineConfig
from motorbus.motion.robot import PROGRAMS, AsyncRobot, Robot
from tests.support.machines import listen, machine, orders

JSON = {
    '{"type":"move","goals":{"a1":0.2}}': "moved",
    '{"type":"move","goals":{"a1":0.1,"a2":-0.1},"relative":true,"speed":0.5,"kind":"minimum_jerk"}': "moved",
    '{"type":"pose","name":"ready"}': "moved",
    '{"type":"jog","name":"a1","velocity":0.5,"seconds":0.3}': "loop",
    '{"type":"torque","on":true}': "",
    '{"type":"stop","verify":true}': "stopped",
    '{"type":"clear_fault"}': "",
    '{"type":"read_registers","name":"a1","registers":["present_position"]}': "",
    '{"type":"write_registers","name":"a1","values":{"torque_limit":0.5}}': "",
    '{"type":"device_command","name":"a1","function":"position"}': "",
    '{"type":"estop"}': "",
    '{"type":"reset"}': "",
}


def test_each_command_is_one_json_text_and_its_result_is_another() -> None:
    with machine("1-2", extra={"pose": {"ready": {"a1": "5 deg"}}}) as (config, _), Robot(config) as robot:
        for text, tag in JSON.items():
            command = msgspec.json.decode(text.replace('"type"', '"type"'), type=RobotCommand)
            result = msgspec.json.encode(robot.execute(command))
            assert (f'"type":"{tag}"' in result.decode()) == bool(tag), text
        msgspec.json.encode(robot.describe())
        msgspec.json.encode(robot.snapshot())
    assert set(PROGRAMS) == set(RobotCommand.__args__)


WRONG = {
    '{"type":"move","goals":{"b1":0.2}}': "no axis 'b1'",
    '{"type":"move","goals":{"a1":0.2},"duration":0.01}': "too short",
    '{"type":"move","goals":{"a1":0.2},"speed":0}': "speed 0",
    '{"type":"pose","name":"redy"}': "no pose",
    '{"type":"home"}': "no axis has a reference switch",
    '{"type":"home","names":["a1"]}': "a1: arm#1 has no home",
    '{"type":"run","name":"a1","number":1}': "a1: arm#1 has no run",
    '{"type":"set_position","name":"a1","position":0}': "reports its position",
    '{"type":"device_command","name":"a1","function":"__init__"}': "no command",
    '{"type":"read_registers","name":"a1","registers":["presnt"]}': "presnt",
    '{"type":"torque","on":false,"names":["c1"]}': "c1: torque cannot be switched off",
}


@pytest.mark.parametrize("text", WRONG)
def test_a_wrong_command_is_refused_in_one_line(text: str) -> None:
    with machine("1", "1") as (config, sims), Robot(config) as robot:
        robot.states()
        listen(sims)
        with pytest.raises(RequestError, match=WRONG[text]) as caught:
            robot.execute(msgspec.json.decode(text, type=RobotCommand))
        assert "\n" not in caught.value.summary
        assert not orders(sims)


def test_a_device_that_does_not_answer_is_named() -> None:
    with machine("1-2") as (config, sims):
        sims["arm"][2].unplug()
        with pytest.raises(NoReply, match=r"a2: arm#2 does not answer on feetech:sim"):
            Robot(config)
        with Robot(config, "a1") as robot:
            assert list(robot.axes) == ["a1"]


def test_states_show_what_the_devices_report() -> None:
    with machine("1", "1", lift=True) as (config, _), Robot(config) as robot:
        states = robot.states()
        assert states["a1"].voltage == pytest.approx(7.4, abs=0.3)
        assert states["a1"].age is not None
        assert states["lift"].position is None
        assert not states["c1"].torque
        robot.enable_torque()
        assert robot.snapshot().axes["a1"].torque


def test_a_subscription_drops_the_oldest_and_keeps_its_rate() -> None:
    with machine("1") as (config, _), Robot(config) as robot:
        every, few = robot.subscribe(depth=5), robot.subscribe(rate=10)
        robot.move({"a1": 0.8})
        states = list(iter(every.get, None))
        assert len(states) == 5
        assert every.dropped > 20
        assert [state.number for state in states] == sorted(state.number for state in states)
        slow = list(iter(few.get, None))
        assert all(b.at - a.at > 0.045 for a, b in pairwise(slow))
        assert slow[-1].at - slow[0].at == pytest.approx(0.1 * (len(slow) - 1), abs=0.06)
        assert slow[-1].axes["a1"].target is not None
        robot.unsubscribe(every)
        robot.unsubscribe(few)


# -- real time -------------------------------------------------------------------------------------------------


def real(sim: Any, **keys: Any) -> MachineConfig:
    """One axis on a simulation in real time."""
    axis = {
        "device": "b#1",
        "zero": "180 deg",
        "low": "-90 deg",
        "high": "90 deg",
        "max_velocity": "60 deg/s",
    }
    return MachineConfig.of(
        {"format": 1, "bus": {"b": {"address": sim.url}}, "axis": {"a1": {**axis, **keys}}}
    )


def test_a_stop_of_another_thread_ends_a_move_and_states_are_polled() -> None:
    with motorbus.simulate("feetech", ids="1", clock="real") as sim, Robot(real(sim)) as robot:
        subscription = robot.subscribe()
        first = subscription.get(2.0)
        assert first is not None
        assert first.axes["a1"].position is not None

        def stop() -> None:
            time.sleep(0.4)
            robot.stop()

        thread = Thread(target=stop)
        thread.start()
        with pytest.raises(Interrupted):
            robot.move({"a1": 1.5})
        thread.join()
        assert robot.stop(verify=True).axes["a1"].at_rest
        assert robot.positions()["a1"] < 1.0


def test_an_emergency_stop_of_another_thread_ends_a_move() -> None:
    with motorbus.simulate("feetech", ids="1", clock="real") as sim, Robot(real(sim)) as robot:
        outcome: list[Any] = []

        def stop() -> None:
            time.sleep(0.3)
            outcome.append(robot.execute(commands.EStop()))

        thread = Thread(target=stop)
        thread.start()
        with pytest.raises(Interrupted):
            robot.move({"a1": 1.5})
        thread.join()
        assert outcome[0]["b"].acknowledged == (1,)
        assert sim[1].memory["torque_enable"] == 0


def test_a_lost_lease_stops_a_program_that_hangs() -> None:
    with motorbus.simulate("feetech", ids="1", clock="real") as sim, Robot(real(sim)) as robot:
        with pytest.raises(Refused) as caught:
            _hang(robot)
        assert caught.value.reason == "lease"
        assert robot.stop(verify=True).axes["a1"].at_rest


def _hang(robot: Robot) -> None:
    with robot.attended(0.2), robot.loop(50) as loop:
        for state in loop:
            loop.set_target("a1", 1.5)
            if state.number == 5:
                time.sleep(0.7)
                assert robot.axes["a1"].status.owner > 0
                assert not robot.axes["a1"].status.moving


def test_asyncio_stops_by_another_task_and_never_blocks() -> None:
    async def run() -> None:
        with motorbus.simulate("feetech", ids="1", clock="real") as sim:
            async with AsyncRobot(real(sim, exit="torque_off")) as robot:
                subscription = robot.subscribe(rate=5)
                move = asyncio.create_task(robot.move({"a1": 1.5}))
                await asyncio.sleep(0.4)
                begun = time.monotonic()
                result = await robot.stop()
                assert time.monotonic() - begun < 0.3
                assert set(result.axes) == {"a1"}
                with pytest.raises(Interrupted):
                    await move
                await robot.execute(commands.EStop())
                with pytest.raises(MotorbusError):
                    await robot.move({"a1": 0.0})
                robot.reset()
                with pytest.raises(LimitExceeded):
                    await robot.move({"a1": 3.0})
                await robot.enable_torque()
                assert subscription.get() is not None
                async with robot.attended(), robot.loop(50) as loop:
                    async for state in loop:
                        with pytest.raises(RequestError):
                            loop.set_target("none", 0.0)
                        if state.number > 3:
                            break
            assert sim[1].memory["torque_enable"] == 0

    asyncio.run(run())


@pytest.mark.parametrize("second", [0, 30, 60])
def test_a_second_signal_shortens_the_end_and_skips_no_axis(second: int) -> None:
    extra = {"pose": {"park": {"a1": "60 deg"}}}
    axes = {"a1": {"exit": "park"}, "a2": {"exit": "torque_off"}}
    with machine("1-2", axes=axes, extra=extra) as (config, sims):
        with pytest.raises(KeyboardInterrupt):
            _press_twice(config, sims, second)
        assert sims["arm"][2].memory["torque_enable"] == 0
        parked = abs(sims["arm"][1].memory["present_position"] - 2048 - 60 * 4096 / 360) < 20
        assert parked == (not second)


def _press_twice(config: MachineConfig, sims: Any, second: int) -> None:
    with Robot(config) as robot:
        robot.enable_torque()
        listen(sims, 25, *([25 + second] if second else []))
        robot.move({"a1": 0.8, "a2": 0.8})
