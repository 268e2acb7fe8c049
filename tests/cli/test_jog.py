"""Turning by hand: bounded, asked for when far, put back afterwards, and refused where it cannot be."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

import pytest

import motorbus
from tests.cli.conftest import Bench, Run
from tests.cli.stepper.conftest import Line, line_of

pytestmark = pytest.mark.usefixtures("state_folder")


@pytest.fixture
def line(monkeypatch: pytest.MonkeyPatch) -> Iterator[Line]:
    """A stepper controller as it is shipped."""
    with motorbus.simulate("stepper") as simulation:
        yield line_of(simulation, monkeypatch)


def pulses(line: Line) -> object:
    return line.simulation[1].status()["position"]


@pytest.mark.parametrize(("speed", "turned"), [("60rpm", 400), ("-60rpm", -400), ("6.283185", 400)])
def test_it_turns_as_far_as_speed_and_time_say(speed: str, turned: int, run: Run, line: Line) -> None:
    ran = run("jog", f"{line.url}#1={speed}", "--seconds", "250ms")
    assert (ran.code, ran.err) == (0, "")
    assert "estimated" in ran.out
    assert pulses(line) == turned
    assert "save_project" not in line.orders(), "what was borrowed is put back, and nothing is saved"


def test_a_long_way_needs_agreement(run: Run, line: Line) -> None:
    assert run("jog", f"{line.url}#1=60rpm", "--seconds", "2").code == 8
    assert (pulses(line), line.orders()) == (0, [])
    ran = run("jog", f"{line.url}#1=60rpm", "--seconds", "2", "--yes", "--json")
    assert ran.document["result"]["angle"] == pytest.approx(4 * math.pi)


def test_a_dry_run_moves_nothing(run: Run, line: Line) -> None:
    ran = run("jog", f"{line.url}#1=60rpm", "--seconds", "2", "--dry-run")
    assert "FF AA 03 0C 00" in ran.out
    assert line.orders() == []


@pytest.mark.parametrize(
    "words",
    [
        "BUS#1 --seconds 1",
        "BUS#1=fast --seconds 1",
        "BUS#1=nan --seconds 1",
        "BUS#1=60rpm --seconds 0",
        "BUS#1=60rpm --seconds 61",
        "BUS#1=0 --seconds 1",
        "BUS#1=60rpm",
        "BUS --seconds 1",
        "BUS#2=60rpm --seconds 1",
        "feetech:sim#1=60rpm --seconds 1",
        "=60rpm --seconds 1",
    ],
)
def test_what_cannot_be_done_is_refused_and_nothing_moves(words: str, run: Run, line: Line) -> None:
    ran = run("jog", *words.replace("BUS", line.url).split(), "--yes")
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.count("error: ") == 1
    assert line.orders() == []


def test_an_axis_goes_in_its_own_unit_and_inside_its_limits(run: Run, bench: Bench) -> None:
    told = run("jog", "lift=2mm/s", "--seconds", "1", "--json").document
    assert (told["schema"], told["axis"], told["present"]) == ("motorbus.jog.axes/1", "lift", None)
    assert told["result"] == pytest.approx(0.002, abs=2e-4)
    ran = run("jog", "a1=-10deg/s", "--seconds", "1")
    assert ran.code == 0
    assert re.search(r"a1: by -[0-9.]+ deg; now at -[0-9.]+ deg", ran.out)
    assert run("jog", "a1=60deg/s", "--seconds", "4", "--yes").code == 8
    assert run("jog", "a1=600deg/s", "--seconds", "0.1").code == 8


def test_a_long_way_of_an_axis_needs_agreement(run: Run, bench: Bench) -> None:
    assert run("move", "a1=-140deg").code == 0
    ran = run("jog", "a1=90deg/s", "--seconds", "3")
    assert (ran.code, "move a1 by 270.0 deg" in ran.err, "--yes" in ran.err) == (8, True, True)
    ran = run("jog", "lift=20mm/s", "--seconds", "6")
    assert (ran.code, "move lift by 120.00 mm" in ran.err) == (8, True)


def test_a_dry_run_of_an_axis_moves_nothing(run: Run, bench: Bench) -> None:
    told = run("jog", "a1=10deg/s", "--seconds", "1", "--dry-run", "--json").document
    assert told["schema"] == "motorbus.jog.plan/1"
    assert "would go by 10.0 deg at most" in run("jog", "a1=10deg/s", "--seconds", "1", "--dry-run").out
    assert "would send FF AA" in run("jog", "lift=2mm/s", "--seconds", "1", "--dry-run").out
    assert abs(run("hold", "a1", "--json").document["axes"][0]["present"]) < 0.01


def test_with_clamp_an_axis_goes_as_far_as_it_may_and_that_is_told(run: Run, bench: Bench) -> None:
    assert run("move", "a1=140deg").code == 0
    ran = run("jog", "a1=30deg/s", "--seconds", "2", "--clamp", "--dry-run")
    assert ran.code == 0, ran.err
    assert "a1 would go by 10" in ran.out or "a1 would go by 9.9" in ran.out
    assert "a1 goes to 150.0 deg instead of" in ran.err
    ran = run("jog", "a1=30deg/s", "--seconds", "2", "--clamp", "--json")
    assert ran.code == 0, ran.err
    assert ran.document["present"] == pytest.approx(2.618, abs=0.01)
    assert ran.document["result"] == pytest.approx(0.1745, abs=0.01)
    assert "a1 goes to 150.0 deg instead of" in ran.err
    assert run("jog", "a1=30deg/s", "--seconds", "2").code == 8
