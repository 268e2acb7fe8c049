"""The points from 9 on that a machine with motors should be able to rely on; those before are in `test_promises`."""

from __future__ import annotations

from contextlib import ExitStack
from math import nan, pi

import pytest

import motorbus
from motorbus.core.steps import Emit
from motorbus.errors import Faulted, LimitExceeded, MotorbusError, Overloaded, Refused, RequestError
from motorbus.families.feetech import ServoGroup, reg_write_all
from motorbus.motion.safety.gate import Gate
from motorbus.session.robot import Robot
from tests.conformance.cuts import Kind, violations
from tests.safety.points import asks, known, sent
from tests.support.catalogue.cuts import COMMANDS
from tests.support.machines import Heard, listened, machine


def test_09_a_change_of_settings_is_all_or_nothing_and_the_lock_is_closed_again() -> None:
    with motorbus.simulate("feetech", ids="3") as sim, motorbus.open(sim.url) as bus:
        servo = motorbus.feetech.Servo(bus, 3)
        before = servo.read("max_temperature", "lock")
        with pytest.raises(RequestError):
            servo.write(max_temperature=55, min_position_limit=1e9)
        assert servo.read("max_temperature", "lock") == before
        servo.write(max_temperature=55)
        sim[3].power_cycle()
        bus.link.advance(1.0)  # type: ignore[attr-defined]
        assert servo.read("max_temperature", "lock") == {**before, "max_temperature": 55}


def test_09_a_device_whose_change_nobody_has_ended_is_not_moved() -> None:
    with motorbus.simulate("feetech", ids="3") as sim, motorbus.open(sim.url, interlock=Gate()) as bus:
        assert isinstance(bus.interlock, Gate)
        bus.interlock.faults[3] = "a change of it is unfinished"
        servo = motorbus.feetech.Servo(bus, 3)
        with pytest.raises(Refused) as caught:
            servo.move(pi + 0.1, velocity=1.0)
        assert caught.value.reason == "fault"
        servo.disable_torque()
        assert sim[3].memory["goal_position"] != round((pi + 0.1) / (2 * pi) * 4096)


@pytest.mark.parametrize("name", ["feetech-sts-set_id", "feetech-sts-set_baud"])
def test_10_an_id_and_a_rate_change_in_two_phases_and_every_crash_ends_old_or_new(name: str) -> None:
    command = next(one for one in COMMANDS if one.name == name)
    crashes = [cut for cut in command.single_cuts() if cut.kind is Kind.BLACKOUT]
    for crash in crashes[-12:]:
        assert violations(command, crash) == [], crash


def test_10_an_id_that_somebody_has_is_refused_before_anything_is_written() -> None:
    with motorbus.simulate("feetech", ids="3+7") as sim, motorbus.open(sim.url) as bus:
        sim.line = heard = Heard()
        with pytest.raises(RequestError):
            motorbus.feetech.Servo(bus, 3).set_id(7)
        assert [data for data in heard.sent if not asks(data)] == []
        assert sorted(node.memory["id"] for node in sim.simulator.nodes.values()) == [3, 7]


def test_11_a_restart_is_an_event_and_nothing_moves_until_somebody_has_looked() -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()

        def leads() -> None:
            with robot.loop(100) as loop:
                for cycle, _ in enumerate(loop):
                    loop.goal.update({"a1": 0.5, "a2": 0.5})
                    if cycle == 50:
                        sims["arm"][1].power_cycle()
                    assert cycle < 200, "nobody noticed"

        with pytest.raises(Faulted) as caught:
            leads()
        assert caught.value.node == 1
        assert set(robot.faults) == {"a1"}
        goal = sims["arm"][1].memory["goal_position"]
        listened(sims)
        for ordered in (lambda: robot.move({"a1": 0.1}), robot["a1"].enable_torque):
            with pytest.raises(MotorbusError):
                ordered()
        robot.buses["arm"].link.advance(2.0)  # type: ignore[attr-defined]
        assert [data for data in sent(sims) if not asks(data)] == []
        assert sims["arm"][1].memory["goal_position"] == goal
        robot.clear_fault(["a1"])
        robot.enable_torque(["a1"])
        robot.move({"a1": 0.1})


