"""What becomes of a whole movement: all begin or nobody does, and when something goes wrong all of them stop."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

from motorbus.core.steps import Progress
from motorbus.errors import Interrupted, LinkLost, NoReply, RequestError, Stalled
from motorbus.session.robot import AsyncRobot, Robot
from motorbus.simulation.named import Simulation
from tests.support.machines import machine

GOALS = {"a1": 1.0, "a2": -1.0, "c1": 0.6}


class Poke:
    """Does something once, when the movement has got so far (ms)."""

    def __init__(self, at: int, what: Callable[[], object]) -> None:
        self._at = at
        self._what = what
        self.done = False

    def __call__(self, event: object) -> None:
        if (
            isinstance(event, Progress)
            and event.what == "moving"
            and event.done >= self._at
            and not self.done
        ):
            self.done = True
            self._what()


def at_rest(robot: Robot) -> dict[str, float | None]:
    """Where they are, once it is shown that none of them moves any more."""
    for seconds in (0.5, 1.0):  # what was stopped decelerates
        here = robot.positions()
        for bus in robot.buses.values():
            bus.link.advance(seconds)  # type: ignore[attr-defined]
    assert robot.positions() == pytest.approx(here, abs=1e-6)
    return here


def failed(
    poke: Callable[[dict[str, Simulation]], object], error: type[Exception], **options: Any
) -> tuple[Any, Any]:
    """A movement of three axes in which something happens after 600 ms: the error, and where they are then."""
    with machine(arm="1-2", can="0x25", **options) as (made, sims):
        trigger = Poke(600, lambda: poke(sims))
        with Robot.of(made, report=trigger) as robot:
            with pytest.raises(error) as told:
                robot.move(GOALS, duration=2.0)
            assert trigger.done
            return told.value, at_rest(robot)


# -- before the start --------------------------------------------------------------------------------------------------


def test_nobody_moves_when_one_is_silent_from_the_beginning() -> None:
    with machine(arm="1-2", can="0x25") as (made, sims), Robot.of(made) as robot:
        sims["arm"][2].unplug()
        with pytest.raises(NoReply, match=r"a2 \(arm#2\) does not answer, so this movement does not begin"):
            robot.move(GOALS)
        assert robot.positions(["a1", "c1"]) == pytest.approx({"a1": 0.0, "c1": 0.0}, abs=0.002)
        assert sims["arm"][1].memory["torque_enable"] == 0
        assert not any(axis.engaged or axis.under_way for axis in robot.axes.values())


def test_an_axis_that_stands_outside_its_limits_may_come_back() -> None:
    with machine(arm="1-2", can="0x25") as (made, sims), Robot.of(made) as robot:
        sims["can"][0x25].raw_position = 700  # 70 degrees, and the machine file has 50
        moved = robot.move(GOALS, duration=2.0)
        assert moved.axes["c1"].present == pytest.approx(0.6, abs=0.002)


def test_an_axis_that_is_moved_by_hand_is_not_begun_with() -> None:
    with machine(arm="1-2", can="0x25") as (made, sims), Robot.of(made) as robot:
        receive, count = sims["arm"].simulator.receive, 0

        def turning(data: Any, at: float) -> None:
            nonlocal count
            count += 1
            sims["arm"][1].raw_position = 2048 + 20 * count
            receive(data, at)

        sims["arm"].simulator.receive = turning  # type: ignore[method-assign]
        with pytest.raises(RequestError, match="a1 is moving: it was at"):
            robot.move(GOALS)
        assert robot.positions("c1") == pytest.approx({"c1": 0.0}, abs=0.002)
        assert not robot["c1"].under_way


# -- on the way --------------------------------------------------------------------------------------------------------


def test_one_that_goes_silent_ends_it_for_all_and_they_hold_where_they_are() -> None:
    error, here = None, None
    with machine(arm="1-2", can="0x25") as (made, sims):
        trigger = Poke(600, lambda: sims["arm"][2].unplug())
        with Robot.of(made, report=trigger) as robot:
            with pytest.raises(
                NoReply, match=r"a2 \(arm#2\) has not answered for 0\.\d+ s while it was led"
            ) as told:
                robot.move(GOALS, duration=2.0)
            error = told.value
            sims["arm"][2].plug()
            robot.buses["arm"].link.advance(1.0)  # type: ignore[attr-defined]
            here = robot.positions(["a1", "c1"])
            assert not robot["a1"].under_way
            assert robot["a2"].under_way  # nobody knows: it did not accept the stop
    assert any("a2 did not accept the stop" in note for note in error.__notes__)
    assert here["a1"] is not None
    assert here["c1"] is not None
    assert 0.2 < here["a1"] < 0.6  # 1.0 rad in 2 s, ended soon after 0.6 s
    assert 0.1 < here["c1"] < 0.4


def test_one_that_is_blocked_ends_it_for_all() -> None:
    error, here = failed(lambda sims: setattr(sims["arm"][2], "blocked", (1900, 2200)), Stalled)
    assert str(error).startswith("a2 does not follow: it is at")
    assert "deg, and should be at" in str(error)
    assert here["a1"] < 0.8
    assert here["c1"] < 0.5


def test_one_that_stays_off_its_goal_at_the_end_is_told_with_goal_and_present() -> None:
    with machine(arm="1-2", can="0x25") as (made, sims), Robot.of(made) as robot:
        sims["arm"][1].blocked = (2000, 2048 + 600)  # 2048 + 652 is the goal: 4.6 degrees off
        with pytest.raises(
            Stalled, match=r"a1 is not in position: its goal is 57\.3 deg, and it stands at 52\.7 deg"
        ):
            robot.move(GOALS, duration=2.0)
        assert not robot["c1"].under_way


def test_one_that_is_slower_than_the_machine_file_says_is_told() -> None:
    with machine(arm="1", can="0x25") as (made, sims), Robot.of(made) as robot:
        sims["can"][0x25].speed = 0.1
        with pytest.raises(Stalled, match="c1 does not follow") as told:
            robot.move({"a1": 0.6, "c1": 0.6})
        assert "slower than max_velocity says" in str(told.value)


def test_an_adapter_that_is_pulled_ends_it_for_the_other_bus() -> None:
    with machine(arm="1-2", can="0x25") as (made, _):
        trigger = Poke(600, lambda: robot.buses["can"].link.unplug())  # type: ignore[attr-defined]
        with Robot.of(made, report=trigger) as robot:
            with pytest.raises(LinkLost):
                robot.move(GOALS, duration=2.0)
            robot.buses["can"].link.plug()  # type: ignore[attr-defined]
            here = at_rest(robot)
            assert here["a1"] is not None
            assert 0.1 < here["a1"] < 0.6


def test_ctrl_c_stops_all_axes_and_is_raised() -> None:
    def interrupt() -> None:
        raise KeyboardInterrupt

    with machine(arm="1-2", can="0x25") as (made, sims), Robot.of(made, report=Poke(600, interrupt)) as robot:
        with pytest.raises(KeyboardInterrupt):
            robot.move(GOALS, duration=2.0)
        here = at_rest(robot)
        assert here["a1"] is not None
        assert 0.1 < here["a1"] < 0.6
        assert sims["arm"][1].memory["torque_enable"] == 1
        assert not any(axis.under_way for axis in robot.axes.values())
        assert robot.move(GOALS).axes["a1"].present == pytest.approx(1.0, abs=0.002)


def test_a_stepper_is_stopped_when_another_part_fails_and_its_place_is_not_known_then() -> None:
    with machine(arm="1", lift=True) as (made, sims):
        trigger = Poke(1500, lambda: sims["arm"][1].unplug())
        with Robot.of(made, report=trigger) as robot:
            robot["lift"].declare(0.0)
            with pytest.raises(NoReply, match="a1"):
                robot.move({"a1": 1.0, "lift": 0.1}, duration=8.0)
            sims["arm"][1].plug()
            before = sims["stage"][1].status()["load"]
            robot.buses["stage"].link.advance(5.0)  # type: ignore[attr-defined]
            assert sims["stage"][1].status()["load"] == before
            assert robot["lift"].estimated is None
            assert "did not come to its end" in str(robot["lift"].reckoning)


# -- other orders in between -------------------------------------------------------------------------------------------


def interrupted_by(act: Callable[[AsyncRobot], Coroutine[Any, Any, object]], goals: dict[str, float]) -> Any:
    """A movement, and in the middle of it another task: the error, where they are then, and the robot's axes."""

    async def both() -> Any:
        events: list[Any] = []
        with machine(arm="1-2", can="0x25") as (made, sims):
            async with AsyncRobot.of(made, report=events.append) as robot:

                async def later() -> None:
                    while not any(getattr(event, "done", 0) > 600 for event in events):
                        await asyncio.sleep(0)
                    await act(robot)

                movement = asyncio.create_task(robot.move(goals, duration=2.0))
                await later()
                with pytest.raises((Interrupted, asyncio.CancelledError)) as told:
                    await movement
                for seconds in (0.5, 1.0):
                    here = await robot.positions()
                    for bus in robot.buses.values():
                        bus.link.advance(seconds)  # type: ignore[attr-defined]
                assert await robot.positions() == pytest.approx(here, abs=1e-6)
                return told.value, here, {id: sims["arm"][id].memory["torque_enable"] for id in (1, 2)}

    return asyncio.run(asyncio.wait_for(both(), 60))


