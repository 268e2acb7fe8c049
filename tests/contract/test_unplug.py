"""A port that goes away and comes back: calls fail at once, nothing of before is sent, reads are right again."""

from __future__ import annotations

import asyncio
import os
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import pytest

import motorbus
from motorbus import feetech, kst, stepper
from motorbus.link.base import Side
from tests.conftest import Rounds
from tests.support.lines import ByteFault, ByteFaultLine
from tests.support.processes import LATENCY, LIMIT, Simulator, simulator, until_back

READ: Final = 2
PING: Final = 1
"""Instructions of FEETECH packets; byte 4 of each."""
FAMILIES: Final[dict[str, tuple[str, Callable[[Any], Any]]]] = {
    "kst": ("0x21", lambda bus: kst.Servo(bus, 0x21).position()),
    "stepper": ("1", lambda bus: stepper.Controller(bus).read_input(1)),
}


@pytest.fixture
def before(tmp_path: Path) -> Iterator[Simulator]:
    """Two servos on a port that a test takes away."""
    simulated = Simulator(tmp_path / "bus", "feetech", "--ids", "1-2")
    yield simulated
    simulated.kill()


@contextmanager
def recorded(port: Path) -> Iterator[Callable[[], bytes]]:
    """A terminal at this path on which no device answers; the function returns the bytes that came since."""
    master, slave = os.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    port.symlink_to(os.ttyname(slave))

    def received() -> bytes:
        try:
            return os.read(master, 1 << 16)
        except BlockingIOError:
            return b""

    try:
        yield received
    finally:
        port.unlink()
        os.close(slave)
        os.close(master)


def instructions(data: bytes) -> set[int]:
    """The instructions of the packets in these bytes."""
    return {packet[2] for packet in data.split(b"\xff\xff")[1:]}


def raised(call: Callable[[], Any]) -> motorbus.MotorbusError | None:
    """The error that a call raises."""
    try:
        call()
    except motorbus.MotorbusError as error:
        return error
    return None


def test_orders_of_before_are_not_sent_afterwards(before: Simulator) -> None:
    with motorbus.open(before.address) as bus:
        servo = feetech.Servo(bus, 1)
        servo.enable_torque()
        right = servo.position()
        servo.move(right + 1.0, velocity=0.1, wait=False)
        before.kill()
        for order in (servo.enable_torque, servo.position, lambda: servo.move(1.0, wait=False)):
            assert isinstance(raised(order), motorbus.LinkLost)
        with recorded(before.port) as received:
            while isinstance(error := raised(servo.position), motorbus.LinkLost):
                os.sched_yield()
            assert isinstance(error, motorbus.NoReply)
            assert instructions(received()) <= {READ, PING}
            with pytest.raises(motorbus.MotorbusError):
                servo.move(1.0, wait=False)
            assert instructions(received()) <= {READ, PING}, "an order on a position that is not fresh"
        with simulator(before.port, "feetech", "--ids", "1-2"):
            assert until_back(servo.position) == right
            assert not servo.read("torque_enable")["torque_enable"]
            servo.enable_torque()
            assert servo.read("torque_enable")["torque_enable"]


def test_callers_that_wait_get_an_error_at_once(before: Simulator) -> None:
    """They wait for silent nodes; with their time-outs of a second they would get NoReply."""
    with motorbus.open(before.address.replace(LATENCY, ",latency=1")) as bus:
        errors: list[motorbus.MotorbusError | None] = []

        def read(node: int) -> None:
            errors.append(raised(feetech.Servo(bus, node).position))

        trace = bus.trace.subscribe(1_000)
        callers = [threading.Thread(target=read, args=(node,)) for node in range(10, 14)]
        for caller in callers:
            caller.start()
        while not len(trace):
            os.sched_yield()
        before.kill()
        for caller in callers:
            caller.join(LIMIT)
        assert [type(error) for error in errors] == [motorbus.LinkLost] * len(callers)


def lost(error: BaseException | None) -> bool:
    """Whether the error, or one behind it, says that the port is gone."""
    while error is not None:
        if isinstance(error, motorbus.LinkLost):
            return True
        error = error.__cause__ or error.__context__
    return False


CALLS: Final[dict[str, tuple[str, Any, Callable[[Any], Any]]]] = {
    "feetech read": ("feetech", feetech.Servo, lambda servo: servo.position()),
    "feetech move": ("feetech", feetech.Servo, lambda servo: servo.move(3.3, wait=False)),
    "feetech EEPROM": ("feetech", feetech.Servo, lambda servo: servo.write(max_temperature=61)),
    "kst read": ("kst", kst.Servo, lambda servo: servo.position()),
    "kst move": ("kst", kst.Servo, lambda servo: servo.move(0.3, wait=False)),
    "stepper read": ("stepper", stepper.Controller, lambda controller: controller.read_input(1)),
    "stepper start": ("stepper", stepper.Controller, lambda controller: controller.start_project(1)),
}
"""Family, device class and call."""


