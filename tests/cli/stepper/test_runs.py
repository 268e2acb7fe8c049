"""A project started and waited for: what is printed, and which exit code each end has."""

from __future__ import annotations

from typing import Any

import pytest

import motorbus
from motorbus.core.request import Data
from tests.cli.conftest import Run
from tests.cli.stepper.conftest import Line, press

pytestmark = pytest.mark.usefixtures("state_folder")


def test_it_ends_with_0_when_the_notice_came(run: Run, line: Line) -> None:
    ran = run("stepper", "run", line.url, "--project", "1", "--yes", "--json")
    assert (ran.code, ran.err) == (0, "")
    assert ran.document["outcome"] == "completed"
    assert ran.document["seconds"] == pytest.approx(ran.document["predicted"]["seconds"], rel=0.02)
    assert line.orders() == ["start_project"]


@pytest.mark.parametrize(
    ("options", "more", "code", "outcome"),
    [
        ({"notice_fault": "lost"}, [], 5, "timeout"),
        ({}, ["--timeout", "500ms"], 5, "timeout"),
    ],
)
def test_every_other_end_has_its_own_code(
    options: dict[str, Any], more: list[str], code: int, outcome: str, run: Run
) -> None:
    with motorbus.simulate("stepper", **options) as simulation:
        ran = run("stepper", "run", simulation.url, "--project", "1", "--yes", "--json", *more)
    assert ran.code == code, ran.err
    assert ran.document["outcome"] == outcome


def test_what_cannot_be_known_ends_with_1(run: Run, line: Line, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both answers to the start are lost: its acknowledgement and its notice."""
    receive = line.simulation.simulator.receive

    def lossy(data: Data, at: float) -> None:
        if isinstance(data, bytes) and data[2] == 0x4E:
            line.simulation[1].switch(reply_fault="lost", notice_fault="lost")
        receive(data, at)

    monkeypatch.setattr(line.simulation.simulator, "receive", lossy)
    ran = run("stepper", "run", line.url, "--project", "1", "--yes", "--json")
    assert (ran.code, ran.document["outcome"]) == (1, "unknown")
    assert line.orders().count("start_project") == 1, "a start is never said twice"


def test_a_button_that_is_watched_stops_it(run: Run) -> None:
    with motorbus.simulate("stepper") as simulation:
        press(simulation, "1.0 4 on\n")
        words = ("stepper", "run", simulation.url, "--project", "1", "--yes", "--watch", "4", "--progress")
        ran = run(*words)
    assert ran.code == 10
    assert "input 4 active" in ran.out
    assert "project 1 stopped" in ran.out


def test_its_progress_is_called_estimated(run: Run, line: Line) -> None:
    ran = run("stepper", "run", line.url, "--project", "1", "--yes", "--progress", "--json")
    *estimates, last = ran.records
    assert {one["schema"] for one in estimates} == {"motorbus.stepper.estimated/1"}
    assert [one["estimated"] for one in estimates] == [True] * len(estimates)
    fractions = [one["fraction"] for one in estimates]
    assert fractions == sorted(fractions)
    assert len(fractions) > 4
    assert last["schema"] == "motorbus.stepper.run/1"


def test_far_ways_ask_and_what_is_refused_is_refused_before(run: Run, line: Line) -> None:
    ran = run("stepper", "run", line.url, "--project", "1")
    assert ran.code == 8
    assert "start project 1, which goes up to -6.2832 rad" in ran.err
    assert run("stepper", "run", line.url, "--project", "2").code == 2, "it has no steps"
    assert line.orders() == []


def test_a_dry_run_reads_and_starts_nothing(run: Run, line: Line) -> None:
    ran = run("stepper", "run", line.url, "--project", "1", "--stop-first", "--dry-run", "--json")
    sent = [one["data"][6:11] for one in ran.document["withheld"]]
    assert sent == ["5E 00", "03 0D", "4E 01"]
    assert line.orders() == []


@pytest.mark.parametrize(
    "words",
    [
        "run BUS",
        "run BUS --project 5",
        "run BUS --project one",
        "run BUS --project 1 --timeout 0",
        "run BUS --project 1 --timeout soon",
        "run BUS --project 1 --watch 6",
        "run BUS --project 1 --endless",
    ],
)
def test_bad_input_sends_nothing(words: str, run: Run, line: Line) -> None:
    ran = run("stepper", *words.replace("BUS", line.url).split(), "--yes")
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.count("error: ") == 1
    assert line.heard == []
