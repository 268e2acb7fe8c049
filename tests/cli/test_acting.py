"""One verb that moves a device: shown, agreed to, or carried out."""

from __future__ import annotations

import pytest

import motorbus
from motorbus.cli.acting import acted
from motorbus.cli.exits import NeedsConsent
from motorbus.cli.output import Output
from motorbus.errors import RequestError
from motorbus.simulation.named import Simulation


def test_it_is_carried_out_where_nothing_is_asked(arm: Simulation) -> None:
    with motorbus.open(arm.url) as bus:
        acted(bus, 1, "move", 2.0, question="", dry_run=False, output=Output())
        assert motorbus.feetech.Servo(bus, 1).position() == pytest.approx(2.0, abs=0.01)


def test_nobody_agrees_and_nothing_moves(arm: Simulation) -> None:
    with motorbus.open(arm.url) as bus:
        with pytest.raises(NeedsConsent, match="move it"):
            acted(bus, 1, "move", 2.0, question="move it", dry_run=False, output=Output())
        assert motorbus.feetech.Servo(bus, 1).position() == pytest.approx(3.14, abs=0.01)


def test_a_dry_run_shows_and_gives_nothing(arm: Simulation, capsys: pytest.CaptureFixture[str]) -> None:
    with motorbus.open(arm.url) as bus:
        assert acted(bus, 1, "move", 2.0, question="move it", dry_run=True, output=Output()) is None
        assert motorbus.feetech.Servo(bus, 1).position() == pytest.approx(3.14, abs=0.01)
    said = capsys.readouterr()
    assert "would send" in said.out
    assert "as far as it can be foreseen" in said.err, "its arrival is not seen in a rehearsal"


def test_what_the_verb_lacks_is_refused(arm: Simulation) -> None:
    with motorbus.open(arm.url) as bus, pytest.raises(RequestError, match="has no colour"):
        acted(bus, 1, "move", 2.0, question="", dry_run=False, output=Output(), colour="red")
