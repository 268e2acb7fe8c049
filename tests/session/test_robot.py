"""A machine by its file is opened as a whole or not at all, and closed."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

import motorbus
from motorbus import AsyncRobot, NoReply, PortNotFound, RequestError, Robot
from motorbus.core.steps import INTENT, JournalEntry, Progress
from motorbus.motion.machine import Machine
from tests.support.machines import machine


def broken(made: Machine, bus: str, address: str) -> Machine:
    """The same machine with another address of one bus."""
    buses = {
        name: type(spec)(address=address if name == bus else spec.address)
        for name, spec in made.buses.items()
    }
    return Machine(name=made.name, buses=buses, axes=made.axes, groups=made.groups, poses=made.poses)


def test_a_robot_by_its_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with machine(arm="1-6", can="0x25,0x26", lift=True) as (made, _):
        (tmp_path / "motorbus.toml").write_text(made.text(), encoding="utf-8")
        with Robot.load(tmp_path / "motorbus.toml") as robot:
            assert list(robot.axes) == list(made.axes)
            assert robot.machine == made
            assert robot.simulated
            assert robot["a1"].name == "a1"
        monkeypatch.chdir(tmp_path)
        with Robot.load(axes="can") as robot:
            assert list(robot.axes) == ["c1", "c2"]


def test_a_bad_file_opens_nothing(tmp_path: Path) -> None:
    file = tmp_path / "motorbus.toml"
    with pytest.raises(RequestError, match="cannot be read"):
        Robot.load(file)
    file.write_text("format = 1\n[bus.arm]\naddress = 3\n", encoding="utf-8")
    with pytest.raises(RequestError, match="bus.arm.address"):
        AsyncRobot.load(file)


def test_when_one_bus_cannot_be_opened_the_others_are_closed() -> None:
    with machine(arm="1", can="0x25", lift=True) as (made, _):
        with pytest.raises(PortNotFound, match=r"bus\.stage"):
            Robot.of(broken(made, "stage", "stepper:sim:nobody"))
        with Robot.of(made) as robot:
            assert len(robot.buses) == 3


def test_when_a_device_is_silent_all_buses_are_closed() -> None:
    with machine(arm="1-2", can="0x25") as (made, sims):
        sims["can"][0x25].unplug()
        with pytest.raises(NoReply, match="c1: can#0x25 does not answer"):
            Robot.of(made)
        sims["can"][0x25].plug()
        with Robot.of(made) as robot:
            assert len(robot.axes) == 3


def test_a_name_stands_for_one_axis() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made, "a1") as robot:
        with pytest.raises(RequestError, match="'a2' is not open"):
            robot["a2"]
        with pytest.raises(RequestError, match="'upper' is not open|not open"):
            robot["upper"]
        with pytest.raises(RequestError, match="'elbow'"):
            robot["elbow"]


def test_events_of_every_bus_reach_the_listener() -> None:
    events: list[object] = []
    with machine(arm="1", lift=True) as (made, _), Robot.of(made, report=events.append) as robot:
        robot["lift"].move_by(0.001)
        assert any(isinstance(event, Progress) and "estimated" in event.what for event in events)
        events.clear()
        robot["a1"].move(0.2)
        assert any(isinstance(event, Progress) for event in events)


def test_a_change_that_was_cut_off_is_a_warning() -> None:
    with machine(arm="1", can="0x25") as (made, sims):
        with motorbus.open(sims["arm"].url) as bus:
            assert bus.journal is not None
            bus.journal(JournalEntry("set_id", INTENT, {"node": 1, "to": 5}))
        with Robot.of(made) as robot:
            (warning,) = robot.warnings
            assert warning.startswith("arm: ")
            assert warning.removeprefix("arm: ") in robot.buses["arm"].warnings


def test_an_async_robot_is_opened_when_it_is_entered() -> None:
    async def main() -> None:
        with machine(arm="1-2", can="0x25") as (made, _):
            robot = AsyncRobot.of(made, ["a1", "c1"])
            assert dict(robot.axes) == {}
            with pytest.raises(RequestError, match="not open"):
                robot["a1"]
            await robot.close()
            async with robot:
                assert robot.simulated
                assert list(await robot.positions()) == ["a1", "c1"]
                assert await robot["c1"].position() == pytest.approx(0.0, abs=0.01)
            async with robot:
                assert list(robot.axes) == ["a1", "c1"], "it can be opened again"

    asyncio.run(main())


def test_an_async_robot_that_cannot_be_opened_gives_all_back() -> None:
    async def main() -> None:
        with machine(arm="1-2", can="0x25") as (made, sims):
            with pytest.raises(PortNotFound, match=r"bus\.can"):
                await AsyncRobot.of(broken(made, "can", "kst:sim:nobody")).__aenter__()
            sims["arm"][2].unplug()
            with pytest.raises(NoReply, match="a2: arm#2"):
                await AsyncRobot.of(made).__aenter__()
            sims["arm"][2].plug()
            async with AsyncRobot.of(made) as robot:
                assert len(robot.axes) == 3

    asyncio.run(main())


def test_a_robot_that_is_closed_says_so() -> None:
    with machine(arm="1-2") as (made, _):
        robot = Robot.of(made)
        robot.close()
        robot.close()
        uses: list[Callable[[], object]] = [
            robot.__enter__,
            robot.positions,
            robot.stop,
            robot.estop,
            robot.reset,
            lambda: robot["a1"],
            lambda: robot.move({"a1": 0.1}),
            lambda: robot.loop(50.0).__enter__(),
        ]
        for use in uses:
            with pytest.raises(RequestError, match="the machine is closed") as caught:
                use()
            assert "load it again" in str(caught.value)


def test_an_async_robot_that_was_not_entered_says_so() -> None:
    async def main() -> None:
        with machine(arm="1-2") as (made, sims):
            robot = AsyncRobot.of(made)
            for use in (robot.estop, robot.reset, lambda: robot["a1"]):
                with pytest.raises(RequestError, match="the machine is not open"):
                    use()
            for verb in (robot.positions, robot.stop, lambda: robot.move({"a1": 0.1})):
                with pytest.raises(RequestError, match="use `async with`"):
                    await verb()
            sims["arm"][2].unplug()
            with pytest.raises(NoReply):
                await robot.__aenter__()
            assert dict(robot.axes) == {}
            with pytest.raises(RequestError, match="not open"):
                await robot.positions()
            sims["arm"][2].plug()
            async with robot:
                assert await robot.positions()
                with pytest.raises(RequestError, match="open already"):
                    await robot.__aenter__()
                assert await robot.positions()

    asyncio.run(main())


def test_whoever_wants_to_know_is_told_how_it_was_left_while_it_can_be_asked() -> None:
    told: list[Any] = []
    error = RuntimeError("a bug")
    with machine(arm="1", exit="torque_off") as (made, sims):
        robot = Robot.of(made)
        robot.when_left = lambda leaving, ended: told.append((robot["a1"].position(), leaving.errors, ended))
        with suppress(RuntimeError), robot:
            robot.move({"a1": 0.2})
            raise error
        assert told == [(pytest.approx(0.2, abs=0.02), {}, error)]
        assert sims["arm"][1].memory["torque_enable"] == 0
        robot.close()
        assert len(told) == 1


def test_one_verb_moves_axes_of_all_families() -> None:
    ready = '[pose.ready]\na1 = "20 deg"\nc1 = "10 deg"\n'
    with machine(arm="1-2", can="0x25", lift=True, extra=ready) as (made, _):
        robot = Robot.of(made)
        with robot:
            robot["lift"].declare(0.0)
            robot.move({"a1": 0.2, "a2": -0.2, "c1": 0.1, "lift": 0.01})
            places: dict[str, Any] = robot.positions()
            assert places == {
                "a1": pytest.approx(0.2, abs=0.01),
                "a2": pytest.approx(-0.2, abs=0.01),
                "c1": pytest.approx(0.1, abs=0.01),
                "lift": pytest.approx(0.01, abs=1e-4),
            }
            robot.pose("ready")
            assert robot.positions("a1") == {"a1": pytest.approx(0.349, abs=0.01)}