async def _stop(robot: AsyncRobot) -> None:
    await robot["a2"].stop()


async def _limp(robot: AsyncRobot) -> None:
    await robot["a2"].disable_torque()


async def _hold(robot: AsyncRobot) -> None:
    await robot["c1"].hold()


async def _emergency(robot: AsyncRobot) -> None:
    robot.estop()
    robot.reset()  # the latch is gone before the next goal would leave


@pytest.mark.parametrize(("act", "whose"), [(_stop, "a2"), (_limp, "a2"), (_hold, "c1")])
def test_an_order_from_elsewhere_ends_the_movement_and_is_not_overridden(act: Any, whose: str) -> None:
    error, here, torque = interrupted_by(act, GOALS)
    assert f"{whose}: the movement was ended by another order" in str(error)
    assert 0.1 < here["a1"] < 0.6
    assert 0.1 < here["c1"] < 0.4
    assert torque == {1: 1, 2: 0 if act is _limp else 1}


def test_an_emergency_stop_ends_it_also_when_it_was_reset_at_once() -> None:
    error, here, torque = interrupted_by(_emergency, GOALS)
    assert isinstance(error, Interrupted)
    assert here["a1"] < 0.6
    assert torque == {1: 0, 2: 0}  # limp, and nobody gave it torque again


def test_a_task_that_is_cancelled_stops_all_axes() -> None:
    async def cancel(robot: AsyncRobot) -> None:
        for task in asyncio.all_tasks():
            if "move" in repr(task.get_coro()) or "run" in repr(task.get_coro()):
                task.cancel()

    error, here, torque = interrupted_by(cancel, GOALS)
    assert isinstance(error, asyncio.CancelledError)
    assert here["a1"] < 0.6
    assert torque == {1: 1, 2: 1}


def test_blocking_and_async_robots_move_by_the_same_words() -> None:
    async def run() -> Any:
        with machine(arm="1-2", can="0x25") as (made, _):
            async with AsyncRobot.of(made) as robot:
                moved = await robot.move(GOALS)
                await robot["a1"].move(0.0)
                return moved, await robot.positions()

    moved, here = asyncio.run(asyncio.wait_for(run(), 60))
    assert here == pytest.approx({"a1": 0.0, "a2": -1.0, "c1": 0.6}, abs=0.002)
    with machine(arm="1-2", can="0x25") as (made, _), Robot.of(made) as robot:
        assert robot.move(GOALS).duration == moved.duration
