"""Orders whose effect would differ from their words: after a stop, through another object, from a force of 0."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from motorbus.errors import MotorbusError, RequestError, Stalled
from motorbus.families.feetech import (
    Node,
    Servo,
    ServoGroup,
    action_all,
    disable_torque_all,
    sync_read,
    sync_write,
)
from motorbus.families.feetech.driver import feedback
from motorbus.families.feetech.driver.motion import Motion, move_all
from motorbus.families.feetech.driver.requests import Block, read_block, write_block
from motorbus.families.feetech.traits import Mode
from tests.families.feetech.worlds import later, traffic, world, writes


@pytest.mark.parametrize(("name", "bound"), [("sts", "torque_limit"), ("hls", "torque_limit")])
def test_a_torque_limit_that_rises_from_zero_moves_nothing(name: str, bound: str) -> None:
    with world(name) as (bus, servo, _):
        servo.enable_torque()
        servo.write(**{bound: 0})
        servo.write(goal_position=2.0)
        before = servo.position()
        servo.write(**{bound: 1.0})
        later(bus, 1.0)
        assert servo.position() == pytest.approx(before, abs=0.01)


def test_a_goal_torque_that_rises_from_zero_moves_nothing() -> None:
    with world("hls") as (bus, servo, _):
        servo.enable_torque()
        bus.run(_raw_write(servo, 44, b"\0\0"))
        servo.write(goal_position=2.0)
        before = servo.position()
        servo.write(goal_torque=0.5)
        later(bus, 1.0)
        assert servo.position() == pytest.approx(before, abs=0.01)


def _raw_write(servo: Servo, address: int, data: bytes) -> Any:
    return write_block(servo, Block(address, data))


@pytest.mark.parametrize("what", ["reg_write", "sync_write", "group"])
def test_a_bound_of_the_force_is_not_raised_in_a_group_packet(what: str) -> None:
    with world() as (bus, servo, _):
        servo.prepare()
        group = ServoGroup([servo])
        orders: dict[str, Callable[[], Any]] = {
            "reg_write": lambda: servo.reg_write(torque_limit=0.5),
            "sync_write": lambda: bus.run(sync_write({servo: {"torque_limit": 0.5}})),
            "group": lambda: bus.run(group.write("torque_limit")([0.5])),
        }
        with pytest.raises(RequestError, match="may jump") as caught:
            orders[what]()
        assert "write(torque_limit" in caught.value.advice


def test_a_loop_may_bound_the_force_of_an_hls_that_has_some() -> None:
    with world("hls") as (bus, servo, _):
        servo.prepare()
        send = ServoGroup([servo]).write("goal_torque")
        with pytest.raises(RequestError, match="may jump"):
            bus.run(send([0.5]))
        servo.enable_torque()
        for bound in (0.5, 0.6):
            bus.run(send([bound]))
        assert servo.read("goal_torque")["goal_torque"] == pytest.approx(0.6, abs=0.01)


@pytest.mark.parametrize("how", ["stop", "disable_torque", "disable_torque_all"])
@pytest.mark.parametrize("by", ["action", "action_all"])
def test_an_action_after_a_stop_by_another_object_is_refused(how: str, by: str) -> None:
    with world() as (bus, servo, _):
        servo.enable_torque()
        servo.reg_write(goal_position=2.0)
        other = Servo(bus, 1)
        if how == "disable_torque_all":
            bus.run(disable_torque_all([other]))
        else:
            getattr(other, how)()
        with pytest.raises(RequestError, match="stopped or made limp"):
            other.action() if by == "action" else bus.run(action_all([servo]))
        later(bus, 1.0)
        assert servo.position() == pytest.approx(3.14, abs=0.01)


def test_an_action_by_another_object_carries_out_the_order() -> None:
    with world() as (bus, servo, _):
        servo.enable_torque()
        servo.reg_write(goal_position=2.0)
        Servo(bus, 1).action()
        later(bus, 1.0)
        assert servo.position() == pytest.approx(2.0, abs=0.01)


def test_a_broadcast_action_is_refused_for_a_servo_that_it_does_not_name() -> None:
    with world(ids="1,2") as (bus, servo, _):
        other = Servo(bus, 2)
        for one in (servo, other):
            one.enable_torque()
            one.reg_write(goal_position=2.0)
        Servo(bus, 2).stop()
        with pytest.raises(RequestError, match="node 2 was stopped"):
            bus.run(action_all([servo]))
        other.reg_write(goal_position=2.0)
        bus.run(action_all([servo]))
        later(bus, 1.0)
        assert [one.position() for one in (servo, other)] == pytest.approx([2.0, 2.0], abs=0.01)
        servo.stop()
        bus.run(action_all([other]))  # nothing waits any more
        nothing: Any
        for nothing in ([], [1]):
            with pytest.raises(RequestError, match="takes servo objects"):
                bus.run(action_all(nothing))


def test_recover_refuses_two_servos_that_could_be_the_one() -> None:
    with world(ids="1,7") as (bus, servo, _):
        facts: dict[str, Any] = {"node": 1, "rate": 1_000_000, "new": 7, "new_rate": 1_000_000, "taken": []}
        facts["registers"] = bus.run(read_block(servo, 0, 40, bytes)).hex()
        with pytest.raises(RequestError, match="two servos could be"):
            servo.recover("set_id", facts)
        assert [Servo(bus, id).ping() for id in (1, 7)] == [True, True]


def test_an_interrupted_step_ends_limp(monkeypatch: pytest.MonkeyPatch) -> None:
    with world() as (_, servo, __):
        servo.set_mode("step")
        telemetry, calls = feedback.telemetry, iter(range(100))

        def interrupted(node: Node) -> Any:
            if next(calls) == 3:
                raise KeyboardInterrupt
            return telemetry(node)

        monkeypatch.setattr(feedback, "telemetry", interrupted)
        with pytest.raises(KeyboardInterrupt) as caught:
            servo.step(2.0)
        assert "torque off" in "".join(caught.value.__notes__)
        assert servo.read_raw("torque_enable") == {"torque_enable": 0}


def test_a_stalled_step_is_ended_by_torque_off() -> None:
    with world() as (_, servo, simulation):
        servo.set_mode("step")
        simulation.simulator.nodes[1].block_shaft()
        with pytest.raises(Stalled) as caught:
            servo.step(1.0)
        assert "disable_torque()" in caught.value.advice
        assert "stop()" not in caught.value.advice


def test_each_servo_of_a_move_has_its_own_tolerance() -> None:
    with world(ids="1,2", model="sts3215+scs0009") as (bus, _, __):
        servos = [Servo(bus, 1), Servo(bus, 2)]
        for servo in servos:
            servo.prepare()
        logic = Motion(velocity=1.0)
        bus.run(move_all(logic, dict.fromkeys(servos, 2.5)))
        assert [round(logic.tolerance_of(servo), 4) for servo in servos] == [0.05, 0.0511]
        assert logic.stall_time_of(servos[0]) < logic.stall_time_of(servos[1])


def test_an_id_is_not_given_that_another_hls_obeys_as_its_second_one() -> None:
    with world("hls", ids="1,2") as (bus, servo, simulation):
        simulation.simulator.nodes[2].memory["second_id"] = 9
        Servo(bus, 2).identify()
        with traffic(bus) as sent, pytest.raises(RequestError, match="servo 2 obeys 9"):
            servo.set_id(9)
        assert not writes(sent)


@pytest.mark.parametrize("row", ["homing_offset", "dead_band_cw", "dead_band_ccw", "hysteresis"])
def test_the_arc_holds_for_every_angle_of_an_scs2(row: str) -> None:
    with world("scs2") as (bus, servo, _):
        raw = servo.read_raw(row)[row]
        if row == "homing_offset":
            servo.write(homing_offset=0.1)
            raw = servo.read_raw(row)[row]
        before = servo.read(row)[row]
        bus.driver.facts.arcs = {1: 150.0}
        servo.prepare()
        assert servo.read_raw(row)[row] == raw
        assert raw
        assert servo.read(row)[row] == pytest.approx(before / 2)


def test_a_group_of_one_costs_one_read() -> None:
    with world() as (bus, servo, _):
        servo.prepare()
        for _ in range(2):
            with traffic(bus) as sent:
                bus.run(sync_read(("present_position",), [servo]))
            assert [one.split()[2] for one in sent] == ["02"]


def test_a_row_that_one_map_lacks_costs_that_servo_only() -> None:
    with world(ids="1,2", model="sts3215+scs0009") as (bus, _, __):
        found = bus.run(sync_read(("present_position", "torque_limit"), [1, 2]))
        assert set(found.values) == {1}
        assert "node 2 has the map scs, which has no torque_limit" in str(found.errors[2])


def test_a_read_of_an_unknown_map_is_not_called_a_write() -> None:
    with world(firmware="9.99") as (_, servo, __), pytest.raises(MotorbusError) as caught:
        servo.mode()
    assert "refuses to write" not in str(caught.value)


def test_an_hls_in_pwm_mode_gets_advice_that_works() -> None:
    with world("hls") as (_, servo, simulation):
        simulation.simulator.nodes[1].memory["operating_mode"] = 3
        with pytest.raises(RequestError, match="duty register") as caught:
            servo.enable_torque()
        assert "set_mode('position')" in caught.value.advice
        assert any("set_mode('position')" in text for text in servo.why_not_moving())
        servo.set_mode(Mode.POSITION)
        with pytest.raises(RequestError, match="no pwm mode"):
            servo.set_mode("pwm")


@pytest.mark.parametrize("limits", [(3.0, 1.0), (2.0, 2.0), (None, 0.0), (4.5, None)])
def test_limits_that_leave_no_range_are_refused(limits: tuple[float | None, float | None]) -> None:
    with world() as (_, servo, __):
        servo.write(min_position_limit=0.5, max_position_limit=4.0)
        names = ("min_position_limit", "max_position_limit")
        given = {name: value for name, value in zip(names, limits, strict=True) if value is not None}
        with pytest.raises(RequestError, match="leave no range"):
            servo.write(**given)
        servo.write(min_position_limit=0, max_position_limit=0)


def test_a_loop_sees_settings_that_another_object_has_written() -> None:
    with world() as (bus, servo, _):
        servo.enable_torque()
        send = ServoGroup([servo]).write("goal_position")
        kept = send([3.0])
        Servo(bus, 1).write(angular_resolution=2)
        orders: list[Callable[[], Any]] = [lambda: kept, lambda: send([3.1]), lambda: send([99.0])]
        for goal in orders:
            with pytest.raises(RequestError, match="other settings"):
                bus.run(goal())
        with pytest.raises(RequestError, match="not identified"):
            ServoGroup([servo])


def test_a_write_that_fails_gives_a_servo_its_torque_back() -> None:
    with world(out_of_range="drop") as (_, servo, simulation):
        servo.enable_torque()
        device = simulation.simulator.nodes[1]
        write: Any = device.memory.write

        def lossy(address: int, data: bytes, **rest: Any) -> set[str]:
            return set() if address == 13 else write(address, data, **rest)

        device.memory.write = lossy
        with pytest.raises(MotorbusError, match="reads back different"):
            servo.write(max_temperature=60)
        assert servo.read_raw("torque_enable", "goal_position")["torque_enable"] == 1
        assert servo.position() == pytest.approx(3.14, abs=0.01)
