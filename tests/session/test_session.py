"""The package as users call it: open, refuse, move, async, and the examples of the README."""

from __future__ import annotations

import asyncio
import logging
from typing import Any

import pytest

import motorbus
from motorbus.core.request import Request
from motorbus.errors import LimitExceeded, NoReply, PortBusy, RequestError
from tests.support.noisy_line import NoisyLine


@pytest.mark.parametrize(
    ("address", "why"),
    [
        ("nothing:/dev/ttyACM0", "no family 'nothing'"),
        ("feetech:/dev/null/x,speed=3", "unknown option 'speed'"),
        ("feetech:/dev/null/x,baud=fast", "not a rate"),
        ("feetech:/dev/null/x,baud=-1", "not a rate"),
        ("feetech:sim,ids=1-6,model=mx28", "mx28"),
        ("feetech:sim,colour=red", "unknown option 'colour'"),
        ("feetech:ftp://x", "unknown scheme"),
    ],
)
def test_a_bad_address_opens_nothing(address: str, why: str) -> None:
    with pytest.raises(RequestError, match=why):
        motorbus.open(address)


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


def test_arm_survives_a_dead_servo() -> None:
    with motorbus.simulate("feetech", ids="1-6") as sim, motorbus.open(sim.url) as bus:
        sim[3].unplug()
        with pytest.raises(motorbus.NoReply):
            motorbus.feetech.Servo(bus, 3).position()
        assert motorbus.feetech.Servo(bus, 4).position() > 0


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


def test_an_echoing_adapter_is_found_at_open_and_told(caplog: pytest.LogCaptureFixture) -> None:
    with motorbus.simulate("feetech", ids="1-2") as sim:
        sim.line = NoisyLine(1, echo=True)
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


def test_every_bus_has_the_gate() -> None:
    with motorbus.simulate("feetech", ids="1") as sim, motorbus.open(sim.url) as bus:
        servo = motorbus.feetech.Servo(bus, 1)
        for bad in (float("nan"), float("inf"), 100.0, -1.0):
            with pytest.raises((LimitExceeded, RequestError)):
                servo.move(bad)
        assert sim[1].memory["torque_enable"] == 0
        estop = bus.estop()
        assert estop.acknowledged == (1,)
        with pytest.raises(motorbus.Interrupted):
            servo.enable_torque()
        bus.reset()
        servo.enable_torque()


def test_the_package_lists_its_public_names_and_objects_say_what_they_are() -> None:
    assert dir(motorbus) == sorted(motorbus.__all__)
    with motorbus.simulate("feetech", ids="1-2", name="shown") as sim, motorbus.open(sim.url) as bus:
        assert repr(sim) == "<Simulation feetech:sim:shown, ids 1, 2>"
        assert repr(bus) == "<Bus feetech:sim:shown, feetech, 1000000 bit/s>"
        assert repr(motorbus.feetech.Servo(bus, 1)) == f"<Servo 1 on {bus!r}>"
