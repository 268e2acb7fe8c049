"""Row L5: an order that is changed on its way and still passes the device's sum is obeyed; who finds that out?

A sum of 8 bits lets two changes that cancel pass. So what is to last is read back before it is called written, and a
goal is arrived at only where the device really is. An order that is neither, such as a RAM register by name, is
acknowledged as it was heard: docs/explanation/taint.md says so.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import pytest

from motorbus.bus.pump import Bus
from motorbus.core.family import Family, Simulator
from motorbus.core.operation import CanFrame, Data
from motorbus.errors import MotionError, VerificationFailed
from motorbus.families import feetech, stepper
from motorbus.families.feetech import wire
from motorbus.families.stepper.simulator.ear import Ear
from motorbus.families.stepper.wire import encode
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.link.memory import MemoryLink
from motorbus.motion.safety import Gate
from motorbus.simulation.faults import FaultyLine
from tests.conftest import Figures


class Forger(PerfectLine):
    """Turns over a bit in a byte of the orders that it is told of, and mends their sum; `forged` counts them."""

    def __init__(self, is_meant: Callable[[bytes], bool], byte: int, mend: Callable[[bytes], bytes]) -> None:
        self.is_meant = is_meant
        self.byte = byte
        self.mend = mend
        self.forged = 0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST and isinstance(data, bytes) and self.is_meant(data):
            self.forged += 1
            changed = bytearray(data)
            changed[self.byte] ^= 1
            data = self.mend(bytes(changed))
        return super().carry(sender, data, at)


def bus_of(family: Family, simulator: Simulator, rate: int, line: PerfectLine) -> Bus:
    """An open bus over this line."""
    link = MemoryLink(simulator, rate=rate, line=line)
    return Bus(link, family.configured(), interlock=Gate(), report=lambda event: None)


def servo_mended(packet: bytes) -> bytes:
    """With the sum of FEETECH packets."""
    return packet[:-1] + bytes((~sum(packet[2:-1]) & 0xFF,))


def stepper_mended(request: bytes) -> bytes:
    """With the sum of the stepper controller's requests."""
    return request[:-1] + bytes((sum(request[:-1]) & 0xFF,))


def writes_to(address: int) -> Callable[[bytes], bool]:
    """Whether a packet writes there."""
    return lambda packet: packet[4:6] == bytes((wire.Instruction.WRITE, address))


@pytest.mark.parametrize(("name", "address", "value"), [("max_temperature", 13, 60), ("position_p", 21, 40)])
def test_l5_a_setting_that_arrives_changed_is_found_by_reading_it_back(
    name: str, address: int, value: int
) -> None:
    line = Forger(writes_to(address), 6, servo_mended)
    simulator = feetech.FAMILY.simulator((1,))
    servo = feetech.Servo(bus_of(feetech.FAMILY, simulator, 1_000_000, line), 1)
    with pytest.raises(VerificationFailed):
        servo.write(**{name: value})
    assert line.forged >= 1
    assert simulator.nodes[1].memory[name] == value ^ 1, "the servo has obeyed it"


def test_l5_a_goal_that_arrives_changed_is_never_said_to_be_reached() -> None:
    goal = 1.0
    line = Forger(
        lambda packet: packet[4] == wire.Instruction.WRITE and packet[5] in (41, 42), 8, servo_mended
    )
    simulator = feetech.FAMILY.simulator((1,))
    servo = feetech.Servo(bus_of(feetech.FAMILY, simulator, 1_000_000, line), 1)
    servo.enable_torque()
    line.forged = 0
    with pytest.raises(MotionError):
        servo.move(goal)
    assert line.forged == 1
    assert abs(servo.position() - goal) > 0.05


def test_l5_a_project_that_arrives_changed_is_found_by_reading_it_back() -> None:
    request = encode("set_step_delay", step=1, delay=500)
    line = Forger(lambda sent: sent[2:4] == request[2:4], 6, stepper_mended)
    simulator = stepper.FAMILY.simulator((1,))
    controller = stepper.Controller(bus_of(stepper.FAMILY, simulator, 9600, line))
    with pytest.raises(VerificationFailed):
        controller.write(step_1_delay=0.5)
    assert line.forged >= 1


def test_l5_how_often_a_changed_order_passes_the_sum(rounds: Callable[[int], int], figures: Figures) -> None:
    """1 % per byte, 11 bytes: two of them have to be changed, and by amounts that cancel."""
    total = rounds(1_000_000)
    line = FaultyLine("seed 5; 1% of bytes to device: corrupt", most=10)
    request = encode("set_step_delay", step=1, delay=500)
    passed = changed = 0
    for number in range(total):
        (heard,) = line.carry(Side.HOST, request, float(number))
        if heard.data == request:
            continue
        changed += 1
        assert not isinstance(heard.data, CanFrame)
        passed += sum(one != request for one in Ear(1.0).feed(heard.data, 0.0).requests)
    figures(
        "L5 changed orders that pass the sum", family="stepper", orders=total, changed=changed, obeyed=passed
    )
    assert changed > total / 20
    expected = 2e-5 * total
    assert passed <= expected + 4 * expected**0.5 + 1


def test_l5_whoever_writes_by_name_reads_back_what_lasts() -> None:
    """Without the forger the same writes succeed: it is the change that is found, and not something else."""
    line = Forger(lambda packet: False, 6, servo_mended)
    servo = feetech.Servo(bus_of(feetech.FAMILY, feetech.FAMILY.simulator((1,)), 1_000_000, line), 1)
    servo.write(max_temperature=60)
    with suppress(MotionError):
        servo.move(1.0)
    assert abs(servo.position() - 1.0) < 0.05
