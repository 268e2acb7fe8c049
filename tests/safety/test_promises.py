"""The points of docs/explanation/safety.md; the number of the point is in the name."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from math import inf, nan, pi, radians
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest

import motorbus
from motorbus.core.steps import INTENT, JournalEntry
from motorbus.errors import (
    Faulted,
    Interrupted,
    LimitExceeded,
    LinkLost,
    MotorbusError,
    NoReply,
    NotHomed,
    Overloaded,
    Refused,
    RequestError,
    Stalled,
)
from motorbus.families import feetech
from motorbus.journal import BusJournal
from motorbus.motion.commands import Jog, Move, Torque, WriteRegisters
from motorbus.motion.robot import AsyncRobot, Robot
from tests.conformance.cuts import Kind, violations
from tests.support.catalogue.cuts import COMMANDS
from tests.support.machines import described, listen, machine, orders, wait
from tests.support.processes import Simulated, python


def test_01_nothing_moves_on_connect() -> None:
    with machine("1-2", "1-2", lift=True) as (config, sims):
        listen(sims)
        for _ in range(20):
            with Robot(config) as robot:
                robot.states()
                robot.describe()
                with robot.loop(50, ["a1", "c1"]) as loop:
                    loop.read()
        assert not orders(sims)


@pytest.mark.parametrize("name", ["a1", "c1"])
def test_01_torque_on_moves_by_a_count_at_most(name: str) -> None:
    with machine("1", "1") as (config, sims), Robot(config) as robot:
        sims["arm"][1].memory["goal_position"] = 500  # an old goal, far away
        before = robot.positions()[name]
        assert robot.enable_torque(name) == (name,)
        for _ in range(20):
            wait(robot, 0.05)
            assert abs(robot.positions()[name] - before) < 0.004


def test_02_unknown_is_not_safe_and_a_stop_is_allowed() -> None:
    with machine("1", lift=True) as (config, sims), Robot(config) as robot:
        with pytest.raises(NotHomed, match="lift: its position is not known"):
            robot.move({"lift": 0.01})
        wait(robot, 1.0)
        sims["arm"][1].unplug()
        with pytest.raises(NoReply):
            robot.move({"a1": 0.1})
        sims["arm"][1].plug()
        robot.stop()


def spellings(robot: Robot, to: float) -> dict[str, Callable[[], object]]:
    """Ways to order the device of a1 to an angle; it is at pi and its axis at 0."""
    axis = robot.axes["a1"]
    bus, servo = robot.buses["arm"], feetech.Servo(robot.buses["arm"], 1)
    bus.run(axis.driver.limits(servo))
    own = axis.config.from_device(to)
    return {
        "move": lambda: robot.move({"a1": own}),
        "loop": lambda: _one_cycle(robot, own),
        "device": lambda: servo.move(to, velocity=1.0, wait=False),
        "register": lambda: servo.write(goal_position=to),
        "group": lambda: bus.run(feetech.sync_write({servo: {"goal_position": to}})),
        "buffer": lambda: servo.reg_write(goal_position=to),
    }


def _one_cycle(robot: Robot, to: float) -> None:
    with robot.loop(50, "a1", direct=True) as loop:
        loop.set_target("a1", to)
        next(iter(loop))


@pytest.mark.parametrize("way", ["move", "loop", "device", "register", "group", "buffer"])
def test_03_one_gate_judges_each_spelling(way: str) -> None:
    with (
        machine("1", axes={"a1": {"low": "-60 deg", "high": "60 deg"}}) as (config, sims),
        Robot(config) as robot,
    ):
        robot.enable_torque()
        for wrong in (pi + radians(61), pi - radians(61), nan, inf):
            order = spellings(robot, wrong)[way]
            listen(sims)
            with pytest.raises((LimitExceeded, RequestError)):
                order()
            assert all(b"\x2a" not in data[5:6] for data in orders(sims) if isinstance(data, bytes))
        order = spellings(robot, pi + radians(5))[way]
        listen(sims)
        order()
        assert orders(sims)


def test_04_a_goal_is_one_cycle_ahead() -> None:
    with machine("1") as (config, sims), Robot(config) as robot, robot.loop(50) as loop:
        most = config.axes["a1"].max_velocity / 50
        for state in loop:
            loop.set_target("a1", 2.0)
            goal = sims["arm"][1].memory["goal_position"] * 2 * pi / 4096 - pi
            if state.number > 5:
                assert goal - state.position["a1"] < 3 * most + 0.01
            if state.number > 40:
                break


def test_04_endless_motion_needs_a_lease() -> None:
    with (
        machine(lift=True, axes={"lift": {"low": None, "high": None}}) as (config, _),
        Robot(config) as robot,
    ):
        with pytest.raises(Refused) as caught:
            robot.home(timeout=1.0)
        assert caught.value.reason == "unattended"


def test_05_a_silent_holder_loses_the_machine() -> None:
    with machine("1-2") as (config, _), Robot(config) as robot:
        attended = robot.attended(0.3)
        lease = attended.__enter__()
        robot.move({"a1": 0.1})
        lease.beat()
        with pytest.raises(Refused):
            robot.move({"a1": 1.5})
        with pytest.raises(Refused) as caught:
            attended.__exit__(None, None, None)
        assert caught.value.reason == "lease"
        here = robot.positions()["a1"]
        assert 0.1 < here < 1.0
        wait(robot, 0.5)
        assert robot.stop(verify=True).axes["a1"].at_rest
        assert abs(robot.positions()["a1"] - here) < 0.2
        robot.move({"a1": 0.0})


def test_05_nothing_moves_after_the_loss_until_a_reset() -> None:
    with machine("1") as (config, _), Robot(config) as robot, robot.attended(0.2) as lease:
        wait(robot, 0.5)
        with pytest.raises(Refused):
            lease.beat()
        with pytest.raises(Refused):
            robot.move({"a1": 0.1})
        lease.reset()
        robot.enable_torque()
        wait(robot, 0.1)


def test_06_an_emergency_stop_latches() -> None:
    with machine("1-2", "1") as (config, sims), Robot(config) as robot:
        robot.enable_torque()
        outcome = robot.estop()
        assert outcome["arm"].acknowledged == (1, 2)
        assert outcome["can"].acknowledged == (1,)
        listen(sims)
        with pytest.raises(Interrupted):
            robot.move({"a1": 0.1})
        with pytest.raises(Interrupted):
            robot.enable_torque()
        assert not orders(sims)
        robot.reset()
        robot.move({"a1": 0.1, "c1": 0.1})


def test_06_an_emergency_stop_holds_what_the_file_says() -> None:
    with machine("1-2", axes={"a1": {"estop": "hold"}}) as (config, sims), Robot(config) as robot:
        robot.enable_torque()
        robot.estop()
        assert [sims["arm"][node].memory["torque_enable"] for node in (1, 2)] == [1, 0]


def test_07_stopped_is_what_was_seen_at_rest() -> None:
    with machine("1", lift=True) as (config, _), Robot(config) as robot:
        robot.enable_torque("a1")
        result = robot.stop(verify=True)
        assert result.axes["a1"].at_rest is True
        assert result.axes["lift"].at_rest is None
        assert robot.stop("a1").axes["a1"].at_rest is None


@pytest.mark.parametrize("dead", [None, 1, 2])
@pytest.mark.parametrize("action", ["hold", "torque_off", "leave"])
def test_08_every_axis_is_visited_at_the_end(action: str, dead: int | None) -> None:
    with machine("1-3", exit=action) as (config, sims):
        try:
            with Robot(config) as robot:
                robot.enable_torque()
                robot.axes["a3"].status.moving = True
                if dead:
                    sims["arm"][dead].unplug()
                listen(sims)
        except MotorbusError:
            assert dead
        for node in {1, 2, 3} - {dead}:
            assert sims["arm"][node].memory["torque_enable"] == (action != "torque_off")
        assert bool(orders(sims)) == (action != "leave")


def test_08_parking_is_last() -> None:
    extra = {"pose": {"park": {"a1": "20 deg"}}}
    axes = {"a1": {"exit": "park"}, "a2": {"exit": "torque_off"}}
    with machine("1-2", axes=axes, extra=extra) as (config, sims):
        with Robot(config) as robot:
            robot.enable_torque()
        assert abs(sims["arm"][1].memory["present_position"] - 2048 - 20 * 4096 / 360) < 10
        assert sims["arm"][1].memory["torque_enable"] == 1
        assert sims["arm"][2].memory["torque_enable"] == 0


def test_08_the_graceful_stop_parks_and_releases() -> None:
    with machine("1-2", extra={"pose": {"park": {"a1": "20 deg"}}}) as (config, sims):
        with Robot(config) as robot:
            robot.enable_torque()
            robot.shutdown()
            assert not robot.warnings
        assert abs(sims["arm"][1].memory["present_position"] - 2048 - 20 * 4096 / 360) < 10
        assert [sims["arm"][node].memory["torque_enable"] for node in (1, 2)] == [0, 0]


def _lead_until(robot: Robot, cycle: int, then: Callable[[], object]) -> None:
    """Lead all axes to 0.5; in this cycle something happens."""
    with robot.loop(50) as loop:
        for state in loop:
            for name in robot.axes:
                loop.set_target(name, 0.5)
            if state.number == cycle:
                then()
            assert state.number < 4 * cycle


def test_09_a_change_of_settings_is_complete_or_absent() -> None:
    with machine("1") as (config, sims), Robot(config) as robot:
        servo = robot["a1"].device
        before = servo.read("max_temperature", "lock")
        with pytest.raises(RequestError):
            servo.write(max_temperature=55, min_position_limit=1e9)
        assert servo.read("max_temperature", "lock") == before
        robot.execute(WriteRegisters("a1", {"max_temperature": 55}))
        sims["arm"][1].power_cycle()
        wait(robot, 1.0)
        assert servo.read("max_temperature", "lock") == {**before, "max_temperature": 55}


def test_09_an_axis_with_an_unfinished_change_gets_no_motion() -> None:
    with machine("1-2") as (config, sims):
        with motorbus.open(sims["arm"].url) as bus:
            assert isinstance(bus.journal, BusJournal)
            bus.journal(JournalEntry("set_id", INTENT, {"node": 1, "new": 7}))
        with Robot(config) as robot:
            assert list(robot.faults) == ["a1"]
            listen(sims)
            for command in (Move({"a1": 0.1, "a2": 0.1}), Torque(on=True), Jog("a1", 0.1, 0.2)):
                with pytest.raises(Refused, match="a1 is at fault: unfinished change"):
                    robot.execute(command)
            with pytest.raises(Refused):
                robot.clear_fault()
            assert not orders(sims)
            robot.stop()
            robot.move({"a2": 0.1})


@pytest.mark.parametrize("name", ["feetech-sts-set_id", "feetech-sts-set_baud"])
def test_10_id_and_rate_are_old_or_new_after_a_crash(name: str) -> None:
    command = next(one for one in COMMANDS if one.name == name)
    crashes = [cut for cut in command.single_cuts() if cut.kind is Kind.BLACKOUT]
    for crash in crashes[-12:]:
        assert violations(command, crash) == [], crash


def test_10_an_id_in_use_is_refused_before_anything_is_written() -> None:
    with machine("3+7") as (config, sims), Robot(config) as robot:
        listen(sims)
        with pytest.raises(RequestError):
            robot["a1"].device.set_id(7)
        assert not orders(sims)
        assert sorted(node.memory["id"] for node in sims["arm"].simulator.nodes.values()) == [3, 7]


def test_11_a_restart_is_a_fault_until_it_is_cleared() -> None:
    with machine("1-2") as (config, sims), Robot(config) as robot:
        with pytest.raises(Faulted) as caught:
            _lead_until(robot, 20, lambda: sims["arm"][1].power_cycle())
        assert caught.value.reason == "restart"
        assert list(robot.faults) == ["a1"]
        with pytest.raises(Refused):
            robot.move({"a1": 0.0})
        robot.stop("a1")
        robot.clear_fault("a1")
        robot.move({"a1": 0.0})


def test_11_an_axis_that_only_held_is_asked_before_it_moves() -> None:
    with machine("1") as (config, sims), Robot(config) as robot:
        robot.move({"a1": 0.2})
        sims["arm"][1].power_cycle()
        wait(robot, 1.0)
        with pytest.raises(Faulted):
            robot.move({"a1": 0.0})


def test_13_a_move_is_refused_as_a_whole() -> None:
    with machine("1-2", "1") as (config, sims), Robot(config) as robot:
        listen(sims)
        with pytest.raises(LimitExceeded):
            robot.move({"a1": 0.2, "a2": 5.0, "c1": 0.1})
        assert not orders(sims)


def test_14_a_blocked_motor_ends_the_move() -> None:
    with machine("1-2") as (config, sims), Robot(config) as robot:
        robot.move({"a1": 0.1})
        sims["arm"][1].block_shaft()
        with pytest.raises((Overloaded, Stalled), match="a1"):
            robot.move({"a1": 1.0, "a2": 1.0})
        assert robot.stop("a2", verify=True).axes["a2"].at_rest
        assert robot.positions()["a2"] < 0.9


@pytest.mark.parametrize("frame", range(3, 60, 7))
def test_an_interrupted_move_stops(frame: int) -> None:
    with machine("1-2", "1") as (config, sims), Robot(config) as robot:
        robot.enable_torque()
        listen(sims, frame)
        with pytest.raises(KeyboardInterrupt):
            robot.move({"a1": 1.5, "c1": 0.8})
        here = robot.positions()
        wait(robot, 0.6)
        after = robot.positions()
        assert all(abs(after[name] - here[name]) < 0.15 for name in ("a1", "c1"))
        assert after["a1"] < 1.3


def test_the_async_robot_moves_and_a_cancelled_move_stops() -> None:
    async def run() -> None:
        with machine("1-2", "1") as (config, _):
            async with AsyncRobot(config) as robot:
                await robot.move({"a1": 0.3, "c1": 0.2})
                task = asyncio.create_task(robot.move({"a1": 1.5, "c1": 0.8}))
                for _ in range(60):
                    await asyncio.sleep(0)
                task.cancel()
                with pytest.raises(asyncio.CancelledError):
                    await task
                assert (await robot.stop(verify=True)).axes["a1"].at_rest
                assert (await robot.positions())["a1"] < 1.4
                async with robot.loop(50, "a2") as loop:
                    async for state in loop:
                        loop.set_target("a2", 0.2)
                        if state.number > 40:
                            break
                assert abs((await robot.positions())["a2"] - 0.2) < 0.02

    asyncio.run(run())


def test_a_silent_axis_ends_a_move_and_stops_the_others() -> None:
    with machine("1-2", "1") as (config, sims), Robot(config) as robot:
        robot.enable_torque()

        def unplug(state: Any) -> None:
            if (robot.axes["a1"].status.known_position or 0.0) > 0.3:
                sims["arm"][1].unplug()

        robot.publish = lambda: unplug(None)  # type: ignore[method-assign]
        with pytest.raises(NoReply, match="a1"):
            robot.move({"a1": 1.0, "a2": 1.0, "c1": 0.8})
        assert robot.stop(["a2", "c1"], verify=True).axes["a2"].at_rest


def test_a_lost_bus_ends_a_move_and_the_other_holds() -> None:
    with machine("1-6", "0x25-0x27", exit="leave") as (config, sims), Robot(config) as robot:
        robot.enable_torque()
        goals = {name: 1.0 if name in config.groups["upper"] else 0.8 for name in robot.axes}

        def unplug() -> None:
            if (robot.axes["a1"].status.known_position or 0.0) > 0.3:
                sims["arm"].unplug(seconds=60.0)

        robot.publish = unplug  # type: ignore[method-assign]
        with pytest.raises(LinkLost) as caught:
            robot.move(goals)
        robot.publish = lambda: None  # type: ignore[method-assign]
        notes = getattr(caught.value, "__notes__", [])
        assert {"c1", "c2", "c3"} <= {note.partition(":")[0] for note in notes}
        assert len([note for note in notes if "lost" in note]) <= 1, "one cause is told once"
        assert all(one.at_rest for one in robot.stop("can", verify=True).axes.values())
        assert max(robot.positions("can").values()) < 0.8


def test_an_async_loop_of_200_hz_and_its_cancellation() -> None:
    async def run() -> None:
        with machine("1-6") as (config, sims):
            async with AsyncRobot(config) as robot:
                loop = robot.loop(200)

                async def follow() -> None:
                    async with loop:
                        async for state in loop:
                            for name in robot.axes:
                                loop.set_target(name, 0.5)
                            if state.number == 100:
                                reached.set()

                reached = asyncio.Event()
                task = asyncio.create_task(follow())
                await reached.wait()
                assert loop.statistics.rate == 200
                assert not loop.statistics.lost
                task.cancel()
                with pytest.raises(asyncio.CancelledError):
                    await task
                listen(sims)
                assert all(one.at_rest for one in (await robot.stop(verify=True)).axes.values())
                assert all(0.1 < place < 0.5 for place in (await robot.positions()).values())

    asyncio.run(run())


def test_an_emergency_stop_of_another_process_ends_a_move(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with Simulated("feetech", ids="1-6", link=tmp_path / "bus") as arm:
        config = described({"arm": arm.bus}, "1-6")
        with Robot(config) as robot:
            robot.enable_torque()

            def stop() -> None:
                while not robot.axes["a1"].status.moving:
                    Event().wait(0.001)
                with python("-m", "motorbus", "estop", arm.bus) as child:
                    child.communicate(timeout=60)
                codes.append(child.returncode)

            codes: list[int] = []
            thread = Thread(target=stop)
            thread.start()
            with pytest.raises(Interrupted, match="stop"):
                robot.move(dict.fromkeys(robot.axes, 2.0), duration=60.0)
            thread.join()
            assert codes == [0]
            robot.reset()
            assert not any(robot[name].device.read("torque_enable")["torque_enable"] for name in robot.axes)


def test_rounding_a_speed_up_never_makes_it_illegal() -> None:
    for velocity in ("1 deg/s", "7.3 deg/s", "33.3 deg/s", "119.9 deg/s", "298.7 deg/s"):
        with machine("1", "1", max_velocity=velocity) as (config, _), Robot(config) as robot:
            robot.enable_torque()
            robot.move({"a1": 0.02, "c1": 0.02})


def test_setpoints_of_other_devices_are_judged_by_their_own_limits() -> None:
    with machine("1-2") as (config, _), Robot(config, "a1") as robot:
        gate = robot.gates[robot.buses["arm"]]
        assert set(gate.axes) == {1}
        other = feetech.Servo(robot.buses["arm"], 2)
        other.move(3.2, wait=False)
        with pytest.raises(MotorbusError):
            other.move(9.0, wait=False)
