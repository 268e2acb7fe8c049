"""How a machine is left: each axis as its file says, everyone visited, nothing sent to what rests where it shall."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from motorbus import AsyncRobot, LinkLost, MotorbusError, NotHomed, Robot
from motorbus.core.steps import Sleep, catch, gather
from motorbus.motion.leaving import Leaving, given_up, goes_on
from motorbus.motion.machine import Machine
from motorbus.motion.moving import verbs as moving
from motorbus.motion.parallel import Parallel
from tests.support.machines import Cut, listened, machine, said

PARKED = {"exit": "park", "park": "10 deg"}
LIMP = {"exit": "torque_off"}


def torque(sims: Any, node: int) -> int:
    found: int = sims["arm"][node].memory["torque_enable"]
    return found


def test_what_was_only_read_is_left_alone() -> None:
    with machine(arm="1-2", can="0x25", lift=True, axes={"a1": PARKED, "a2": LIMP}) as (made, sims):
        with Robot.of(made) as robot:
            robot.positions()
            listened(sims)
        assert said(sims) == []


def test_hold_sends_nothing_to_an_axis_that_rests_at_its_goal() -> None:
    with machine(arm="1-2", can="0x25", lift=True) as (made, sims):
        with Robot.of(made) as robot:
            robot["lift"].declare(0.0)
            robot.move({"a1": 0.1, "a2": -0.1, "c1": 0.1, "lift": 0.01})
            listened(sims)
        assert said(sims) == []
        assert torque(sims, 1) == 1


def test_each_axis_is_left_as_its_file_says() -> None:
    axes = {"a1": LIMP, "a2": PARKED, "a4": {"exit": "leave"}, "lift": {"exit": "park", "park": "3 mm"}}
    with machine(arm="1-4", lift=True, axes=axes) as (made, sims):
        with Robot.of(made) as robot:
            robot["lift"].declare(0.0)
            robot.enable_torque()
            robot.move({"a1": 0.3, "a2": 0.3, "a3": 0.3, "a4": 0.3})
            robot["lift"].move_by(0.001)
        assert [torque(sims, node) for node in range(1, 5)] == [0, 1, 1, 1]
        with Robot.of(made) as robot:
            places = robot.positions("arm")
            assert places["a2"] == pytest.approx(0.1745, abs=0.01)
            assert places["a3"] == pytest.approx(0.3, abs=0.01)
            assert places["a4"] == pytest.approx(0.3, abs=0.01)
        assert float(str(sims["stage"][1].status()["load"])) == pytest.approx(0.003 / 0.005 * 1600, rel=0.5)


def _failing(made: Machine, error: BaseException, dead: Any = None) -> None:
    """A program that ends by an error, after which a device is dead."""
    with Robot.of(made) as robot:
        robot.enable_torque()
        if dead is not None:
            dead.unplug()
        raise error


@pytest.mark.parametrize("kind", [ValueError, KeyboardInterrupt, SystemExit])
def test_an_exception_leaves_it_in_the_same_way_and_is_what_is_raised(kind: type[BaseException]) -> None:
    with machine(arm="1", exit="torque_off") as (made, sims):
        with pytest.raises(kind):
            _failing(made, kind())
        assert torque(sims, 1) == 0


def test_what_moves_is_stopped_first() -> None:
    with machine(arm="1-2", axes={"a2": LIMP}) as (made, sims):
        with Robot.of(made) as robot:
            robot.enable_torque()
            for name in ("a1", "a2"):
                robot[name].departs()
                robot[name].device.move(4.0, velocity=0.5, wait=False)
            listened(sims)
        titles = [one for one in said(sims) if "WRITE" in one]
        limp = next(
            number for number, one in enumerate(titles) if "servo 2" in one and _is_last(titles, number)
        )
        assert any("servo 1" in one for one in titles[:limp]), titles
        assert torque(sims, 2) == 0
        assert torque(sims, 1) == 1
        with Robot.of(made) as robot:
            before = robot["a1"].position()
            robot["a1"].bus.run(_wait(1.0))
            assert robot["a1"].position() == pytest.approx(before, abs=0.01), "it has stopped"


def _is_last(titles: list[str], number: int) -> bool:
    return not any("servo 2" in one for one in titles[number + 1 :])


async def _wait(seconds: float) -> None:
    await Sleep(seconds)


def test_everyone_is_visited_though_some_are_dead() -> None:
    with machine(arm="1-4", can="0x25", exit="torque_off", axes={"c1": {"exit": "hold"}}) as (made, sims):
        robot = Robot.of(made)
        robot.enable_torque()
        for axis in robot.axes.values():
            axis.departs()
        sims["arm"][1].unplug()
        sims["arm"][3].unplug()
        sims["can"][0x25].unplug()
        with pytest.raises(MotorbusError) as caught:
            robot.close()
        assert [torque(sims, node) for node in (2, 4)] == [0, 0]
        told = "\n".join([str(caught.value), *caught.value.__notes__])
        assert all(name in told for name in ("a1", "a3", "c1"))
        for bus, node in (("arm", 1), ("arm", 3), ("can", 0x25)):
            sims[bus][node].plug()
        with Robot.of(made):
            pass  # and every port was given back


def test_what_leaving_did_not_achieve_is_a_note_of_what_is_raised_already() -> None:
    with machine(arm="1-2", exit="torque_off") as (made, sims):
        with pytest.raises(ValueError, match="mine") as caught:
            _failing(made, ValueError("mine"), sims["arm"][1])
        assert any("leaving failed: a1" in note for note in caught.value.__notes__)
        assert torque(sims, 2) == 0


def test_one_that_lost_its_power_is_let_go_all_the_same() -> None:
    with machine(arm="1-2", exit="torque_off") as (made, sims):
        with Robot.of(made) as robot:
            robot.enable_torque()
            sims["arm"][2].power_cycle()
        assert [torque(sims, node) for node in (1, 2)] == [0, 0]


def test_an_interruption_while_leaving_skips_no_stop_and_no_torque_off() -> None:
    for number in range(1, 12):
        with machine(arm="1-3", exit="torque_off") as (made, sims):
            robot = Robot.of(made)
            robot.enable_torque()
            for axis in robot.axes.values():
                axis.departs()
            sims["arm"].line = Cut(number, number + 1, number + 3)
            with pytest.raises(KeyboardInterrupt):
                robot.close()
            assert [torque(sims, node) for node in (1, 2, 3)] == [0, 0, 0], number


def test_an_interruption_takes_the_parking_away_and_says_so() -> None:
    with machine(arm="1-2", exit="park", park="100 deg", axes={"a2": LIMP}) as (made, sims):
        robot = Robot.of(made)
        robot.enable_torque()
        sims["arm"].line = Cut(60)
        with pytest.raises(KeyboardInterrupt) as caught:
            robot.close()
        assert any("a1: not parked" in note for note in caught.value.__notes__)
        assert any("a1: not parked" in text for text in robot.warnings)
        assert torque(sims, 2) == 0
        with Robot.of(made) as robot:
            here = robot["a1"].position()
            assert here < 1.5, "it was under way to its place"
            robot["a1"].bus.run(_wait(2.0))
            assert robot["a1"].position() == pytest.approx(here, abs=0.01), "and was stopped"


def test_after_an_emergency_stop_nothing_is_sent_that_would_be_refused(
    caplog: pytest.LogCaptureFixture,
) -> None:
    axes = {"a1": LIMP, "a2": PARKED}
    with machine(arm="1-3", can="0x25", axes=axes) as (made, sims):
        with Robot.of(made) as robot:
            robot.enable_torque()
            for axis in robot.axes.values():
                axis.departs()
            robot.estop()
            listened(sims)
        titles = said(sims)
        assert not any("position" in title for title in titles), "nobody was told to hold or to park"
        assert any("servo 1" in title for title in titles), "torque off goes through"
        assert any("emergency stop is still in force" in text for text in robot.warnings)
        assert any(text.startswith("a2: not parked") for text in robot.warnings)
        assert "a2: not parked" in caplog.text


def test_what_nobody_knows_is_not_parked_and_the_others_are() -> None:
    axes = {"lift": {"exit": "park", "park": "3 mm"}, "a1": PARKED}
    with machine(arm="1", lift=True, axes=axes) as (made, _):
        robot = Robot.of(made)
        robot.enable_torque()
        robot["lift"].move_by(0.001)
        with pytest.raises(NotHomed, match="lift: where it is is not known"):
            robot.close()
        with Robot.of(made) as robot:
            assert robot["a1"].position() == pytest.approx(0.1745, abs=0.01)


def test_what_cannot_park_together_parks_alone() -> None:
    with machine(arm="1-3", exit="park", park="10 deg") as (made, sims):
        robot = Robot.of(made)
        robot.enable_torque()
        sims["arm"][2].unplug()
        with pytest.raises(MotorbusError, match="a2"):
            robot.close()
        sims["arm"][2].plug()
        with Robot.of(made) as robot:
            places = robot.positions()
        assert places["a1"] == pytest.approx(0.1745, abs=0.01)
        assert places["a3"] == pytest.approx(0.1745, abs=0.01)
        assert places["a2"] == pytest.approx(0.0, abs=0.01)


def test_closing_twice_leaves_once() -> None:
    with machine(arm="1", exit="torque_off") as (made, sims):
        with Robot.of(made) as robot:
            robot.enable_torque()
            robot.close()
            assert torque(sims, 1) == 0
            listened(sims)
        assert said(sims) == []


def test_a_step_is_not_begun_for_ever() -> None:
    with machine(arm="1", exit="torque_off") as (made, _), Robot.of(made) as robot:
        robot["a1"].engaged = True
        leaving = Leaving(robot)
        begun = 0
        while (work := leaving.work()) is not None:
            begun += 1
            for operation in work.operations.values():
                operation.close()  # type: ignore[union-attr]
        assert begun == 3
        robot["a1"].engaged = False


def test_a_movement_that_was_cut_was_stopped_and_is_left_so() -> None:
    with machine(arm="1-2", can="0x25") as (made, sims):
        sims["arm"].line = Cut(200)
        with pytest.raises(KeyboardInterrupt), Robot.of(made) as robot:
            robot.move({"a1": 1.5, "a2": -1.5, "c1": 0.8})
        with Robot.of(made) as robot:
            here = robot.positions()
            assert abs(here["a1"] or 0.0) < 1.4, "it was under way"
            robot.conductor.run(Parallel({"arm": _wait(1.0), "can": _wait(1.0)}, dict))
            assert robot.positions() == {name: pytest.approx(place, abs=0.01) for name, place in here.items()}


def test_a_cancelled_task_leaves_it_too() -> None:
    async def main() -> None:
        with machine(arm="1-2", exit="torque_off") as (made, sims):

            async def work() -> None:
                async with AsyncRobot.of(made) as robot:
                    await robot.enable_torque()
                    begun.set()
                    await robot.move({"a1": 2.0, "a2": -2.0})

            begun = asyncio.Event()
            task = asyncio.create_task(work())
            await begun.wait()
            for _ in range(50):
                await asyncio.sleep(0)
            assert torque(sims, 1) == 1
            task.cancel()
            for _ in range(3):
                await asyncio.sleep(0)
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task
            assert [torque(sims, node) for node in (1, 2)] == [0, 0]

    asyncio.run(main())


def test_async_parks_and_tells_what_failed() -> None:
    async def main() -> None:
        with machine(arm="1-2", exit="park", park="10 deg") as (made, sims):
            async with AsyncRobot.of(made) as robot:
                await robot.enable_torque()
            with Robot.of(made, "a1") as again:
                assert again["a1"].position() == pytest.approx(0.1745, abs=0.01)
            robot = await AsyncRobot.of(made).__aenter__()
            await robot.enable_torque()
            sims["arm"][2].unplug()
            with pytest.raises(MotorbusError, match="a2"):
                await robot.close()

    asyncio.run(main())


def test_a_stop_of_others_in_a_movement_needs_no_more_when_it_is_left() -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:

        async def both() -> list[object]:
            told = await gather(catch(moving.move_axis(robot["a1"], 1.0)), catch(_stopped_after(robot, 0.3)))
            return list(told)

        told: list[object] = robot.conductor.run(Parallel({"arm": both()}, lambda found: found["arm"]))
        assert isinstance(told[0], MotorbusError)
        listened(sims)
        robot.close()
        assert said(sims) == []


async def _stopped_after(robot: Robot, seconds: float) -> object:
    from motorbus.motion.capabilities import stop

    await Sleep(seconds)
    return await stop(robot["a1"])


def test_a_bus_that_is_gone_keeps_no_other_from_being_left() -> None:
    with machine(arm="1-2", can="0x25", axes={"a1": LIMP, "a2": LIMP}) as (made, sims):
        robot = Robot.of(made)
        robot.enable_torque()
        robot["c1"].departs()
        robot["c1"].bus.link.unplug()
        with pytest.raises(LinkLost, match="^c1: "):
            robot.close()
        assert [torque(sims, node) for node in (1, 2)] == [0, 0]
        with Robot.of(made) as robot:
            assert len(robot.axes) == 3


# -- without its holder ----------------------------------------------------------------------------------------------


def test_given_up_is_stopped_whatever_the_file_says_and_nothing_is_parked() -> None:
    axes = {"a1": LIMP, "a2": PARKED, "a3": {"exit": "leave"}, "a4": LIMP}
    with machine(arm="1-4", axes=axes) as (made, sims), Robot.of(made) as robot:
        robot.enable_torque(["a1", "a2", "a3"])
        robot["a3"].device.set_mode("velocity")
        robot["a3"].device.enable_torque()
        with robot.attended():
            robot["a3"].device.set_velocity(1.0)
            assert goes_on(robot["a3"])
            robot["a2"].under_way = True
            sims["arm"][1].unplug()
            errors = robot.buses["arm"].run(given_up(robot.axes.values()))  # type: ignore[attr-defined]
            assert list(errors) == ["a1"]
            assert not goes_on(robot["a3"])
        assert [torque(sims, node) for node in (2, 3, 4)] == [1, 1, 0]
        assert not sims["arm"][3].memory["goal_velocity"]
        assert not robot["a2"].under_way
        assert abs(sims["arm"][2].raw_position - 2048) < 5
        sims["arm"][1].plug()


def test_given_up_after_an_emergency_stop_is_nothing_to_do() -> None:
    with machine(arm="1", axes={"a1": LIMP}) as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()
        robot.estop()
        listened(sims)
        assert robot.buses["arm"].run(given_up(robot.axes.values())) == {}  # type: ignore[attr-defined]
        assert said(sims) == []
        robot.reset()


def test_what_goes_on_without_an_end_is_stopped_when_it_is_left() -> None:
    for how, turns in (("hold", False), ("leave", True)):
        with machine(arm="1", exit=how) as (made, sims):
            with Robot.of(made) as robot:
                robot["a1"].device.set_mode("velocity")
                robot["a1"].device.enable_torque()
                robot.buses["arm"].interlock.attended = False  # type: ignore[union-attr]  # as if nobody had to attend
                robot["a1"].device.set_velocity(1.0)
            assert bool(sims["arm"][1].memory["goal_velocity"]) == turns
