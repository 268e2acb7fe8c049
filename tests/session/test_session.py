"""The package as users call it: open, move, async; opening writes nothing."""

from __future__ import annotations

import asyncio
import logging
from typing import Any

import pytest

import motorbus
from motorbus.core.request import Request
from motorbus.errors import NoReply, PortBusy


def test_one_servo_from_open_to_torque_off() -> None:
    with (
        motorbus.simulate("feetech", ids="1-6") as simulated,
        motorbus.open(simulated.url) as bus,
    ):
        servo = motorbus.feetech.Servo(bus, 3)
        assert servo.position() == pytest.approx(3.1416, abs=0.001)
        assert 4.0 < servo.voltage() < 14.0
        assert 10.0 < servo.temperature() < 70.0
        servo.enable_torque()
        assert servo.position() == pytest.approx(3.1416, abs=0.001), "no jump"
        servo.move(1.2, velocity=2.0)
        assert servo.position() == pytest.approx(1.2, abs=0.01)
        servo.disable_torque()
        assert servo.read("torque_enable") == {"torque_enable": 0}


def test_the_async_face_is_the_same() -> None:
    async def main() -> float:
        with motorbus.simulate("feetech", ids="1-6") as sim:
            async with motorbus.open_async(sim.url) as bus:
                servo = motorbus.feetech.AsyncServo(bus, 3)
                await servo.enable_torque()
                await servo.move(1.2, velocity=2.0)
                return await servo.position()

    assert asyncio.run(main()) == pytest.approx(1.2, abs=0.01)


def test_a_simulated_bus_by_its_address_runs_on_the_real_clock() -> None:
    with motorbus.open("feetech:sim,ids=2+4") as bus:
        assert bus.simulated
        assert not bus.link.virtual
        assert motorbus.feetech.Servo(bus, 4).ping()
        assert not motorbus.feetech.Servo(bus, 3).ping()


def test_a_bus_is_open_once() -> None:
    with motorbus.simulate("feetech") as sim, motorbus.open(sim.url), pytest.raises(PortBusy):
        motorbus.open(sim.url)


def test_opening_writes_nothing() -> None:
    """Ten opens, each with scan, identify and reads, leave every byte of every servo as it was."""
    with motorbus.simulate("feetech", ids="1-3") as sim:
        before = [sim[node].memory.read(0, 56) for node in (1, 2, 3)]
        for _ in range(10):
            with motorbus.open(sim.url) as bus:
                found = bus.run(bus.driver.scan((1, 2, 3, 4)))
                assert [item.node for item in found] == [1, 2, 3]
                motorbus.feetech.Servo(bus, 2).telemetry()
        assert [sim[node].memory.read(0, 56) for node in (1, 2, 3)] == before


def test_an_echoing_adapter_is_found_at_open_and_logged(caplog: pytest.LogCaptureFixture) -> None:
    with motorbus.simulate("feetech", ids="1-2") as sim:
        sim.faults = "100%: echo"
        with caplog.at_level(logging.WARNING, "motorbus"), motorbus.open(sim.url) as bus:
            assert bus.echoes
            assert motorbus.feetech.Servo(bus, 2).position() > 0
            assert bus.statistics.of(2).retries == 0
    assert "echoes" in caplog.text


def test_a_broken_port_is_closed_again_when_opening_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    from motorbus.families.feetech import FeetechDriver

    def fail(self: FeetechDriver) -> Request[Any]:
        raise RuntimeError("bug")

    with motorbus.simulate("feetech") as sim:
        monkeypatch.setattr(FeetechDriver, "echo_test", fail)
        with pytest.raises(RuntimeError):
            motorbus.open(sim.url)
        monkeypatch.undo()
        with motorbus.open(sim.url) as bus, pytest.raises(NoReply):
            motorbus.feetech.Servo(bus, 9).position()


def test_the_package_lists_its_public_names_and_objects_say_what_they_are() -> None:
    assert dir(motorbus) == sorted(motorbus.__all__)
    with motorbus.simulate("feetech", ids="1-2", name="shown") as sim, motorbus.open(sim.url) as bus:
        assert repr(sim) == "<Simulation feetech:sim:shown, ids 1, 2>"
        assert repr(bus) == "<Bus feetech:sim:shown, feetech, 1000000 bit/s>"
        assert repr(motorbus.feetech.Servo(bus, 1)) == f"<Servo 1 on {bus!r}>"
