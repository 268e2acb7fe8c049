"""A program step by step."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.conftest import Run
from tests.cli.stepper.conftest import EXAMPLE
from tests.protocol.stepper.projects import MOTOR, file


def test_every_step_is_a_row(run: Run) -> None:
    ran = run("stepper", "show", EXAMPLE)
    assert ran.code == 0, ran.err
    lines = ran.out.splitlines()
    assert lines[0] == "Pick and place"
    assert [line.split()[0] for line in lines[2:12]] == [str(n) for n in range(1, 11)]
    for word in (
        "gripper on",
        "tray",
        "part",
        "trapezoid",
        "at least 52.8 s + 6 waits",
        "a pass ends where it began",
    ):
        assert word in ran.out


def test_the_plan_is_the_document(run: Run) -> None:
    document = run("stepper", "show", EXAMPLE, "--json").document
    assert document["schema"] == "motorbus.stepper.plan/1"
    assert (document["name"], len(document["steps"])) == ("Pick and place", 10)
    assert document["file"] == EXAMPLE


def test_several_are_shown_one_after_the_other(run: Run, tmp_path: Path) -> None:
    other = tmp_path / "other.toml"
    other.write_text(file(top='name = "Other"'), encoding="utf-8")
    out = run("stepper", "show", EXAMPLE, str(other)).out
    assert out == run("stepper", "show", EXAMPLE).out + run("stepper", "show", str(other)).out
    records = run("stepper", "show", EXAMPLE, str(other), "--json").records
    assert [(one["schema"], one["name"]) for one in records] == [
        ("motorbus.stepper.plan/1", "Pick and place"),
        ("motorbus.stepper.plan/1", "Other"),
    ]


def test_pulses_that_are_carried_are_a_range(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "thirds.toml"
    motor = MOTOR.replace("turn_distance = 5000", "turn_distance = 3")
    path.write_text(file(top="repeat = 9", motor=motor).replace("10 mm", "1 units"), encoding="utf-8")
    assert "533 to 534" in run("stepper", "show", "--rounding", "carry", str(path)).out
    assert "533 to" not in run("stepper", "show", str(path)).out


def test_where_a_pass_ends_is_said(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "walk.toml"
    path.write_text(file(top="repeat = 2"), encoding="utf-8")
    assert "a pass ends +10000 units from where it began" in run("stepper", "show", str(path)).out


@pytest.mark.parametrize("command", ["show", "estimate"])
def test_a_step_that_never_ends_is_a_document_too(run: Run, tmp_path: Path, command: str) -> None:
    endless = tmp_path / "endless.toml"
    endless.write_text(
        'format = 1\nproject = 2\n[motor]\nmicrosteps = 8\nstep_angle = "1.8 deg"\nturn_distance = 5000\n'
        '[[step]]\nspeed = "100 rpm"\nstart = "50 Hz"\nacceleration = "30 Hz"\n'
    )
    ran = run("stepper", command, str(endless), "--zero-distance", "endless", "--json")
    assert ran.code == 0, ran.err
    told = ran.document["estimate"] if command == "show" else ran.document["estimates"][0]
    assert told["seconds"] is None
    assert "never ends: step 1" in run("stepper", command, str(endless), "--zero-distance", "endless").out
