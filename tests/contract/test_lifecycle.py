"""Opening, torque, threads and signals as the design has them."""

from __future__ import annotations

import json
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import motorbus
from motorbus import feetech
from tests.support.processes import LIMIT, python, simulator


def test_a_simulated_bus_refuses_a_second_thread() -> None:
    errors: list[Exception] = []

    def read() -> None:
        try:
            servo.position()
        except motorbus.MotorbusError as error:
            errors.append(error)

    with motorbus.simulate("feetech") as sim, motorbus.open(sim.url) as bus:
        servo = feetech.Servo(bus, 1)
        servo.position()
        other = threading.Thread(target=read)
        other.start()
        other.join(LIMIT)
        assert "thread" in str(errors[0])
        servo.position()


def test_torque_on_sets_the_goal_to_the_present_position_first() -> None:
    with motorbus.simulate("feetech") as sim, motorbus.open(sim.url) as bus:
        servo = feetech.Servo(bus, 1)
        servo.enable_torque()
        servo.move(2.0)
        servo.disable_torque()
        sim[1].raw_position = 3000
        servo.enable_torque()
        sim.wait(sim.now + 1.0)
        assert sim[1].raw_position == 3000


def test_torque_on_holds_a_servo_that_is_on_its_way() -> None:
    """A second call does what the first one does: the goal becomes the present position."""
    with motorbus.simulate("feetech") as sim, motorbus.open(sim.url) as bus:
        servo = feetech.Servo(bus, 1)
        servo.enable_torque()
        here = servo.position()
        servo.enable_torque()
        assert servo.position() == here
        servo.move(4.0, velocity=1.0, wait=False)
        sim.wait(sim.now + 0.3)
        servo.enable_torque()
        sim.wait(sim.now + 1.0)
        assert here < servo.position() < 4.0
        assert not sim[1].memory["moving"]


READER = """
import sys, motorbus
with motorbus.open(sys.argv[1]) as bus:
    servo = motorbus.feetech.Servo(bus, 1)
    servo.position()
    try:
        print("ready", flush=True)
        while True:
            servo.position()
    finally:
        print(servo.position(), flush=True)
"""


def test_sigterm_lets_a_program_clean_up(tmp_path: Path) -> None:
    with (
        simulator(tmp_path / "bus", "feetech", "--ids", "1") as simulated,
        python("-c", READER, simulated.address) as child,
    ):
        assert child.stdout is not None
        assert child.stdout.readline() == "ready\n"
        child.send_signal(signal.SIGTERM)
        output, _ = child.communicate(timeout=LIMIT)
    assert (child.returncode, output) == (143, "3.141592653589793\n")


PARKING = """
import sys, motorbus
with motorbus.Robot.load(sys.argv[1]) as robot:
    robot.enable_torque()
    print("ready", flush=True)
    robot.move({"a1": 1.4})
"""
MACHINE = """
format = 1
[bus.arm]
address = "{address}"
[axis.a1]
device = "arm#1"
zero = "180 deg"
low = "-90 deg"
high = "90 deg"
max_velocity = "2 deg/s"
max_acceleration = "90 deg/s2"
exit = "park"
[pose.park]
a1 = "-80 deg"
"""


def test_a_second_signal_skips_parking(tmp_path: Path) -> None:
    """Parking would take 40 s. The first signal ends the move, the second one the way to the park position."""
    with simulator(tmp_path / "bus", "feetech", "--ids", "1") as simulated:

        def until(reached: Callable[[int], bool]) -> int:
            end = time.monotonic() + LIMIT
            while time.monotonic() < end:
                status: dict[str, Any] = json.loads(simulated.command("status"))
                position = int(status["nodes"][0]["raw_position"])
                if reached(position):
                    return position
            raise AssertionError(f"the servo is at {position}")

        file = tmp_path / "motorbus.toml"
        file.write_text(MACHINE.format(address=simulated.address))
        with python("-c", PARKING, str(file)) as child:
            assert child.stdout is not None
            assert child.stdout.readline() == "ready\n"
            until(lambda position: position > 2055)
            child.send_signal(signal.SIGINT)
            until(lambda position: position < 2050)
            child.send_signal(signal.SIGINT)
            _, errors = child.communicate(timeout=LIMIT / 2)
        assert "KeyboardInterrupt" in errors
        assert 1900 < until(lambda position: True) < 2050