def test_12_a_position_is_not_used_once_it_is_old() -> None:
    with machine(arm="1", axes={"a1": {"max_step": "10 deg"}}) as (made, sims), Robot.of(made) as robot:
        robot.positions()
        sims["arm"][1].raw_position = 3000  # turned by hand, by 84 degrees
        robot.buses["arm"].link.advance(1.0)  # type: ignore[attr-defined]
        with pytest.raises(LimitExceeded) as caught:
            robot["a1"].device.move(pi + 0.1, velocity=1.0)
        assert caught.value.reason == "step"
        robot["a1"].device.move(3000 * 2 * pi / 4096 + 0.1, velocity=1.0)


@pytest.mark.parametrize("wrong", [nan, 9.0])
def test_13_a_synchronous_move_is_all_or_nothing(wrong: float) -> None:
    with machine(arm="1-3", can="0x25") as (made, sims), Robot.of(made) as robot:
        robot.enable_torque(["a1", "a2", "a3"])
        listened(sims)
        with pytest.raises(LimitExceeded):
            robot.move({"a1": 0.1, "a2": 0.1, "a3": 0.1, "c1": wrong})
        for values in ([pi, pi, pi + wrong], [pi + wrong, pi, pi]):
            devices = [robot[name].device for name in ("a1", "a2", "a3")]
            with pytest.raises(LimitExceeded):
                robot.buses["arm"].run(ServoGroup(devices).write("goal_position")(values))  # type: ignore[attr-defined]
        assert [data for data in sent(sims) if not asks(data)] == []


def test_13_buffered_writes_are_released_by_all_acknowledgements_or_not_at_all() -> None:
    with machine(arm="1-3") as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()
        devices = [known(robot[name]) for name in ("a1", "a2", "a3")]
        sims["arm"][2].unplug()
        with pytest.raises(MotorbusError):
            robot.buses["arm"].run(reg_write_all({one: {"goal_position": pi + 0.1} for one in devices}))  # type: ignore[attr-defined]
        robot.buses["arm"].link.advance(2.0)  # type: ignore[attr-defined]
        assert [sims["arm"][node].raw_position for node in (1, 2, 3)] == [2048] * 3


def test_14_a_motor_that_is_held_ends_its_movement_before_its_own_protection_does() -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        sims["arm"][1].blocked = (2040, 2060)

        def leads() -> None:
            with robot.loop(100) as loop:
                for cycle, _ in enumerate(loop):
                    loop.goal.update({"a1": 0.5, "a2": 0.5})
                    assert cycle < 300, "nobody noticed"

        with pytest.raises(Overloaded) as caught:
            leads()
        assert (caught.value.node, caught.value.reason) == (1, "load")
        assert sims["arm"][1].status()["alarm"] == []


def test_15_a_bus_can_be_stopped_when_everything_around_it_fails() -> None:
    def full(event: object) -> None:
        raise OSError(28, "No space left on device")

    with ExitStack() as stack:
        sim = stack.enter_context(motorbus.simulate("feetech", ids="1-4"))
        bus = stack.enter_context(motorbus.open(sim.url, report=full))
        watcher = bus.trace.subscribe(limit=1)
        for node in (1, 2, 3, 4):
            motorbus.feetech.Servo(bus, node).enable_torque()
        with pytest.raises(OSError, match="No space left"):
            bus.run(Emit("something"))
        sim[3].unplug()
        outcome = bus.estop()
        assert (set(outcome.acknowledged), outcome.silent) == ({1, 2, 4}, (3,))
        assert [sim[node].memory["torque_enable"] for node in (1, 2, 4)] == [0, 0, 0]
        assert watcher.dropped > 10
