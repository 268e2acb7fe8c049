"""From file to motor over a real pseudo-terminal, each step a command of its own, with nothing but files in between."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.conftest import Run
from tests.cli.stepper.conftest import EXAMPLE
from tests.support.processes import Simulated

pytestmark = pytest.mark.usefixtures("state_folder")


def test_written_saved_kept_and_nothing_differs(run: Run, tmp_path: Path) -> None:
    backup = tmp_path / "backup.toml"
    with Simulated("stepper", link=tmp_path / "bus") as served:
        assert run("stepper", "write", EXAMPLE, served.bus, "--yes").code == 0
        assert run("stepper", "diff", EXAMPLE, served.bus).code == 0
        assert run("stepper", "backup", served.bus, str(backup)).code == 0
        assert run("stepper", "run", served.bus, "--project", "1", "--yes").code == 0
        assert run("move", f"{served.bus}#1+=45deg").code == 0
        assert run("stepper", "restore", str(backup), served.bus).code == 0, (
            "a motion leaves everything as it was"
        )


def test_a_jog_that_is_interrupted_is_stopped_and_puts_everything_back(run: Run, tmp_path: Path) -> None:
    with Simulated("stepper", link=tmp_path / "bus") as served:
        before = run("stepper", "read-project", served.bus, "--project", "1", "--json").document["dump"]
        words = ["jog", f"{served.bus}#1=60rpm", "--seconds", "30", "--yes", "-vv"]
        command = [sys.executable, "-m", "motorbus", *words]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as jogging:
            assert jogging.stderr is not None
            for line in jogging.stderr:
                if "tx FF AA 03 0C" in line:  # the motor has begun
                    jogging.send_signal(signal.SIGINT)
                    break
            rest = jogging.stderr.read()
            assert jogging.wait(timeout=30) == 10, rest
        assert "tx FF AA 03 0D" in rest
        assert (
            run("stepper", "read-project", served.bus, "--project", "1", "--json").document["dump"] == before
        )
        assert "nothing is unfinished" in run("recover", served.bus).out


def test_one_that_is_killed_is_taken_back(run: Run, tmp_path: Path) -> None:
    with Simulated("stepper", link=tmp_path / "bus") as served:
        before = run("stepper", "read-project", served.bus, "--project", "1", "--json").document["dump"]
        words = ["jog", f"{served.bus}#1=60rpm", "--seconds", "30", "--yes", "-vv"]
        command = [sys.executable, "-m", "motorbus", *words]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as jogging:
            assert jogging.stderr is not None
            next(line for line in jogging.stderr if "tx FF AA 03 0C" in line)
            jogging.kill()
        for refused in (
            ["jog", f"{served.bus}#1=60rpm", "--seconds", "0.1"],
            ["stepper", "run", served.bus, "--project", "1", "--yes"],
        ):
            ran = run(*refused)
            assert ran.code != 0
            assert "the borrow of project 1" in ran.err
        assert run("recover", served.bus, "--yes").code == 0
        assert (
            run("stepper", "read-project", served.bus, "--project", "1", "--json").document["dump"] == before
        )
