"""A program written from the shell: told beforehand, asked for, verified, and refused where it should be."""

from __future__ import annotations

from pathlib import Path

import pytest

from motorbus.families.stepper import Program
from tests.cli.conftest import Run
from tests.cli.stepper.conftest import EXAMPLE, Line


@pytest.fixture
def edited(run: Run, line: Line, tmp_path: Path) -> str:
    """Project 1 of the controller as a file, with another pause in its only step."""
    path = tmp_path / "edited.toml"
    assert run("stepper", "read-project", line.url, "--project", "1", "--output", str(path)).code == 0
    text = path.read_text(encoding="utf-8").replace("1000 ms", "500 ms")
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_a_difference_is_told_with_its_cost_and_ends_with_1(run: Run, line: Line, edited: str) -> None:
    ran = run("stepper", "diff", edited, line.url)
    assert ran.code == 1
    assert "project 1: 3 commands and 4 dumps" in ran.out
    assert "step_1_delay: 1 s -> 0.5 s" in ran.out
    (change,) = run("stepper", "diff", edited, line.url, "--json").document["changes"]
    assert (change["name"], change["before"], change["after"], change["raw_after"]) == (
        "step_1_delay",
        1.0,
        0.5,
        500,
    )
    assert line.orders() == []


def test_nothing_differs_after_it_was_written(run: Run, line: Line) -> None:
    ran = run("stepper", "write", EXAMPLE, line.url, "--yes", "--json")
    assert (ran.code, ran.err) == (0, "")
    assert (ran.document["saved"], ran.document["proof"]) == (True, "acknowledged")
    assert ran.document["commands"] == ran.document["difference"]["cost"]["writes"]
    assert run("stepper", "diff", EXAMPLE, line.url).code == 0
    line.simulation[1].power_cycle()
    assert run("stepper", "diff", EXAMPLE, line.url, "--project", "2").code == 0
    before = len(line.orders())
    assert run("stepper", "write", EXAMPLE, line.url).code == 0, "nothing to agree to"
    assert len(line.orders()) == before


def test_one_field_is_three_commands(run: Run, line: Line, edited: str) -> None:
    ran = run("stepper", "write", edited, line.url, "--yes")
    assert line.orders() == ["select_project", "set_step_delay", "save_project"]
    assert ran.out.index("step_1_delay: 1 s -> 0.5 s") < ran.out.index("proved by a power cycle only")


def test_without_saving_a_power_cycle_takes_it_away(run: Run, line: Line, edited: str) -> None:
    assert run("stepper", "write", edited, line.url, "--no-save", "--yes").code == 0
    assert run("stepper", "diff", edited, line.url).code == 0
    line.simulation[1].power_cycle()
    assert run("stepper", "diff", edited, line.url).code == 1


def test_it_asks_and_shows_first(run: Run, line: Line, edited: str) -> None:
    ran = run("stepper", "write", edited, line.url)
    assert ran.code == 8
    assert "step_1_delay: 1 s -> 0.5 s" in ran.out
    assert "write project 1" in ran.err
    assert line.orders() == []


def test_a_dry_run_shows_every_frame_to_the_save(run: Run, line: Line, edited: str) -> None:
    ran = run("stepper", "write", edited, line.url, "--dry-run", "--json")
    assert [one["data"] for one in ran.document["withheld"]] == [
        "FF AA 6E 01 01 00 00 00 00 00 19",
        "FF AA 03 07 F4 01 00 00 00 01 A9",
        "FF AA 2E 01 00 00 00 00 00 00 D8",
    ]
    assert "step_1_delay" in run("stepper", "write", edited, line.url, "--dry-run").out
    assert line.orders() == []


def test_what_would_not_do_what_it_says_needs_an_expert(run: Run, line: Line, tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(
        Program.load(EXAMPLE).text().replace('start = "400 Hz"', 'start = "0 Hz"'), encoding="utf-8"
    )
    ran = run("stepper", "write", str(path), line.url, "--yes")
    assert (ran.code, line.heard) == (2, [])
    assert "`motorbus stepper check` names them all; with --expert it is written all the same" in ran.err
    assert run("stepper", "write", str(path), line.url, "--yes", "--expert").code == 0


@pytest.mark.parametrize(
    "words",
    [
        "write not-there.toml BUS",
        "write EXAMPLE BUS --project 5",
        "write EXAMPLE BUS --project 0",
        "write EXAMPLE kst:sim",
        "write EXAMPLE",
        "diff EXAMPLE BUS --project 7",
        "diff EXAMPLE BUS --dump-order middle",
    ],
)
def test_bad_input_sends_nothing(words: str, run: Run, line: Line) -> None:
    said = words.replace("BUS", line.url).replace("EXAMPLE", EXAMPLE).split()
    ran = run("stepper", *said)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.count("error: ") == 1
    assert line.heard == []
