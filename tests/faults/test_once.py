"""Row L18: the answer alone is lost, each time. What would do more when done twice is said once; the rest again.

A motion start, a relative move, a save and a change of id or baud rate are never said twice by themselves. Reads and
absolute targets are.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from motorbus.bus.blocking import Bus
from motorbus.bus.interlock import DeviceLimits
from motorbus.bus.retry import RETRIES
from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.errors import MotorbusError, NoReply, OutcomeUnknown
from motorbus.families.feetech import FAMILY, Servo, protocol
from motorbus.families.feetech.driver.requests import Block, acknowledged, write_block
from motorbus.families.kst.driver.requests import write_row
from motorbus.families.stepper import protocol as stepper
from motorbus.link.base import Delivery, PerfectLine, Side
from tests.families.stepper.rig import Rig as StepperRig
from tests.faults.test_stepper_single_faults import COMMANDS, ask
from tests.support.catalogue.kst import NODE, KstRig
from tests.support.rigs.feetech import Rig
from tests.support.single_faults import Struck


class Unanswered(PerfectLine):
    """Carries everything to the devices and nothing back; `said` is what they heard."""

    def __init__(self) -> None:
        self.said: list[Data] = []
        self.lost = 0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.DEVICE:
            self.lost += 1
            return []
        self.said.append(data)
        return super().carry(sender, data, at)


def said_by(rig: Struck, act: Callable[[], Any]) -> tuple[Unanswered, MotorbusError]:
    """What an act says when nobody answers it, and how it then fails."""
    rig.put(line := Unanswered())
    with pytest.raises(MotorbusError) as raised:
        act()
    assert line.lost > 0, "there was no answer to lose"
    return line, raised.value


GOAL = 42
STEP, GO, ID, BAUD, LOCK = (b"\x10\x00", b"\x00\x08", b"\x07", b"\x02", b"\x01")
ONCE = Block(0, b"", repeatable=False)
FEETECH_ONCE: dict[str, Callable[[Servo], Any]] = {
    "a relative move": lambda servo: write_block(servo, Block(GOAL, STEP, repeatable=False)),
    "a write for later": lambda servo: acknowledged(servo, protocol.reg_write(1, GOAL, GO), ONCE),
    "the start of what waits": lambda servo: acknowledged(servo, protocol.action(1), ONCE),
    "a factory restore": lambda servo: acknowledged(servo, protocol.factory_restore(1), ONCE),
    "a calibration": lambda servo: acknowledged(servo, protocol.calibrate(1), ONCE),
    "forgetting turns": lambda servo: acknowledged(servo, protocol.clear_turns(1), ONCE),
}


@pytest.mark.parametrize("what", FEETECH_ONCE)
def test_l18_feetech_says_once_what_would_do_more_when_said_twice(what: str) -> None:
    rig = Rig(model="hls3606")
    request = FEETECH_ONCE[what](Servo(rig.bus, 1))
    line, error = said_by(rig, lambda: rig.bus.run(request))
    assert line.said.count(request.wire) == 1
    assert isinstance(error, OutcomeUnknown)


class DeafTo(Unanswered):
    """Loses the answer to one request alone, each time it is said."""

    def __init__(self, is_it: Callable[[bytes], bool]) -> None:
        super().__init__()
        self.is_it = is_it
        self.losing = False

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST:
            self.losing = self.is_it(data.data if isinstance(data, CanFrame) else data)
            self.said.append(data)
            return [Delivery(at, Side.DEVICE, data)]
        if self.losing:
            self.lost += 1
            return []
        return [Delivery(at, Side.HOST, data)]


@pytest.mark.parametrize(
    ("what", "register"),
    [("the id", 5), ("the baud rate", 6)],
)
def test_l18_a_change_of_id_or_baud_is_written_once(what: str, register: int) -> None:
    """The whole job, of which the answer to that one write is lost: it finds out what became of it, by looking."""
    rig = Rig(ids=(1,))

    def is_it(data: bytes) -> bool:
        return data[4:6] == bytes((protocol.Instruction.WRITE, register))

    rig.put(line := DeafTo(is_it))
    servo = Servo(
        Bus(rig.link, FAMILY.open(), interlock=DeviceLimits(), report=lambda event: None), 1
    )  # it keeps a journal
    told: list[type[MotorbusError]] = []
    try:
        servo.set_id(7) if register == 5 else servo.set_baud(500_000)
    except MotorbusError as error:
        told.append(type(error))
    assert told in ([], [OutcomeUnknown]), what
    assert line.lost == 1, "it was answered once, for it was written once"
    assert sum(is_it(data) for data in line.said if isinstance(data, bytes)) == 1


def _mid_point(rig: KstRig) -> None:
    rig.run(write_row(rig.servo, rig.servo.table["mid_point"], 0))


KST: dict[str, tuple[Callable[[KstRig], Any], bytes, int]] = {
    "a mid point": (_mid_point, b"\x09\x30", 1),
    "a target": (lambda rig: rig.servo.move(0.2, wait=False), b"\x03\x60", 1 + RETRIES),
    "a reading": (lambda rig: rig.servo.read_raw("function_enable"), b"\x0f\x30", 1 + RETRIES),
}
"""What is said, the index of its object as it stands in the frame, and how often it may be said."""


@pytest.mark.parametrize("what", KST)
def test_l18_kst_says_once_what_would_do_more_when_said_twice(what: str) -> None:
    act, index, most = KST[what]
    rig = KstRig()
    rig.put(line := DeafTo(lambda data: data[1:3] == index))
    with pytest.raises(MotorbusError) as raised:
        act(rig)
    assert line.lost == most
    assert sum(isinstance(data, CanFrame) and data.data[1:3] == index for data in line.said) == most
    assert isinstance(raised.value, NoReply if what == "a reading" else OutcomeUnknown)


def test_l18_a_save_is_said_once() -> None:
    """By the manual it has no answer; one that comes and is lost is no reason to say it again."""
    rig = KstRig(save_reply="ack")
    rig.put(line := Unanswered())
    rig.servo.save()
    assert (line.lost, len(line.said)) == (1, 1)
    assert rig.servos[NODE].status()["saving"] or rig.servos[NODE].status()["saved"]


@pytest.mark.parametrize("name", COMMANDS)
def test_l18_stepper_says_again_only_what_may_be(name: str) -> None:
    rig = StepperRig(PerfectLine(), 3)
    rig.open()
    rig.link.line = line = Unanswered()
    assert not ask(rig, name)
    assert line.lost > 0
    again = line.said.count(line.said[0]) > 1
    assert again <= stepper.COMMANDS[name].repeatable
    assert stepper.COMMANDS[name].repeatable or isinstance(rig.errors[-1], OutcomeUnknown)
