"""The machine of a command: opened with the options of flags, left as the command left it, and as `exit` says else."""

from __future__ import annotations

from contextlib import suppress

import pytest

import motorbus
from motorbus.cli import robot
from motorbus.cli.machine import machine as machine_of_file
from motorbus.cli.machine import using
from motorbus.cli.output import Output
from motorbus.core.steps import INTENT, JournalEntry, Progress
from motorbus.errors import MotorbusError, RequestError
from tests.cli.conftest import Bench, Run


def torque(run: Run, axis: str) -> float:
    """Whether its device has torque."""
    value: float = run("read", axis, "torque_enable", "--json").document["registers"][0]["value"]
    return value


def limp_at_the_end(bench: Bench) -> None:
    """From here on the exit policy of a1 is to let go."""
    text = bench.file.read_text(encoding="utf-8")
    bench.file.write_text(text.replace('exit = "hold"', 'exit = "torque_off"', 1), encoding="utf-8")


@pytest.mark.parametrize("command", ["move a1=10deg", "torque on a1", "hold a1", "jog a1=5deg/s --seconds 1"])
def test_what_was_done_stays_whatever_exit_says(command: str, bench: Bench, run: Run) -> None:
    limp_at_the_end(bench)
    assert run(*command.split()).code == 0
    assert torque(run, "a1") == 1


def test_what_failed_ends_as_exit_says(bench: Bench, run: Run) -> None:
    limp_at_the_end(bench)
    open_ = robot.robot(["a1", "a2"], {}, Output())
    hand = open_.__enter__()
    hand.robot.enable_torque()
    error = MotorbusError("on the way")
    assert not open_.__exit__(MotorbusError, error, None)
    assert (torque(run, "a1"), torque(run, "a2")) == (0, 1)


def test_a_command_that_is_recommended_names_the_bus_that_is_meant(bench: Bench) -> None:
    def hint(*axes: str) -> str:
        error = MotorbusError("x", advice="recover() gives it back")
        with suppress(MotorbusError), robot.robot(axes, {}, Output()):
            raise error
        return error.advice

    assert hint("a1", "a2") == "`motorbus recover arm` gives it back"
    assert hint("a1", "lift") == "`motorbus recover BUS` gives it back"
    with motorbus.open(bench.simulations["stage"].url) as bus:
        assert bus.journal is not None
        bus.journal(JournalEntry("jog", INTENT, {"node": 1, "what": "the borrow"}))
    assert hint("a1", "lift") == "`motorbus recover stage` gives it back"


def test_options_go_before_the_file_and_only_where_they_are_needed(bench: Bench) -> None:
    with robot.robot(["a1"], {"baud": "1M"}, Output()) as hand:
        assert hand.robot.buses["arm"].link.rate == 1_000_000
    changed = robot.with_options(machine_of_file(), ["a1"], {"baud": "500k"})
    assert changed.buses["arm"].address.endswith(",baud=500k")
    assert changed.buses["can"] == bench.machine.buses["can"]
    assert changed.file == machine_of_file().file != ""
    with pytest.raises(RequestError, match="unknown option 'colour'"):
        robot.with_options(bench.machine, ["a1"], {"colour": "red"})


def test_what_it_reports_goes_to_the_bar_only_while_somebody_works(bench: Bench) -> None:
    output = Output()
    with robot.robot(["a1"], {}, output) as hand, hand.working("moving"):
        hand.heard(Progress(1, 2, "a1"))
        hand.heard(object())
    assert output.simulated


def test_a_verb_that_an_axis_lacks_is_named(bench: Bench) -> None:
    with robot.robot(["c1", "lift"], {}, Output()) as hand:
        assert robot.able(hand, "lift", "home")
        with pytest.raises(RequestError, match=r"c1: can#0x25 has no torque switch"):
            robot.able(hand, "c1", "enable_torque")
        assert robot.place(hand.robot, "lift", None) == "a place that is not known"


def test_a_rehearsal_withholds_what_would_change_anything(
    bench: Bench, run: Run, capsys: pytest.CaptureFixture[str]
) -> None:
    with robot.robot(["a1", "c1"], {}, Output()) as hand:
        robot.rehearse(hand, ["a1", "c1"], lambda axis: axis.hold())
    assert capsys.readouterr().out.count("would send") == 2
    assert torque(run, "a1") == 0


def test_the_file_of_a_command_is_the_one_it_was_told(bench: Bench) -> None:
    with using(str(bench.file.with_name("nowhere.toml"))), pytest.raises(RequestError, match="nowhere"):
        robot.robot(["a1"], {}, Output()).__enter__()
