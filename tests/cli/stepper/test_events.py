"""What is told of what is sent to find a controller, and that nothing else has words."""

from __future__ import annotations

from motorbus.cli.stepper.events import say
from motorbus.core.can_frame import CanFrame
from motorbus.core.steps import Progress
from motorbus.families.stepper import EditsLost, Sends, Slowing, Unrecorded

READ_1 = "FF AA 3E 01 00 00 00 00 00 00 E8"


def test_the_frame_that_is_sent_is_told() -> None:
    assert READ_1 in say(Sends(bytes.fromhex(READ_1), 9600))


def test_what_selecting_loses_and_what_cannot_be_recorded_is_told() -> None:
    assert say(EditsLost(2, ())).startswith("selecting project 2 has loaded what is stored of it")
    assert say(Unrecorded("stopped", "no space left")).startswith(
        "stopped, but the journal could not be told: no space"
    )


def test_why_it_takes_its_time_is_told_and_what_another_ctrl_c_would_do() -> None:
    told = say(Slowing(12.0))
    assert told.startswith("the motor gets 12 s to come to rest before project 1 is given back")
    assert "Ctrl-C again leaves it borrowed: `recover` gives it back" in told


def test_nothing_else_is() -> None:
    assert say(Progress(1, 2)) == ""
    assert say(Sends(CanFrame(1, b""), 9600)) == ""
