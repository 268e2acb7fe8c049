"""Torque limit, gains and protection from the shell: read without a value, written with one, EEPROM with consent."""

from __future__ import annotations

import pytest

import motorbus
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


def test_a_torque_limit_until_power_off_needs_no_consent(run: Run, arm: Simulation) -> None:
    bus = f"{arm.url}#3"
    assert "100.0 %" in run("feetech", "torque-limit", bus).out
    document = run("feetech", "torque-limit", bus, "50%", "--json").document
    assert document["schema"] == "motorbus.feetech.torque-limit/1"
    assert (document["limit"], document["registers"], document["kept"]) == (0.5, ["torque_limit"], False)
    assert run("feetech", "torque-limit", bus, "--json").document["limit"] == 0.5
    assert arm[3].memory["max_torque"] == 1000
    assert "until power-off" in run("feetech", "torque-limit", bus, "0.5").out


def test_a_torque_limit_that_is_kept_does(run: Run, arm: Simulation) -> None:
    bus = f"{arm.url}#3"
    assert run("feetech", "torque-limit", bus, "50%", "--keep").code == 8
    assert arm[3].memory["max_torque"] == 1000
    assert "for good" in run("feetech", "torque-limit", bus, "50%", "--keep", "--yes").out
    assert arm[3].memory["max_torque"] == 500


def test_where_there_is_no_other_it_is_always_kept(run: Run) -> None:
    with motorbus.simulate("feetech", ids="3", model="scs0009") as servo:
        bus = f"{servo.url}#3"
        assert run("feetech", "torque-limit", bus, "50%").code == 8
        document = run("feetech", "torque-limit", bus, "50%", "--yes", "--json").document
        assert (document["registers"], document["kept"]) == (["max_torque"], True)


def test_gains(run: Run, arm: Simulation) -> None:
    bus = f"{arm.url}#3"
    document = run("feetech", "gains", bus, "--json").document
    assert document["schema"] == "motorbus.feetech.gains/1"
    assert (document["p"], document["i"], document["d"], document["live_p"]) == (32, 0, 32, None)
    assert run("feetech", "gains", bus, "p=16").code == 8
    ran = run("feetech", "gains", bus, "p=16", "d=20", "--yes")
    lines = dict(line.split() for line in ran.out.splitlines()[2:])
    assert lines == {"p": "16", "i": "0", "d": "20", "velocity_p": "10", "velocity_i": "10"}
    assert arm[3].memory["position_d"] == 20


def test_live_gains_of_an_hls_need_no_consent(run: Run) -> None:
    with motorbus.simulate("feetech", ids="3", model="hls3925") as servo:
        assert run("feetech", "gains", f"{servo.url}#3", "live_p=20").code == 0
        assert servo[3].memory["live_p"] == 20


def test_protection(run: Run, arm: Simulation) -> None:
    bus = f"{arm.url}#3"
    out = run("feetech", "protection", bus).out
    assert "temperature, current, overload" in out
    assert "3.250 A" in out
    assert run("feetech", "protection", bus, "torque=30%").code == 8
    words = ["torque=30%", "time=1500ms", "max_temperature=60", "unload=overload,temperature", "led=none"]
    document = run("feetech", "protection", bus, *words, "--yes", "--json").document
    assert document["schema"] == "motorbus.feetech.protection/1"
    assert (document["torque"], document["time"], document["max_temperature"]) == (0.3, 1.5, 60.0)
    assert (document["unload"], document["led"]) == (["temperature", "overload"], [])
    assert [arm[3].memory[row] for row in ("protective_torque", "overload_time", "unload_mask")] == [
        *(30, 150, 0x24)
    ]


@pytest.mark.parametrize(
    "words",
    [
        "torque-limit BUS --dry-run",
        "torque-limit BUS 110%",
        "torque-limit BUS half",
        "gains BUS --dry-run",
        "gains BUS p",
        "gains BUS q=1 --yes",
        "gains BUS p=1 p=2 --yes",
        "gains BUS p=1.5 --yes",
        "gains BUS p=255 --yes",
        "gains BUS current_p=1 --yes",
        "protection BUS --dry-run",
        "protection BUS torque=101% --yes",
        "protection BUS time=3s --yes",
        "protection BUS unload=overlord --yes",
        "protection BUS max_voltage=4V --yes",
        "protection BUS max_voltage=60degC --yes",
    ],
)
def test_what_is_impossible_changes_nothing(words: str, run: Run, arm: Simulation) -> None:
    before = bytes(arm[3].memory.live)
    ran = run("feetech", *words.replace("BUS", f"{arm.url}#3").split())
    assert (ran.code, ran.out) == (2, ""), ran.err
    assert bytes(arm[3].memory.live)[:56] == before[:56]


def test_dry_runs_show_the_guarded_sequence(run: Run, arm: Simulation) -> None:
    for words in (["gains", "p=16"], ["protection", "torque=30%"], ["torque-limit", "50%", "--keep"]):
        ran = run("feetech", words[0], f"{arm.url}#3", *words[1:], "--dry-run", "--json")
        meanings = [one["meaning"] for one in ran.document["withheld"]]
        assert "lock 0" in meanings[0]
        assert "torque_enable 0 (off)" in meanings[1]
        assert any("lock 1" in one for one in meanings)
    assert arm[3].memory["position_p"] == 32
