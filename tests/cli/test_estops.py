"""A process that was given a bus by its address knows whom its emergency stop must not let fall."""

from __future__ import annotations

from pathlib import Path

import pytest

from motorbus.cli.estops import with_estops
from tests.cli.conftest import Bench, Run
from tests.cli.test_fenced import bounded
from tests.support.machines import described

HOLD = 'estop = "hold"'


def torque(bench: Bench) -> list[int]:
    return [bench.simulations["arm"][node].memory["torque_enable"] for node in (1, 2, 3)]


@pytest.mark.parametrize("word", ["arm", "{address}#1-3", ""])
def test_who_is_to_hold_keeps_its_torque_by_every_name(word: str, run: Run, bench: Bench) -> None:
    bounded(bench, HOLD)
    assert run("torque", "on", "arm#1-3").code == 0
    said = word.format(address=bench.machine.buses["arm"].address)
    ran = run("estop", *([said] if said else []), "--json")
    assert "held: " in ran.out
    assert torque(bench) == [1, 0, 0]


def test_without_it_everyone_lets_go(run: Run, bench: Bench) -> None:
    assert run("torque", "on", "arm#1-3").code == 0
    assert run("estop", "arm").code in (0, 6)
    assert torque(bench) == [0, 0, 0]


def test_what_the_command_line_says_comes_on_top(run: Run, bench: Bench) -> None:
    bounded(bench, HOLD)
    assert run("torque", "on", "arm#1-3").code == 0
    run("estop", "arm", "--estop-hold", "3")
    assert torque(bench) == [1, 0, 1]


def test_a_file_that_nobody_understands_says_nothing(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, run: Run
) -> None:
    bounded(bench, "speed = 3", HOLD)
    address = bench.machine.buses["arm"].address
    ran = run("estop", address)
    assert ran.code in (0, 6), ran.err
    assert with_estops(address, {"baud": "1"}) == {"baud": "1"}


def test_it_is_the_same_port_by_every_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "ttyUSB0").touch()
    (tmp_path / "arm").symlink_to("ttyUSB0")
    axes = {"a2": {"estop": "hold"}}
    file = tmp_path / "motorbus.toml"
    file.write_text(described({"arm": "feetech:arm"}, "1-2", "", False, axes, {}), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    for spelling in ("arm", "./arm", "ttyUSB0", str(tmp_path / "ttyUSB0")):
        assert with_estops(f"feetech:{spelling}", {}) == {"estop_hold": "2"}
    assert with_estops("feetech:./ttyUSB1", {}) == {}
