"""The demo and the commands of one family, in virtual time."""

from __future__ import annotations

import json
from pathlib import Path

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


def run(capsys: pytest.CaptureFixture[str], *words: str) -> object:
    capsys.readouterr()
    code = main([*words, "--json"])
    out, err = capsys.readouterr()
    assert code == 0, err
    return json.loads(out)


def test_the_demo_moves_nine_axes_to_their_goals(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    found = run(capsys, "demo", "--output", "demo.svg")
    assert isinstance(found, dict)
    assert len(found["axes"]) == 9
    assert all(one["goal"] == one["position"] for one in found["axes"].values())
    assert max(found["durations"]) < 6
    assert "<svg" in (folder / "demo.svg").read_text(encoding="utf-8")


def test_set_mode_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    found = run(capsys, "feetech", "mode", SERVO, "velocity", "--yes")
    assert isinstance(found, dict)
    assert found["mode"] == "velocity"


def test_dry_run_of_write_shows_the_differences(capsys: pytest.CaptureFixture[str]) -> None:
    found = run(capsys, "stepper", "write", "program.toml", STEPPER, "--dry-run")
    assert isinstance(found, list)
    assert found
    assert all(row["now"] != row["new"] for row in found)


def test_set_outputs_are_reported(capsys: pytest.CaptureFixture[str]) -> None:
    found = run(capsys, "stepper", "io", STEPPER, "1=on")
    assert isinstance(found, dict)
    assert found["outputs"]["1"] is True
