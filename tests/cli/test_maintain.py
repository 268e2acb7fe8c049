"""The guarded changes of what a device keeps, on simulated devices in virtual time."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import motorbus
from motorbus.motion.machine import MachineConfig
from tests.cli.shell import MACHINE, Shell, check_error, shell

__all__ = ["shell"]
BUS = "feetech:sim:care"


def test_set_id_changes_the_device_and_its_axis(shell: Shell, tmp_path: Path) -> None:
    path = tmp_path / "motorbus.toml"
    path.write_text(MACHINE.replace("feetech:sim,ids=1-2", BUS), "utf-8")
    with motorbus.simulate("feetech", ids="1-2", name="care"):
        before = path.read_text("utf-8")
        assert shell("set-id shoulder 7 --dry-run").code == 0
        assert path.read_text("utf-8") == before
        ran = shell("set-id shoulder 7 --yes")
        assert ran.code == 0, ran.err
        assert MachineConfig.load(str(path)).axes["shoulder"].node == 7
        assert shell("read shoulder id").code == 0
        assert shell(f"read {BUS}#1 id").code == 5
        assert MachineConfig.load(str(path)).axes["elbow"].node == 2


@pytest.mark.parametrize(
    ("line", "code"),
    [
        (f"set-id {BUS}#1 2 --yes", 2),  # in use
        (f"set-id {BUS}#1 999 --yes", 2),
        (f"set-id {BUS}#9 7 --yes", 5),  # silent
        (f"set-id {BUS} 7 --yes", 2),  # two devices
        (f"set-baud {BUS}#1 fast --yes", 2),
        (f"set-baud {BUS}#9 500k --yes", 5),
        (f"set-zero {BUS}#9 --yes", 5),
        (f"backup {BUS}#9 new.json", 5),
        (f"set-id {BUS}#1 7", 8),  # no consent
        (f"set-zero {BUS}#1", 8),
    ],
)
def test_refusals_write_nothing(shell: Shell, tmp_path: Path, line: str, code: int) -> None:
    with motorbus.simulate("feetech", ids="1-2", name="care"):
        ran = shell(line)
        assert ran.code == code, ran.err
        check_error(ran)
        assert shell.writes() == []
        assert not (tmp_path / "new.json").exists()


def test_set_zero_reads_the_wanted_position(shell: Shell) -> None:
    with motorbus.simulate("feetech", ids="1", name="care"):
        ran = shell(f"set-zero {BUS}#1 --to 90deg --yes")
        assert ran.code == 0, ran.err
        read = json.loads(shell(f"read {BUS}#1 present_position --json").out)
        assert read[0]["value"] == pytest.approx(1.5708, abs=0.01)


def test_restore_writes_only_what_differs(shell: Shell, tmp_path: Path) -> None:
    with motorbus.simulate("feetech", ids="1-2", name="care"):
        assert shell(f"backup {BUS}#1 saved.json").code == 0
        saved = json.loads((tmp_path / "saved.json").read_text("utf-8"))
        assert not {"id", "baud_rate"} & set(saved["values"])
        assert shell(f"backup {BUS}#1 saved.json").code != 0  # keeps the first file
        assert shell(f"write {BUS}#1 max_temperature=60°C --yes").code == 0
        ran = shell(f"restore saved.json {BUS}#1 --yes --json")
        assert ran.code == 0, ran.err
        assert json.loads(ran.out)["settings"] == ["max_temperature"]
        ran = shell(f"restore saved.json {BUS}#1 --yes --json")
        assert json.loads(ran.out)["settings"] == []
        assert shell.writes() == []


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"values": {"id": 1}}', '{"values": 3, "family": 1, "map": 2}']
)
def test_restore_refuses_another_file(shell: Shell, tmp_path: Path, text: str) -> None:
    (tmp_path / "bad.json").write_text(text, "utf-8")
    with motorbus.simulate("feetech", ids="1", name="care"):
        ran = shell(f"restore bad.json {BUS}#1 --yes")
        assert ran.code == 2, ran.err
        check_error(ran)
        assert shell.writes() == []


@pytest.mark.parametrize("name", ["id", "phase", "goal_position", "nothing"])
def test_restore_refuses_what_is_no_setting(shell: Shell, tmp_path: Path, name: str) -> None:
    with motorbus.simulate("feetech", ids="1", name="care"):
        assert shell(f"backup {BUS}#1 saved.json").code == 0
        saved = json.loads((tmp_path / "saved.json").read_text("utf-8"))
        assert name not in saved["values"]
        saved["values"][name] = 1
        (tmp_path / "edited.json").write_text(json.dumps(saved), "utf-8")
        ran = shell(f"restore edited.json {BUS}#1 --yes")
        assert ran.code == 2, ran.err
        check_error(ran)
        assert shell.writes() == []


def test_each_saved_setting_can_be_restored(shell: Shell, tmp_path: Path) -> None:
    with motorbus.simulate("kst", ids="5", name="care", profile="kst-ext") as simulation:
        device = f"{simulation.url}#5"
        assert shell(f"backup {device} saved.json").code == 0
        saved = json.loads((tmp_path / "saved.json").read_text("utf-8"))
        assert set(saved["values"]) == {"negative_limit", "positive_limit"}
        saved["values"] = {"negative_limit": -900, "positive_limit": 900}
        (tmp_path / "edited.json").write_text(json.dumps(saved), "utf-8")
        ran = shell(f"restore edited.json {device} --yes --json")
        assert json.loads(ran.out)["settings"] == ["negative_limit", "positive_limit"], ran.err


def test_a_kst_servo_returns_after_the_power_cycle(shell: Shell) -> None:
    with motorbus.simulate("kst", ids="5", name="care", faults="at 10 s: power-cycle 5"):
        ran = shell("set-id kst:sim:care#5 6 --yes --json")
        assert ran.code == 0, ran.err
        assert json.loads(ran.out)["devices"] == [6]


def test_a_kst_servo_asks_for_the_power_cycle(shell: Shell) -> None:
    with motorbus.simulate("kst", ids="5", name="care"):
        ran = shell("set-id kst:sim:care#5 6 --yes")
        assert ran.code == 1, ran.err  # not switched off and on: it does not come back in time
        assert "note: servo 0x05: switch its supply off and on now" in ran.err


def test_a_stepper_controller_keeps_its_projects(shell: Shell, tmp_path: Path) -> None:
    with motorbus.simulate("stepper", name="care"):
        assert shell("backup stepper:sim:care projects.toml").code == 0
        ran = shell("restore projects.toml stepper:sim:care --yes")
        assert ran.code == 0, ran.err
        for verb in ("set-id stepper:sim:care 2", "set-zero stepper:sim:care"):
            assert shell(f"{verb} --yes").code == 2
