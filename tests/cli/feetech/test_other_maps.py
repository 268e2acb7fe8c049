"""Common commands with a servo whose map is not commanded: it is told and read, and refuses to be written or moved.

The simulator knows the STS map only, so the first registers of a simulated servo are made to say that it is another;
what it does with bytes is all the same to these commands, which must not send any.
"""

from __future__ import annotations

import pytest

from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run

HEADS = {
    "hls": {"firmware_minor": 43, "model_major": 10, "model_minor": 18},
    "scs": {"firmware_major": 0, "firmware_minor": 10, "byte_order": 1, "model_major": 5, "model_minor": 4},
    "smbl": {"firmware_major": 2, "firmware_minor": 45, "model_major": 8, "model_minor": 44},
}
REFUSED = (
    "write BUS#1 led_mask=1 --yes",
    "write BUS#1 led_mask=1 --dry-run",
    "write BUS#1 goal_position=0.5 --yes",
    "move BUS#1=0.5 --yes",
    "move BUS#1=0.5 BUS#2=3.0 --yes",
    "torque on BUS#1",
    "stop BUS#1",
    "feetech reg-write BUS#1 goal_position=0.5 --yes",
    "feetech sync-write BUS goal_position 1=0.5 --yes",
    "feetech factory-restore BUS#1 --yes",
)


@pytest.fixture(params=HEADS)
def other(request: pytest.FixtureRequest, arm: Simulation) -> str:
    """Servo 1 of `arm` says that it has this map."""
    name = str(request.param)
    for row, raw in HEADS[name].items():
        arm[1].memory[row] = raw
    return name


def test_info_says_which_map_it_has_and_that_it_is_not_written(other: str, run: Run, arm: Simulation) -> None:
    told = run("info", f"{arm.url}#1", "--json").document
    assert (told["table"], told["register_map"], told["writable"]) == (other, other, False)
    assert run("info", f"{arm.url}#1").code == 0
    assert run("info", f"{arm.url}#1", "--registers").code == 0


def test_it_is_scanned_read_and_watched(other: str, run: Run, arm: Simulation) -> None:
    assert len(run("scan", arm.url, "--json").document["devices"]) == 3
    assert run("read", f"{arm.url}#1", "present_voltage", "id").code == 0
    assert run("read", f"{arm.url}#1").code == 0
    assert run("monitor", f"{arm.url}#1", "--count", "1").code == 0


def test_hls_is_read_in_its_own_units(run: Run, arm: Simulation) -> None:
    arm[1].memory["goal_velocity"] = 100
    for row, raw in HEADS["hls"].items():
        arm[1].memory[row] = raw
    (told,) = run("read", f"{arm.url}#1", "goal_velocity", "--json").document["registers"]
    assert (told["raw"], told["value"]) == (100, pytest.approx(7.66990))
    ran = run("read", f"{arm.url}#1", "goal_time")
    assert ran.code == 2
    assert "table hls has no register" in ran.err


@pytest.mark.parametrize("command", REFUSED)
def test_it_refuses_and_nothing_changes(other: str, command: str, run: Run, arm: Simulation) -> None:
    before = bytes(arm[1].memory.live), bytes(arm[2].memory.live[40:56])
    ran = run(*command.replace("BUS", arm.url).split())
    assert ran.code == 7, ran.err
    assert f"map {other} is read and not commanded yet" in ran.err
    assert (bytes(arm[1].memory.live), bytes(arm[2].memory.live[40:56])) == before


def test_it_is_let_go_and_stopped(other: str, run: Run, arm: Simulation) -> None:
    arm[1].memory["torque_enable"] = 1
    assert run("torque", "off", f"{arm.url}#1").code == 0
    assert arm[1].memory["torque_enable"] == 0
    arm[1].memory["torque_enable"] = 1
    assert run("estop", f"{arm.url}#1").code == 0
    assert arm[1].memory["torque_enable"] == 0
