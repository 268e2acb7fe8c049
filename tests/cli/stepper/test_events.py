"""What is told of what is sent to find a controller, and that nothing else has words."""

from __future__ import annotations

from motorbus.cli.stepper.events import say
from motorbus.core.operation import CanFrame, Progress
from motorbus.families.stepper import Sends

READ_1 = "FF AA 3E 01 00 00 00 00 00 00 E8"


def test_the_frame_that_is_sent_is_told() -> None:
    assert READ_1 in say(Sends(bytes.fromhex(READ_1), 9600))


def test_nothing_else_is() -> None:
    assert say(Progress(1, 2)) == ""
    assert say(Sends(CanFrame(1, b""), 9600)) == ""
