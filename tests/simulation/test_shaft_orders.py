"""`block`, `push`, `load` and `release` of the control socket, seen through the port."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import radians
from pathlib import Path

import pytest

import motorbus
from motorbus.simulation.control import obey
from tests.support.processes import Simulated

MIDDLE = radians(180)
Order = Callable[[str], str]


@contextmanager
def served(tmp_path: Path) -> Iterator[tuple[motorbus.feetech.Servo, Order]]:
    """A servo behind a real port, and its control socket."""
    control = tmp_path / "control"
    with (
        Simulated("feetech", ids="1", link=tmp_path / "bus", control=str(control)) as simulated,
        motorbus.open(simulated.bus) as bus,
        socket.socket(socket.AF_UNIX) as client,
    ):
        client.settimeout(30)
        client.connect(os.fspath(control))
        lines = client.makefile("rw")

        def order(text: str) -> str:
            lines.write(f"{text}\n")
            lines.flush()
            return lines.readline().strip()

        yield motorbus.feetech.Servo(bus, 1), order


def until(condition: Callable[[], bool]) -> None:
    """Ask again for at most 20 s."""
    end = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < end


def test_a_pushed_limp_shaft_moves_gradually(tmp_path: Path) -> None:
    with served(tmp_path) as (servo, order):
        assert order("push 1 150deg") == "ok"
        assert MIDDLE <= servo.position() < MIDDLE + radians(149)
        until(lambda: servo.position() == pytest.approx(MIDDLE + radians(150), abs=0.01))
        assert servo.read("present_load", "torque_enable") == {"present_load": 0, "torque_enable": False}


def test_a_blocked_servo_raises_the_overload_alarm(tmp_path: Path) -> None:
    with served(tmp_path) as (servo, order):
        servo.enable_torque()
        assert order("block 1") == "ok"
        servo.move(radians(200), wait=False)
        until(lambda: any("overload" in alarm for alarm in servo.alarms()))
        assert servo.position() == pytest.approx(MIDDLE, abs=0.01)
        assert order("release 1") == "ok"
        assert order("power-cycle 1") == "ok"
        servo.enable_torque()
        servo.move(radians(200))
        assert servo.position() == pytest.approx(radians(200), abs=0.01)


def test_a_loaded_servo_reads_a_load_until_it_is_released(tmp_path: Path) -> None:
    with served(tmp_path) as (servo, order):
        servo.enable_torque()
        assert order("load 1 50%") == "ok"
        assert servo.read("present_load")["present_load"] == pytest.approx(0.5, abs=0.01)
        assert order("load 1 -25%") == "ok"
        assert servo.read("present_load")["present_load"] == pytest.approx(-0.25, abs=0.01)
        assert order("release 1") == "ok"
        assert servo.read("present_load")["present_load"] == 0


@pytest.mark.parametrize("model", ["sts3215", "scs0009", "hls3925"])
def test_a_servo_with_torque_returns_from_a_push(model: str) -> None:
    with motorbus.simulate("feetech", ids="1", model=model) as sim, motorbus.open(sim.url) as bus:
        servo = motorbus.feetech.Servo(bus, 1)
        servo.enable_torque()
        home = servo.position()
        assert obey(sim.simulator, "push 1 -20deg") == "ok"
        assert servo.position() < home - radians(10)
        sim.wait(sim.now + 2.0)
        assert servo.position() == pytest.approx(home, abs=0.02)


@pytest.mark.parametrize("settings", [{}, {"phase": 0x80 | 12}, {"angular_resolution": 3}])
def test_angles_are_those_that_the_servo_reads(settings: dict[str, int]) -> None:
    with motorbus.simulate("feetech", ids="1", position=1500) as sim, motorbus.open(sim.url) as bus:
        servo = motorbus.feetech.Servo(bus, 1)
        for name, raw in settings.items():
            sim[1].memory[name] = raw
        sim[1].power_cycle()
        before = servo.position()
        for order in ("block 1 1deg 350deg", "push 1 40deg"):
            assert obey(sim.simulator, order) == "ok"
        sim.wait(sim.now + 2.0)
        assert servo.position() == pytest.approx(before + radians(40), abs=0.01)
        obey(sim.simulator, "push 1 1turn")
        sim.wait(sim.now + 10.0)
        assert servo.position() == pytest.approx(radians(350), abs=0.01)


@pytest.mark.parametrize("after", [0.0, 0.1, 0.5, 1.0])
def test_a_block_stops_a_moving_shaft_and_release_lets_it_finish(after: float) -> None:
    with motorbus.simulate("feetech", ids="1") as sim, motorbus.open(sim.url) as bus:
        servo = motorbus.feetech.Servo(bus, 1)
        servo.enable_torque()
        servo.move(radians(270), wait=False)
        sim.wait(sim.now + after)
        obey(sim.simulator, "block 1")
        blocked = servo.position()
        sim.wait(sim.now + 1.0)
        assert servo.position() == pytest.approx(blocked, abs=0.002)
        obey(sim.simulator, "release 1")
        sim.wait(sim.now + 4.0)
        assert servo.position() == pytest.approx(radians(270), abs=0.01)


def test_release_ends_a_push() -> None:
    with motorbus.simulate("feetech", ids="1") as sim, motorbus.open(sim.url) as bus:
        servo = motorbus.feetech.Servo(bus, 1)
        obey(sim.simulator, "push 1 90deg")
        sim.wait(sim.now + 0.5)
        obey(sim.simulator, "release 1")
        stopped = servo.position()
        sim.wait(sim.now + 2.0)
        assert MIDDLE < stopped < MIDDLE + radians(60)
        assert servo.position() == stopped


def test_a_kst_servo_takes_a_load_and_no_other_force() -> None:
    with motorbus.simulate("kst", ids="37", profile="kst-ext") as sim, motorbus.open(sim.url) as bus:
        servo = motorbus.kst.Servo(bus, 37)
        idle = servo.telemetry().current
        assert idle is not None
        assert obey(sim.simulator, "load 37 50%") == "ok"
        assert (servo.telemetry().current or 0) > idle
        assert obey(sim.simulator, "release 37") == "ok"
        assert servo.telemetry().current == idle
        for verb in ("block 37", "push 37 30deg"):
            assert obey(sim.simulator, verb) == f"error: node 37 has no physics for `{verb.split()[0]}`"


def test_supply_and_heat_raise_the_alarms_of_a_servo_and_end_them() -> None:
    with motorbus.simulate("feetech", ids="1") as sim, motorbus.open(sim.url) as bus:
        servo = motorbus.feetech.Servo(bus, 1)
        for order in ("supply 1 12V", "heat 1 90"):
            assert obey(sim.simulator, order) == "ok"
        state = servo.telemetry()
        assert (state.voltage, state.temperature, state.alarm) == (12.0, 90.0, ("voltage", "temperature"))
        for order in ("supply 1 7.4", "heat 1 30°C"):
            assert obey(sim.simulator, order) == "ok"
        assert servo.telemetry().alarm == ()
        assert "error" in obey(sim.simulator, "supply 1 hot")
        assert obey(sim.simulator, "heat 1") == "error: the order is: heat ID DEGREES"


FORCES = ["block 1", "push 1 30deg", "load 1 50%", "release 1", "supply 1 7.4", "heat 1 40"]


@pytest.mark.parametrize("order", FORCES)
def test_a_stepper_controller_says_that_it_has_no_physics(order: str) -> None:
    with motorbus.simulate("stepper") as sim:
        assert obey(sim.simulator, order) == f"error: node 1 has no physics for `{order.split()[0]}`"
