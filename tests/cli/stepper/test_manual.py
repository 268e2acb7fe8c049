"""The commands of the manual that are one frame: each sends its own, and nothing at all where it cannot be."""

from __future__ import annotations

import shlex

import pytest

from motorbus.cli.stepper import app
from motorbus.cli.stepper.manual import EXAMPLES, words
from motorbus.families.stepper import wire
from motorbus.families.stepper.table import EDITS, ORDERS
from tests.cli.conftest import Run
from tests.cli.stepper.conftest import Line

FRAMES = {
    "set_microstep_and_angle": "FF AA 03 01 08 00 B4 00 00 00 69",
    "set_turn_distance": "FF AA 03 02 40 06 00 00 00 00 F4",
    "set_step_distance": "FF AA 03 03 0A 00 00 00 00 01 BA",
    "set_step_direction_start": "FF AA 03 04 01 32 00 00 00 01 E4",
    "set_step_accel_speed": "FF AA 03 05 1E 00 64 00 00 01 34",
    "set_step_output": "FF AA 03 06 04 00 00 00 00 01 B7",
    "set_step_delay": "FF AA 03 07 F4 01 00 00 00 01 A9",
    "set_step_start_input": "FF AA 03 08 02 00 00 00 00 01 B7",
    "set_step_stop_input": "FF AA 03 09 00 00 00 00 00 01 B6",
    "set_segment_loop": "FF AA 7E 01 01 03 00 00 00 00 2C",
    "set_project_loop": "FF AA 8E FF 00 00 00 00 00 00 36",
    "set_stop_mode": "FF AA 03 0E 01 00 00 00 00 00 BB",
    "set_mode4": "FF AA 9E 00 00 00 00 00 00 00 47",
    "set_power_on_home": "FF AA AE 00 00 00 00 00 00 00 57",
}
"""What the examples of the help send: bytes by hand, after the manual, not by our encoder."""
STOPS = {
    "stop_project": "FF AA 5E 00 00 00 00 00 00 00 07",
    "stop_motor": "FF AA 03 0D 00 00 00 00 00 00 B9",
}


def test_there_is_a_command_for_each_of_the_27() -> None:
    known = [name for name in app if not name.startswith("-")]
    assert [name for name in wire.COMMANDS if words(name) not in known] == []
    assert len(wire.COMMANDS) == 27


def test_each_that_sets_something_has_an_example() -> None:
    assert set(EXAMPLES) == set(FRAMES) == set(EDITS) - {"select_project"}


@pytest.mark.parametrize("name", FRAMES)
def test_it_sends_one_frame_and_says_what_for(name: str, run: Run, line: Line) -> None:
    ran = run("stepper", words(name), line.url, *shlex.split(EXAMPLES[name]))
    assert (ran.code, ran.err) == (0, "")
    assert [data.hex(" ").upper() for data in line.heard if data[2] != 0x3E] == [FRAMES[name]]
    assert "the selected project, whichever that is" in ran.out
    assert "lost with the supply unless it is saved" in ran.out


@pytest.mark.parametrize("name", FRAMES)
def test_a_project_is_selected_first_and_keeps_its_steps(name: str, run: Run, line: Line) -> None:
    ran = run("stepper", words(name), line.url, *shlex.split(EXAMPLES[name]), "--project", "1", "--json")
    assert ran.code == 0, ran.err
    assert ran.document["schema"] == f"motorbus.stepper.{words(name)}/1"
    assert (ran.document["project"], ran.document["kept"]) == (1, False)
    assert line.orders() == ["select_project", name]


@pytest.mark.parametrize("name", FRAMES)
def test_a_dry_run_sends_nothing_and_shows_it(name: str, run: Run, line: Line) -> None:
    ran = run("stepper", words(name), line.url, *shlex.split(EXAMPLES[name]), "--dry-run", "--json")
    assert ran.code == 0, ran.err
    assert line.orders() == []
    assert [one["data"] for one in ran.document["withheld"]] == [FRAMES[name]]


