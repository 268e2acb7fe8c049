"""The examples of the protocol manual, and those of the README, end to end against simulated servos.

Example numbers are those of the FEETECH serial bus servo protocol manual V1.01. What the driver sends is compared
with the bytes printed there; what comes of it is asked of the simulated servos themselves.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from math import tau
from typing import Any

import pytest

import motorbus
from motorbus.bus.blocking import Bus
from motorbus.families.feetech import ServoGroup
from motorbus.families.feetech.simulator import Servo as SimulatedServo
from motorbus.simulation.named import Simulation

COUNT = tau / 4096
GOAL = {"goal_position": 2048 * COUNT, "goal_time": 0, "goal_velocity": 1000 * COUNT}


@pytest.fixture
def sim() -> Iterator[Simulation]:
    """Ten servos at raw position 1304, on a wire where bytes take their time."""
    with motorbus.simulate("feetech", ids="1-10", position=1304) as found:
        found.pace = True
        yield found


@pytest.fixture
def bus(sim: Simulation) -> Iterator[Bus]:
    with motorbus.open(sim.url) as found:
        yield found


class Wire:
    """Listens in; `tx` and `rx` are what went over the wire since, as hex."""

    def __init__(self, bus: Bus) -> None:
        self.records = bus.trace.subscribe(100_000)

    def take(self) -> tuple[list[str], list[str]]:
        records = list(self.records)
        return tuple(  # type: ignore[return-value]
            [bytes(one.data).hex(" ").upper() for one in records if one.direction == way]  # type: ignore[arg-type]
            for way in ("tx", "rx")
        )


def shaft(sim: Simulation, id: int) -> SimulatedServo:
    found = sim[id]
    assert isinstance(found, SimulatedServo)
    return found


def wait(bus: Bus, seconds: float) -> None:
    """Let simulated time pass."""
    until = bus.link.now() + seconds
    while bus.link.now() < until:
        bus.link.read(until)


# -- the protocol manual -------------------------------------------------------------------------------------


def test_example_1_ping(bus: Bus) -> None:
    wire = Wire(bus)
    assert motorbus.feetech.Servo(bus, 1).ping() is True
    assert wire.take() == (["FF FF 01 02 01 FB"], ["FF FF 01 02 00 FC"])
    assert motorbus.feetech.Servo(bus, 99).ping() is False


def test_example_2_the_present_position_is_1304(bus: Bus) -> None:
    servo = motorbus.feetech.Servo(bus, 1)
    servo.prepare()
    wire = Wire(bus)
    assert servo.read_raw("present_position") == {"present_position": 1304}
    assert wire.take() == (["FF FF 01 04 02 38 02 BE"], ["FF FF 01 04 00 18 05 DD"])
    assert servo.position() == pytest.approx(1304 * COUNT)


def test_example_3_a_broadcast_of_an_id_is_refused(bus: Bus) -> None:
    servo = motorbus.feetech.Servo(bus, 1)
    servo.prepare()
    wire = Wire(bus)
    with pytest.raises(motorbus.RequestError):
        motorbus.feetech.Servo(bus, 254)
    with pytest.raises(motorbus.RequestError):
        servo.write(id=1)
    assert wire.take() == ([], [])


def test_example_4_reaches_2048_at_1000_counts_a_second(bus: Bus, sim: Simulation) -> None:
    servo = motorbus.feetech.Servo(bus, 1)
    servo.prepare()
    wire = Wire(bus)
    servo.write(**GOAL)  # type: ignore[arg-type]
    assert wire.take() == (["FF FF 01 09 03 2A 00 08 00 00 E8 03 D5"], ["FF FF 01 02 00 FC"])
    begun = shaft(sim, 1).motion.start
    wait(bus, 0.3)
    assert servo.velocity() == pytest.approx(1000 * COUNT)
    wait(bus, begun + 744 / 1000 + 0.1 - bus.link.now())
    assert servo.read_raw("present_position", "moving") == {"present_position": 2048, "moving": 0}


def test_example_4_by_a_move_that_waits(bus: Bus) -> None:
    servo = motorbus.feetech.Servo(bus, 1)
    servo.enable_torque()
    begun = bus.link.now()
    servo.move(2048 * COUNT, velocity=1000 * COUNT, tolerance=COUNT)
    assert servo.read_raw("present_position") == {"present_position": 2048}
    assert 0.744 <= bus.link.now() - begun < 0.9


def test_examples_5_and_6_ten_servos_start_in_the_same_instant(bus: Bus, sim: Simulation) -> None:
    servos = [motorbus.feetech.Servo(bus, id) for id in range(1, 11)]
    assert bus.run(motorbus.feetech.prepare_all(servos)) == {}
    wire = Wire(bus)
    for servo in servos:
        servo.reg_write(**GOAL)
    sent, heard = wire.take()
    assert sent[0] == "FF FF 01 09 04 2A 00 08 00 00 E8 03 D4"
    assert sent[6:] == [
        "FF FF 07 09 04 2A 00 08 00 00 E8 03 CE",
        "FF FF 08 09 04 2A 00 08 00 00 E8 03 CD",
        "FF FF 09 09 04 2A 00 08 00 00 E8 03 CC",
        "FF FF 0A 09 04 2A 00 08 00 00 E8 03 CB",
    ]
    assert heard[0] == "FF FF 01 02 00 FC"
    assert {servo.read_raw("reg_write_pending")["reg_write_pending"] for servo in servos} == {1}
    assert {sim[id].status()["moving"] for id in range(1, 11)} == {False}
    wire.take()
    bus.run(motorbus.feetech.action_all(servos))
    wait(bus, 0.01)
    assert wire.take() == (["FF FF FE 02 05 FA"], [])
    assert {sim[id].status()["moving"] for id in range(1, 11)} == {True}
    assert len({shaft(sim, id).motion.start for id in range(1, 11)}) == 1
    wait(bus, 1.0)
    assert {shaft(sim, id).raw_position for id in range(1, 11)} == {2048}
    assert {servo.read_raw("reg_write_pending")["reg_write_pending"] for servo in servos} == {0}


def test_example_7_four_servos_and_no_reply(bus: Bus, sim: Simulation) -> None:
    servos = [motorbus.feetech.Servo(bus, id) for id in (1, 2, 3, 4)]
    assert bus.run(motorbus.feetech.prepare_all(servos)) == {}
    wire = Wire(bus)
    bus.run(motorbus.feetech.sync_write(dict.fromkeys(servos, GOAL)))
    wait(bus, 1.0)
    items = " ".join(f"0{id} 00 08 00 00 E8 03" for id in (1, 2, 3, 4))
    assert wire.take() == ([f"FF FF FE 20 83 2A 06 {items} 58"], [])
    assert len({shaft(sim, id).motion.start for id in (1, 2, 3, 4)}) == 1
    assert [shaft(sim, id).raw_position for id in (1, 2, 3, 4, 5)] == [2048, 2048, 2048, 2048, 1304]


# -- the README ----------------------------------------------------------------------------------------------


def test_one_servo(bus: Bus, sim: Simulation) -> None:
    servo = motorbus.feetech.Servo(bus, 3)
    found = [servo.position(), servo.voltage(), servo.temperature()]
    assert found == pytest.approx([1304 * COUNT, 7.4, 30])
    servo.enable_torque()
    assert shaft(sim, 3).raw_position == 1304
    servo.move(1.2, velocity=2.0)
    assert servo.position() == pytest.approx(1.2, abs=COUNT)
    servo.disable_torque()
    assert sim[3].status()["torque_enabled"] is False


def test_arm_survives_a_dead_servo() -> None:
    with motorbus.simulate("feetech", ids="1-6") as sim, motorbus.open(sim.url) as bus:
        sim[3].unplug()
        with pytest.raises(motorbus.NoReply):
            motorbus.feetech.Servo(bus, 3).position()
        result = bus.run(motorbus.feetech.sync_read(["present_position"], range(1, 7)))
        assert sorted(result.values) == [1, 2, 4, 5, 6]
        assert isinstance(result.errors[3], motorbus.NoReply)


def test_the_same_awaited(sim: Simulation) -> None:
    async def talk() -> list[float]:
        async with motorbus.open_async(sim.url) as bus:
            servo = motorbus.feetech.AsyncServo(bus, 5)
            before = await servo.position()
            await servo.move(1.2, velocity=2.0)
            return [before, await servo.position()]

    assert asyncio.run(talk()) == pytest.approx([1304 * COUNT, 1.2], abs=COUNT)


# -- what else has to hold together --------------------------------------------------------------------------


@pytest.mark.parametrize("silence", ["wait", "close_up", "silent"])
def test_a_missing_servo_costs_nobody_else_whatever_the_others_do(silence: str) -> None:
    with (
        motorbus.simulate("feetech", ids="1+3-6", sync_read_missing=silence) as sim,
        motorbus.open(sim.url) as bus,
    ):
        result = bus.run(motorbus.feetech.sync_read(["present_voltage"], range(1, 7)))
        assert sorted(result.values) == [1, 3, 4, 5, 6]
        assert list(result.errors) == [2]


def test_torque_goes_on_without_a_jump_even_with_an_old_goal(bus: Bus, sim: Simulation) -> None:
    servo = motorbus.feetech.Servo(bus, 1)
    servo.move(2000 * COUNT)
    servo.disable_torque()
    shaft(sim, 1).raw_position = 500
    servo.enable_torque()
    wait(bus, 1.0)
    assert shaft(sim, 1).raw_position == 500
    assert sim[1].status()["torque_enabled"] is True


def test_stop_in_the_middle_of_a_move_ends_where_it_was_said(bus: Bus, sim: Simulation) -> None:
    servo = motorbus.feetech.Servo(bus, 1)
    servo.move(3000 * COUNT, velocity=1000 * COUNT, wait=False)
    wait(bus, 0.5)
    assert servo.stop() is motorbus.feetech.Promise.HOLD_ACCEPTED
    wait(bus, 1.0)
    held = shaft(sim, 1).raw_position
    assert held == servo.read_raw("goal_position")["goal_position"]
    assert 1304 + 400 < held < 1304 + 510


def test_a_servo_that_cannot_get_there_stalls(bus: Bus, sim: Simulation) -> None:
    servo = motorbus.feetech.Servo(bus, 1)
    servo.write(torque_limit=0.0)
    with pytest.raises(motorbus.Stalled, match="stands at 2 rad, not at 3.142 rad"):
        servo.move(2048 * COUNT)


def test_a_setting_survives_power_off_and_leaves_the_lock_closed(bus: Bus, sim: Simulation) -> None:
    servo = motorbus.feetech.Servo(bus, 1)
    servo.write(position_p=40, max_temperature=65)
    assert sim[1].status()["locked"] is True
    sim[1].power_cycle()
    assert servo.read("position_p", "max_temperature") == {"position_p": 40, "max_temperature": 65}


def test_a_servo_that_acknowledges_nothing_can_be_set_back(bus: Bus, sim: Simulation) -> None:
    servo = motorbus.feetech.Servo(bus, 1)
    servo.write(status_return_level=0)
    servo.write(torque_limit=0.5)
    servo.write(status_return_level=1)
    servo.disable_torque()
    assert servo.read("torque_limit", "status_return_level", "lock") == {
        "torque_limit": pytest.approx(0.5),
        "status_return_level": 1,
        "lock": 1,
    }


def test_an_overloaded_servo_is_let_go_and_told(bus: Bus, sim: Simulation) -> None:
    servo = motorbus.feetech.Servo(bus, 2)
    servo.enable_torque()
    shaft(sim, 2).alarm = 0x20
    servo.disable_torque()
    assert servo.alarm == ("overload",)
    assert sim[2].status()["torque_enabled"] is False


def test_everyone_is_let_go_although_one_is_dead(bus: Bus, sim: Simulation) -> None:
    for id in range(1, 11):
        motorbus.feetech.Servo(bus, id).enable_torque()
    sim[4].unplug()
    errors = bus.run(motorbus.feetech.disable_torque_all(range(1, 11)))
    assert list(errors) == [4]
    assert not any(sim[id].status()["torque_enabled"] for id in range(1, 11) if id != 4)


@pytest.mark.parametrize("goal", [4096 * COUNT, -0.01, 100.0])
def test_a_goal_outside_the_limits_moves_nothing(bus: Bus, goal: float) -> None:
    servo = motorbus.feetech.Servo(bus, 1)
    servo.prepare()
    node: Any = servo
    wire = Wire(bus)
    with pytest.raises(motorbus.LimitExceeded):
        servo.move(goal)
    with pytest.raises((motorbus.LimitExceeded, motorbus.RequestError)):
        servo.write(goal_position=goal)
    with pytest.raises(motorbus.LimitExceeded):
        bus.run(ServoGroup([node]).write("goal_position")([goal]))
    sent, _ = wire.take()
    assert sent == []


def test_a_scan_over_rates_leaves_the_bus_at_its_own(sim: Simulation) -> None:
    with motorbus.open(sim.url) as bus:
        found = bus.run(bus.driver.scan((1, 2, 11), (500_000, 1_000_000, 4_800)))
        assert [(one.node, one.rate) for one in found] == [(1, 1_000_000), (2, 1_000_000)]
        assert bus.rate == 1_000_000
        assert motorbus.feetech.Servo(bus, 2).ping()
