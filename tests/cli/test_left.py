"""Whoever ends a command early is told how each axis was left, and not how it was before `exit` had its way."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest

from motorbus.cli import robot
from motorbus.cli.output import Output
from motorbus.cli.robot import InHand
from motorbus.errors import MotorbusError
from tests.cli.conftest import Bench
from tests.support.machines import Cut

HOLD, EXITS = 'exit = "hold"', ('exit = "torque_off"', 'exit = "park"', 'exit = "leave"')


@pytest.fixture
def ways(bench: Bench) -> Bench:
    """a1 parks at 30 degrees, a2 lets go, a3 is left alone."""
    parts = bench.file.read_text(encoding="utf-8").split("[axis.")
    told = dict(zip(("a2]", "a1]", "a3]"), EXITS, strict=True))
    changed = [part.replace(HOLD, told[part[:3]]) if part[:3] in told else part for part in parts]
    assert sum(new != old for new, old in zip(changed, parts, strict=True)) == 3
    bench.file.write_text("[axis.".join(changed), encoding="utf-8")
    return bench


@contextmanager
def ended_by(error: BaseException, *axes: str) -> Iterator[InHand]:
    """A command with these axes that is ended so."""
    with suppress(type(error)), robot.robot(axes, {}, Output()) as hand:
        yield hand
        raise error


def test_each_axis_is_told_of_as_exit_left_it(ways: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    error = KeyboardInterrupt()
    with ended_by(error, "a1", "a2", "a3", "c1") as hand:
        hand.robot.enable_torque(["a1", "a2", "a3"])
    assert error.__notes__ == [
        "a1: parked at 30.0 deg; a2: let go at 0.0 deg; a3: left as it was, last at 0.0 deg"
    ]
    assert "parking a1; Ctrl-C stops that too" in capsys.readouterr().err


def test_it_is_told_of_an_error_too_but_not_when_nothing_was_ordered(ways: Bench) -> None:
    error = MotorbusError("on the way")
    with ended_by(error, "a2", "c1") as hand:
        hand.robot.move({"a2": 0.2, "c1": 0.1})
    (told,) = error.__notes__
    assert told.startswith("a2: let go at 11.")
    assert "; c1: holds at 5.7 deg" in told
    before = MotorbusError("before anything")
    with ended_by(before, "a2", "c1"):
        pass
    assert not hasattr(before, "__notes__")


def test_whoever_interrupts_what_ordered_nothing_is_told_where_they_stand(ways: Bench) -> None:
    error = KeyboardInterrupt()
    with ended_by(error, "a2", "lift") as hand:
        hand.robot["lift"].declare(0.004)
    assert error.__notes__ == ["a2: at 0.0 deg; lift: at 4.00 mm (estimated)"]


def test_a_second_interruption_tells_the_state_as_well(ways: Bench) -> None:
    def interrupted_twice() -> None:
        with robot.robot(["a1"], {}, Output()) as hand:
            hand.robot.enable_torque()
            ways.simulations["arm"].line = Cut(40)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as raised:
        interrupted_twice()
    told = " / ".join(raised.value.__notes__)
    assert "a1: not parked, for it was interrupted" in told
    assert "a1: not parked, holds at " in told


def test_whom_nobody_can_ask_is_said_to_tell_nothing(ways: Bench) -> None:
    error = KeyboardInterrupt()
    with ended_by(error, "a2", "c1") as hand:
        hand.robot.move({"c1": 0.1})
        ways.simulations["can"][0x25].unplug()
    (told,) = [note for note in error.__notes__ if note.startswith("c1: ")]
    assert told == "c1: does not tell where it stands"
