"""One of the four projects: selected, read, saved and cleared."""

from __future__ import annotations

from pathlib import Path

import pytest

from motorbus.families.stepper import Program
from tests.cli.conftest import Run
from tests.cli.stepper.conftest import Line


def test_selecting_keeps_the_number_of_steps_or_sets_it(run: Run, line: Line) -> None:
    ran = run("stepper", "select-project", line.url, "--project", "1")
    assert (ran.code, line.heard[-2].hex(" ").upper()) == (0, "FF AA 6E 01 01 00 00 00 00 00 19")
    ran = run("stepper", "select-project", line.url, "--project", "2", "--total-steps", "3", "--json")
    assert (ran.document["total_steps"], line.heard[-1][2:5]) == (3, bytes([0x6E, 2, 3]))


def test_one_that_was_cleared_has_no_steps_to_keep(run: Run, line: Line) -> None:
    ran = run("stepper", "select-project", line.url, "--project", "2")
    assert ran.code == 2
    assert "has been cleared" in ran.err
    assert line.orders() == []


def test_what_is_read_is_a_program(run: Run, line: Line, tmp_path: Path) -> None:
    text, dump = tmp_path / "one.toml", tmp_path / "one.bin"
    ran = run("stepper", "read-project", line.url, "--project", "1", "--json")
    for path in (text, dump):
        words = ("stepper", "read-project", line.url, "--project", "1", "--output", str(path))
        assert run(*words).code == 0
    program = Program.load(str(text))
    assert dump.read_bytes().hex(" ").upper() == ran.document["dump"]
    assert Program.from_dump(dump.read_bytes()).project == program.project
    assert program.project.step(1).speed == 100
    assert line.orders() == []


def test_a_cleared_one_has_nothing_to_say(run: Run, line: Line) -> None:
    assert "project 3 has been cleared" in run("stepper", "read-project", line.url, "--project", "3").out
    assert run("stepper", "read-project", line.url, "--project", "3", "--json").document["program"] is None


def test_saving_asks_and_says_what_it_proves(run: Run, line: Line) -> None:
    refused = run("stepper", "save-project", line.url, "--project", "1")
    assert (refused.code, line.orders()) == (8, [])
    ran = run("stepper", "save-project", line.url, "--project", "1", "--yes", "--json")
    assert (ran.document["saved"], ran.document["proof"]) == (True, "as_before")
    assert line.orders() == ["save_project"]


def test_clearing_asks_and_project_1_needs_an_expert(run: Run, line: Line) -> None:
    words = ("stepper", "clear-project", line.url, "--project", "1")
    assert run(*words, "--yes").code == 2
    assert run(*words, "--expert").code == 8
    assert line.orders() == []
    assert run(*words, "--expert", "--yes").code == 0
    assert line.orders() == ["clear_project"]
    assert line.simulation[1].memory["total_steps"] == 0


@pytest.mark.parametrize(
    "words",
    [
        "select-project BUS --project 0",
        "select-project BUS --project 5",
        "select-project BUS --project 2 --total-steps 11",
        "select-project BUS",
        "read-project BUS --project 9",
        "save-project BUS --project 5 --yes",
        "clear-project BUS --project 0 --yes",
        "clear-project BUS --project all --yes",
    ],
)
def test_bad_input_sends_nothing(words: str, run: Run, line: Line) -> None:
    ran = run("stepper", *words.replace("BUS", line.url).split())
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.count("error: ") == 1
    assert line.heard == []
