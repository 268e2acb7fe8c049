"""A line that returns what is sent: in full, or its first six bytes, which are a whole acknowledgement of 15 commands.

So these tests let the controller be deaf while the line echoes, and whatever is acknowledged then is forged.
"""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.core.request import Data, Effect
from motorbus.core.setpoint import Setpoint
from motorbus.errors import MotorbusError
from motorbus.families.stepper import FAMILY, Controller
from motorbus.families.stepper.driver.node import command
from motorbus.families.stepper.parameters import PARAMETERS
from motorbus.families.stepper.protocol import COMMANDS, REPLY_LENGTH
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.link.memory import MemoryLink
from tests.support.world import make_bus

BYTE = 10 / 9600
WAY = (Setpoint(1, "relative", 1.0, -100.0, 100.0), Setpoint(1, "speed", 1.0, -100.0, 100.0))


class Echoing(PerfectLine):
    """Echoes up to `most` bytes of each request in pieces, at the moments at which a wire of 9600 baud has them.

    While `deaf` nothing reaches the controller. `pace`: the link takes its time, so the bus knows it.
    """

    def __init__(self, *, most: int = 11, piece: int, pace: bool, deaf: bool) -> None:
        self.most, self.piece, self.pace, self.deaf = most, piece, pace, deaf
        self.heard: list[Data] = []

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        assert isinstance(data, bytes)
        if sender is Side.DEVICE:
            return super().carry(sender, data, at)
        begin = at - len(data) * BYTE if self.pace else at
        back = data[: self.most]
        echo = []
        for start in range(0, len(back), self.piece):
            end = min(start + self.piece, len(back))
            echo.append(Delivery(begin + end * BYTE, Side.HOST, back[start:end]))
        if self.deaf:
            return echo
        self.heard.append(data)
        return echo + super().carry(sender, data, at if self.pace else at + len(data) * BYTE)


class Rig:
    """A bus on such a line; `opened`: it was tested for an echo."""

    def __init__(self, line: Echoing, *, opened: bool) -> None:
        self.line = line
        link = MemoryLink(FAMILY.simulator((1,)), rate=9600, line=line, pace=line.pace)
        self.bus: Any = make_bus(link, FAMILY.open(), report=lambda event: None)
        self.device = Controller(self.bus)
        test = self.bus.driver.echo_test()
        if opened and test is not None:
            self.bus.expect_echo(test)
            self.acknowledged(test)

    def acknowledged(self, request: Any) -> bool:
        try:
            self.bus.run(request)
        except MotorbusError:
            return False
        return True

    def ask(self, name: str) -> bool:
        """Whether this command is acknowledged."""
        row = COMMANDS[name]
        values: dict[str, Any] = {field: max(1, PARAMETERS[field].low) for field in row.fields}
        setpoints = WAY if row.effect is Effect.MOTION and not row.repeatable else ()
        return self.acknowledged(command(self.device, name, bytes, setpoints=setpoints, **values))


@pytest.mark.parametrize("opened", [True, False])
@pytest.mark.parametrize("pace", [True, False])
@pytest.mark.parametrize("piece", [1, 4, 6, 11])
def test_line_that_only_echoes_acknowledges_nothing(piece: int, pace: bool, opened: bool) -> None:
    rig = Rig(Echoing(piece=piece, pace=pace, deaf=True), opened=opened)
    for name in (*COMMANDS, "stop_motor", "start_project"):
        assert not rig.ask(name), f"{name} was acknowledged by its own echo"
    assert rig.device.ping() is False


@pytest.mark.parametrize("pace", [True, False])
@pytest.mark.parametrize("piece", [1, 4, 6, 11])
def test_controller_behind_an_echo_that_was_found_is_right_at_the_first_try(piece: int, pace: bool) -> None:
    rig = Rig(Echoing(piece=piece, pace=pace, deaf=False), opened=True)
    rig.line.heard.clear()
    for name in COMMANDS:
        assert rig.ask(name), name
    assert len(rig.line.heard) == len(COMMANDS)


@pytest.mark.parametrize("pace", [True, False])
@pytest.mark.parametrize("piece", [1, 6])
def test_silent_controller_behind_six_echoed_bytes_is_never_found(piece: int, pace: bool) -> None:
    rig = Rig(Echoing(most=REPLY_LENGTH, piece=piece, pace=pace, deaf=True), opened=True)
    device = rig.device
    reads = (device.ping, device.identify, device.dump, device.read_project, device.read, device.backup)
    motions = (device.run_once, lambda: device.jog(1.0, 0.1), lambda: device.run(1), device.home)
    for call in (*reads, *motions):
        with pytest.raises(MotorbusError):
            call()


@pytest.mark.parametrize("name", ["jog_forward", "run_once", "home", "start_project"])
def test_echo_and_reply_are_more_than_was_expected(name: str) -> None:
    rig = Rig(Echoing(most=REPLY_LENGTH, piece=1, pace=True, deaf=False), opened=True)
    assert not rig.ask(name)
