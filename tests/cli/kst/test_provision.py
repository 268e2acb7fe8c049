"""Provisioning from the shell: guided on a real port, resumable, and never with two servos that answer alike."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from pathlib import Path

import pytest

import motorbus
from motorbus.cli.simulated import Simulated
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


def power_cycle(control: Path) -> None:
    with socket.socket(socket.AF_UNIX) as told:
        told.connect(str(control))
        told.sendall(b"power-cycle\n")
        assert told.recv(100).startswith(b"ok")


def test_a_person_is_asked_for_the_power_cycle_and_the_servo_comes_back(
    on_slcan: Simulated, tmp_path: Path, run: Run
) -> None:
    words = ["kst", "provision", f"{on_slcan.bus}#0x25", "--new-id", "0x27", "--yes", "--json"]
    with subprocess.Popen(
        [sys.executable, "-m", "motorbus", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        events = []
        for line in process.stdout:
            events.append(json.loads(line))
            if events[-1]["event"] == "power-cycle":
                power_cycle(tmp_path / "control")
        _, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert {one["schema"] for one in events} == {"motorbus.kst.provision/1"}
    assert [one["event"] for one in events if one["event"] != "progress"] == ["power-cycle", "provisioned"]
    assert (events[-1]["id"], events[-1]["from"], events[-1]["resumed"]) == (39, 37, False)
    assert "take the supply" in err
    assert [one["id"] for one in run("scan", on_slcan.bus, "--json").document["devices"]] == [38, 39]


def test_interrupted_it_says_so_and_goes_on_when_said_again(servos: Simulation, run: Run) -> None:
    words = ["kst", "provision", f"{servos.url}#37", "--new-id", "39", "--yes", "--timeout", "1s"]
    ran = run(*words)
    assert ran.code == 1
    assert "power-cycle it, then call provision again" in ran.err
    servos[37].power_cycle()
    ran = run(*words, "--json")
    assert ran.code == 0, ran.err
    assert (ran.records[-1]["id"], ran.records[-1]["resumed"]) == (39, True)


def test_an_id_that_is_taken_is_refused(servos: Simulation, run: Run) -> None:
    ran = run("kst", "provision", f"{servos.url}#37", "--new-id", "38", "--yes", "-vv")
    assert ran.code == 2
    assert "is taken" in ran.err
    assert "#22" not in ran.err


@pytest.mark.parametrize("delay", ["0", "0.0005"])
def test_two_servos_with_one_id_are_told_and_nothing_is_written(delay: str, run: Run) -> None:
    with motorbus.simulate("kst", ids="0x25", duplicate="0x25", duplicate_delay=delay) as simulation:
        simulation[1002].raw_position = 5
        ran = run("kst", "provision", f"{simulation.url}#37", "--new-id", "39", "--yes", "-vv")
    assert ran.code == 2
    assert "two servos answer as 0x25" in ran.err
    assert "#22" not in ran.err


def test_a_rehearsal_shows_what_would_be_written(servos: Simulation, run: Run) -> None:
    words = ["--new-id", "39", "--new-bitrate", "1M", "--dry-run", "--json"]
    ran = run("kst", "provision", f"{servos.url}#37", *words)
    frames = [one["frame"] for one in ran.document["withheld"]]
    assert frames == ["625#2200300027000000", "625#2201300007000000", "625#2210100173617665"]
    assert servos[37].memory["node_id"] == 37


def test_what_it_shall_become_must_be_said_and_possible(servos: Simulation, run: Run) -> None:
    device = f"{servos.url}#37"
    for words in ([], ["--new-id", "0"], ["--new-id", "128"], ["--new-bitrate", "123"]):
        ran = run("kst", "provision", device, *words, "--yes", "-vv")
        assert (ran.code, ran.out) == (2, "")
        assert " tx " not in ran.err
    assert run("kst", "provision", device, "--new-id", "39").code == 8
