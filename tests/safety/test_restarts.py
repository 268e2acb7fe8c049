"""A device that restarts in mid-motion: at fault within two looks at how it fares, and no torque by itself."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from motorbus.core.can_frame import CanFrame
from motorbus.core.family import Health, State
from motorbus.core.request import Data
from motorbus.errors import Faulted, Refused, RequestError
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.motion.safety import restarts
from motorbus.motion.safety.restarts import HEALTH, LET_GO, RESTART, FaultNoted, RestartDetector
from motorbus.session.robot import AsyncRobot, Robot
from tests.safety.decoders import READ, REG_WRITE, SYNC_WRITE, WRITE
from tests.support.machines import machine

GOALS = {"a1": 0.6, "a2": -0.6, "a3": 0.6}


class At(PerfectLine):
    """A wire that keeps what the host sent, with when, and at a moment lets something happen."""

    def __init__(self, moment: float, happens: Callable[[], object]) -> None:
        self.sent: list[tuple[float, Data]] = []
        self.moment = moment
        self._happens: Callable[[], object] | None = happens

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST:
            self.sent.append((at, data))
            happens = self._happens
            if happens is not None and at >= self.moment:
                self._happens = None
                happens()
        return super().carry(sender, data, at)


class Drops(PerfectLine):
    """A wire on which something happens just before a servo is asked how it fares: a READ of 31 bytes from 40 on."""

    def __init__(self, happens: Callable[[], object]) -> None:
        self._happens = happens

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST and isinstance(data, bytes) and data[4:7] == bytes((READ, 40, 31)):
            self._happens()
        return super().carry(sender, data, at)


def sample(torque: bool | None = True, blank: bool | None = False, **rest: Any) -> Health:
    restarts = rest.pop("restarts", None)
    return Health(State(1.0, **rest), torque, blank, restarts)


# -- the detector alone --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("found", "reason"),
    [
        (sample(), ""),
        (sample(torque=None, blank=None), ""),
        (sample(torque=False), LET_GO),
        (sample(torque=False, blank=True), RESTART),
        (sample(torque=False, blank=None), RESTART),
        (sample(torque=False, blank=True, alarm=("overload",)), LET_GO),
        (sample(torque=False, blank=True, alarm=("voltage",)), RESTART),
        (sample(alarm=("overload", "temperature")), ""),
    ],
)
def test_torque_that_is_gone_is_a_fault_and_an_alarm_is_none(found: Health, reason: str) -> None:
    assert RestartDetector().take(found, armed=True, led=True) == reason


def test_who_was_given_no_torque_may_be_limp() -> None:
    assert RestartDetector().take(sample(torque=False, blank=True), armed=False, led=False) == ""


def test_torque_that_came_back_by_itself_hides_no_restart_from_who_leads_it() -> None:
    detector = RestartDetector()
    detector.arm()
    assert detector.take(sample(), armed=True, led=True) == ""
    assert detector.take(sample(blank=True), armed=True, led=True) == RESTART
    detector.arm()
    assert (
        detector.take(sample(blank=True), armed=True, led=True) == ""
    )  # nothing was told to it that could be lost
    detector.arm()
    assert detector.take(sample(), armed=True, led=False) == ""
    assert detector.take(sample(blank=True), armed=True, led=False) == ""  # others may tell it how fast to be


def test_a_device_that_says_that_it_starts_has_restarted() -> None:
    detector = RestartDetector()
    for count, reason in ((2, ""), (2, ""), (3, RESTART), (3, "")):
        assert detector.take(sample(torque=None, blank=None, restarts=count), armed=True, led=True) == reason


def test_a_stop_since_it_got_torque_makes_torque_no_news() -> None:
    detector = RestartDetector()
    assert not detector.is_armed(0)
    detector.prepare(4)
    assert not detector.is_armed(4)
    detector.arm()
    assert detector.is_armed(4)
    assert not detector.is_armed(5)
    detector.disarm()
    assert not detector.is_armed(4)


# -- in mid-motion -----------------------------------------------------------------------------------------------------


def moving_or_giving_torque(data: Data, node: int) -> bool:
    """Whether this frame gives an STS servo torque, or moves it: any WRITE to registers 40 to 48 but torque off."""
    assert isinstance(data, bytes)
    to, instruction, rest = data[2], data[4], data[5:-1]
    if instruction == SYNC_WRITE:
        size = rest[1]
        items = [rest[start : start + size + 1] for start in range(2, len(rest), size + 1)]
        writes = [item[1:] for item in items if item[0] == node]
    else:
        writes = [rest[1:]] if instruction in (WRITE, REG_WRITE) and to in (node, 254) else []
    return any(40 <= rest[0] <= 48 and not (rest[0] == 40 and one == b"\0") for one in writes)


def test_d3_a_servo_that_restarts_in_mid_motion_is_at_fault_within_two_looks_and_gets_no_torque() -> None:
    noted: list[object] = []
    with machine(arm="1-3") as (made, sims), Robot.of(made, report=noted.append) as robot:
        sim, bus = sims["arm"], robot.buses["arm"]
        line = sim.line = At(bus.link.now() + 0.7, sim[2].power_cycle)
        with pytest.raises(Faulted, match="a2 is at fault: arm#2 has restarted, and its supply is") as told:
            robot.move(GOALS, duration=2.0)
        seen = bus.link.now()
        assert told.value.reason == "restart"
        assert told.value.node == 2
        assert "clear_fault" in told.value.advice
        assert seen - line.moment < 2 * HEALTH
        assert robot.faults == {"a2": restarts.why(robot["a2"])}
        assert FaultNoted("a2", robot.faults["a2"]) in noted
        assert not robot["a2"].engaged
        assert robot["a2"].track.sample is None
        assert robot["a1"].engaged  # it was stopped, and holds
        for one in (
            lambda: robot.move({"a2": 0.1}),
            lambda: robot.enable_torque("a2"),
            lambda: robot.hold("a2"),
        ):
            with pytest.raises(Refused, match="a2 is at fault") as refused:
                one()
            assert refused.value.reason == "fault"
        with pytest.raises(Refused, match="node 2 is at fault"):  # and whatever way round the axis it is told
            robot["a2"].device.move(3.2)
        before = len(line.sent)
        robot.positions()
        assert robot["a2"].stop() is not None
        robot["a2"].disable_torque()
        assert len(line.sent) > before
        robot.clear_fault("a2")
        assert robot.faults == {}
        robot.move({"a2": 0.1})
        assert robot["a2"].position() == pytest.approx(0.1, abs=0.01)


def test_nothing_that_moves_it_or_gives_it_torque_leaves_after_the_fault_was_seen() -> None:
    noted: list[float] = []
    with machine(arm="1-3", exit="torque_off") as (made, sims):
        sim = sims["arm"]

        def report(event: object) -> None:
            if isinstance(event, FaultNoted):
                noted.append(robot.buses["arm"].link.now())

        with Robot.of(made, report=report) as robot:
            line = sim.line = At(robot.buses["arm"].link.now() + 0.9, sim[1].power_cycle)
            with pytest.raises(Faulted):
                robot.move(GOALS, duration=2.0)
        (seen,) = noted
        late = [data for at, data in line.sent if at > seen and moving_or_giving_torque(data, 1)]
        assert late == []
        assert not sim[1].memory["torque_enable"]


RETURNS = {"sts3215": True, "sm85blhv": False}
"""Model -> whether a goal switches its torque on."""


@pytest.mark.parametrize("model", RETURNS)
def test_in_a_quick_movement_the_fault_is_seen_before_it_is_taken_for_a_stall(model: str) -> None:
    options = {"arm": {"model": model, "servo_baud": 1_000_000}}
    for moment in (0.30, 0.34, 0.38, 0.42, 0.46):
        with (
            machine(arm="1-2", options=options, max_velocity="240 deg/s") as (made, sims),
            Robot.of(made) as robot,
        ):
            sim = sims["arm"]
            sim.line = At(robot.buses["arm"].link.now() + moment, sim[1].power_cycle)
            with pytest.raises(Faulted, match="a1 is at fault"):
                robot.move({"a1": 2.0, "a2": 2.0})


@pytest.mark.parametrize("model", RETURNS)
def test_torque_that_comes_back_with_the_next_goal_hides_no_restart(model: str) -> None:
    options = {"arm": {"model": model, "servo_baud": 1_000_000}}
    with machine(arm="1-2", options=options) as (made, sims), Robot.of(made) as robot:
        sim, bus = sims["arm"], robot.buses["arm"]
        line = sim.line = At(bus.link.now() + 0.7, sim[1].power_cycle)
        with pytest.raises(Faulted, match="a1 is at fault") as told:
            robot.move({"a1": 0.6, "a2": 0.6}, duration=2.0)
        assert told.value.reason == "restart"
        assert bus.link.now() - line.moment < 2 * HEALTH
        assert bool(sim[1].memory["torque_enable"]) is RETURNS[model]


class Boots(At):
    """A wire on which servo 0x26 sends a boot message (CiA 301) after what happens."""

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        before, found = self._happens, super().carry(sender, data, at)
        boot = Delivery(at, Side.HOST, CanFrame(0x726, b"\0"))
        return [*found, boot] if before and not self._happens else found


@pytest.mark.parametrize("line", [At, Boots])
def test_a_kst_servo_is_at_fault_when_it_says_that_it_starts(line: type[At]) -> None:
    with machine(can="0x25,0x26") as (made, sims), Robot.of(made) as robot:
        sim, bus = sims["can"], robot.buses["can"]
        wire = sim.line = line(bus.link.now() + 0.5, sim[0x26].power_cycle)
        if line is At:
            robot.move({"c1": 0.4, "c2": 0.4}, duration=2.0)  # it obeys the next goal as if nothing had been
            assert robot.faults == {}
            return
        with pytest.raises(Faulted, match="c2 is at fault: can#0x26 has restarted"):
            robot.move({"c1": 0.4, "c2": 0.4}, duration=2.0)
        assert bus.link.now() - wire.moment < 2 * HEALTH
        assert set(robot.faults) == {"c2"}


def test_torque_that_goes_while_nothing_moves_is_noted_when_somebody_looks() -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()
        robot.states()
        sims["arm"][1].power_cycle()
        robot.move({"a2": 0.3}, duration=0.5)
        assert robot["a1"].state().position is not None  # telling raises nothing
        assert set(robot.faults) == {"a1"}
        with pytest.raises(Refused, match="at fault"):
            robot.move({"a1": 0.1})


@pytest.mark.parametrize("verb", ["move", "enable_torque", "hold", "device axis", "loop"])
def test_a_restart_while_it_only_held_is_a_fault_before_it_gets_torque_again(verb: str) -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()
        robot["a1"].bus.link.advance(1.0)
        sims["arm"][1].power_cycle()
        robot["a1"].bus.link.advance(1.0)
        with pytest.raises(Faulted, match="a1 is at fault: arm#1 has restarted") as told:
            again(robot, verb)
        assert told.value.reason == "restart"
        assert set(robot.faults) == {"a1"}
        assert not sims["arm"][1].memory["torque_enable"]
        assert sims["arm"][1].raw_position == 2048


def again(robot: Robot, verb: str) -> None:
    """Somebody moves it, or gives it torque, without having looked at it."""
    if verb == "move":
        robot.move({"a1": 0.3, "a2": 0.3})
    elif verb == "enable_torque":
        robot.enable_torque()
    elif verb == "hold":
        robot["a1"].hold()
    elif verb == "device axis":
        robot["a1"].enable_torque()
    else:
        with robot.loop(50, "a1") as loop:
            for state in loop:
                loop.goal["a1"] = 0.1
                if state.number > 20:
                    break


def test_who_kept_his_torque_or_was_let_go_gets_it_again() -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()
        robot["a2"].disable_torque()
        sims["arm"][2].power_cycle()
        robot["a1"].bus.link.advance(1.0)
        robot.enable_torque()
        robot.move({"a1": 0.1, "a2": 0.1})
        assert robot.faults == {}


def test_who_is_told_to_hold_and_does_not_keep_his_torque_is_at_fault() -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        robot.hold("a2")
        sim = sims["arm"]
        sim.line = Drops(sim[1].power_cycle)
        with pytest.raises(Faulted, match="a1 is at fault"):
            robot.hold("a1")
        assert set(robot.faults) == {"a1"}


def test_whoever_lets_it_go_from_here_is_no_fault() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot:
        robot.enable_torque()
        robot["a1"].device.disable_torque()  # behind the back of the axis
        robot["a2"].disable_torque()
        robot.states()
        assert robot.faults == {}
        robot.move({"a1": 0.2, "a2": 0.2})


def test_an_emergency_stop_is_no_fault() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot:
        robot.enable_torque()
        robot.estop()
        robot.states()
        assert robot.faults == {}


def test_the_fault_of_an_async_robot_is_the_same() -> None:
    async def run() -> dict[str, str]:
        with machine(arm="1-2") as (made, sims):
            async with AsyncRobot.of(made) as robot:
                sim = sims["arm"]
                sim.line = At(robot.buses["arm"].link.now() + 0.5, sim[1].power_cycle)
                with pytest.raises(Faulted, match="a1 is at fault"):
                    await robot.move({"a1": 0.6, "a2": 0.6}, duration=2.0)
                return robot.faults

    assert set(asyncio.run(run())) == {"a1"}


def test_only_faults_that_there_are_can_be_cleared() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot:
        robot.clear_fault()
        with pytest.raises(RequestError):
            robot.clear_fault("nobody")
        restarts.fault(robot["a1"], "it was seen to smoke")
        assert robot.faults == {"a1": "it was seen to smoke"}
        robot.clear_fault()
        assert robot.faults == {}
