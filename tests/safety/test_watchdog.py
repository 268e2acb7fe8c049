"""A lease that is lost, the first time or the tenth, stops whatever moves; without who attends nothing goes on."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from math import pi
from threading import Event, active_count
from typing import Any

import pytest

from motorbus import Robot
from motorbus.core.request import Data
from motorbus.core.steps import Sleep
from motorbus.errors import MotorbusError, Refused
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.motion import capabilities
from motorbus.motion.safety.lease import Lease, Standing
from motorbus.session.watchdog import RETRY_PERIOD
from motorbus.simulation.named import Simulation
from tests.support.machines import listened, machine, said

REAL = {"arm": {"clock": "real"}, "can": {"clock": "real"}}


class Deaf(PerfectLine):
    """A wire that carries nothing to the servos for which `lost` is true; `node` is that of a FEETECH frame."""

    def __init__(self, lost: Callable[[int], bool]) -> None:
        self.lost = lost

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST and isinstance(data, bytes | bytearray | memoryview) and self.lost(data[2]):
            return []
        return super().carry(sender, data, at)


@contextmanager
def turned(arm: str = "1", **how: Any) -> Iterator[tuple[Robot, dict[str, Simulation], Lease]]:
    """A robot whose first servo turns, and the lease of the one who attends."""
    with machine(arm=arm, **how) as (made, sims), Robot.of(made) as robot:
        device = robot["a1"].device
        device.set_mode("velocity")
        device.enable_torque()
        robot.lease = lease = Lease(0.5)
        lease.take("page", robot.now, attended=True)
        device.set_velocity(1.0)
        assert turning(sims)
        yield robot, sims, lease


def turning(sims: dict[str, Simulation], node: int = 1) -> bool:
    return bool(sims["arm"][node].memory["goal_velocity"])


def passes(robot: Robot, seconds: float) -> None:
    """Nobody calls the robot for so long."""
    for bus in robot.buses.values():
        bus.run(Sleep(seconds))  # type: ignore[attr-defined]


# -- a loss --------------------------------------------------------------------------------------------------------


def test_a_second_loss_stops_as_the_first_did_though_that_was_reset_while_it_was_dealt_with() -> None:
    with turned("1-2") as (robot, sims, lease):
        robot["a2"].device.set_mode("velocity")
        robot["a2"].device.enable_torque()
        robot["a2"].device.set_velocity(1.0)
        deaf = sims["arm"].line = Deaf(lambda node: node == 2)
        while lease.standing(robot.now) is not Standing.LOST:
            passes(robot, 0.001)
        lease.reset(robot.now)
        lease.take("page", robot.now, attended=True)
        watchdog = robot._watchdog
        assert watchdog is not None
        assert watchdog.busy("arm"), "who is silent keeps it waiting"
        while watchdog.busy("arm"):
            passes(robot, 0.01)
            lease.beat("page", robot.now)
        deaf.lost = lambda _: False
        robot["a1"].device.set_velocity(1.0)
        passes(robot, 0.4)
        assert turning(sims)
        passes(robot, 1.0)
        assert lease.losses == 2
        assert not turning(sims)
        assert not turning(sims, 2)


def test_who_did_not_accept_the_stop_is_told_again_until_he_does_and_no_longer() -> None:
    out = [True]
    with turned("1-2") as (robot, sims, lease):
        robot["a2"].enable_torque()
        sims["arm"].line = Deaf(lambda _: out[0])
        passes(robot, 3.0)
        assert lease.standing(robot.now) is Standing.LOST
        assert robot._watchdog is not None
        assert robot._watchdog.errors.keys() == {"a1"}
        assert turning(sims)
        out[0] = False
        passes(robot, RETRY_PERIOD + 0.5)
        assert not turning(sims)
        assert not robot._watchdog.errors
        listened(sims)
        passes(robot, 10 * RETRY_PERIOD)
        assert not said(sims)


def test_it_is_told_so_at_a_bounded_rate() -> None:
    heard: list[int] = []
    with turned() as (robot, sims, _):

        def lost(node: int) -> bool:
            heard.append(node)
            return True

        deaf = sims["arm"].line = Deaf(lost)
        passes(robot, 1.0)
        first = len(heard)
        assert first
        passes(robot, 10 * RETRY_PERIOD)
        assert first < len(heard) <= 12 * first
        deaf.lost = lambda _: False


def test_a_reset_ends_the_trying() -> None:
    out = [True]
    with turned() as (robot, sims, lease):
        sims["arm"].line = Deaf(lambda _: out[0])
        passes(robot, 1.5)
        out[0] = False
        lease.reset(robot.now)
        lease.take("page", robot.now, attended=True)
        for _ in range(10):
            passes(robot, 0.3)
            lease.beat("page", robot.now)
        assert turning(sims), "somebody attends it again"


def test_what_an_emergency_stop_was_to_stop_is_stopped_once_that_is_reset_while_the_lease_is_lost() -> None:
    with turned() as (robot, sims, _):
        deaf = sims["arm"].line = Deaf(lambda _: True)
        robot.estop()
        passes(robot, 1.0)
        deaf.lost = lambda _: False
        assert turning(sims)
        robot.reset()
        passes(robot, 2 * RETRY_PERIOD)
        assert not turning(sims)


def test_a_slow_bus_delays_no_other_where_time_is_real() -> None:
    held, moved, again = Event(), Event(), Event()

    class Held(PerfectLine):
        """Takes its time for whatever comes when the first lease was lost."""

        def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
            if held.is_set() and sender is Side.HOST:
                assert again.wait(60), "the other bus was not stopped a second time"
            return super().carry(sender, data, at)

    class Watched(PerfectLine):
        stops = 0

        def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
            found = super().carry(sender, data, at)
            if sender is Side.DEVICE and moved.is_set() and not turning(sims):
                moved.clear()
                self.stops += 1
                (held if self.stops == 1 else again).set()
            return found

    with machine(arm="1", can="0x25", options=REAL) as (made, sims), Robot.of(made) as robot:
        sims["arm"].line, sims["can"].line = Watched(), Held()
        device = robot["a1"].device
        device.set_mode("velocity")
        device.enable_torque()
        robot["c1"].under_way = True
        for _ in range(2):
            robot.lease = robot.lease or Lease(3.0)
            robot.lease.reset(robot.now)
            robot.lease.take("page", robot.now, attended=True)
            device.set_velocity(1.0)
            moved.set()
            assert (again if held.is_set() else held).wait(60), "nobody has stopped it"


@pytest.mark.parametrize("options", [{}, REAL])
def test_want_of_memory_in_the_stop_of_an_axis_ends_neither_the_stop_nor_the_watch(
    options: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    stop, struck = capabilities.stop, Event()

    async def once(axis: Any) -> Any:
        if not struck.is_set():
            struck.set()
            raise MemoryError
        return await stop(axis)

    monkeypatch.setattr(capabilities, "stop", once)
    with turned(options=options) as (robot, sims, _):
        for _ in range(1000):
            with suppress(MemoryError):
                passes(robot, 0.05)
            if struck.is_set() and not turning(sims):
                break
        assert not turning(sims)
        passes(robot, 3.0)
        assert not turning(sims)


# -- without who attends -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("lasts", [0.5, None])
@pytest.mark.parametrize("how", ["attend", "take", "release"])
def test_what_goes_on_ends_with_the_attending_whoever_ends_that(how: str, lasts: float | None) -> None:
    with turned() as (robot, sims, _):
        robot.lease = lease = Lease(lasts, needed=False)
        lease.take("page", robot.now, attended=True)
        passes(robot, 0.1)
        assert turning(sims)
        if how == "attend":
            lease.attend("page", robot.now, False)
        elif how == "take":
            lease.take("page", robot.now)
        else:
            lease.release("page", robot.now)
        passes(robot, 0.1)
        assert not turning(sims)
        assert lease.standing(robot.now) is not Standing.LOST


def test_what_ends_by_itself_outlives_the_attending() -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        robot["a1"].enable_torque()
        robot.lease = lease = Lease(0.5, needed=False)
        lease.take("page", robot.now, attended=True)
        robot["a1"].device.move(pi + 0.5, velocity=1.0, wait=False)
        lease.release("page", robot.now)
        listened(sims)
        passes(robot, 2.0)
        assert not said(sims)
        assert robot["a1"].position() == pytest.approx(0.5, abs=0.01)


def test_a_stop_that_was_lost_is_said_again_while_nobody_attends() -> None:
    out = [True]
    with turned() as (robot, sims, lease):
        sims["arm"].line = Deaf(lambda _: out[0])
        lease.release("page", robot.now)
        passes(robot, 2.0)
        out[0] = False
        passes(robot, RETRY_PERIOD + 0.5)
        assert not turning(sims)


# -- what was ordered by itself ------------------------------------------------------------------------------------


def test_a_move_of_the_device_by_itself_is_stopped_too() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot:
        robot["a1"].enable_torque()
        robot.lease = lease = Lease(0.5)
        lease.take("page", robot.now)
        robot["a1"].device.move(pi + 2.0, velocity=0.3, wait=False)
        passes(robot, 1.5)
        assert lease.standing(robot.now) is Standing.LOST
        at = robot["a1"].position()
        passes(robot, 3.0)
        assert robot["a1"].position() == pytest.approx(at, abs=0.01)
        assert at < 0.5


# -- when it is over -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("real", [False, True])
def test_a_block_that_has_ended_leaves_nothing_behind(real: bool) -> None:
    with machine(arm="1", options=REAL if real else {}) as (made, _), Robot.of(made) as robot:
        threads = active_count()
        for _ in range(5):
            with robot.attended(lasts=30.0) as hand:
                hand.beat()
            assert robot.lease is None
        ends = time.monotonic() + 5.0
        while active_count() > threads + 1 and time.monotonic() < ends:  # a thread ends when it is scheduled
            passes(robot, 0.01)
        assert active_count() <= threads + 1


def test_a_lease_that_was_lost_before_it_is_set_stops_at_once() -> None:
    with turned() as (robot, sims, lease):
        with suppress(Refused):
            lease.check(robot.now + 9.0)
        robot.lease = lease
        passes(robot, 0.1)
        assert not turning(sims)


def test_what_goes_on_ends_when_the_rule_is_taken_away_too() -> None:
    with turned() as (robot, sims, _):
        robot.lease = None
        passes(robot, 0.1)
        assert not turning(sims)


def test_nothing_that_goes_wrong_ends_the_watch(caplog: pytest.LogCaptureFixture) -> None:
    with turned() as (robot, sims, _):
        deaf = sims["arm"].line = Deaf(lambda _: True)
        passes(robot, 5.0)
        assert sum("a1: the lease is lost" in text for text in caplog.messages) == 1
        deaf.lost = lambda _: False
        passes(robot, 1.0)
        assert any("a1: the axis has accepted the stop" in text for text in caplog.messages)
        with suppress(MotorbusError):
            robot["a1"].state()