def pulled(name: str, exchange: int, byte: int, to: Side) -> bool:
    """Pull the port at this byte of the call; False when the call has no such byte."""
    family, device, call = CALLS[name]
    with motorbus.simulate(family, ids="1") as sim:
        sim.pace = True
        with motorbus.open(sim.url) as bus:
            servo = device(bus, 1)
            servo.identify()
            if name == "feetech move":
                servo.enable_torque()
            fault = ByteFault(exchange, byte, "unplug", to)
            link: Any = bus.link
            sim.line = line = ByteFaultLine(fault, lambda at: link.unplug(at, 0.5))
            error = raised(lambda: call(servo))
            if not line.fired:
                assert error is None
                return False
            assert error is None or lost(error)
            assert lost(raised(servo.ping))
            sim.wait(sim.now + 1.0)
            trace = bus.trace.subscribe(1_000)
            for _ in range(3):
                raised(servo.ping)
            for record in trace:
                if isinstance(record.data, bytes) and family == "feetech" and record.direction == "tx":
                    assert instructions(record.data) <= {READ, PING}
            assert servo.ping()
            return True


@pytest.mark.parametrize("name", CALLS)
def test_a_port_that_is_pulled_at_any_byte(name: str, rounds: Rounds) -> None:
    """In virtual time; bytes of requests and of replies, in each exchange of the call."""
    most, fired = rounds(10_000, 40), 0
    for request in range(1, 10):
        for byte in range(250):
            struck = [pulled(name, request, byte, side) for side in Side]
            fired += sum(struck)
            if not any(struck) or fired > most:
                break
    assert fired >= 4


@pytest.mark.parametrize("family", FAMILIES)
def test_a_simulator_that_is_killed_and_started_again(family: str, tmp_path: Path) -> None:
    ids, read = FAMILIES[family]
    simulated = Simulator(tmp_path / "bus", family, "--ids", ids)
    with motorbus.open(simulated.address) as bus:
        right = until_back(lambda: read(bus))
        simulated.kill()
        assert isinstance(raised(lambda: read(bus)), motorbus.LinkLost)
        with simulator(tmp_path / "bus", family, "--ids", ids):
            assert until_back(lambda: read(bus)) == right
        assert bus.engine.losses >= 1


def test_tasks_whose_port_is_gone(before: Simulator) -> None:
    async def main() -> None:
        async with motorbus.open_async(before.address) as bus:
            servos = [feetech.AsyncServo(bus, node) for node in (1, 2)]
            right = [await servo.position() for servo in servos]
            before.kill()
            for _ in range(2):
                found = await asyncio.gather(
                    *(servo.position() for servo in servos * 4), return_exceptions=True
                )
                assert {type(one) for one in found} == {motorbus.LinkLost}
            with simulator(before.port, "feetech", "--ids", "1-2"):
                again: list[Any] = []
                while again != right:
                    again = await asyncio.gather(
                        *(servo.position() for servo in servos), return_exceptions=True
                    )

    asyncio.run(asyncio.wait_for(main(), LIMIT))


def test_a_robot_does_not_move_a_servo_that_has_restarted(before: Simulator, tmp_path: Path) -> None:
    """The axis is at fault until the caller clears it, and then needs torque and a new goal."""
    file = tmp_path / "motorbus.toml"
    file.write_text(
        f'format = 1\n[bus.arm]\naddress = "{before.address}"\n[axis.a1]\ndevice = "arm#1"\nzero = "180 deg"\n'
        'low = "-90 deg"\nhigh = "90 deg"\nmax_velocity = "90 deg/s"\nmax_acceleration = "360 deg/s2"\n'
        'exit = "leave"\n'
    )
    with motorbus.Robot.load(file) as robot:
        robot.enable_torque()
        robot.move({"a1": 0.1})
        before.kill()
        with pytest.raises(motorbus.LinkLost):
            robot.move({"a1": 0.2})
        with simulator(before.port, "feetech", "--ids", "1-2"):
            until_back(robot.positions)
            with pytest.raises((motorbus.Faulted, motorbus.Refused), match="has restarted"):
                robot.move({"a1": 0.2})
            bus: Any = robot.buses["arm"]
            assert not feetech.Servo(bus, 1).read("torque_enable")["torque_enable"]
            robot.clear_fault("a1")
            robot.enable_torque()
            robot.move({"a1": 0.2})
            assert robot.positions()["a1"] == pytest.approx(0.2, abs=0.02)
