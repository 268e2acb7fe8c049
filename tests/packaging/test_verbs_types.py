"""A type checker sees through verbs: what is wrong with a call of a servo or a robot is found before it is run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from mypy import api

ROOT = Path(__file__).resolve().parents[2]
SNIPPET = """
from motorbus import Robot
from motorbus.families.feetech import AsyncServo, Servo

def blocking(servo: Servo) -> None:
    servo.move(1.0, velocity=2.0, wait=False)
    here: float = servo.position()
    servo.move(1.0, speed=2.0)  # call-arg: there is no such argument
    servo.move("far")  # arg-type: a position is a number
    text: str = servo.position()  # assignment: a position is a number
    servo.mvoe(1.0)  # attr-defined: there is no such verb

async def awaiting(servo: AsyncServo) -> None:
    await servo.move(1.0, velocity=2.0, wait=False)
    here: float = await servo.position()
    servo.move(1.0)  # unused-coroutine: await is forgotten
    there: float = servo.position()  # assignment: await is forgotten
    await servo.move(1.0, speed=2.0)  # call-arg: there is no such argument
    await servo.move("far")  # arg-type: a position is a number
    text: str = await servo.position()  # assignment: a position is a number

def together(robot: Robot) -> None:
    robot.move({"shoulder": 0.5}, duration=1.0)
    robot.move({"shoulder": "far"})  # dict-item: a goal is a number
    robot.mvoe({"shoulder": 0.5})  # attr-defined: there is no such method
    robot.stop(when="now")  # call-arg: there is no such argument
"""


def wrong() -> dict[int, str]:
    """Line by line, which error the snippet is to have."""
    found = ((number, re.search(r"# ([a-z-]+):", line)) for number, line in enumerate(SNIPPET.split("\n"), 1))
    return {number: match[1] for number, match in found if match}


def test_what_is_wrong_with_a_call_is_found_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "snippet.py"
    file.write_text(SNIPPET, encoding="utf-8")
    monkeypatch.setenv("MYPYPATH", str(ROOT / "src"))
    told, trouble, _ = api.run(
        ["--strict", "--config-file=", f"--cache-dir={tmp_path / 'cache'}", "--no-pretty", str(file)]
    )
    assert trouble == ""
    errors = re.findall(r"snippet\.py:(\d+): error: .*\[([a-z-]+)\]$", told, re.MULTILINE)
    assert {int(line): code for line, code in errors} == wrong(), told
    assert len(errors) == len(wrong())