@pytest.mark.parametrize("name", STOPS)
def test_a_stop_is_one_frame(name: str, run: Run, line: Line) -> None:
    ran = run("stepper", words(name), line.url)
    assert (ran.code, ran.err) == (0, "")
    assert [data.hex(" ").upper() for data in line.heard if data[2] != 0x3E] == [STOPS[name]]
    assert "accepted" in ran.out


@pytest.mark.parametrize(
    ("line_", "told"),
    [
        ("set-step-delay BUS --step 11 --delay 5", "1 to 10"),
        ("set-step-delay BUS --step 0 --delay 5", "1 to 10"),
        ("set-step-delay BUS --step 1 --delay -5", "0 to 16777215 ms"),
        ("set-step-delay BUS --step 1 --delay 16777216", "0 to 16777215 ms"),
        ("set-step-delay BUS --step 1 --delay 0.5ms", "lies between two numbers"),
        ("set-step-delay BUS --step 1 --delay 3V", "measures voltage"),
        ("set-step-delay BUS --step 1 --delay soon", "is not a"),
        ("set-step-distance BUS --step 1 --distance 1.5", "is not a whole number"),
        ("set-step-distance BUS --step 1", "--distance"),
        ("set-step-output BUS --step 1 --output 9", "0 to 8"),
        ("set-step-start-input BUS --step 1 --start-input 3", "inputs 3 and 4 start and stop projects"),
        ("set-microstep-and-angle BUS --microsteps 0 --step-angle 180", "1 to 65535"),
        ("set-microstep-and-angle BUS --microsteps 8 --step-angle 7.5deg", "2.55"),
        ("set-segment-loop BUS --loop-first 5 --loop-last 2 --loop-count 2", "is no range"),
        ("set-project-loop BUS --project-loop 256", "0 to 255"),
        ("set-stop-mode BUS --stop-mode gently", "is not a whole number"),
        ("set-step-delay BUS --step 1 --delay 5 --project 5", "5"),
        ("set-step-delay BUS --step 1 --delay 5 --colour red", "--colour: no such flag"),
        ("set-step-delay feetech:sim --step 1 --delay 5", "is no stepper bus"),
        ("set-step-delay BUS#2 --step 1 --delay 5", "is not the id of a stepper controller"),
    ],
)
def test_bad_input_is_one_error_before_anything_is_sent(line_: str, told: str, run: Run, line: Line) -> None:
    ran = run("stepper", *line_.replace("BUS", line.url).split())
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.count("error: ") == 1
    assert told in ran.err
    assert line.heard == []


@pytest.mark.parametrize("name", ["set_mode4", "set_power_on_home"])
def test_what_nobody_knows_or_moves_at_power_on_asks_first(name: str, run: Run, line: Line) -> None:
    flags = shlex.split(EXAMPLES[name].replace("--yes", ""))
    ran = run("stepper", words(name), line.url, *flags)
    assert ran.code == 8
    assert ORDERS[name].note in ran.err
    assert line.orders() == []


def test_a_port_is_not_opened_for_what_cannot_be(run: Run) -> None:
    ran = run("stepper", "set-step-delay", "stepper:/dev/not-there", "--step", "1", "--delay", "-1")
    assert ran.code == 2
    assert run("stepper", "stop-motor", "stepper:/dev/not-there").code == 3


def test_edits_are_kept_when_they_are_saved(run: Run, line: Line) -> None:
    """The way that the help describes: select once, set, save."""
    for words_ in (
        "select-project BUS --project 1",
        "set-step-delay BUS --step 1 --delay 250ms",
        "set-step-distance BUS --step 1 --distance 7",
        "save-project BUS --project 1 --yes",
    ):
        assert run("stepper", *words_.replace("BUS", line.url).split()).code == 0
    line.simulation[1].power_cycle()
    read = run("read", f"{line.url}#1", "step_1_delay", "step_1_distance", "--json").document["registers"]
    assert [one["raw"] for one in read] == [250, 7]
