"""Common commands on a stepper bus: what they find, and that nothing is sent without being told."""

from __future__ import annotations

import pytest

import motorbus
from motorbus.cli.stepper import say
from motorbus.core.operation import CanFrame
from motorbus.families.stepper import Sends
from tests.cli.conftest import Run

READ_1 = "FF AA 3E 01 00 00 00 00 00 00 E8"
WORKS = [
    "scan BUS",
    "ping BUS#1",
    "info BUS#1",
    "info BUS#1 --registers",
    "read BUS#1 total_steps step_1_speed",
    "stop BUS",
    "stop BUS#1 --dry-run",
    "estop BUS#1",
]


@pytest.mark.parametrize("command", WORKS)
def test_it_works_and_says_that_it_is_simulated(command: str, run: Run) -> None:
    with motorbus.simulate("stepper") as simulation:
        words = command.replace("BUS", simulation.url).split()
        ran = run(*words)
        told = run(*words, "--json")
    assert (ran.code, told.code) == (0, 0), ran.err
    assert "simulated" in ran.out
    assert [record["simulated"] for record in told.records] == [True]


@pytest.mark.parametrize(
    "command", ["write BUS#1 step_1_speed=3 --yes", "move BUS#1=1", "torque on BUS#1", "set-id BUS#1 4 --yes"]
)
def test_what_it_cannot_is_refused_before_a_port_is_opened(command: str, run: Run) -> None:
    ran = run(*command.replace("BUS", "stepper:/dev/not-there").split(), "-vv")
    assert (ran.code, ran.out) == (2, "")
    assert "stepper devices have no" in ran.err


def test_a_scan_tells_the_frame_it_sends(run: Run) -> None:
    with motorbus.simulate("stepper") as simulation:
        ran = run("scan", simulation.url)
    assert f"this is sent and nothing else: {READ_1} (read project 1)" in ran.err


def test_only_what_is_sent_is_told() -> None:
    assert say("anything else") == ""
    assert say(Sends(CanFrame(1, b""), 9600)) == ""
    assert READ_1 in say(Sends(bytes.fromhex(READ_1), 9600))


def test_a_dump_is_explained_by_the_names_it_is_read_by(run: Run) -> None:
    with motorbus.simulate("stepper") as simulation, motorbus.open(simulation.url) as bus:
        dump = motorbus.stepper.Controller(bus).dump(1)
    ran = run("decode", "--family", "stepper", dump.hex())
    assert ran.code == 0
    assert "step_1_delay" in ran.out
