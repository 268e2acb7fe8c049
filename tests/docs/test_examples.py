"""Every example runs as a user would run it, and says what it should; the test of a robot in its own process."""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEST = "test_of_my_robot.py"
EXPECTED = {
    "one_servo.py": ["STS3215 simulated", "3.142 rad, 7.4 V", "now at 3.44"],
    "async_servos.py": ["1: 3.142 rad", "6: 3.142 rad", "7: no reply"],
    "can_servo.py": ["simulated", "at 10.9°", "at -0.8°", "at 0.0°"],
    "control_loop.py": ["cycles/s, simulated"],
    "fleet.py": ["30 axes within 0.000 rad of their goals, simulated", "times faster than real time"],
    "robot.py": [
        "bench: 9 axes, simulated",
        "planned=1.0",
        "shoulder at -0.30",
        "slide at 0.02, estimated",
    ],
    "async_robot.py": ["MoveResult", "held up: True", "tilt 0.20 rad"],
    TEST: ["1 passed"],
}


def test_every_example_is_run() -> None:
    assert {path.name for path in (ROOT / "examples").glob("*.py")} == set(EXPECTED)


@pytest.mark.parametrize("name", [name for name in EXPECTED if name != TEST])
def test_an_example_runs(
    name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", [name])
    runpy.run_path(str(ROOT / "examples" / name), run_name="__main__")
    out = capsys.readouterr().out
    for text in EXPECTED[name]:
        assert text in out


def test_the_test_of_a_robot_runs() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(ROOT / "examples" / TEST)],
        env={**os.environ, "PYTHONPATH": str(ROOT / "src")},
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert EXPECTED[TEST][0] in done.stdout
