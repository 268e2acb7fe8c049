"""Wheels, self-timed axes, addresses instead of files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf, tau
from typing import Any

import pytest

import motorbus
from motorbus.core.family import AxisDriver, Identity
from motorbus.core.request import Effect, Priority, Request
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import Sleep
from motorbus.errors import LimitExceeded, MotorbusError, NotHomed, Refused, RequestError
from motorbus.families import feetech
from motorbus.motion.commands import SetPosition
from motorbus.motion.machine import MachineConfig
from motorbus.motion.robot import Robot
from tests.support.machines import listen, machine, orders

WHEEL = {"kind": "wheel", "zero": None, "low": None, "high": None}


def with_functions(
    monkeypatch: pytest.MonkeyPatch, kind: type, change: Callable[[Any, AxisDriver, int], AxisDriver]
) -> None:
    """Give devices of a bus driver other functions."""
    before = kind.axis  # type: ignore[attr-defined]

    def axis(self: Any, identity: Identity) -> AxisDriver:
        return change(self, before(self, identity), identity.node)

    monkeypatch.setattr(kind, "axis", axis)


# -- wheels ----------------------------------------------------------------------------------------------------


@pytest.fixture
def wheel(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A position axis a1 and a wheel a2."""
    with machine("1-2", axes={"a2": WHEEL}) as (config, sims):
        with motorbus.open(sims["arm"].url) as bus:
            feetech.Servo(bus, 2).set_mode("velocity")

        def change(driver: Any, axis: AxisDriver, node: int) -> AxisDriver:
            if node != 2:
                return axis
            names = axis.names - {"stream", "move", "limits", "travel"}
            kept = {name: getattr(axis, name) for name in names}
            return AxisDriver(**{**kept, "set_velocity": feetech.Servo.set_velocity.function})

        with_functions(monkeypatch, type(feetech.FAMILY.open()), change)
        with Robot(config) as robot:
            yield robot, sims


def test_a_wheel_turns_only_while_attended(wheel: Any) -> None:
    robot, sims = wheel
    with pytest.raises(Refused) as caught:
        robot.jog("a2", 1.0, 0.5)
    assert caught.value.reason == "unattended"
    with robot.attended():
        robot.jog("a2", 1.0, 0.5)
    assert sims["arm"][2].memory["goal_velocity"] == 0


def test_a_wheel_follows_velocities_in_a_loop_and_stops_with_it(wheel: Any) -> None:
    robot, sims = wheel
    fastest = 0
    with robot.attended(), robot.loop(50, policy="clamp") as loop:
        for state in loop:
            loop.set_target("a1", 0.3)
            loop.set_target("a2", 99.0)
            speed = sims["arm"][2].memory["goal_velocity"]
            assert speed - fastest < 2 * tau / 50 * 4096 / tau + 50  # its acceleration holds
            fastest = max(fastest, speed)
            if state.number > 40:
                break
    assert abs(fastest - 4096 / 4) < 60
    assert sims["arm"][2].memory["goal_velocity"] == 0
    assert abs(robot.positions()["a1"] - 0.3) < 0.02


@pytest.mark.parametrize("end", ["lease", "stop", "exit"])
def test_every_end_stops_a_wheel(wheel: Any, end: str) -> None:
    robot, sims = wheel
    memory = sims["arm"][2].memory
    attended = robot.attended(0.2 if end == "lease" else inf)
    attended.__enter__()
    loop = robot.loop(50, "a2")
    loop.__enter__()
    for state in loop:
        loop.set_target("a2", 1.0)
        if state.number > 8:
            break
    assert memory["goal_velocity"] > 0
    if end == "lease":
        with pytest.raises(Refused) as refused:
            for _ in loop:
                pass
        loop.__exit__(Refused, refused.value, None)
    elif end == "stop":
        robot.stop("a2")
    else:
        robot.close()
    assert memory["goal_velocity"] == 0


def test_a_wheel_has_no_position(wheel: Any) -> None:
    robot, _ = wheel
    with pytest.raises(RequestError, match="a2: a wheel has no position"):
        robot.move({"a1": 0.1, "a2": 1.0})


def test_a_servo_in_velocity_mode_is_no_position_axis(wheel: Any) -> None:
    robot, sims = wheel
    robot.close()
    axis = {"device": "arm#2", "max_velocity": "90 deg/s"}
    config = MachineConfig.of(
        {"format": 1, "bus": {"arm": {"address": sims["arm"].url}}, "axis": {"x": axis}}
    )
    with pytest.raises(RequestError, match="not in position mode"):
        Robot(config)


# -- self-timed axes -------------------------------------------------------------------------------------------


