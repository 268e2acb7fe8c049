"""What the commands share: only buses of this family, one controller, and a rehearsal that teaches nothing."""

from __future__ import annotations

import pytest

import motorbus
from motorbus.cli.dry import DryBus
from motorbus.cli.output import Output
from motorbus.cli.stepper.controller import carried_out, numbers_in, ours, verb
from motorbus.errors import RequestError
from motorbus.families.stepper import Controller
from motorbus.families.stepper.driver import commands
from tests.cli.stepper.conftest import Line


def test_the_controller_may_be_named_or_not() -> None:
    assert ours("stepper:sim") == ours("stepper:sim#1") == "stepper:sim"
    for other in ("kst:sim", "stepper:sim#2", "nobody:sim"):
        with pytest.raises(RequestError):
            ours(other)


def test_numbers_are_listed_or_a_range() -> None:
    assert numbers_in("1,3") == (1, 3)
    assert numbers_in("2-4") == (2, 3, 4)
    with pytest.raises(RequestError):
        numbers_in("some")


def test_what_is_refused_before_the_first_step_opens_no_port() -> None:
    with pytest.raises(RequestError, match="there is no project 9"):
        carried_out("stepper:/dev/not-there", {}, Output(), verb("run", 9))


def test_a_rehearsal_leaves_no_memory(line: Line) -> None:
    with motorbus.open(line.url) as bus:
        rehearsal = DryBus(bus)
        one = Controller(rehearsal)
        one.start_project(1)
        one.set_output(1, True)
        assert one.memory.owed
        assert not Controller(bus).memory.owed
        assert Controller(bus).last_commanded[1] is None
    assert line.orders() == []


def test_a_dry_run_gives_nothing(line: Line, capsys: pytest.CaptureFixture[str]) -> None:
    assert carried_out(line.url, {}, Output(), commands.stop_motor, dry_run=True) is None
    assert "FF AA 03 0D" in capsys.readouterr().out
    assert line.orders() == []
