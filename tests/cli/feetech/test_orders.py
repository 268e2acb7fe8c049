"""What only FEETECH servos can do, from the shell, and what their face offers to common commands."""

from __future__ import annotations

import pytest

from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


def goal(run: Run, arm: Simulation, node: int) -> int:
    raw: int = run("read", f"{arm.url}#{node}", "goal_position", "--json").document["registers"][0]["raw"]
    return raw


def test_a_reg_write_waits_for_its_action(run: Run, arm: Simulation) -> None:
    assert run("feetech", "reg-write", f"{arm.url}#1", "goal_position=2000raw").code == 0
    assert run("feetech", "reg-write", f"{arm.url}#2", "goal_position=90deg").code == 0
    assert (goal(run, arm, 1), goal(run, arm, 2)) == (0, 0)
    assert run("feetech", "action", arm.url).code == 0
    assert (goal(run, arm, 1), goal(run, arm, 2)) == (2000, 1024)


def test_an_action_for_one(run: Run, arm: Simulation) -> None:
    for node in ("1", "2"):
        assert run("feetech", "reg-write", f"{arm.url}#{node}", "goal_position=90deg").code == 0
    assert run("feetech", "action", f"{arm.url}#2").code == 0
    assert (goal(run, arm, 1), goal(run, arm, 2)) == (0, 1024)


def test_sync_read_with_partial_results(run: Run, arm: Simulation) -> None:
    ran = run("feetech", "sync-read", f"{arm.url}#1+9+3", "present_position", "moving", "--json")
    assert ran.code == 6
    assert [row["raw"] for row in ran.document["devices"]["3"]] == [2048, 0]
    assert list(ran.document["errors"]) == ["9"]
    assert run("feetech", "sync-read", f"{arm.url}#1-3", "present_position").out.count("180.0°") == 3
    assert run("feetech", "sync-read", f"{arm.url}#9", "present_position").code == 5


def test_sync_write(run: Run, arm: Simulation) -> None:
    ran = run("feetech", "sync-write", arm.url, "goal_position", "1=90deg", "3=2000raw")
    assert ran.code == 0
    assert [goal(run, arm, node) for node in (1, 2, 3)] == [1024, 0, 2000]


def test_a_dry_sync_write_shows_one_frame(run: Run, arm: Simulation) -> None:
    ran = run(
        "feetech", "sync-write", arm.url, "goal_position", "1=90deg", "3=2000raw", "--dry-run", "--json"
    )
    (frame,) = ran.document["withheld"]
    assert frame["data"].startswith("FF FF FE 0A 83 2A 02 01 00 04 03 D0 07")
    assert goal(run, arm, 1) == 0


def test_dry_runs_leave_nothing_waiting_and_start_nothing(run: Run, arm: Simulation) -> None:
    ran = run("feetech", "reg-write", f"{arm.url}#1", "goal_position=90deg", "--dry-run", "--json")
    assert [frame["data"] for frame in ran.document["withheld"]] == ["FF FF 01 05 04 2A 00 04 C7"]
    assert run("feetech", "action", arm.url).code == 0
    assert goal(run, arm, 1) == 0
    assert run("feetech", "reg-write", f"{arm.url}#1", "goal_position=90deg").code == 0
    for devices in (arm.url, f"{arm.url}#1"):
        ran = run("feetech", "action", devices, "--dry-run", "--json")
        assert "ACTION" in ran.document["withheld"][0]["meaning"]
        assert goal(run, arm, 1) == 0


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["sync-write", "BUS", "goal_position", "1=9"], 8),
        (["sync-write", "BUS", "goal_position", "254=1"], 2),
        (["sync-write", "BUS", "goal_position", "1=1", "1=2"], 2),
        (["sync-write", "BUS", "goal_position"], 2),
        (["sync-write", "BUS", "max_temperature", "1=60"], 2),
        (["sync-write", "BUS", "goal_positon", "1=1"], 2),
        (["sync-write", "BUS", "goal_position", "9=1"], 5),
        (["sync-read", "BUS", "present_position"], 2),
        (["sync-read", "BUS#1"], 2),
        (["sync-read", "BUS#1", "present_positon"], 2),
        (["reg-write", "BUS#1"], 2),
        (["reg-write", "BUS#1", "goal_position=nan"], 2),
        (["reg-write", "BUS#254", "goal_position=1"], 2),
        (["action", "BUS#254"], 2),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else str(value),
)
def test_what_cannot_be_done(words: list[str], code: int, run: Run, arm: Simulation) -> None:
    ran = run("feetech", *(word.replace("BUS", arm.url) for word in words))
    assert ran.code == code
    assert ran.err.startswith("error: ")


def test_back_as_shipped_needs_consent_and_says_where_it_is(run: Run, arm: Simulation) -> None:
    assert run("write", f"{arm.url}#3", "max_temperature=60", "--yes").code == 0
    assert run("feetech", "factory-restore", f"{arm.url}#3").code == 8
    assert arm[3].memory["max_temperature"] == 60
    document = run("feetech", "factory-restore", f"{arm.url}#3", "--yes", "--json").document
    assert (document["id"], document["found"], document["baud"]) == (3, 3, 1_000_000)
    assert arm[3].memory["max_temperature"] == 70
    assert arm[1].memory["max_temperature"] == 70
