"""Moving: there and back, several together, and what asks first or is refused."""

from __future__ import annotations

import json
import math
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

import motorbus
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Bench, Run
from tests.support.processes import Simulated


def stands(run: Run, arm: Simulation, node: int) -> float:
    position: float = run("read", f"{arm.url}#{node}", "--json").document["position"]
    return position


def test_it_returns_when_it_is_there(run: Run, arm: Simulation) -> None:
    ran = run("move", f"{arm.url}#1=90deg", "--velocity", "90deg/s", "--acceleration", "20")
    assert (ran.code, ran.err) == (0, "")
    assert stands(run, arm, 1) == pytest.approx(math.pi / 2, abs=0.05)


def test_several_are_moved_together_and_all_arrive(run: Run, arm: Simulation) -> None:
    ran = run("move", f"{arm.url}#1+2=2.5", f"{arm.url}#3=200deg", "--velocity", "2", "--json")
    assert ran.code == 0
    assert [(one["id"], one["goal"]) for one in ran.document["devices"]] == [
        (1, 2.5),
        (2, 2.5),
        (3, pytest.approx(math.radians(200))),
    ]
    for one in ran.document["devices"]:
        assert one["present"] == pytest.approx(one["goal"], abs=0.05)


def test_it_need_not_wait(run: Run, arm: Simulation) -> None:
    (one,) = run("move", f"{arm.url}#1=1", "--no-wait", "--json").document["devices"]
    assert one["present"] == pytest.approx(math.pi, abs=0.05)


class Unplugging(PerfectLine):
    """Unplugs a node 0.6 s from the first frame on."""

    def __init__(self, simulation: Simulation, node: int) -> None:
        self.simulation, self.node, self.first = simulation, node, -1.0

    def carry(self, sender: Side, data: object, at: float) -> list[Delivery]:
        self.first = at if self.first < 0 else self.first
        if at > self.first + 0.6:
            self.simulation[self.node].unplug()
        return super().carry(sender, data, at)  # type: ignore[arg-type]


@pytest.mark.parametrize("lost", [1, 2, 3])
@pytest.mark.parametrize("family", ["feetech", "kst"])
def test_one_that_is_lost_ends_the_move_of_all_within_a_second(family: str, lost: int, run: Run) -> None:
    bounds = [] if family == "kst" else ["--velocity", "0.5"]
    with motorbus.simulate(family, ids="1-3") as sim:
        for node in (1, 2, 3) if family == "kst" else ():
            sim[node].speed = 0.5
        start = run("read", f"{sim.url}#1", "--json").document["position"]
        sim.line, begun = Unplugging(sim, lost), sim.now
        ran = run("move", f"{sim.url}#1+2+3={start + 0.7}", *bounds)
        assert (ran.code, sim.now - begun < 1.6) == (5, True)
        assert f"error: node {lost} did not answer" in ran.err
        assert f"note: #{lost} may still be moving: " in ran.err
        assert f"`motorbus stop {sim.url}#{lost}` stops it" in ran.err
        for node in {1, 2, 3} - {lost}:
            sim.wait(sim.now + 2)
            place = run("read", f"{sim.url}#{node}", "--json").document["position"]
            assert 0.1 < place - start < 0.6
            assert f"note: #{node}: holds at {place:.4f} rad" in ran.err


def wait_until_moved(control: Path, counts: int) -> None:
    """Return when the simulated servo 1 is this many counts away from where it is first seen."""
    with socket.socket(socket.AF_UNIX) as line:
        line.connect(str(control))
        seen: list[int] = []
        with line.makefile("rw", encoding="utf-8") as stream:
            while not seen or abs(seen[-1] - seen[0]) < counts:
                print("status", file=stream, flush=True)
                seen.append(json.loads(stream.readline())["nodes"][0]["raw_position"])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_the_device_and_the_note_says_where_it_holds(
    number: signal.Signals, run: Run, tmp_path: Path, state_folder: Path, patient: None
) -> None:
    link, control = tmp_path / "bus", tmp_path / "control"
    with Simulated("feetech", link=link, control=str(control)) as simulated:
        device = f"{simulated.bus}#1"
        words = ["move", f"{device}=260deg", "--velocity", "10deg/s"]
        command = [sys.executable, "-m", "motorbus", *words]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as mover:
            wait_until_moved(control, 50)
            mover.send_signal(number)
            _, said = mover.communicate()
        places = [run("read", device, "--json").document["position"] for _ in range(5)]
        shown = f"{places[0]:.4f} rad ({math.degrees(places[0]):.1f}°)"
        assert (mover.returncode, said) == (10, f"error: cancelled\n  note: #1: holds at {shown}\n")
        assert places == [places[0]] * 5
        assert run(*words, "--no-wait").code == 0
        wait_until_moved(control, 50)


