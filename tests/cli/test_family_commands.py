"""The demo and the commands of one family, in virtual time."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from motorbus.cli import main
from tests.cli.shell import PROGRAM

SERVO = "feetech:sim,ids=1,clock=virtual#1"
STEPPER = "stepper:sim,clock=virtual"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    (tmp_path / "program.toml").write_text(PROGRAM, encoding="utf-8")
    return tmp_path


def run(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    capsys.readouterr()
    code = main([*words, "--json"])
    out, err = capsys.readouterr()
    assert code == 0, err
    return json.loads(out)


def test_the_demo_moves_nine_axes_to_their_goals(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    found = run(capsys, "demo", "--output", "demo.svg")
    assert len(found["axes"]) == 9
    assert all(one["goal"] == one["position"] for one in found["axes"].values())
    assert max(found["durations"]) < 6
    assert "<svg" in (folder / "demo.svg").read_text(encoding="utf-8")


def test_set_mode_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    found = run(capsys, "feetech", "mode", SERVO, "velocity", "--yes")
    assert found["mode"] == "velocity"


def test_dry_run_of_write_shows_the_differences(capsys: pytest.CaptureFixture[str]) -> None:
    found = run(capsys, "stepper", "write", "program.toml", STEPPER, "--dry-run")
    assert found
    assert all(row["now"] != row["new"] for row in found)


def test_set_outputs_are_reported(capsys: pytest.CaptureFixture[str]) -> None:
    found = run(capsys, "stepper", "io", STEPPER, "1=on")
    assert found["outputs"]["1"] is True


def test_what_blocks_a_servo_names_a_command(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (("info", SERVO), ("feetech", "mode", SERVO)):
        found = run(capsys, *words)
        assert found["blocked"] == ["its torque is off: `motorbus torque on feetech:sim#1`"]


def test_a_dry_run_with_json_gives_the_frames(capsys: pytest.CaptureFixture[str]) -> None:
    (found,) = run(capsys, "torque", "off", SERVO, "--dry-run")
    assert found["would_send"] == "FF FF 01 04 03 28 00 CF"
    assert "torque_enable" in found["meaning"]


def test_arguments_of_a_command_have_units(capsys: pytest.CaptureFixture[str]) -> None:
    servo = "kst:sim,ids=0x25,clock=virtual"
    rows = run(capsys, "command", servo)
    assert {row["name"]: row["arguments"] for row in rows}["move"].startswith("TO(rad)")
    run(capsys, "command", servo, "move", "30deg", "timeout=900ms", "--yes")
    assert main(["command", servo, "move", "30mm", "--yes"]) == 2
    assert "measures length and not position" in capsys.readouterr().err


@pytest.mark.parametrize("assignment", ["torque_limit=50%", "goal_position=180deg"])
def test_several_servos_are_written_and_read_together(
    capsys: pytest.CaptureFixture[str], assignment: str
) -> None:
    servos = "feetech:sim,ids=1-3,clock=virtual#1-3"
    rows = run(capsys, "write", servos, assignment, "--yes")
    assert [row["device"] for row in rows] == ["#1", "#2", "#3"]
    assert [row["value"] for row in run(capsys, "read", servos, "id")] == [1, 2, 3]
