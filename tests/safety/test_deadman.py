"""Endless motion needs somebody who attends, and ends with him; a lease that is lost stops whatever moves."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from math import inf, pi
from threading import Event
from typing import Any

import pytest

from motorbus import AsyncRobot, Robot
from motorbus.core.request import Data
from motorbus.core.steps import Sleep
from motorbus.errors import Refused, RequestError
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.motion.safety.lease import Lease, Standing
from motorbus.simulation.named import Simulation
from tests.support.machines import listened, machine, said

REAL = {"arm": {"clock": "real"}, "can": {"clock": "real"}, "stage": {"clock": "real"}}


@contextmanager
def wheels(arm: str = "1-2", **how: Any) -> Iterator[tuple[Robot, dict[str, Simulation]]]:
    """A robot whose first servo is in velocity mode, with torque."""
    with machine(arm=arm, **how) as (made, sims), Robot.of(made) as robot:
        robot["a1"].device.set_mode("velocity")
        robot["a1"].device.enable_torque()
        yield robot, sims


@contextmanager
def refused() -> Iterator[list[Refused]]:
    """What the block ends with."""
    found: list[Refused] = []
    try:
        yield found
    except Refused as error:
        found.append(error)
    assert [one.reason for one in found] == ["lease"]


def turning(sims: dict[str, Simulation], node: int = 1) -> bool:
    return bool(sims["arm"][node].memory["goal_velocity"])


def passes(robot: Robot, seconds: float) -> None:
    """Nobody calls the robot for so long."""
    for bus in robot.buses.values():
        bus.run(Sleep(seconds))  # type: ignore[attr-defined]


# -- endless motion ------------------------------------------------------------------------------------------------


def test_endless_motion_is_refused_while_nobody_attends() -> None:
    with wheels(lift=True) as (robot, sims):
        sims["stage"].simulator.script("0.5 5 on")  # type: ignore[attr-defined]
        listened(sims)
        device = robot["a1"].device
        for order in (
            lambda: device.set_velocity(1.0),
            lambda: device.write(goal_velocity=1.0),
            lambda: robot.home(),
            lambda: robot["lift"].device.jog_forward(0.2),
            lambda: robot["lift"].device.jog_reverse(0.2),
        ):
            with pytest.raises(Refused, match="nobody attends") as caught:
                order()
            assert (caught.value.reason, caught.value.unmoved) == ("unattended", True)
        assert not [one for one in said(sims) if "goal_velocity" in one or "home" in one.split()]
        device.set_velocity(0.0)
        with robot.attended():
            device.set_velocity(1.0)
            assert turning(sims)


@pytest.mark.parametrize(("mode", "verb"), [("pwm", "set_duty"), ("current", "set_current")])
def test_a_duty_and_a_current_are_endless_too(mode: str, verb: str) -> None:
    model = {"arm": {"model": "hls3915"}} if mode == "current" else {}
    with machine(arm="1", options=model) as (made, _), Robot.of(made) as robot:
        device = robot["a1"].device
        device.set_mode(mode)
        device.enable_torque()
        with pytest.raises(Refused, match="nobody attends"):
            getattr(device, verb)(0.2)
        with robot.attended():
            getattr(device, verb)(0.2)


def test_it_ends_with_the_block_that_attends() -> None:
    with wheels() as (robot, sims):
        with robot.attended():
            robot["a1"].device.set_velocity(1.0)
        assert not turning(sims)
        assert robot.lease is None


@pytest.mark.parametrize("kind", [ValueError, KeyboardInterrupt])
def test_it_ends_with_the_block_also_when_that_fails(kind: type[BaseException]) -> None:
    with wheels() as (robot, sims):
        with suppress(kind), robot.attended():
            robot["a1"].device.set_velocity(1.0)
            raise kind
        assert not turning(sims)


def test_what_was_stopped_or_let_go_meanwhile_is_left_alone_at_the_end() -> None:
    with wheels() as (robot, sims), robot.attended():
        robot["a1"].device.set_velocity(1.0)
        robot["a1"].stop()
        listened(sims)
    assert not [one for one in said(sims) if "goal_velocity" in one]


def test_who_attends_is_one_at_a_time() -> None:
    with wheels() as (robot, _), robot.attended(), pytest.raises(Refused, match="this program holds"):
        robot.attended().__enter__()


# -- a lease that is lost ------------------------------------------------------------------------------------------


def test_while_beats_come_it_goes_on() -> None:
    with wheels() as (robot, sims), robot.attended(lasts=0.5) as hand:
        robot["a1"].device.set_velocity(1.0)
        for _ in range(8):
            passes(robot, 0.3)
            hand.beat()
        assert turning(sims)


def test_silence_stops_what_moves_and_nothing_moves_until_a_reset() -> None:
    with wheels() as (robot, sims):
        with refused() as caught, robot.attended(lasts=0.5) as hand:
            robot["a1"].device.set_velocity(1.0)
            passes(robot, 0.4)
            assert turning(sims)
            passes(robot, 0.2)
            assert not turning(sims)
            with pytest.raises(Refused, match="was lost"):
                hand.beat()
        assert (caught[0].reason, caught[0].unmoved) == ("lease", False)
        assert "this program was silent for more than 0.5 s" in str(caught[0])
        with pytest.raises(Refused, match="was lost"):
            robot.move({"a2": 0.1})
        robot.stop()
        robot["a2"].disable_torque()
        with pytest.raises(Refused, match="was lost"), robot.attended():
            pytest.fail("nobody can attend before the reset")
        assert robot.lease is not None
        robot.lease.reset(robot.now)
        robot.move({"a2": 0.1})
        with robot.attended():
            robot["a1"].device.set_velocity(1.0)


def test_a_movement_that_is_under_way_raises_the_reason_and_is_stopped() -> None:
    with machine(arm="1-2", can="0x25", lift=True) as (made, sims), Robot.of(made) as robot:
        robot["lift"].declare(0.0)
        for goals in ({"a1": 1.5, "c1": 0.5, "lift": 0.1}, {"a2": 1.5}, {"lift": 0.05}):
            with pytest.raises(Refused) as caught, robot.attended(lasts=0.5):
                robot.move(goals, duration=10.0)
            assert (caught.value.reason, caught.value.unmoved) == ("lease", False)
            assert not any(axis.under_way for axis in robot.axes.values())
            passes(robot, 1.0)
            assert not sims["stage"][1].status()["frequency"]
            assert robot.lease is not None
            robot.lease.reset(robot.now)
            robot["lift"].declare(0.0)


def test_the_verb_of_one_axis_raises_it_too() -> None:
    lost = pytest.raises(Refused, match="lift: the lease of this machine was lost")
    with machine(lift=True) as (made, _), Robot.of(made) as robot, lost, robot.attended(lasts=0.5):
        robot["lift"].home(deadline=20.0)


@pytest.mark.parametrize("direct", [False, True])
def test_a_loop_that_nobody_attends_any_more_raises_it_in_each_cycle(direct: bool) -> None:
    with machine(arm="1-2", can="0x25") as (made, _), Robot.of(made) as robot:
        with refused(), robot.attended(lasts=0.5), robot.loop(rate=50, direct=direct) as loop:
            for state in loop:
                for name in robot.axes:
                    loop.goal[name] = 0.2 * state.at if direct else 1.0 if name != "c1" else 0.5
        assert not any(axis.under_way for axis in robot.axes.values())


def test_every_axis_is_stopped_whatever_happens_to_some_and_the_error_tells() -> None:
    with wheels("1-4", exit="torque_off", axes={"a3": {"exit": "leave"}}) as (robot, sims):
        for name in ("a3", "a4"):
            robot[name].device.set_mode("velocity")
            robot[name].device.enable_torque()
        robot["a2"].enable_torque()
        with refused() as caught, robot.attended(lasts=0.5):
            for name in ("a1", "a3", "a4"):
                robot[name].device.set_velocity(1.0)
            sims["arm"][1].unplug()
            passes(robot, 5.0)
        assert [turning(sims, node) for node in (1, 3, 4)] == [True, False, False]
        assert not sims["arm"][2].memory["torque_enable"]
        assert sims["arm"][3].memory["torque_enable"], "leave: stopped, and nothing else"
        assert any("a1 did not accept the stop" in note for note in caught[0].__notes__)
        sims["arm"][1].plug()


def test_a_time_that_is_none_is_refused_and_changes_nothing() -> None:
    with wheels() as (robot, _):
        with pytest.raises(RequestError, match="cannot last"):
            robot.attended(lasts=-1.0).__enter__()
        assert robot.lease is None
        with pytest.raises(RequestError, match="is not attended"):
            robot.attended().beat()


# -- a lease that somebody else sets -------------------------------------------------------------------------------


def test_a_lease_that_was_set_is_needed_and_is_watched() -> None:
    with wheels() as (robot, sims):
        robot.lease = lease = Lease(0.5)
        with pytest.raises(Refused, match="nobody holds the lease"):
            robot.move({"a2": 0.1})
        with pytest.raises(RequestError, match=r"lasts 0\.5 s"):
            robot.attended(lasts=2.0).__enter__()
        with robot.attended(who="page") as hand:
            robot["a1"].device.set_velocity(1.0)
            hand.beat()
        assert lease.standing(robot.now) is Standing.FREE
        assert not turning(sims)
        lease.take("page", robot.now, attended=True)
        robot["a1"].device.set_velocity(1.0)
        passes(robot, 2.0)
        assert lease.standing(robot.now) is Standing.LOST
        assert not turning(sims)
        robot.lease = None
        robot.move({"a2": 0.1})


def test_a_lease_does_not_keep_the_machine_from_parking_unless_it_was_lost() -> None:
    for lost in (False, True):
        with machine(arm="1", exit="park", axes={"a1": {"park": "20 deg"}}) as (made, sims):
            with Robot.of(made) as robot:
                robot.lease = lease = Lease(0.5)
                lease.take("page", robot.now)
                robot["a1"].enable_torque()
                if lost:
                    passes(robot, 1.0)
            parked = abs(sims["arm"][1].raw_position - 2048 - 20 / 360 * 4096) < 20
            assert parked != lost
            assert any("not parked, for the lease" in text for text in robot.warnings) == lost


# -- where nobody pumps --------------------------------------------------------------------------------------------


def test_time_that_passed_while_nobody_looked_counts() -> None:
    with wheels() as (robot, sims):
        with refused(), robot.attended(lasts=0.5) as hand:
            robot["a1"].device.set_velocity(1.0)
            robot.buses["arm"].link.advance(5.0)  # type: ignore[attr-defined]  # as in a program that hangs
            hand.beat()
        assert not turning(sims)


def test_a_program_that_calls_nothing_is_stopped_by_a_thread() -> None:
    with machine(arm="1", options=REAL) as (made, sims), Robot.of(made) as robot:
        stopped = watched(sims)
        robot["a1"].device.set_mode("velocity")
        robot["a1"].device.enable_torque()
        with refused(), robot.attended(lasts=0.2):
            robot["a1"].device.set_velocity(1.0)
            assert stopped.wait(60), "nobody has stopped it"


def test_an_event_loop_that_hangs_is_silence() -> None:
    async def main() -> None:
        with machine(arm="1", options=REAL) as (made, sims):
            stopped = watched(sims)
            async with AsyncRobot.of(made) as robot:
                await robot["a1"].device.set_mode("velocity")
                await robot["a1"].device.enable_torque()
                with refused():
                    async with robot.attended(lasts=0.2) as hand:
                        await robot["a1"].device.set_velocity(1.0)
                        assert stopped.wait(60), "nobody has stopped it while the loop hung"
                        hand.beat()

    asyncio.run(main())


def watched(sims: dict[str, Simulation]) -> Event:
    """Set once the servo is told a velocity of 0 after another one."""
    stopped = Event()

    class Line(PerfectLine):
        turned = False

        def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
            turns = turning(sims)
            if self.turned and not turns:
                stopped.set()
            self.turned = turns
            return super().carry(sender, data, at)

    sims["arm"].line = Line()
    return stopped


def test_on_an_event_loop_it_is_the_same() -> None:
    async def main() -> None:
        with machine(arm="1-2") as (made, sims):
            async with AsyncRobot.of(made) as robot:
                device = robot["a1"].device
                await device.set_mode("velocity")
                await device.enable_torque()
                with pytest.raises(Refused, match="nobody attends"):
                    await device.set_velocity(1.0)
                async with robot.attended():
                    await device.set_velocity(1.0)
                assert not turning(sims)
                with refused() as caught:
                    async with robot.attended(lasts=0.5):
                        await device.set_velocity(1.0)
                        await robot.move({"a2": pi / 4}, duration=5.0)
                assert (caught[0].reason, turning(sims)) == ("lease", False)

    asyncio.run(main())


@pytest.mark.parametrize("lasts", ["x", True, 0.0, -1.0, inf, [1.0]])
def test_a_time_that_is_none_is_refused_at_the_call(lasts: Any) -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        with pytest.raises(RequestError, match="a lease cannot last"):
            robot.attended(lasts=lasts)
        with pytest.raises(RequestError, match="a lease cannot last"):
            AsyncRobot.of(made).attended(lasts=lasts)
        assert robot.lease is None