class Timed:
    """A self-timed move that needs 1.5 times the shortest time and knows no positions; the wire carries a probe."""

    def __init__(self, bus: Any, node: int, angle: float, velocity: float) -> None:
        self.angle = angle
        self.shortest = abs(angle) / velocity
        self.calls: list[str] = []
        self.duration = 0.0
        probe = bus.driver.probe(node, 0)
        setpoint = Setpoint(node, "relative", angle, -inf, inf)
        self.start: Request[Any] = replace(
            probe, priority=Priority.CONTROL, effect=Effect.MOTION, setpoints=(setpoint,)
        )

    def fit(self, duration: float) -> float:
        return max(duration, self.shortest) * 1.5

    def position(self, elapsed: float) -> float:
        return self.angle * min(1.0, elapsed / self.duration)

    async def prepare(self, duration: float) -> None:
        self.calls.append("prepare")
        self.duration = duration

    async def finish(self) -> None:
        self.calls.append("finish")
        await Sleep(0.1)


@pytest.fixture
def timed(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A machine of a1, c1 and a self-timed lift; `plans` are the moves that it made."""
    from motorbus.families import stepper

    plans: list[Timed] = []

    async def plan(device: Any, angle: float, *, velocity: float, acceleration: float) -> Timed:
        assert velocity == pytest.approx(4 * tau)
        plans.append(Timed(device.bus, device.node, angle, velocity))
        return plans[-1]

    def change(driver: Any, axis: AxisDriver, node: int) -> AxisDriver:
        return replace(axis, plan_move=plan)

    with_functions(monkeypatch, type(stepper.FAMILY.open()), change)
    with machine("1", "1", lift=True) as (config, sims), Robot(config) as robot:
        yield robot, sims, plans


def test_a_self_timed_axis_starts_with_the_others_and_decides_the_duration(timed: Any) -> None:
    robot, _, plans = timed
    robot.execute(SetPosition("lift", 0.0))
    result = robot.move({"a1": 0.5, "c1": 0.1, "lift": 0.04})
    (plan,) = plans
    assert plan.calls == ["prepare", "finish"]
    assert plan.angle == pytest.approx(8 * tau)
    assert result.planned == plan.duration == pytest.approx(3.0)
    assert result.axes["lift"].estimated
    assert result.axes["lift"].position == pytest.approx(0.04)
    assert result.axes["a1"].position == pytest.approx(0.5, abs=0.01)
    assert robot.snapshot().axes["lift"].estimated


def test_a_self_timed_axis_moves_alone_and_relative_without_a_position(timed: Any) -> None:
    robot, _, plans = timed
    with pytest.raises(NotHomed):
        robot.move({"lift": 0.01})
    with pytest.raises(NotHomed):  # it has limits, and its position is unknown
        robot.move({"lift": 0.01}, relative=True)
    robot.set_position("lift", 0.1)
    robot.move({"lift": 0.02}, relative=True)
    assert robot.snapshot().axes["lift"].position == pytest.approx(0.12)
    with pytest.raises(LimitExceeded):
        robot.move({"lift": 0.15}, relative=True)
    assert [plan.calls for plan in plans] == [["prepare", "finish"]]


def test_an_interrupted_self_timed_move_is_stopped_and_loses_its_position(timed: Any) -> None:
    robot, sims, plans = timed
    robot.set_position("lift", 0.0)
    robot.enable_torque(["a1", "c1"])
    listen(sims, 40)
    with pytest.raises(KeyboardInterrupt):
        robot.move({"a1": 1.0, "lift": 0.04})
    assert plans[0].calls == ["prepare", "finish"]
    assert robot.snapshot().axes["lift"].position is None
    assert orders({"stage": sims["stage"]})  # the stop; the start was a probe


# -- addresses, keys ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("family", "far"), [("feetech", 7.0), ("kst", 2.0)])
def test_an_address_has_axes_with_the_limits_of_its_devices(family: str, far: float) -> None:
    with motorbus.simulate(family, ids="1-2") as sim, Robot.at(f"{sim.url}#1-2") as robot:
        start = robot.positions()
        assert list(start) == ["#1", "#2"]
        robot.move({"#1": start["#1"] + 0.2})
        with pytest.raises(LimitExceeded):
            robot.move({"#2": start["#2"] + far})
    with pytest.raises(RequestError, match="names no device"):
        Robot.at("feetech:sim")


def test_a_key_that_a_device_cannot_follow_is_refused() -> None:
    for keys in ({"max_torque": 0.5}, {"exit": "torque_off"}, {"estop": "torque_off"}):
        with machine(can="1", axes={"c1": keys}) as (config, _), pytest.raises(MotorbusError, match="c1"):
            Robot(config)


def test_max_torque_is_written_before_torque_comes_on() -> None:
    with machine("1", axes={"a1": {"max_torque": 0.5}}) as (config, sims), Robot(config) as robot:
        robot.enable_torque()
        assert sims["arm"][1].memory["torque_limit"] == 500