def test_a_long_way_needs_agreement(run: Run, arm: Simulation) -> None:
    assert run("move", f"{arm.url}#1=0.1").code == 0
    ran = run("move", f"{arm.url}#1=200deg")
    assert ran.code == 8
    assert "--yes" in ran.err
    assert stands(run, arm, 1) == pytest.approx(0.1, abs=0.05)
    assert run("move", f"{arm.url}#1=200deg", "--yes").code == 0


@pytest.mark.parametrize(
    ("goal", "code"),
    [
        ("#1=nan", 2),
        ("#1=far", 2),
        ("#1=1A", 2),
        ("#1", 2),
        ("=1", 2),
        ("#254=1", 2),
        ("#1=-0.1", 8),
        ("#9=1", 5),
    ],
)
def test_what_cannot_be_done_is_refused_and_nothing_moves(
    goal: str, code: int, run: Run, arm: Simulation
) -> None:
    ran = run("move", f"{arm.url}{goal}", "--yes")
    assert (ran.code, ran.out) == (code, "")
    assert stands(run, arm, 1) == pytest.approx(math.pi)


@pytest.mark.parametrize("form", ["+=", "-="])
def test_by_an_angle_go_those_only_that_do_not_know_where_they_are(
    form: str, run: Run, arm: Simulation
) -> None:
    ran = run("move", f"{arm.url}#1{form}1", "--yes")
    assert (ran.code, ran.out) == (2, "")
    assert f"a position: {arm.url}#1=POSITION" in ran.err
    assert stands(run, arm, 1) == pytest.approx(math.pi)


def test_one_of_several_outside_its_limits_holds_back_all(run: Run, arm: Simulation) -> None:
    assert run("move", f"{arm.url}#1=2", f"{arm.url}#2=-1", "--yes").code == 8
    assert stands(run, arm, 1) == pytest.approx(math.pi)


@pytest.mark.parametrize(
    "words", [["--velocity", "fast"], ["--velocity", "-1"], ["--acceleration", "nan"]], ids=" ".join
)
def test_impossible_bounds_end_with_2(words: list[str], run: Run, arm: Simulation) -> None:
    assert run("move", f"{arm.url}#1=2", *words).code == 2


def test_a_device_is_named_once(run: Run, arm: Simulation) -> None:
    assert run("move", f"{arm.url}#1=2", f"{arm.url}#1+2=3").code == 2
    assert run("move").code == 2


@pytest.mark.parametrize("more", [[], ["#2"]], ids=["one", "two"])
def test_a_dry_run_shows_each_frame_and_moves_nothing(more: list[str], run: Run, arm: Simulation) -> None:
    goals = [f"{arm.url}#1=2", *(f"{arm.url}{node}=2.5" for node in more)]
    ran = run("move", *goals, "--dry-run", "--json")
    assert ran.code == 0
    assert len(ran.document["withheld"]) == len(goals)
    assert all("goal_position" in frame["meaning"] for frame in ran.document["withheld"])
    assert stands(run, arm, 1) == pytest.approx(math.pi)


def test_devices_and_axes_are_not_mixed(run: Run, bench: Bench) -> None:
    ran = run("move", "a1=10deg", "arm#2=3.0")
    assert (ran.code, ran.out, "two commands" in ran.err) == (2, "", True)
    assert run("move", "arm#1+2=3.0", "--velocity", "1").code == 0
    (one,) = run("hold", "a1", "--json").document["axes"]
    assert one["present"] == pytest.approx(3.0 - math.pi, abs=0.05), "a device goes by its own angle"


def test_a_bare_number_beyond_the_limits_may_have_been_degrees(bench: Bench, run: Run) -> None:
    ran = run("move", "a1=10", "a2=0.1")
    assert ran.code == 8
    assert "10 without a unit is in rad: did you mean 10deg?" in ran.err
    assert "without a unit" not in run("move", "a1=500deg").err


def test_what_an_option_lacks_is_said_with_the_option(bench: Bench, run: Run) -> None:
    assert "--speed nan: it is a share" in run("move", "a1=1deg", "--speed", "nan").err
    assert "--assume lift: where does it stand?" in run("move", "a1=1deg", "--assume", "lift").err
