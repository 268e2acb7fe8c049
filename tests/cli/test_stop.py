"""Decelerate and hold, and say what was promised."""

from __future__ import annotations

import math
import os

import pytest

import motorbus
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Bench, Run
from tests.support.processes import Simulated


def test_it_ends_a_motion_and_holds(run: Run, arm: Simulation) -> None:
    assert run("move", f"{arm.url}#1=1", "--velocity", "1", "--no-wait").code == 0
    ran = run("stop", f"{arm.url}#1", "--json")
    assert ran.code == 0
    assert "holds" in ran.document["devices"][0]["promise"]
    registers = run("read", f"{arm.url}#1", "torque_enable", "goal_position", "--json").document["registers"]
    assert registers[0]["raw"] == 1
    assert registers[1]["value"] == pytest.approx(math.pi, abs=0.2), "not the goal of the move"


def test_nobody_named_means_everyone(run: Run, arm: Simulation) -> None:
    assert run("stop", arm.url).out.count("holds") == 3


def test_somebody_silent_is_told(run: Run, arm: Simulation) -> None:
    ran = run("stop", f"{arm.url}#1+9")
    assert ran.code == 6
    assert run("stop").code == 2


def test_on_a_bus_that_is_held_the_other_stop_is_named(run: Run, served: Simulated) -> None:
    with motorbus.open(served.bus):
        ran = run("stop", served.bus)
    assert ran.code == 4
    assert f"Ctrl-C there, or SIGTERM to process {os.getpid()}, ends it" in ran.err
    assert f"`motorbus estop {served.bus}` stops the bus at once" in ran.err


def test_a_held_bus_beside_others_is_told_of_with_what_reaches_it(
    run: Run, served: Simulated, arm: Simulation
) -> None:
    with motorbus.open(served.bus):
        ran = run("stop", f"{arm.url}#1", served.bus)
    assert ran.code == 6
    assert "is held by this very program" in ran.err
    assert f"`motorbus estop {served.bus}` stops the bus at once" in ran.err


def test_by_name_and_the_whole_machine_without_one(run: Run, bench: Bench) -> None:
    assert run("move", "arm#1=1", "--velocity", "1", "--no-wait").code == 0
    told = run("stop", "--json").document["devices"]
    assert [one["axis"] for one in told] == ["a1", "a2", "a3", "c1", "lift"]
    assert all(one["done"] for one in told)
    assert abs(run("hold", "a1", "--json").document["axes"][0]["present"]) < 0.5
    assert [one["axis"] for one in run("stop", "upper", "lift", "--json").document["devices"]] == [
        "a1",
        "a2",
        "a3",
        "lift",
    ]
    assert run("stop", "a1").out.splitlines()[-1].startswith("a1 (feetech:sim:")


def test_a_bus_by_its_name_is_its_axes_and_a_silent_one_has_its_row(run: Run, bench: Bench) -> None:
    text = bench.file.read_text(encoding="utf-8").replace('"arm#3"', '"arm#9"')
    bench.file.write_text(text, encoding="utf-8")
    for words in ("stop arm", "torque off arm"):
        ran = run(*words.split(), "--json")
        assert ran.code == 6, words
        told = [(one.get("axis"), one["id"], one["done"]) for one in ran.document["devices"]]
        assert told == [("a1", 1, True), ("a2", 2, True), ("a3", 9, False)]
    ran = run("estop", "arm", "--json")
    assert (ran.code, ran.document["buses"][0]["silent"]) == (6, [9])


def test_without_a_name_or_a_machine_it_asks_which_bus(run: Run) -> None:
    assert "which bus?" in run("stop").err


def test_a_machine_without_axes_is_stopped_by_its_buses(run: Run, bench: Bench) -> None:
    text = bench.file.read_text(encoding="utf-8")
    bench.file.write_text(text[: text.index("[axis.")], encoding="utf-8")
    told = run("stop", "--json").document["devices"]
    assert [(one["id"], one["done"]) for one in told] == [
        (1, True),
        (2, True),
        (3, True),
        (37, True),
        (1, True),
    ]


@pytest.mark.parametrize("command", ["stop", "estop"])
@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("upr", "did you mean upper?"),
        ("a1#1", "it is an axis: a1 alone means its device, arm#1"),
        ("stge#1", "did you mean stage?"),
        ("arm#x", "'x' is not a number"),
        ("arm#300", "300"),
        ("ready", "it is a pose"),
        ("fetech:COM7", "there is no family 'fetech'"),
        ("arm,baud=1", "a name has no options"),
    ],
)
def test_of_a_word_that_is_none_one_message_is_made(
    command: str, word: str, said: str, run: Run, bench: Bench
) -> None:
    ran = run(command, word)
    assert (ran.code, ran.out) == (2, "")
    assert said in ran.err
    assert ran.err.count("error: ") == 1


def test_a_machine_file_with_an_error_is_refused(run: Run, bench: Bench) -> None:
    text = bench.file.read_text(encoding="utf-8").replace('"arm#2"', '"arm#300"')
    bench.file.write_text(text, encoding="utf-8")
    for words in ("stop", "stop a1"):
        ran = run(*words.split())
        assert (ran.code, ran.out) == (2, ""), words
        assert "300" in ran.err.splitlines()[0]
