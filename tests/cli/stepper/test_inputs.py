"""Inputs read and watched, outputs switched, and what is known of them afterwards."""

from __future__ import annotations

import pytest

import motorbus
from tests.cli.conftest import Run
from tests.cli.stepper.conftest import Line, press


def test_the_levels_of_all_inputs(run: Run, line: Line) -> None:
    line.simulation[1].set_input(2, True)
    ran = run("stepper", "inputs", line.url, "--json")
    assert ran.document["inputs"] == {"1": False, "2": True, "3": False, "4": False, "5": False}
    assert "2      active" in run("stepper", "inputs", line.url, "--ports", "2").out
    assert line.orders() == []


def test_one_input_is_one_frame(run: Run, line: Line) -> None:
    line.simulation[1].set_input(5, True)
    assert run("stepper", "read-input", line.url, "--port", "5").out.endswith("input 5 is active\n")
    assert line.commands().count("read_input") == 1


def test_changes_are_told_and_the_rate_that_was_reached(run: Run) -> None:
    with motorbus.simulate("stepper") as simulation:
        press(simulation, "0.5 1 on\n1.0 1 off\n")
        ran = run("stepper", "inputs", simulation.url, "--ports", "1", "--seconds", "2", "--json")
    *changes, last = ran.records
    assert [(one["port"], one["active"]) for one in changes] == [(1, True), (1, False)]
    assert changes[1]["at"] - changes[0]["at"] == pytest.approx(0.5, abs=0.05)
    assert last["changes"] == 2
    assert last["rate"] == pytest.approx(last["rounds"] / last["seconds"])


def test_outputs_are_switched_in_order_and_remembered_as_commanded(run: Run, line: Line) -> None:
    ran = run("stepper", "outputs", line.url, "all=off", "2=on", "LEDS=on", "--json")
    assert ran.document["last_commanded"] == {"1": False, "2": True, "3": False, "5": True}
    assert line.simulation[1].status()["outputs"] == [False, True, False]
    assert line.orders() == ["set_output"] * 3


def test_one_output(run: Run, line: Line) -> None:
    ran = run("stepper", "set-output", line.url, "--port", "3", "--level", "1")
    assert ran.code == 0
    assert "not known" in ran.out, "of the others nobody knows"
    assert line.simulation[1].status()["outputs"] == [False, False, True]


def test_a_dry_run_switches_nothing(run: Run, line: Line) -> None:
    assert "FF AA 00 0C 04 01" in run("stepper", "outputs", line.url, "4=1", "--dry-run").out
    assert line.orders() == []


@pytest.mark.parametrize(
    "words",
    [
        "inputs BUS --ports 6",
        "inputs BUS --ports 0",
        "inputs BUS --ports some",
        "inputs BUS --seconds -1",
        "inputs BUS --seconds soon",
        "read-input BUS --port 6",
        "read-input BUS --port one",
        "set-output BUS --port 6 --level on",
        "set-output BUS --port 1 --level 2",
        "outputs BUS",
        "outputs BUS 1",
        "outputs BUS 1=on 6=on",
    ],
)
def test_bad_input_sends_nothing(words: str, run: Run, line: Line) -> None:
    ran = run("stepper", *words.replace("BUS", line.url).split())
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.count("error: ") == 1
    assert line.heard == []
