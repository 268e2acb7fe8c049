"""What a device is, what bounds it, and everything it can be asked."""

from __future__ import annotations

import pytest

import motorbus
from motorbus.families.feetech.registers import STS
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Bench, Run


def test_identity_and_limits(run: Run, arm: Simulation) -> None:
    document = run("info", f"{arm.url}#2", "--json").document
    assert (document["id"], document["model"], document["firmware"], document["table"]) == (
        2,
        "STS3215",
        "3.10",
        "sts",
    )
    limits = {row["name"]: row for row in document["limits"]}
    assert limits["max_temperature"]["value"] == 70
    assert limits["max_position_limit"]["raw"] == 4095
    assert all(row["storage"] == "EEPROM" for row in limits.values())


def test_every_register(run: Run, arm: Simulation) -> None:
    rows = run("info", f"{arm.url}#2", "--registers", "--json").document["registers"]
    assert [row["name"] for row in rows] == [row.name for row in STS.values() if row.readable]
    (position,) = (row for row in rows if row["name"] == "present_position")
    assert (position["address"], position["raw"], position["unit"], position["access"]) == (
        56,
        2048,
        "rad",
        "r",
    )


def test_a_table_for_eyes(run: Run, arm: Simulation) -> None:
    ran = run("info", f"{arm.url}#2", "--registers")
    assert (ran.code, ran.err) == (0, "")
    lines = {line.split()[0]: line for line in ran.out.splitlines() if line}
    assert "STS3215 (simulated)" in ran.out
    assert lines["present_position"].split()[1:5] == ["56", "3.1416", "rad", "(180.0°)"]
    assert "position" in lines["operating_mode"]


@pytest.mark.parametrize("model", ["sts3215", "scs0009", "sm85blhv", "sm60-360m", "hls3925", "scs215-2"])
def test_an_open_lock_is_seen_and_how_to_close_it(model: str, run: Run) -> None:
    with motorbus.simulate("feetech", ids="1", model=model) as simulation:
        device = f"{simulation.url}#1"
        ran = run("info", device, "--json")
        assert (ran.document["lock"], ran.err) == ("closed", "")
        simulation[1].memory["lock"] = 0
        ran = run("info", device)
        assert [line.split()[1] for line in ran.out.splitlines() if line.startswith("lock")] == ["open"]
        assert "every write to EEPROM is for good: `motorbus write BUS#ID lock=1` closes it" in ran.err
        assert run("info", device, "--registers", "--json").document["lock"] == "open"
        assert run("write", device, "lock=1").code == 0
        assert simulation[1].memory["lock"] == 1
        assert run("info", device).err == ""


def test_one_device_at_a_time(run: Run, arm: Simulation) -> None:
    assert run("info", arm.url).code == 2


def test_nobody_there(run: Run, arm: Simulation) -> None:
    assert run("info", f"{arm.url}#9").code == 5


def test_of_an_axis_it_says_that_the_angles_are_the_device_s(run: Run, bench: Bench) -> None:
    assert "the device of a1 tells, in its own angles" in run("info", "a1").err
    assert run("info", "arm#1").err == ""
