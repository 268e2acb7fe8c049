"""The emergency stop from another shell: of a program that loops, of one that hangs, of a bus that nobody holds."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import motorbus
from motorbus.cli.simulated import Simulated
from tests.cli.conftest import Bench, Run

LOOPING = """
import sys, motorbus
with motorbus.open(sys.argv[1]) as bus:
    servos = [motorbus.feetech.Servo(bus, node) for node in (1, 2, 3)]
    for servo in servos:
        servo.enable_torque()
    print("looping", flush=True)
    try:
        while True:
            for servo in servos:
                servo.move(servo.position() + 0.01, wait=False)
    except motorbus.Interrupted:
        print("interrupted", flush=True)
"""
HANGING = """
import asyncio, sys, motorbus
async def main():
    async with motorbus.open_async(sys.argv[1]) as bus:
        for node in (1, 2, 3):
            await motorbus.feetech.AsyncServo(bus, node).enable_torque()
        print("hanging", flush=True)
        sys.stdin.read()  # the event loop stands still
asyncio.run(main())
"""
WATCHING = """
import sys, motorbus
with motorbus.open(sys.argv[1]) as bus:
    print("watching", flush=True)
    sys.stdin.read()
"""
FOREIGN = """
import os, sys
descriptor = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
print("holding", flush=True)
sys.stdin.read()
"""

pytestmark = pytest.mark.usefixtures("state_folder")


@contextmanager
def program(code: str, argument: str) -> Iterator[subprocess.Popen[str]]:
    """Another program, from its first line of output on; it ends when its stdin does."""
    command = [sys.executable, "-c", code, argument]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline()
        try:
            yield process
        finally:
            process.communicate(timeout=30)


def torque(bus: str) -> list[float]:
    with motorbus.open(bus) as opening:
        return [
            motorbus.feetech.Servo(opening, node).read("torque_enable")["torque_enable"] for node in (1, 2, 3)
        ]


@pytest.mark.parametrize("named", [True, False], ids=["named", "every bus"])
def test_a_program_that_loops_is_stopped(named: bool, served: Simulated, run: Run) -> None:
    with program(LOOPING, served.bus) as process:
        ran = run("estop", *([served.bus] if named else []), "--json")
        assert process.stdout is not None
        assert process.stdout.readline() == "interrupted\n"
    assert ran.code == 0
    (stop,) = ran.document["buses"]
    assert stop["acknowledged"] == [1, 2, 3]
    assert str(process.pid) in stop["by"]
    assert torque(served.bus) == [0, 0, 0]


def test_a_program_whose_event_loop_hangs_is_stopped(served: Simulated, run: Run) -> None:
    with program(HANGING, served.bus) as process:
        ran = run("estop", served.bus, "--json")
        assert process.poll() is None
    assert ran.code == 0
    assert ran.document["buses"][0]["acknowledged"] == [1, 2, 3]
    assert torque(served.bus) == [0, 0, 0]


def test_who_was_named_but_is_unknown_to_the_owner_is_silent(served: Simulated, run: Run) -> None:
    with program(HANGING, served.bus):
        ran = run("estop", f"{served.bus}#3+9", "--json")
    assert ran.code == 6
    (stop,) = ran.document["buses"]
    assert (stop["outcome"], stop["silent"]) == ("acknowledged by some", [9])


def test_a_move_that_is_stopped_says_so(served: Simulated, run: Run) -> None:
    command = [
        sys.executable,
        "-m",
        "motorbus.cli",
        "move",
        f"{served.bus}#1=90deg",
        "--velocity",
        "0.1",
        "-vv",
    ]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        while "tx FF FF 01 0A 03 29" not in process.stderr.readline():
            assert process.poll() is None
        assert run("estop", served.bus).code == 0
        _, told = process.communicate(timeout=30)
    assert process.returncode == 10
    assert "an emergency stop is latched" in told


def test_a_bus_that_nobody_holds_is_stopped_from_here(served: Simulated, run: Run) -> None:
    with motorbus.open(served.bus) as bus:
        for node in (1, 2, 3):
            motorbus.feetech.Servo(bus, node).enable_torque()
    ran = run("estop", served.bus)
    assert (ran.code, ran.err) == (0, "")
    assert "sags or falls" in ran.out
    assert torque(served.bus) == [0, 0, 0]


def test_devices_that_are_named_confirm_it(served: Simulated, run: Run) -> None:
    ran = run("estop", f"{served.bus}#1+9", "--json")
    assert ran.code == 6
    (stop,) = ran.document["buses"]
    assert (stop["acknowledged"], stop["silent"], stop["by"]) == ([1], [9], "this process")


@pytest.mark.parametrize(("devices", "silent"), [("", []), ("#8+9", [8, 9])], ids=["unnamed", "named"])
def test_a_stop_that_nobody_acknowledged_promises_nothing(devices: str, silent: list[int], run: Run) -> None:
    words = run("estop", f"feetech:sim,ids=2-6{devices}")
    assert words.code == 5
    assert "acknowledged by nobody" in words.out
    assert "torque off" not in words.out
    ran = run("estop", f"feetech:sim,ids=2-6{devices}", "--json")
    assert ran.code == 5
    (stop,) = ran.document["buses"]
    assert (stop["outcome"], stop["acknowledged"], stop["promise"]) == ("acknowledged by nobody", [], "")
    assert stop["silent"] == silent
    assert json.loads(ran.err)["error"] == "NoReply"


def test_who_can_acknowledge_is_said_where_nobody_was_named(run: Run) -> None:
    ran = run("estop", "feetech:sim,ids=1-6")
    assert ran.code == 0
    assert "acknowledged by #1\n" in ran.out
    assert "only devices that are named" in ran.out
    assert "only devices" not in run("estop", "feetech:sim,ids=1-6#1-6").out


def test_a_stop_that_some_acknowledged_says_so_to_programs(run: Run) -> None:
    ran = run("estop", "feetech:sim,ids=1-2#1-3", "--json")
    assert ran.code == 6
    assert ran.document["buses"][0]["outcome"] == "acknowledged by some"


def test_a_foreign_program_is_named(served: Simulated, run: Run) -> None:
    port = served.bus.partition(":")[2]
    with program(FOREIGN, port) as process:
        ran = run("estop", served.bus)
    assert ran.code == 4
    assert str(process.pid) in ran.err


def test_without_a_bus_there_must_be_one(run: Run) -> None:
    ran = run("estop")
    assert ran.code == 2
    assert "no motorbus process" in ran.err


def test_the_help_says_that_the_arm_will_sag(run: Run) -> None:
    assert "SAG" in run("estop", "--help").out


def test_by_name_every_bus_of_it_is_stopped(bench: Bench, run: Run) -> None:
    stops = run("estop", "all", "--json").document["buses"]
    assert [one["acknowledged"] for one in stops] == [[1, 2, 3], [37], [1]]


def test_without_a_name_the_machine_is_stopped(bench: Bench, run: Run) -> None:
    assert run("hold", "a1").code == 0
    stops = run("estop", "--json").document["buses"]
    assert [one["acknowledged"] for one in stops] == [[1, 2, 3], [37], [1]]
    assert run("read", "a1", "torque_enable", "--json").document["registers"][0]["raw"] == 0


def test_a_broken_machine_file_keeps_nobody_from_being_stopped(
    served: Simulated, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "motorbus.toml").write_text("no machine", encoding="utf-8")
    with program(HANGING, served.bus):
        ran = run("estop", "--json")
    assert ran.code == 0
    assert "the machine file is of no help" in ran.err
    assert torque(served.bus) == [0, 0, 0]
