"""One machine on three real ports, each with a simulator in a process of its own: what goes well, and what fails."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from tests.cli.conftest import Run
from tests.support.machines import described
from tests.support.processes import Simulated

NAMES = "arm", "can", "stage"
EXTRA = '[pose.ready]\na1 = "10 deg"\nc1 = "5 deg"\n'
GOAL = re.compile(r" tx FF FF \w\w \w\w (83|03) (29|2A) ")
"""A write of goals to the arm."""


class Served(NamedTuple):
    """Its simulators by the names of the buses."""

    simulators: dict[str, Simulated]


def write(folder: Path, addresses: dict[str, str]) -> None:
    """The machine file of buses at these addresses."""
    text = described(addresses, "1-3", "0x25", True, {"a1": {"park": "0 deg"}}, {})
    (folder / "motorbus.toml").write_text(text + EXTRA, encoding="utf-8")


@pytest.fixture
def served_machine(tmp_path: Path, state_folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    """Six devices of three families on two pseudo-terminals and one slcan, and their file in this folder."""
    monkeypatch.chdir(tmp_path)
    with ExitStack() as stack:
        ids = {"arm": ("feetech", "1-3"), "can": ("kst", "0x25"), "stage": ("stepper", "1")}
        found = {
            name: stack.enter_context(Simulated(family, ids=which, link=tmp_path / name))
            for name, (family, which) in ids.items()
        }
        write(tmp_path, {name: one.bus for name, one in found.items()})
        yield Served(found)


def command(*words: str) -> subprocess.Popen[str]:
    """A command in a process of its own, which says what it sends."""
    return subprocess.Popen(
        [sys.executable, "-m", "motorbus", *words, "-vv", "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def under_way(process: subprocess.Popen[str]) -> None:
    """Come back when goals have left for all servos of the arm several times."""
    assert process.stderr is not None
    orders = 0
    while orders < 10:
        line = process.stderr.readline()
        assert line, "it ended before it moved"
        orders += GOAL.search(line) is not None


def told(process: subprocess.Popen[str]) -> dict[str, Any]:
    """The one error that it ends with; what it logged is passed over."""
    out, err = process.communicate(timeout=60)
    assert out == ""
    errors = [json.loads(line) for line in err.splitlines() if line.startswith("{")]
    assert len(errors) == 1
    found: dict[str, Any] = errors[0]
    assert found["schema"] == "motorbus.error/1"
    return found


def stand(run: Run, *axes: str) -> dict[str, float]:
    """Where they are (rad)."""
    return {one["name"]: one["present"] for one in run("hold", *axes, "--json").document["axes"]}


def test_it_moves_as_one(served_machine: Served, run: Run) -> None:
    ran = run("move", "a1=10deg", "a2=-10deg", "c1=5deg", "lift=2mm", "--assume", "lift=0", "--json")
    assert ran.code == 0, ran.err
    for one in ran.document["axes"]:
        assert one["present"] == pytest.approx(one["goal"], abs=0.02)
    assert run("pose", "--save", "there", "a1", "a2", "c1").code == 0
    assert run("pose", "there").code == 0
    assert run("park").code == 0
    assert stand(run, "a1")["a1"] == pytest.approx(0, abs=0.02)
    assert run("stop").code == 0


def test_a_port_that_dies_on_the_way_stops_the_others_and_is_the_one_error(
    served_machine: Served, run: Run
) -> None:
    with command("move", "a1=120deg", "c1=45deg", "--duration", "40s") as process:
        under_way(process)
        served_machine.simulators["arm"].process.kill()
        error = told(process)
    assert process.returncode == 3
    assert (error["error"], error["exit"]) == ("LinkLost", 3)
    there = stand(run, "c1")["c1"]
    assert there < 0.6, "it went on to its goal alone"
    assert stand(run, "c1")["c1"] == pytest.approx(there, abs=0.01)


def test_ctrl_c_stops_them_all_and_says_where_they_stand(served_machine: Served, run: Run) -> None:
    with command("move", "a1=120deg", "a2=-120deg", "c1=45deg", "--duration", "20s") as process:
        under_way(process)
        process.send_signal(signal.SIGINT)
        error = told(process)
    assert process.returncode == 10
    assert error["exit"] == 10
    assert any(note.startswith("a1: holds at ") for note in error["notes"])
    there = stand(run, "a1", "a2", "c1")
    assert 0 < there["a1"] < 1.5
    assert -1.5 < there["a2"] < 0
    assert there["c1"] < 0.6
    assert stand(run, "a1", "a2", "c1") == {name: pytest.approx(at, abs=0.01) for name, at in there.items()}


def test_one_bus_that_is_gone_keeps_no_other_from_being_stopped(served_machine: Served, run: Run) -> None:
    served_machine.simulators["arm"].end()
    ran = run("stop", "--json")
    assert ran.code == 6
    done = {one["axis"]: one["done"] for one in ran.document["devices"]}
    assert done == {"a1": False, "a2": False, "a3": False, "c1": True, "lift": True}
    ran = run("estop", "--json")
    assert ran.code == 6
    assert [bool(one["error"]) for one in ran.document["buses"]] == [True, False, False]
