"""The commands `motorbus stepper ...`, judged by their output and by the memory of the simulated controller."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import motorbus
from motorbus.families.stepper.program.backup import Backup
from motorbus.families.stepper.program.file import Program
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run

EXAMPLE = str(Path(__file__).resolve().parents[3] / "examples" / "pick_and_place.toml")
FEED = """format = 1
project = 2
[motor]
microsteps = 8
step_angle = "1.8 deg"
turn_distance = 1600
[[step]]
move = "400 units"
speed = "60 rpm"
start = "400 Hz"
acceleration = "50 Hz"
"""


@pytest.fixture
def line() -> Iterator[Simulation]:
    """A controller as it is shipped, in virtual time."""
    with motorbus.simulate("stepper") as simulation:
        yield simulation


@pytest.fixture
def feed(tmp_path: Path) -> str:
    path = tmp_path / "feed.toml"
    path.write_text(FEED, encoding="utf-8")
    return str(path)


def stored(line: Simulation, number: int) -> Any:
    node: Any = line[1]
    return node.store.stored[number]


# -- check ---------------------------------------------------------------------------------------------


def test_check_shows_steps_duration_and_findings(run: Run, feed: str) -> None:
    ran = run("stepper", "check", EXAMPLE)
    assert ran.code == 0, ran.err
    assert ran.out.startswith("Pick and place\nstep  times")
    assert "at least 52.8 s + 6 waits; 49.7 s to 98.4 s in other readings" in ran.out
    document = run("stepper", "check", feed, "--highest", "1000", "--json").document
    assert document["schema"] == "motorbus.stepper.check/1"
    assert [(one["rule"], one["step"]) for one in document["findings"]] == [("L4", 1)]
    assert document["estimate"]["endless"] is False


def test_check_fails_for_an_error_and_for_no_program(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "slow.toml"
    path.write_text(FEED.replace("400 Hz", "0 Hz"), encoding="utf-8")
    ran = run("stepper", "check", str(path))
    assert ran.code == 1
    assert "L5 error: step 1: start 0 Hz" in ran.out
    path.write_text(FEED.replace("60 rpm", "60 mph"), encoding="utf-8")
    ran = run("stepper", "check", str(path))
    assert ran.code == 2
    assert "step 1, speed: '60 mph' has no unit that is possible here" in ran.err


# -- write and read ------------------------------------------------------------------------------------


def test_write_shows_what_differs_asks_and_saves(line: Simulation, run: Run, feed: str) -> None:
    refused = run("stepper", "write", feed, line.url)
    assert refused.code == 8, refused.err
    assert "write project 2" in refused.err
    assert stored(line, 2).is_cleared
    ran = run("stepper", "write", feed, line.url, "--yes")
    assert ran.code == 0, ran.err
    assert "step_1_distance" in ran.out
    assert stored(line, 2) == Program.parse(FEED).project
    document = run("stepper", "write", feed, line.url, "--json").document  # nothing differs: no question
    assert [(one["project"], one["proof"]) for one in document["projects"]] == [(2, "unchanged")]


def test_write_takes_another_project_and_may_leave_it_unsaved(line: Simulation, run: Run, feed: str) -> None:
    ran = run("stepper", "write", feed, line.url, "--project", "3", "--no-save", "--yes")
    assert ran.code == 0, ran.err
    assert stored(line, 3).is_cleared
    assert line[1].memory["step_1_distance"] == 400
    line[1].power_cycle()
    assert line[1].memory["step_1_distance"] == 1


def test_a_dry_run_shows_every_frame_and_changes_nothing(line: Simulation, run: Run, feed: str) -> None:
    ran = run("stepper", "write", feed, line.url, "--dry-run", "--json")
    assert ran.code == 0, ran.err
    frames = [one["data"] for one in ran.document["withheld"]]
    assert frames[0] == "FF AA 6E 02 01 00 00 00 00 00 1A"
    assert frames[-1] == "FF AA 2E 02 00 00 00 00 00 00 D9"
    assert stored(line, 2).is_cleared


def test_errors_of_a_program_are_refused_unless_expert(line: Simulation, run: Run, tmp_path: Path) -> None:
    path = tmp_path / "slow.toml"
    path.write_text(FEED.replace("400 Hz", "0 Hz"), encoding="utf-8")
    assert run("stepper", "write", str(path), line.url, "--yes").code == 2
    assert stored(line, 2).is_cleared
    assert run("stepper", "write", str(path), line.url, "--yes", "--expert").code == 0
    assert stored(line, 2).total_steps == 1


def test_read_prints_a_program_that_write_takes(line: Simulation, run: Run, tmp_path: Path) -> None:
    ran = run("stepper", "read", line.url)
    assert ran.code == 0, ran.err
    assert ran.out.startswith(f"# read from {line.url} (simulated)\n")
    assert Program.parse(ran.out).project == stored(line, 1)
    path = tmp_path / "one.toml"
    path.write_text(ran.out, encoding="utf-8")
    assert run("stepper", "write", str(path), line.url).code == 0  # nothing differs


def test_a_backup_is_read_and_written_back(line: Simulation, run: Run, feed: str, tmp_path: Path) -> None:
    ran = run("stepper", "read", line.url, "--all")
    assert Backup.parse(ran.out).projects == (1, 2, 3, 4)
    path = tmp_path / "all.toml"
    path.write_text(ran.out, encoding="utf-8")
    before = dict(line[1].store.stored)
    assert run("stepper", "write", feed, line.url, "--yes").code == 0
    ran = run("stepper", "write", str(path), line.url, "--yes")
    assert ran.code == 0, ran.err
    assert "project 2: to be cleared" in ran.out
    assert line[1].store.stored == before


# -- run, inputs and outputs ---------------------------------------------------------------------------


def test_run_waits_for_the_notice(line: Simulation, run: Run) -> None:
    assert run("stepper", "run", line.url, "--project", "1").code == 8  # one turn needs consent
    ran = run("stepper", "run", line.url, "--project", "1", "--yes", "--json")
    assert ran.code == 0, ran.err
    assert (ran.document["outcome"], ran.document["project"]) == ("completed", 1)
    assert line[1].status()["position"] == -1600


def test_run_ends_with_the_code_of_its_outcome(line: Simulation, run: Run) -> None:
    ran = run("stepper", "run", line.url, "--project", "1", "--yes", "--timeout", "0.5s")
    assert ran.code == 5
    assert "it may still run: `motorbus stop` ends it" in ran.err
    assert run("stop", line.url).code == 0
    ran = run("stepper", "run", line.url, "--project", "3", "--yes")
    assert ran.code == 2
    assert "project 3 has no steps" in ran.err


def test_a_dry_run_of_run_shows_the_start(line: Simulation, run: Run) -> None:
    ran = run("stepper", "run", line.url, "--project", "1", "--dry-run", "--json")
    assert ran.code == 0, ran.err
    assert [one["data"] for one in ran.document["withheld"]] == ["FF AA 4E 01 00 00 00 00 00 00 F8"]
    assert line[1].status()["position"] == 0


def test_io_reads_inputs_and_sets_outputs(line: Simulation, run: Run) -> None:
    line[1].set_input(2, True)
    document = run("stepper", "io", line.url, "--json").document
    assert document["inputs"] == {"1": False, "2": True, "3": False, "4": False, "5": False}
    ran = run("stepper", "io", line.url, "all=off", "2=on", "leds=on", "--json")
    assert ran.document["last_commanded"] == {"1": False, "2": True, "3": False, "5": True}
    assert line[1].status()["outputs"] == [False, True, False]
    assert run("stepper", "io", line.url, "7=on").code == 2
    shown = run("stepper", "io", line.url, "1=on", "--dry-run", "--json").document["withheld"]
    assert [one["data"] for one in shown] == ["FF AA 00 0C 01 01 00 00 00 00 B7"]
    assert line[1].status()["outputs"] == [False, True, False]


@pytest.mark.parametrize("command", ["check", "write", "read", "run", "io"])
def test_help_has_examples(run: Run, command: str) -> None:
    ran = run("stepper", command, "--help")
    assert ran.code == 0
    assert f"motorbus stepper {command}" in ran.out
    assert "Examples:" in ran.out


def test_another_family_is_refused(run: Run) -> None:
    ran = run("stepper", "io", "feetech:sim")
    assert ran.code == 2
    assert "is no stepper bus" in ran.err


# -- common commands -----------------------------------------------------------------------------------


def test_common_commands_work_on_a_controller(line: Simulation, run: Run) -> None:
    written = run("write", line.url, "step_1_delay=500ms", "--yes", "--json").document
    assert written["result"]["changes"] == {"step_1_delay": [1000, 500]}
    assert stored(line, 1).step(1).delay == 500
    assert run("read", line.url, "step_1_delay", "--json").document["registers"][0]["raw"] == 500
    assert run("move", f"{line.url}+=90deg", "--velocity", "60rpm").code == 0
    assert line[1].status()["position"] == 400
    assert run("jog", f"{line.url}=60rpm", "--seconds", "0.25").code == 0
    assert run("stop", line.url).code == 0
    document = run("write", line.url, "step_1_delay=1s", "--dry-run", "--json").document
    assert [one["data"][6:11] for one in document["withheld"]] == ["6E 01", "03 07", "2E 01"]


def test_a_backup_that_is_not_to_be_saved_is_refused(line: Simulation, run: Run, tmp_path: Path) -> None:
    path = tmp_path / "backup.toml"
    path.write_text(run("stepper", "read", line.url, "--all").out, encoding="utf-8")
    ran = run("stepper", "write", str(path), line.url, "--no-save", "--yes")
    assert (ran.code, "a backup is always saved" in ran.err) == (2, True)
