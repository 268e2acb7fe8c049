"""A movement of which one axis is stopped or let go: the others rest at once, whatever that one has to clean up."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from inspect import isawaitable
from itertools import count
from typing import Any

import pytest

from motorbus.core.request import Data
from motorbus.core.steps import Progress
from motorbus.errors import Interrupted, MotorbusError, OutcomeUnknown
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.motion.meeting import Seat
from motorbus.motion.moving.moved import Moved
from motorbus.session.robot import AsyncRobot, Robot
from motorbus.simulation.named import Simulation
from tests.support.machines import Cut, Heard, machine

GOALS = {"a1": 1.0, "c1": 0.6, "lift": 0.05}
STOPPED = 0.05
"""s within which the others must rest."""
MOVE = bytes.fromhex("FF AA 03 0C")
"""How the order begins that sets the stepper moving."""


def load(sims: dict[str, Simulation]) -> Any:
    return sims["stage"][1].status()["load"]


class Watched(Heard):
    """A wire of servos: `last` is when (s) the last packet of goals left on it."""

    last = 0.0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST and isinstance(data, bytes) and data[4] == 0x83 and data[5] == 42:
            self.last = at
        return super().carry(sender, data, at)


async def rested(robot: AsyncRobot, sims: dict[str, Simulation]) -> bool:
    """Whether nobody moves any more, once the servos had a moment to come to rest."""
    robot.buses["arm"].link.advance(0.1)  # type: ignore[attr-defined]
    here = (sims["arm"][1].raw_position, load(sims))
    for bus in robot.buses.values():
        bus.link.advance(1.0)  # type: ignore[attr-defined]
    return here == (sims["arm"][1].raw_position, load(sims))


def ended_by(act: Callable[[AsyncRobot], object]) -> tuple[Any, float]:
    """A movement of 8 s in which something befalls the lift after 3 s: the error, how long (s) a1 is led after it."""

    async def both() -> tuple[Any, float]:
        events: list[Any] = []
        with machine(arm="1", can="0x25", lift=True, exit="leave") as (made, sims):
            sims["arm"].line = wire = Watched()
            async with AsyncRobot.of(made, report=events.append) as robot:
                robot["lift"].declare(0.0)
                movement = asyncio.create_task(robot.move(GOALS, duration=8.0))
                while not any(isinstance(one, Progress) and one.done > 3000 for one in events):
                    assert not movement.done()
                    await asyncio.sleep(0)
                now = robot.buses["arm"].link.now()
                if isawaitable(told := act(robot)):
                    await told
                with pytest.raises(MotorbusError) as raised:
                    await movement
                assert await rested(robot, sims)
                return raised.value, wire.last - now

    return asyncio.run(asyncio.wait_for(both(), 60))


@pytest.mark.parametrize(
    "act",
    [
        lambda robot: robot["lift"].stop(),
        lambda robot: robot.stop("lift"),
        lambda robot: robot.buses["stage"].estop(),
        lambda robot: robot.buses["stage"].link.unplug(),
    ],
)
def test_when_the_stepper_is_stopped_midway_the_servos_rest_at_once(act: Any) -> None:
    """Giving project 1 back takes it seconds, and they do not wait for that."""
    error, since = ended_by(act)
    assert since < STOPPED
    assert error.summary.startswith("lift: ")


class Lost(PerfectLine):
    """A line on which the order that sets the stepper moving is lost."""

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        lost = sender is Side.HOST and isinstance(data, bytes) and data.startswith(MOVE)
        return [] if lost else super().carry(sender, data, at)


def test_when_the_order_to_begin_is_lost_the_servos_do_not_go_on_alone() -> None:
    with machine(arm="1", lift=True) as (made, sims), Robot.of(made) as robot:
        robot["lift"].declare(0.0)
        sims["stage"].line = Lost()
        with pytest.raises(OutcomeUnknown, match="^lift: "):
            robot.move({"a1": 1.0, "lift": 0.05}, duration=8.0)
        assert load(sims) == 0
        assert abs(sims["arm"][1].raw_position - 2048) < 30  # 0.3 s of 8


@pytest.mark.parametrize("whose", ["a1", "lift"])
def test_a_stop_between_all_being_ready_and_the_moment_keeps_everybody_where_he_is(
    whose: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    ready: list[object] = []
    start = Seat.start

    async def noted(self: Seat, lead: float, *meanwhile: Any) -> Any:
        ready.append(self)
        return await start(self, lead, *meanwhile)

    monkeypatch.setattr(Seat, "start", noted)

    async def both() -> None:
        with machine(arm="1", lift=True, exit="leave") as (made, sims):
            async with AsyncRobot.of(made) as robot:
                robot["lift"].declare(0.0)
                movement = asyncio.create_task(robot.move({"a1": 0.5, "lift": 0.01}))
                while len(ready) < 2:
                    await asyncio.sleep(0)
                await robot[whose].stop()
                with pytest.raises(Interrupted):
                    await movement
                assert await rested(robot, sims)
                assert abs(sims["arm"][1].raw_position - 2048) < 5
                assert (load(sims), robot["lift"].estimated) == (0, 0.0)
                assert not any(axis.under_way for axis in robot.axes.values())

    asyncio.run(asyncio.wait_for(both(), 60))


@pytest.mark.parametrize("steps", [2, 5, 10, 20, 40, 80])
def test_a_stepper_that_is_stopped_while_the_others_get_ready_ends_it_and_nobody_waits_for_ever(
    steps: int,
) -> None:
    async def both() -> None:
        with machine(arm="1-2", lift=True) as (made, sims):
            async with AsyncRobot.of(made) as robot:
                robot["lift"].declare(0.0)
                movement = asyncio.create_task(robot.move({"a1": 0.5, "lift": 0.02}, duration=4.0))
                for _ in range(steps):
                    await asyncio.sleep(0)
                await robot["lift"].stop()
                with pytest.raises(Interrupted, match="lift"):
                    await movement
                assert abs(sims["arm"][1].raw_position - 2048) < 5

    asyncio.run(asyncio.wait_for(both(), 60))


def test_ctrl_c_at_every_frame_of_the_stepper_leaves_it_stopped_and_ready_for_the_next() -> None:
    for number in count(1):
        with machine(arm="1", lift=True, exit="leave") as (made, sims), Robot.of(made) as robot:
            robot["lift"].declare(0.0)
            sims["stage"].line = cut = Cut(number)
            try:
                robot.move({"a1": 0.1, "lift": 0.002})
                break
            except KeyboardInterrupt:
                assert not cut.numbers
            sims["stage"].line = Heard()
            assert not any(axis.under_way for axis in robot.axes.values()), number
            robot["lift"].declare(0.0)
            robot.move({"a1": 0.2, "lift": 0.001})
    assert number > 15


# -- limp is limp ------------------------------------------------------------------------------------------------------


async def _limp(robot: AsyncRobot) -> None:
    await robot["a2"].disable_torque()


async def _emergency(robot: AsyncRobot) -> None:
    robot.estop()
    robot.reset()


@pytest.mark.parametrize(("act", "limp"), [(_limp, [2]), (_emergency, [1, 2, 3])])
def test_who_is_let_go_in_the_beginning_of_a_movement_is_limp_afterwards(act: Any, limp: list[int]) -> None:
    """At every frame from the first one on that says where they stand to the last before they move."""

    async def at(number: int) -> bool:
        with machine(arm="1-3", axes={"a2": {"torque": 0.5}}, exit="leave") as (made, sims):
            async with AsyncRobot.of(made) as robot:
                sims["arm"].line = heard = Heard()
                movement = asyncio.create_task(robot.move({"a1": 0.05, "a2": 0.05, "a3": 0.05}))
                while len(heard.sent) < number and not movement.done():
                    await asyncio.sleep(0)
                if movement.done():
                    assert isinstance(await movement, Moved)
                    return False
                await act(robot)
                (told,) = await asyncio.gather(movement, return_exceptions=True)
                assert isinstance(told, Interrupted | Moved), (number, told)
                torque = {id: sims["arm"][id].memory["torque_enable"] for id in limp}
                assert torque == dict.fromkeys(limp, 0), number
                return isinstance(told, Interrupted)  # at the very end it is too late to interrupt it

    async def all_of_them() -> int:
        for number in count(1):
            if not await at(number):
                return number
        return 0

    assert asyncio.run(asyncio.wait_for(all_of_them(), 100)) > 30
